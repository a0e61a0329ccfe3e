"""The JSON document of a diagnosis: its schema, and the fields that ``tunnel compare`` reads."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field

from tunnel_sim.files.reading import read_json
from tunnel_sim.files.toml_input import OneLine, StrictModel, check_version, validate
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.errors import TunnelError

REMEDY = "give a file that tunnel diagnose --json wrote"
Excess = Annotated[float, Field(description="a ratio to the noise variance")]
Table = dict[str, Any]
ReadingUnit = Literal["rad", "rad/s", "rad/s2"]


def _known(unit: str) -> str:
    try:
        dimension(unit)
    except TunnelError as error:
        raise ValueError(error.what) from None
    return unit


Unit = Annotated[OneLine, AfterValidator(_known), Field(description="a unit such as 'N m/rad'")]
Share = Annotated[float, Field(ge=0.0, le=1.0, description="a number from 0 to 1")]


class Part(StrictModel):
    """A part of the document; fields that are not compared are not checked."""

    model_config = ConfigDict(extra="ignore")


class _Estimate(Part):
    value: float
    std: Annotated[float, Field(ge=0.0)] | None
    unit: Unit
    bound: OneLine | None = None
    determined: bool = True
    interval: list[float] | None = Field(
        default=None,
        min_length=2,
        max_length=2,
        description="ends of the central interval of 0.95, where it is not value ± 1.96 std",
    )


class _Misfit(Part):
    unit: ReadingUnit = Field(description="'rad', 'rad/s' or 'rad/s2'")


class _Gap(Part):
    misfit: _Misfit | None = None
    excess_before: Excess
    excess_after: Excess
    closed: Share


class _Candidate(Part):
    probability: Share
    effect: OneLine
    parameters: dict[OneLine, _Estimate]


class _Coefficients(Part):
    before: dict[OneLine, _Estimate]
    after: dict[OneLine, _Estimate]
    in_phase: dict[OneLine, _Estimate] = Field(default_factory=dict)


class _Run(Part):
    std: Annotated[float, Field(ge=0.0)]


class _Maps(Part):
    runs: list[_Run]
    unit: ReadingUnit = Field(default="rad", description="'rad', 'rad/s' or 'rad/s2'")


class _Spread(Part):
    effect: OneLine
    width: Annotated[float, Field(ge=0.0)]
    interval: list[float] = Field(min_length=2, max_length=2, description="central 0.90")


class _Repeatability(Part):
    spreads: list[_Spread] = Field(description="chance differences between runs, relative")


class Document(Part):
    """The fields that are compared."""

    schema_version: int = Field(description="1")
    campaign: OneLine = Field(description="the campaign's name")
    causes: list[OneLine] = Field(description="effect names; empty: no gap; unknown: no effect explains it")
    decided: bool = Field(
        default=True, description="whether the answer has at least one half of the probability"
    )
    ambiguous_with: list[OneLine] = Field(
        description="effects that the runs cannot distinguish from the causes"
    )
    gap: _Gap = Field(description="the gap before and after the causes are added")
    candidates: list[_Candidate] = Field(min_length=1, description="answers, most probable first")
    coefficients: _Coefficients = Field(description="estimates before and after, and a note")
    maps: _Maps | None = Field(default=None, description="data of the figures")
    repeatability: _Repeatability | None = Field(
        default=None,
        description="spreads, trends and the outlier of the differences between runs; every run against the model",
    )


def read_diagnosis(path: Path) -> dict[str, Any]:
    """The compared fields of a file from ``tunnel diagnose --json``, in JSON's types."""
    return validate(Document, read_document(path), path).model_dump()


def read_document(path: Path) -> dict[str, Any]:
    """The whole document of a diagnosis; only the compared fields are checked."""
    document = read_json(path, remedy=REMEDY)
    check_version(document, path)
    validate(Document, document, path)
    return document


class DiagnosisDocument(Document):
    """The document of ``tunnel diagnose --json``; excesses are in noise variances of a sample."""

    credible: list[Table] = Field(
        description="effect and probability of the fewest answers that have 0.9 together"
    )
    common: dict[str, dict[str, float]] = Field(
        description="effects and channels that answers of 0.9 together have in common"
    )
    verdict: str = Field(description="the answer in plain words")
    where: Table = Field(description="channel, condition, runs, time_s, amplitude_rad, frequency_hz, words")
    inclusion: dict[str, float] = Field(description="by effect, the probability that it is among the causes")
    waterfall: list[Table] = Field(description="effect and excess, as the causes are added one by one")
    waterfall_on: str = Field(description="its held-out readings")
    without: dict[str, float] = Field(description="by cause, the excess when it alone is taken out")
    sizes: list[Table] = Field(description="what each fitted cause does to a swing of a stated amplitude")
    rest: Table | None = Field(description="the residual with the causes")
    closable: Table | None = Field(
        description="the part of the residual gap that could be explained, and by which kind of law"
    )
    model: Table | None = Field(description="the patched model, with --model")
    next_run: Table | None = Field(description="the run that would distinguish the causes from their rivals")
    confirmation: Table = Field(description="how far MuJoCo and the fits' integrator agree")
    noise: Table = Field(description="std and stated_std in rad, source, reason")
    hidden: list[Table] = Field(
        default_factory=list,
        description="effects that could hide: the largest size that the runs do not exclude, and its moves",
    )
    trade_off: Table | None = Field(
        default=None,
        description="the two parameters that the runs separate least: parameters, correlation, remedy",
    )
    found: Table = Field(
        default_factory=dict, description="the facts behind the sentences, each with its kind"
    )
    unpredictive: str = Field(
        default="", description="the answer, where it is probable and its predictions leave a doubt"
    )
    doubts: list[Table] = Field(default_factory=list, description="these doubts: kind and share")
    blind_spots: list[str] = Field(description="what these runs cannot show")
    cautions: list[str] = Field(description="caveats")
    disturbed: list[Table] = Field(
        default_factory=list,
        description="runs that were disturbed: run, at_s (null: it differs from the others as a whole), "
        "kept_until_s (null: left out, or used), kept_from_s, p_value, used",
    )
    remarks: list[Table] = Field(description="of the examination: outcome, runs, what, remedy")
    seconds: dict[str, float] = Field(description="wall time by step, s")
    provenance: Table = Field(description="versions, SHA-256 of the records, and runs left out as asked")


def read_whole(path: Path) -> dict[str, Any]:
    """The whole document of a diagnosis; all fields are checked."""
    document = read_document(path)
    validate(DiagnosisDocument, document, path)
    return document
