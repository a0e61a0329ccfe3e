"""Conditions of the runs and sizes of the rig, as a table of texts that one can type, and in ``campaign.toml``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.campaign_schema import CAMPAIGN_FILE, NO_CAMPAIGN, parse_document
from tunnel_sim.files.importing.choices import RIG_KEYS, RUN_KEYS, Conditions
from tunnel_sim.files.importing.writing import ORIGINAL, campaign_text
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.toml_input import load_toml, one_line, validate
from tunnel_sim.files.writing import write_json, write_whole
from tunnel_sim.vocabulary.campaign import needs_density
from tunnel_sim.vocabulary.errors import TunnelError

Cells = dict[str, dict[str, str]]
"""Texts by run and key; those of the rig under `RIG`."""

RIG = ""
"""The row of the rig's sizes: no run has an empty name."""

UNITS = {
    "wind_speed": "m/s",
    "spring_stiffness": "N m/rad",
    "air_density": "kg/m³",
    "release_angle": "rad",
    "yaw_inertia": "kg m²",
    "frontal_area": "m²",
    "reference_length": "m",
    "width": "m",
}
WORDS = {
    "wind_speed": "wind speed V",
    "spring_stiffness": "stiffness Kr",
    "air_density": "air density ρ",
    "release_angle": "release angle",
    "yaw_inertia": "nominal inertia Izz",
    "frontal_area": "frontal area A",
    "reference_length": "reference length l",
    "width": "width",
}
MISSING = {
    "spring_stiffness": "needed for Izz, Cr, Cnβ and Cnr; without it a run gives ωn and ζ",
    "frontal_area": "needed for Cnβ and Cnr",
    "reference_length": "needed for Cnβ and Cnr",
}
"""What is missing without these; the others are optional, or required (`faults`)."""


def stated(session: Session) -> Cells:
    """The conditions in ``campaign.toml``.

    Raises:
        TunnelError: when it cannot be read.
    """
    document = _document(session)
    rows = {run["id"]: _texts(run, RUN_KEYS) for run in document["runs"]}
    return {RIG: _texts(document.get("rig", {}), RIG_KEYS), **rows}


def typed(session: Session) -> Cells:
    """The conditions as they were typed last, saved in the campaign or not.

    Raises:
        TunnelError: when they cannot be read.
    """
    saved = stated(session)
    if not session.draft.is_file():
        return saved
    draft = read_json(session.draft, remedy="delete it; what was saved in the campaign is not lost")
    return {
        row: {key: str(draft.get(row, cells).get(key, text)) for key, text in cells.items()}
        for row, cells in saved.items()
    }


def faults(cells: Cells, *, plausible: bool = True) -> dict[tuple[str, str], str]:
    """What is wrong, by row and key.

    Args:
        plausible: whether values that look like a wrong unit are wrong.

    Returns:
        One line for each cell, as a command would print it; empty where the campaign can be read.
    """
    found = {}
    for row, texts in cells.items():
        where = f"run '{row}'" if row else "the rig"
        for key, text in texts.items():
            try:
                value = number(text, f"{where}, {key}")
                if value is not None:
                    validate(Conditions, {key: value}, Path(where))
                    plausible_values({key: value} if plausible else {}, where)
            except TunnelError as error:
                found[row, key] = str(error)
        if not row or texts["air_density"].strip() or (row, "wind_speed") in found:
            continue
        scales = (texts["spring_stiffness"], cells[RIG]["frontal_area"], cells[RIG]["reference_length"])
        speed = number(texts["wind_speed"], where) or 0.0
        if needs_density(speed, *(1.0 if text.strip() else None for text in scales)):
            remedy = "give it in kg/m3 (about 1.2 for air)"
            found[row, "air_density"] = str(
                TunnelError("wind-on without air_density", where=where, remedy=remedy)
            )
    return found


