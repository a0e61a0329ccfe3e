"""Captions of the report's figures, by their names."""

from __future__ import annotations

from collections.abc import Mapping

from diagnosis.findings.whole import Findings
from identification.show.blocks import Figure

CAPTIONS: Mapping[str, str] = {
    "fit": "Above: the measured readings and the predictions of the models fitted to all runs. Below: the "
    "residuals. The first view shows the cycles in which the models differ most.",
    "how-far": "Misfit of every run before and after. Filled circles: the run was held out of the fit, "
    "and only its release was refitted. Open circles: the run was part of the fit.",
    "where-runs": "Excess of every run over time: the mean squared residual of the nominal model over the "
    "noise variance, minus one, on a logarithmic scale. Empty cells are within three standard deviations of "
    "the noise.",
    "where-profiles": "Excess of all runs together over time and over amplitude, in the frequency bands "
    "that show the gap. Grey: the level of noise alone, within three standard deviations. Yellow: the shortest "
    "interval with four fifths of the gap. Missing moment: the share of its energy by time. It shows when a "
    "moment acts, and so locates a blow.",
    "where-spectrum": "Residual power over noise power, by frequency. Grey: the level of noise alone, within three "
    "standard deviations. In print, yellow: the shortest interval with four fifths of the gap; dark bar on the "
    "axis: the natural frequencies of the runs.",
    "where-backbones": "Backbone curves: each run in consecutive windows of three cycles (one cycle where "
    "the record is short), with 95 % bands; values with far wider bands lie beyond the axes. A linear "
    "rig gives horizontal lines. Separate horizontal lines mean that the runs disagree. Curved frequency lines "
    "indicate an effect on the stiffness; curved damping lines indicate an effect on the damping.",
    "where-phase-plane": "The moment that the nominal model lacks, over the runs that show the gap. It is "
    "computed from the residuals with the fitted equation of motion. Empty cells are within three standard "
    "deviations of zero. The part that the nominal coefficients absorb is not shown.",
    "where-moment": "Means of the missing moment, with 95 % bands. A dependence on the angle indicates "
    "stiffness; a dependence on the rate indicates damping.",
    "which": "Probability of the likely answers. The possible answers are: no gap, every fitted set of effects, "
    "and unknown.",
    "coefficients": "Estimates with 95 % intervals.",
}


def captioned(name: str) -> Figure:
    """A figure with its caption."""
    return Figure(name, CAPTIONS[name])


def pictured(answer: Findings, *names: str) -> tuple[Figure, ...]:
    """The figures of findings by their names, those that the answer has."""
    return tuple(answer.pictures[name].block for name in names if name in answer.pictures)
