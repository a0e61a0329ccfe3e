"""JSON schemas of the project's documents, from the classes that read or write them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field

from tunnel_lab.terminal.diagnosis_file import Document

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class DiagnosisDocument(Document):
    """What ``tunnel diagnose --json`` writes; excesses are in noise variances of a sample."""

    credible: Annotated[
        list[dict[str, Any]],
        Field(description="effect and probability of the fewest answers that have 0.9 together"),
    ]
    common: Annotated[
        dict[str, dict[str, float]],
        Field(description="effects and channels that answers of 0.9 together have in common"),
    ]
    verdict: Annotated[str, Field(description="the answer in plain words")]
    where: Annotated[
        dict[str, Any],
        Field(description="channel, condition, runs, time_s, amplitude_rad, frequency_hz, words"),
    ]
    inclusion: Annotated[
        dict[str, float], Field(description="by effect, the probability that it is among the causes")
    ]
    waterfall: Annotated[
        list[dict[str, Any]], Field(description="effect and excess, as the causes are added one by one")
    ]
    waterfall_on: Annotated[str, Field(description="what was held out of the fits for it")]
    without: Annotated[dict[str, float], Field(description="by cause, the excess when it alone is taken out")]
    rest: Annotated[dict[str, Any] | None, Field(description="what remains after the causes")]
    closable: Annotated[
        dict[str, Any] | None, Field(description="how much of what remains could be closed, and by what")
    ]
    model: Annotated[dict[str, Any] | None, Field(description="the patched model, with --model")]
    next_run: Annotated[
        dict[str, Any] | None,
        Field(description="the run that would distinguish the causes from their rivals"),
    ]
    confirmation: Annotated[
        dict[str, Any], Field(description="how far MuJoCo and the fits' integrator agree")
    ]
    noise: Annotated[dict[str, Any], Field(description="std and stated_std in rad, source, reason")]
    blind_spots: Annotated[list[str], Field(description="what these runs cannot show")]
    cautions: Annotated[list[str], Field(description="caveats")]
    remarks: Annotated[
        list[dict[str, Any]],
        Field(description="of the examination: outcome, runs, what, remedy"),
    ]
    seconds: Annotated[dict[str, float], Field(description="wall time by step, s")]
    provenance: Annotated[dict[str, Any], Field(description="versions, and SHA-256 of the records")]


def _campaign() -> dict[str, Any]:
    from tunnel_sim.files.campaign_schema import CampaignDocument

    return CampaignDocument.model_json_schema()


def _plan() -> dict[str, Any]:
    from tunnel_sim.files.plan_schema import PlanDocument

    return PlanDocument.model_json_schema()


def _estimate() -> dict[str, Any]:
    from identification.estimate import estimate_schema

    return estimate_schema()


SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "campaign": _campaign,
    "plan": _plan,
    "estimate": _estimate,
    "diagnosis": DiagnosisDocument.model_json_schema,
}
"""By name of the document."""


def schema(name: str) -> dict[str, Any]:
    """The JSON schema of a document.

    Args:
        name: one of `SCHEMAS`.

    Returns:
        The schema. Titles that only repeat a field's name are left out: an editor shows the description.
    """
    found = {"$schema": DIALECT, **SCHEMAS[name](), "title": f"tunnel {name}"}
    return {key: _plain(value) if key != "title" else value for key, value in found.items()}


def _plain(value: Any) -> Any:
    """Without titles, and with the first line of a description where it is a docstring."""
    if isinstance(value, dict):
        kept = {key: one for key, one in value.items() if not (key == "title" and isinstance(one, str))}
        return {key: _first_line(key, _plain(one)) for key, one in kept.items()}
    return [_plain(one) for one in value] if isinstance(value, list) else value


def _first_line(key: str, value: Any) -> Any:
    return value.partition("\n")[0] if key == "description" and isinstance(value, str) else value