def number(text: str, where: str) -> float | None:
    """The number that a cell holds; None where it is empty.

    Args:
        text: with a decimal point or comma.

    Raises:
        TunnelError: when it is not a number.
    """
    if not text.strip():
        return None
    try:
        return float(text.strip().replace("−", "-").replace(",", "."))
    except ValueError:
        raise TunnelError(
            f"'{one_line(text, 30)}' is not a number", where=where, remedy="give a number in SI units"
        ) from None


def save(session: Session, cells: Cells) -> dict[tuple[str, str], str]:
    """Save conditions in the campaign, or as a draft beside it while something is wrong.

    Returns:
        What is wrong (`faults`).

    Raises:
        TunnelError: when the campaign would not be readable for another reason.
    """
    document = _document(session)
    wrong = faults(cells, plausible=_is_judged(document))
    if wrong:
        write_json(session.draft, cells)
        return wrong
    document["rig"] = _with(document.get("rig", {}), cells[RIG], RIG_KEYS)
    document["runs"] = [_with(run, cells[run["id"]], RUN_KEYS) for run in document["runs"]]
    if stated(session) != cells:
        _write(session, document)
    session.draft.unlink(missing_ok=True)
    return {}


def judge(session: Session, plausible: bool) -> None:
    """State whether values that look like a wrong unit are refused.

    Raises:
        TunnelError: when a value that is kept would then be refused.
    """
    document = _document(session)
    document["sensor"] = {**document.get("sensor", {}), "plausible": False}
    if plausible:
        del document["sensor"]["plausible"]
    _write(session, document)


def is_judged(session: Session) -> bool:
    """Whether values that look like a wrong unit are refused."""
    return _is_judged(_document(session))


def _is_judged(document: Mapping[str, Any]) -> bool:
    return document.get("sensor", {}).get("plausible") is not False


def _write(session: Session, document: dict[str, Any]) -> None:
    path = session.campaign / CAMPAIGN_FILE
    parse_document(document, path)
    comments = [line for line in path.read_text("utf-8").splitlines() if line.startswith(ORIGINAL)]
    write_whole(path, campaign_text(document, comments).encode())


def restore(session: Session, before: Cells) -> None:
    """State again what was stated before a campaign was written anew, for the runs that it still has.

    Args:
        before: of `stated`.

    Raises:
        TunnelError: as `save`.
    """
    now = stated(session)
    kept = {
        row: {key: before.get(row, {}).get(key) or text for key, text in cells.items()}
        for row, cells in now.items()
    }
    save(session, kept)


def pasted(cells: Cells, columns: list[str], row: str, key: str, text: str) -> Cells:
    """Cells with a block from a spreadsheet put in, its upper left cell at a place.

    Args:
        columns: keys of the table's columns, in their order.
        row: where the block begins.
        key: likewise.
        text: rows on lines, cells separated by tabs; what lies outside the table is left out.
    """
    rows = [name for name in cells if name != RIG]
    result = {name: dict(texts) for name, texts in cells.items()}
    block = [line.split("\t") for line in text.replace("\r\n", "\n").rstrip("\n").split("\n")]
    for name, line in zip(rows[rows.index(row) :], block, strict=False):
        for place, cell in zip(columns[columns.index(key) :], line, strict=False):
            result[name][place] = cell.strip()
    return result


def _document(session: Session) -> dict[str, Any]:
    document = load_toml(session.campaign / CAMPAIGN_FILE, missing=NO_CAMPAIGN)
    parse_document(document, session.campaign / CAMPAIGN_FILE)
    return document


def _texts(table: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, str]:
    return {key: "" if table.get(key) is None else repr(float(table[key])).removesuffix(".0") for key in keys}


def _with(table: Mapping[str, Any], cells: Mapping[str, str], keys: tuple[str, ...]) -> dict[str, Any]:
    """A table of ``campaign.toml`` with the conditions typed; a run without a wind speed is wind-off."""
    values = {key: number(cells[key], key) for key in keys}
    if "wind_speed" in values and values["wind_speed"] is None:
        values["wind_speed"] = 0.0
    others = {key: value for key, value in table.items() if key not in keys}
    return others | {key: value for key, value in values.items() if value is not None}
