"""A diagnosis read from the file that ``tunnel diagnose --json`` wrote."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagnosis.result import Diagnosis
from tunnel_sim.files.reading import as_described, read_json
from tunnel_sim.files.toml_input import check_version
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.errors import shown
from tunnel_sim.vocabulary.freedom import FREEDOMS

REMEDY = "give a file that tunnel diagnose --json wrote"
READING_UNITS = {unit for one in FREEDOMS.values() for unit in one.shown}


def read_diagnosis(path: Path) -> Diagnosis:
    """The diagnosis of a file, without its runs.

    Raises:
        TunnelError: when the file is not the document of a diagnosis.
    """
    document = read_json(path, remedy=REMEDY)
    check_version(document, path)
    return diagnosis_of(document, shown(path), REMEDY)


def diagnosis_of(document: Mapping[str, Any], where: str, remedy: str) -> Diagnosis:
    """The diagnosis in a document, as from `Diagnosis.from_json_dict`, with a check that its values can be shown.

    Args:
        where: source of the document, for an error.
        remedy: remedy, for an error.

    Raises:
        TunnelError: when it is not the document of a diagnosis.
    """
    found = Diagnosis.from_json_dict(document, where=where, remedy=remedy)
    with as_described("is not a diagnosis", where, remedy):
        _check(found)
    return found


def _check(diagnosis: Diagnosis) -> None:
    """Refuse values of the right type that cannot be shown."""
    if not diagnosis.candidates:
        raise ValueError("'candidates' is empty")
    stated = (diagnosis.coefficients.before, diagnosis.coefficients.after, diagnosis.coefficients.in_phase)
    named = [*stated, *(candidate.parameters for candidate in diagnosis.candidates)]
    texts = [diagnosis.campaign, *diagnosis.causes, *diagnosis.ambiguous_with]
    texts += [candidate.effect for candidate in diagnosis.candidates] + [
        name for group in named for name in group
    ]
    if not all(text.isprintable() for text in texts):
        raise ValueError("a name has line breaks or control characters")
    probabilities = [
        *diagnosis.inclusion.values(),
        *(candidate.probability for candidate in diagnosis.candidates),
    ]
    for share in (diagnosis.gap.closed, *probabilities):
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"{share:g} is not a share from 0 to 1")
    for given in (quantity for group in named for quantity in group.values()):
        dimension(given.unit)
        if given.std is not None and given.std < 0.0:
            raise ValueError(f"a standard deviation is {given.std:g}")
    for rival in diagnosis.found.rivals:
        if not isinstance(rival.figures.get("words"), str):
            raise ValueError(f"the rival {rival.kind!r} has no words")
    for spread in diagnosis.repeated.spreads:
        if min(spread.width, *spread.interval) < 0.0:
            raise ValueError(f"the width of a scatter is {spread.width:g}")
    units = {diagnosis.gap.misfit.unit, *([diagnosis.maps.unit] if diagnosis.maps else [])}
    for unit in units - READING_UNITS:
        raise ValueError(f"{unit!r} is no unit of a reading")
