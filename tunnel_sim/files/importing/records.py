"""From files to the runs of a campaign, and to its folder, with unknown properties as comments."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from tunnel_sim.files.campaign_folder import IMPORT_PICTURE, IMPORT_RECIPE, write_campaign
from tunnel_sim.files.importing.cleaning import resolution
from tunnel_sim.files.importing.columns import read_calibration, stem
from tunnel_sim.files.importing.condition_names import (
    OF_CAMPAIGN,
    OF_REPEATABILITY,
    RIG_KEYS,
    SPREAD_KEYS,
)
from tunnel_sim.files.importing.conditions import (
    ConditionTable,
    ImportChoices,
    from_name,
    name_pattern,
)
from tunnel_sim.files.importing.imported_run import ImportedRun as ImportedRun
from tunnel_sim.files.importing.imported_run import imported_run
from tunnel_sim.files.importing.raw_records import RawRecord, raw_records
from tunnel_sim.files.importing.releases import RecordPiece, find_runs, find_runs_of_rate
from tunnel_sim.files.importing.source import Source, read_source
from tunnel_sim.files.importing.stated import name_hints
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.reading import check_count
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import (
    Campaign,
    Quantity,
    Repeatability,
    RigProperties,
    SensorProperties,
)
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.record import Array

_FINDERS: Mapping[Quantity, Callable[[Array, Array], list[RecordPiece]]] = {
    "angle": find_runs,
    "rate": find_runs_of_rate,
}
"""How releases are found; in accelerations a hand that holds the body does not show."""


@dataclass(frozen=True, eq=False)
class Imported:
    """The result of reading files.

    Args:
        sizes: of the rig and the scatter between runs, by key of `Conditions`.
    """

    campaign: Campaign
    parts: tuple[ImportedRun, ...]
    sources: tuple[Source, ...]
    choices: ImportChoices
    said: tuple[str, ...]
    sizes: Mapping[str, float] = field(default_factory=dict)

    @property
    def held(self) -> dict[str, dict[str, float]]:
        """Conditions by run, and sizes under the empty name, that are used once the air density is stated."""
        if not any(part.without_density for part in self.parts):
            return {}
        rig = {key: value for key, value in self.sizes.items() if key in _WITH_DENSITY}
        return {"": rig, **{part.id: dict(part.held) for part in self.parts if part.held}}

    def remarks(self, path: Path | None = None) -> list[str]:
        """Remarks on the reading of all files or one, and on changes, each once with its runs."""
        sources = [source for source in self.sources if path in (None, source.path)]
        parts = [part for part in self.parts if path in (None, part.raw.source)]
        found = [(text, s.path.name) for s in sources for table in s.tables for text in table.said]
        found += [(text, part.id) for part in parts for text in (*part.raw.said, *part.said)]
        places: dict[str, list[str]] = {}
        for text, place in dict.fromkeys(found):
            places.setdefault(text, []).append(place)
        lines = []
        for text, names in places.items():
            more = f" and {len(names) - 6} more" if len(names) > 6 else ""
            everywhere = len(names) == len(self.parts) > 1
            lines.append(f"{'all runs' if everywhere else ', '.join(names[:6]) + more}: {text}")
        return [*lines, *self.said]


def read_records(
    files: Sequence[Path],
    choices: ImportChoices = ImportChoices(),  # noqa: B008 - frozen
    *,
    conditions: Path | None = None,
    name: str = "",
    later: bool = False,
) -> Imported:
    """Read files as instruments write them; nothing is written, and open ``choices`` are found from the files.

    Args:
        conditions: a table of conditions; None: none.
        name: of the campaign; empty: the name of the first file.
        later: whether missing air densities may be stated later (`Imported.held`).
    """
    calibration = read_calibration(choices.calibration)
    pattern = None if choices.name is None else name_pattern(choices.name)
    table = None if conditions is None else ConditionTable(conditions)
    sources: list[Source] = []
    raws: list[RawRecord] = []
    for path in (path for path in files if path.name not in choices.leave_out):
        source = read_source(path, choices)
        named = from_name(pattern, path)
        raws += raw_records(source, choices, calibration, named, several=len(files) > 1)
        sources.append(source)
    if not raws:
        what = "every file is left out" if files else "no files"
        raise TunnelError(what, remedy="name at least one")
    kinds = {raw.quantity for raw in raws}
    if len(kinds) > 1:
        remedy = "import one quantity at a time, with --angle"
        raise TunnelError(f"the runs contain {' and '.join(sorted(kinds))}", remedy=remedy)
    ids, hints = [raw.id for raw in raws], name_hints([source.path for source in sources])
    parts = []
    for at, raw in enumerate(raws):
        label = raw.id if ids.count(raw.id) == 1 else f"{raw.id}-{ids[: at + 1].count(raw.id)}"
        time, reading = raw.cleaned.time_s, raw.cleaned.reading
        find = _FINDERS.get(raw.quantity)
        cut = choices.cut and not raw.whole and raw.input is None
        pieces = find(time, reading) if cut and find is not None else [RecordPiece(0, time.size)]
        for number, piece in enumerate(pieces, 1):
            run = label if len(pieces) == 1 else f"{label}-{number}"
            parts.append(imported_run(run, raw, piece, choices, table, hints[raw.source], later=later))
    names = {*(part.id for part in parts), *(path.name for path in files)}
    for left in (left for left in choices.leave_out if left not in names):
        what = f"no run or file '{one_line(left, 60)}' to leave out"
        raise TunnelError(what, where="--leave-out", remedy=did_you_mean(left, names))
    count = sum(part.piece.last - part.piece.first for part in parts)
    check_count(count, limits.CAMPAIGN_SAMPLES, "samples in all files", "", "import fewer files at a time")
    sizes = _sizes(parts, choices)
    campaign = _campaign(parts, sizes, name or one_line(files[0].stem), raws[0].quantity)
    # For the recipe: properties found in the files, where all records share them.
    known: dict[str, Any] = {**sources[0].known}
    units, columns = {raw.unit for raw in raws}, tuple(dict.fromkeys(stem(raw.column) for raw in raws))
    if len(units) == 1 and choices.counts_per_turn is None and choices.calibration is None:
        known["unit"] = units.pop()
    if len(columns) == 1:
        known["angle"] = columns
    found = {key: value for key, value in known.items() if getattr(choices, key) in (None, ())}
    resolved = choices.model_copy(update=found)
    said = []
    if (step := campaign.sensor.resolution) is not None:
        levels = "the readings lie on levels that far apart"
        said.append(f"resolution {step:.4g} {campaign.sensor.unit}: {levels}")
    if campaign.sensor.zero is not None:
        said.append(
            "the runs' stated rests differ: a separate zero is fitted to every run (zero = 'per_run')"
        )
    said += [] if table is None else table.said
    if table is not None and table.ignored:
        said.append(f"columns of {table.path.name} that are not conditions: {', '.join(table.ignored)}")
    return Imported(campaign, tuple(parts), tuple(sources), resolved, tuple(said), sizes)


_WITH_DENSITY = ("frontal_area", "reference_length")
"""Sizes that a campaign takes beside wind-on runs only where these state their air density."""


def _sizes(parts: Sequence[ImportedRun], choices: ImportChoices) -> dict[str, float]:
    """The sizes of the rig and the scatter between runs, as stated or else from the files."""
    common = choices.conditions.model_dump(include=set(OF_CAMPAIGN), exclude_none=True)
    plausible_values(common, "--set")
    for part in parts:
        for key, value in part.sizes.items():
            if common.setdefault(key, value) != value and getattr(choices.conditions, key) is None:
                what = f"{key} = {value:g}, and {common[key]:g} in another run"
                remedy = f"give --set {key}=NUMBER, or import them separately"
                raise TunnelError(what, where=f"{shown(part.raw.source)}, run '{part.id}'", remedy=remedy)
    return common


def _campaign(
    parts: Sequence[ImportedRun], sizes: Mapping[str, float], name: str, quantity: Quantity
) -> Campaign:
    runs = tuple(part.run for part in parts if part.run is not None)
    if not runs:
        part = parts[0]
        what = f"no run can be used; the first one is {part.said[-1]}"
        remedy = "check --time, --time-unit, --rate, --angle and --unit, or keep it whole with --no-cut"
        raise TunnelError(what, where=f"{shown(part.raw.source)}, run '{part.id}'", remedy=remedy)
    open_density = any(part.without_density for part in parts)
    rig = {
        key: sizes[key] for key in RIG_KEYS if key in sizes and not (open_density and key in _WITH_DENSITY)
    }
    files = list(dict.fromkeys(part.raw.source.name for part in parts))
    used = [part for part in parts if part.run is not None]
    spread = {key.removeprefix(OF_REPEATABILITY): sizes[key] for key in SPREAD_KEYS if key in sizes}
    return Campaign(
        name,
        RigProperties(**rig),
        SensorProperties(
            # From the readings in the files: the subtracted value need not be a whole number of steps.
            resolution=resolution([part.reading for part in used]),
            quantity=None if quantity == "angle" else quantity,
            # The subtracted value is as uncertain as a line drawn by hand, independently in each run.
            zero="per_run" if len({part.rest for part in used}) > 1 else None,
        ),
        runs,
        one_line(f"Imported from {', '.join(files[:3])}{' and others' if len(files) > 3 else ''}"),
        repeatability=Repeatability(**spread) if spread else None,
    )


_AS_TEXT = 1_000_000  # samples: a larger campaign is written as Parquet
_RIG = {
    "frontal_area": "m2: needed for Cnβ and Cnr",
    "reference_length": "m: needed for Cnβ and Cnr",
    "yaw_inertia": "kg m2, nominal Izz of model and support; optional",
    "width": "m, for Strouhal numbers; optional",
}
_REPEATABILITY = (
    "# [repeatability]   # optional: wind_speed, spring_stiffness and mechanical_damping, each as one standard\n"
    "#                   # deviation between runs, relative, such as 0.003\n"
)
_RUN = {
    "spring_stiffness": "N m/rad: needed for Izz, Cr, Cnβ and Cnr; without it a run gives ωn and ζ",
    "air_density": "kg/m3: needed for Cnβ and Cnr",
    "release_angle": "rad, nominal; optional",
}
_OF_INPUT = {
    "drive_gain": "N m per unit of a column drive; estimated where it is not stated",
    "drive_hold": "'zero' if a controller holds each command, 'linear' if the input moves between samples; "
    "linear is assumed where it is not stated",
}
_RIG_OF_JOINT = {"yaw_inertia": "kg m2, nominal inertia about the joint; optional"}
_RUN_OF_JOINT = {
    "spring_stiffness": "N m/rad: 0 for a joint without a spring",
    **_OF_INPUT,
}
"""Of driven runs in still air: no coefficient of the wind is sought in them."""
ORIGINAL = "# Original: "
_RUNS_HEAD = "# What the files do not say about the runs: fill it in, and remove the # before it."


def import_records(
    files: Sequence[Path | str],
    folder: Path | str,
    choices: ImportChoices = ImportChoices(),  # noqa: B008 - frozen
    *,
    conditions: Path | None = None,
    overwrite: bool = False,
    picture: Callable[[Imported], bytes] | None = None,
) -> Imported:
    """Read files as instruments write them, and write them as a campaign: completely, or not at all.

    Args:
        files: one or more, of any known format.
        picture: draws the records, as PNG; None: no picture.
    """
    name = one_line(Path(folder).resolve().name)
    imported = read_records([Path(path) for path in files], choices, conditions=conditions, name=name)
    write_imported(imported, folder, overwrite=overwrite, picture=picture)
    return imported


def write_imported(
    imported: Imported,
    folder: Path | str,
    *,
    overwrite: bool = False,
    picture: Callable[[Imported], bytes] | None = None,
) -> None:
    """Write the imported runs as a campaign, with its recipe; arguments as in `import_records`."""
    samples = sum(run.record.time_s.size for run in imported.campaign.runs)
    driven = {run.id for run in imported.campaign.runs if run.drive is not None}
    recipe = {
        "schema_version": 1,
        "choices": imported.choices.model_dump(exclude_none=True, exclude_defaults=True),
        "originals": [
            {"file": one_line(s.path.name), "sha256": s.sha256, "said": imported.remarks(s.path)}
            for s in imported.sources
        ],
    }
    beside = {IMPORT_RECIPE: tomli_w.dumps(recipe).encode()}
    if picture is not None:
        beside[IMPORT_PICTURE] = picture(imported)
    write_campaign(
        imported.campaign,
        folder,
        run_format="csv" if samples <= _AS_TEXT else "parquet",
        overwrite=overwrite,
        text=lambda document: campaign_text(document, originals(imported), driven),
        beside=beside,
        checked=True,
    )


def originals(imported: Imported) -> list[str]:
    """Comments that name the files, with their SHA-256."""
    return [f"{ORIGINAL}{one_line(s.path.name)}, SHA-256 {s.sha256}" for s in imported.sources]


def campaign_text(document: Mapping[str, Any], originals: Sequence[str], driven: Collection[str]) -> str:
    """``campaign.toml`` after comments on its originals; keys that are not stated are also comments.

    Args:
        driven: ids of the driven runs.
    """
    tables = {key: value for key, value in document.items() if key != "runs"}
    rig = tables.pop("rig", {})
    joint = all(run["id"] in driven and not run.get("wind_speed") for run in document["runs"])
    unknown = [
        f"# {key} =   # {why}" for key, why in (_RIG_OF_JOINT if joint else _RIG).items() if key not in rig
    ]
    head = [tomli_w.dumps(tables), "\n".join(["[rig]", *unknown, tomli_w.dumps(rig)])]
    head += [_RUNS_HEAD] if "repeatability" in tables else [_REPEATABILITY, _RUNS_HEAD]
    blocks = []
    for run in document["runs"]:
        wanted = _RUN_OF_JOINT if joint else _RUN | (_OF_INPUT if run["id"] in driven else {})
        unknown = [f"# {key} =   # {why}" for key, why in wanted.items() if key not in run]
        blocks.append("\n".join(["[[runs]]", tomli_w.dumps(run).strip(), *unknown, ""]))
    return "\n".join([*originals, *head, *blocks])
