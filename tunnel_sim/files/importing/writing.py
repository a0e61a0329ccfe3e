"""Writing of imported records as a campaign, with what is not known as comments."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from tunnel_sim.files.campaign_io import IMPORT_PICTURE, IMPORT_RECIPE, write_campaign
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.files.toml_input import one_line

_AS_TEXT = 1_000_000  # samples: a larger campaign is written as Parquet
_RIG = {
    "frontal_area": "m2: needed for Cnβ and Cnr",
    "reference_length": "m: needed for Cnβ and Cnr",
    "yaw_inertia": "kg m2, nominal Izz of model and support; optional",
    "width": "m, for Strouhal numbers; optional",
}
_RUN = {
    "spring_stiffness": "N m/rad: needed for Izz, Cr, Cnβ and Cnr; without it a run gives ωn and ζ",
    "air_density": "kg/m3: needed for Cnβ and Cnr",
    "release_angle": "rad, nominal; optional",
}
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
    """Read files as instruments write them, and write them as a campaign: whole, or not at all.

    Args:
        files: one or more, of any known format.
        folder: where the campaign goes.
        choices: what is known about the files; the rest is found.
        conditions: a table of conditions of the files or runs.
        overwrite: whether a campaign in the folder may be replaced.
        picture: draws what was read, as PNG; None: no picture.

    Returns:
        What was read, with remarks.

    Raises:
        TunnelError: for the first fault of the files or the folder.
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
    """Write what was read as a campaign, with its recipe; arguments as in `import_records`.

    Args:
        folder: where the campaign goes.
        overwrite: whether a campaign in the folder may be replaced.
        picture: draws what was read, as PNG; None: no picture.

    Raises:
        TunnelError: the folder exists or cannot be written.
    """
    samples = sum(run.record.time_s.size for run in imported.campaign.runs)
    beside = {IMPORT_RECIPE: recipe_text(imported).encode()}
    if picture is not None:
        beside[IMPORT_PICTURE] = picture(imported)
    write_campaign(
        imported.campaign,
        folder,
        run_format="csv" if samples <= _AS_TEXT else "parquet",
        overwrite=overwrite,
        text=lambda document: campaign_text(document, originals(imported)),
        beside=beside,
        checked=True,
    )


def originals(imported: Imported) -> list[str]:
    """Comments that name the files, with their SHA-256."""
    return [f"{ORIGINAL}{one_line(s.path.name)}, SHA-256 {s.sha256}" for s in imported.sources]


def campaign_text(document: Mapping[str, Any], originals: Sequence[str]) -> str:
    """``campaign.toml`` with the originals, and the keys that nobody has stated, as comments.

    Args:
        originals: comments that name the files it was made of.
    """
    tables = {key: value for key, value in document.items() if key != "runs"}
    rig = tables.pop("rig", {})
    unknown = [f"# {key} =   # {why}" for key, why in _RIG.items() if key not in rig]
    head = [tomli_w.dumps(tables), "\n".join(["[rig]", *unknown, tomli_w.dumps(rig)]), _RUNS_HEAD]
    blocks = []
    for run in document["runs"]:
        unknown = [f"# {key} =   # {why}" for key, why in _RUN.items() if key not in run]
        blocks.append("\n".join(["[[runs]]", tomli_w.dumps(run).strip(), *unknown, ""]))
    return "\n".join([*originals, *head, *blocks])


def recipe_text(imported: Imported) -> str:
    """The recipe: the choices that were made, the originals, and what was changed, as TOML."""
    document = {
        "schema_version": 1,
        "choices": imported.choices.model_dump(exclude_none=True, exclude_defaults=True),
        "originals": [
            {"file": one_line(s.path.name), "sha256": s.sha256, "said": imported.remarks(s.path)}
            for s in imported.sources
        ],
    }
    return tomli_w.dumps(document)
