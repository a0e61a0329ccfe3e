"""Captions of the report's figures, by their names."""

from __future__ import annotations

from collections.abc import Mapping

from diagnosis.findings.whole import Findings
from identification.show.blocks import Figure

CAPTIONS: Mapping[str, str] = {
    "fit": "Above: the measured readings and the predictions of the models fitted to all runs. Below: the "
    "residuals. The first view shows the cycles in which the models differ most.",
    "which": "Probability of the likely answers. The possible answers are: no gap, every fitted set of effects, "
    "and unknown.",
}


def captioned(name: str) -> Figure:
    """A figure with its caption."""
    return Figure(name, CAPTIONS[name])


def pictured(answer: Findings, *names: str) -> tuple[Figure, ...]:
    """The figures of findings by their names, those that the answer has."""
    return tuple(answer.pictures[name].block for name in names if name in answer.pictures)
