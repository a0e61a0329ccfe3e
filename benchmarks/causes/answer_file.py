"""An entry's answer files: their fields, and the faults for which a file is refused.

``answer.schema.json`` states the fields for other languages.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from benchmarks.causes.entry import NAMES, UNKNOWN
from diagnosis.findings.terms import SCATTERS
from tunnel_sim.files.reading import as_described, read_json
from tunnel_sim.files.toml_input import NotNegative, Positive, StrictModel
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, shown

_ROUNDING = 1e-6  # tolerance of the sum of probabilities
_LABELS = (*NAMES, *SCATTERS, UNKNOWN)
_SEE = "see benchmarks/causes/answer.schema.json"

Probability = Annotated[float, Field(ge=0.0, le=1.0)]


class StatedCoefficient(StrictModel):
    """A coefficient and its standard deviation, 1/rad."""

    value: float
    std: Positive


class StatedCoefficients(StrictModel):
    """The coefficients that an entry states."""

    cn_beta: StatedCoefficient | None = None
    cn_r: StatedCoefficient | None = None


class BeforeAndAfter(StrictModel):
    """The coefficients before and after the causes are added."""

    before: StatedCoefficients = StatedCoefficients()
    after: StatedCoefficients = StatedCoefficients()


class StatedWidth(StrictModel):
    """A relative standard deviation between the runs, with its 90 % interval, and whether the entry names it."""

    value: NotNegative
    interval_90: Annotated[list[NotNegative], Field(min_length=2, max_length=2)]
    named: bool


class StatedSet(StrictModel):
    """A set of causes and its probability."""

    causes: list[str]
    probability: Probability


class AnswerFile(StrictModel):
    """The fields of a file, as in the schema."""

    schema_version: Literal[1]
    campaign: str
    causes: list[str] | None
    probability: dict[str, Probability]
    sets: list[StatedSet] = Field(default=[])
    coefficients: BeforeAndAfter = BeforeAndAfter()
    scatter: dict[Literal["wind_speed", "spring_stiffness", "mechanical_damping"], StatedWidth] = Field(
        default={}
    )
    seconds: NotNegative = 0.0
    error: str = ""


def read_answers(folder: Path) -> dict[str, dict[str, Any]]:
    """The answers of a folder by campaign.

    Args:
        folder: folder of one JSON file for each campaign.

    Raises:
        TunnelError: when there are no files, or a file is not an answer.
    """
    paths = sorted(folder.glob("*.json"))
    if not paths:
        raise TunnelError(
            "holds no answer", where=str(folder), remedy="write one JSON file for each campaign"
        )
    answers = {}
    for path in paths:
        answer = read_json(path, remedy=_SEE)
        with as_described("is not an answer", shown(path), _SEE):
            read = AnswerFile.model_validate(answer)
        _check(read, path.stem, shown(path))
        answers[path.stem] = answer
    return answers


def _check(answer: AnswerFile, campaign: str, where: str) -> None:
    """Refuse content that the types of the fields allow but no score can count."""
    if answer.campaign != campaign:
        what = f"answers the campaign '{answer.campaign}', but its name is of '{campaign}'"
        raise TunnelError(
            what, where=where, remedy=f"rename it {answer.campaign}.json, or correct 'campaign'"
        )
    _check_names(answer.probability, "probability", where)
    _check_set(answer.causes or (), "causes", where)
    for number, one in enumerate(answer.sets):
        _check_set(one.causes, f"sets.{number}.causes", where)
    sets = Counter(frozenset(one.causes) for one in answer.sets)
    if repeated := [sorted(names) for names, count in sets.items() if count > 1]:
        what = f"'sets' has the set [{', '.join(repeated[0])}] more than once"
        raise TunnelError(what, where=where, remedy="give it once, with the sum of its probabilities")
    total = sum(one.probability for one in answer.sets)
    if total > 1.0 + _ROUNDING:
        what = f"the probabilities of 'sets' sum to {total:.7g}, more than 1"
        raise TunnelError(what, where=where, remedy="divide each by their sum")
    for name, width in answer.scatter.items():
        low, high = width.interval_90
        if low > high:
            what = f"scatter.{name}.interval_90 begins at {low:g} and ends at {high:g}"
            raise TunnelError(what, where=where, remedy="give the lower end first")


def _check_set(names: Sequence[str], field: str, where: str) -> None:
    _check_names(names, field, where)
    if len(set(names)) < len(names):
        raise TunnelError(f"{field} has a cause twice", where=where, remedy="name every cause once")
    if UNKNOWN in names and set(names) - {UNKNOWN, *SCATTERS}:
        remedy = f'give ["{UNKNOWN}"], or the causes without it'
        raise TunnelError(f"{field} has '{UNKNOWN}' beside a cause", where=where, remedy=remedy)


def _check_names(names: Iterable[str], field: str, where: str) -> None:
    for name in names:
        if name not in _LABELS:
            what = f"{field} has '{name}', which is not a cause of the benchmark"
            remedy = "give [] for no gap" if name == "none" else did_you_mean(name, _LABELS)
            raise TunnelError(what, where=where, remedy=remedy)
