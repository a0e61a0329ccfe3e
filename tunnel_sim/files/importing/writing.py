"""Step 5 of an import: write the campaign, with unstated properties as comments."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from tunnel_sim.files.campaign_folder import IMPORT_PICTURE, IMPORT_RECIPE, write_campaign
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.vocabulary.errors import one_line
from tunnel_sim.vocabulary.freedom import FREEDOMS

_AS_TEXT = 1_000_000  # samples: a larger campaign is written as Parquet
NEEDED = {
    "spring_stiffness": "needed for Izz, Cr, Cnβ and Cnr; without it a run gives ωn and ζ",
    "frontal_area": "needed for Cnβ and Cnr",
    "reference_length": "needed for Cnβ and Cnr",
}
"""Consequences of unstated values."""
STIFFNESS_OF_JOINT = "0 for a joint without a spring"
"""The stiffness of a driven run in still air."""
_RIG = {
    "frontal_area": f"m2: {NEEDED['frontal_area']}",
    "reference_length": f"m: {NEEDED['reference_length']}",
    "yaw_inertia": "kg m2, nominal Izz of model and support; optional",
    "width": "m, for Strouhal numbers; optional",
}
_REPEATABILITY = (
    "# [repeatability]   # optional: wind_speed, spring_stiffness and mechanical_damping, each as one standard\n"
    "#                   # deviation between runs, relative, such as 0.003\n"
)
_RUN = {
    "spring_stiffness": f"N m/rad: {NEEDED['spring_stiffness']}",
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
    "spring_stiffness": f"N m/rad: {STIFFNESS_OF_JOINT}",
    **_OF_INPUT,
}
"""Comments for driven runs in still air, which give no aerodynamic coefficient."""
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
        files: one or more files, of any known format.
        picture: function that draws the records, as PNG; None: no picture.
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
    driven = {run.id for run in imported.campaign.driven_runs}
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
    """``campaign.toml`` after comments on its originals; unstated keys are comments, too.

    Args:
        driven: ids of the driven runs.
    """
    tables = {key: value for key, value in document.items() if key != "runs"}
    rig = tables.pop("rig", {})
    freedom = FREEDOMS[tables.get("sensor", {}).get("motion", "angle")]

    def comments(why: Mapping[str, str], stated: Collection[str]) -> list[str]:
        """The unstated keys, as comments."""
        own = freedom.as_own({key: text for key, text in why.items() if key not in freedom.refused})
        return [f"# {key} =   # {freedom.words(text)}" for key, text in own.items() if key not in stated]

    joint = all(run["id"] in driven and not run.get("wind_speed") for run in document["runs"])
    unknown = comments(_RIG_OF_JOINT if joint else _RIG, rig)
    head = [tomli_w.dumps(tables), "\n".join(["[rig]", *unknown, tomli_w.dumps(rig)])]
    head += [_RUNS_HEAD] if "repeatability" in tables else [freedom.words(_REPEATABILITY), _RUNS_HEAD]
    blocks = []
    for run in document["runs"]:
        wanted = _RUN_OF_JOINT if joint else _RUN | (_OF_INPUT if run["id"] in driven else {})
        unknown = comments(wanted, run)
        blocks.append("\n".join(["[[runs]]", tomli_w.dumps(run).strip(), *unknown, ""]))
    return "\n".join([*originals, *head, *blocks])
