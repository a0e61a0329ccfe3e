"""Captions of the report's figures, by their names."""

from __future__ import annotations

from collections.abc import Mapping

from identification.blocks import Figure

CAPTIONS: Mapping[str, str] = {
    "fit": "The measured readings, those predicted by the models fitted to all runs, and below them the "
    "residuals. At first the cycles are shown in which the models differ most.",
    "repeatability": "Repeatability: frequency and damping ratio of every run, in their order, minus the "
    "prediction of the model of all runs. Bars: 95 % intervals of the noise. Grey: the scatter between runs, "
    "within which 95 % of them lie; it differs with wind and spring.",
    "how-far": "Misfit of every run before and after. Filled circles: the run was held out of the fit, "
    "and only its release was refitted. Open circles: the run was part of the fit.",
    "law": "What is missing, estimated without a formula, with its 95 % band; in a map, white cells are "
    "within it. What the coefficients and the zero of the model absorb is taken out.",
    "where-runs": "Excess of every run over time: the mean squared residual of the nominal model over the "
    "noise variance, minus one, on a logarithmic scale. Empty cells are within three standard deviations of "
    "the noise.",
    "where-profiles": "Excess of all runs together over time and over amplitude, in the frequency bands "
    "that show the gap. Grey: what noise alone gives, within three standard deviations. Yellow: the shortest "
    "interval with four fifths of the gap. Missing moment: the share of its energy by time, which shows when "
    "a moment acts and not how long the motion after it lasts; it locates a blow.",
    "where-spectrum": "Residual power by frequency over that of the noise. Grey: what noise alone gives, "
    "within three standard deviations. In print, yellow: the shortest interval with four fifths of the gap; "
    "dark bar on the axis: the natural frequencies of the runs.",
    "where-backbones": "Backbone curves: each run in consecutive windows of three cycles (one cycle where "
    "the record is short), with 95 % bands; values known far worse than most lie beyond the axes. A linear "
    "rig gives horizontal lines; separate horizontal lines are runs that disagree. Curved frequency lines "
    "indicate an effect on the stiffness, curved damping lines an effect on the damping.",
    "where-phase-plane": "The moment that the nominal model lacks, over the runs that show the gap. It is "
    "computed from the residuals with the fitted equation of motion. Empty cells are within three standard "
    "deviations of zero. The part that the nominal coefficients absorb is not shown.",
    "where-moment": "Means of the missing moment, with 95 % bands. A dependence on the angle indicates "
    "stiffness, a dependence on the rate damping.",
    "which": "Probability of the answers that are not improbable. The answers are: no gap, every set of "
    "effects that was fitted, and unknown.",
    "friction": "Friction against rate, with 95 % intervals. Line: the law of the answer, with the band "
    "of its fit. Circles: energy lost between reversals of the motion, less what everything else in the "
    "answer dissipates, over the distance; at the mean rate.",
    "coefficients": "Estimates with 95 % intervals.",
}


def captioned(name: str) -> Figure:
    """A figure with its caption."""
    return Figure(name, CAPTIONS[name])
