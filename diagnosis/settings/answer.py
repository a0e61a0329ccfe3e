"""Settings of the answer: the place of the gap, the decision, and the uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting
from identification.policy import TRADE_OFF_CORRELATION


@dataclass(frozen=True)
class WhereSettings:
    """Location of the gap."""

    run_rate: float = setting(
        0.01, "False-alarm rate of the test that a run shows the gap, all runs combined.", "convention"
    )
    still_rate: float = setting(
        0.01, "False-alarm rate of the test that the wind-off runs show a gap.", "convention"
    )
    band_rate: float = setting(
        0.01, "False-alarm rate of the test that a band shows the gap, all bands combined.", "convention"
    )
    line_rate: float = setting(
        0.01, "False-alarm rate of a line in a run, all runs and frequencies combined.", "convention"
    )
    line_contrast: float = setting(
        8.0,
        "Minimum ratio of the power of a line in a run to the median around it.",
        "judgement",
        "The skirt of a resonance has less.",
    )
    run_noise_std: float = setting(
        0.015,
        "Relative standard deviation of the noise between runs.",
        "judgement",
        "Quantisation colours the noise.",
    )
    named_run: float = setting(
        0.1, "Minimum excess of a further run to be named, as a share of the largest excess.", "judgement"
    )
    one_run: float = setting(
        0.8,
        "Share of the excess in one run above which the runs do not show whether the gap needs wind.",
        "judgement",
    )
    one_run_of: int = setting(3, "Minimum number of runs for this test.", "judgement", unit="runs")
    interval_share: float = setting(0.8, "Share of the excess in a stated interval.", "judgement")
    blow_share: float = setting(
        0.5,
        "Minimum share of the missing moment's energy within the time of a blow.",
        "convention",
        "Most of it.",
    )
    blow_stds: float = setting(
        5.0,
        "Minimum significance of the missing moment.",
        "convention",
        unit="std",
    )
    blow_length: float = setting(0.1, "Maximum duration of a blow, as a share of the record.", "judgement")
    blow_after: float = setting(
        0.05,
        "Share of the record after the release that is excluded from the search for a blow.",
        "judgement",
    )
    fastest_moment: float = setting(
        30.0,
        "Maximum frequency of a moment; a faster line is an error of the sensor.",
        "physics",
        "The inertia of the rig keeps the response to faster moments below any noise.",
        unit="Hz of the similar rig",
    )
    line_share: float = setting(
        0.25, "Minimum share of a run's excess in its lines for them to locate the gap.", "judgement"
    )
    line_one_in: int = setting(
        3, "At least one run in this number must have such a line.", "judgement", unit="runs"
    )
    fast_share: float = setting(
        0.5,
        "Share of the excess above the frequency of the motion from which the gap is an error of the sensor.",
        "convention",
        "Most of it.",
    )
    slow_share: float = setting(
        0.5,
        "Share of the excess below the frequency of the motion from which the gap is a shift of the centre.",
        "convention",
        "Most of it.",
    )
    shifted_centre: float = setting(
        0.05, "Minimum share of the excess in the second harmonic that shows a shifted centre.", "judgement"
    )
    harmonic_share: float = setting(
        0.5,
        "Minimum share of the excess in harmonics for them to locate the gap.",
        "convention",
        "Most of it.",
    )
    alone_leaves: float = setting(
        0.2,
        "Maximum share of the excess that remains in fits to single runs, if every run is linear.",
        "judgement",
    )
    drift_ratio: float = setting(
        1.5,
        "Minimum ratio of the drifts of frequency and damping for the larger one to locate the gap.",
        "judgement",
    )
    run_departs: float = setting(
        1.5,
        "Ratio of the mean squared residual of a run to the noise variance above which the model does not fit the "
        "run.",
        "judgement",
    )


@dataclass(frozen=True)
class AnswerSettings:
    """Decision and uncertainties."""

    decided_from: float = setting(
        0.5,
        "Minimum probability of a decided answer.",
        "convention",
        "More probable than all others together.",
    )
    predicted_from: float = setting(
        0.1,
        "Minimum share of the gap on held-out readings that a decided answer must explain.",
        "judgement",
        "An answer that predicts less is fitted to chance.",
    )
    patch_excused: float = setting(
        0.001,
        "Share of the gap that the fit leaves, below which a part of the causes that cannot be written into the "
        "user's model excuses the patched model.",
        "judgement",
        "Simulated joints: a right law leaves 0.0001, a wrong one 0.007 or more.",
    )
    left_of_swing: float = setting(
        0.1,
        "Maximum root mean square residual of a decided answer, as a share of that of the readings about their "
        "mean.",
        "judgement",
        "A model that misses a tenth of the motion lacks a part of it.",
    )
    place_overruled: float = setting(
        0.99,
        "Minimum share of the gap on held-out readings that causes explain for the place of the gap not to "
        "contradict them.",
        "judgement",
        "Causes that predict all but a hundredth of the gap act where it is. Residuals of a grossly wrong model "
        "may look like another place.",
    )
    credible_from: float = setting(
        0.9, "Total probability of the stated set of likely answers.", "convention"
    )
    in_common: float = setting(
        0.9,
        "Minimum probability of an effect or a channel that is common to the likely answers.",
        "convention",
    )
    rivals_from: float = setting(
        0.05, "Minimum probability of a rival answer to be stated and to plan a run for.", "tuned"
    )
    coefficient_interval: float = setting(0.95, "Probability of the interval of a coefficient.", "convention")
    skewed_from: float = setting(
        0.1,
        "Deviation of the ends of the interval from those of a normal distribution above which the interval is "
        "stated.",
        "judgement",
        unit="std",
    )
    small_causes: int = setting(
        3,
        "Maximum number of unnamed small causes considered together.",
        "judgement",
        "Time against coverage.",
        unit="effects",
        decision="0028",
    )
    small_causes_tried: int = setting(
        8,
        "Number of effects in the sets of small causes: those that lower χ² most individually.",
        "judgement",
        "Time against coverage.",
        unit="effects",
        decision="0028",
    )
    small_causes_from: float = setting(
        0.05, "Minimum probability of an answer for small causes beside it.", "judgement"
    )
    small_cause_price: float = setting(
        20.0, "Cost of every small cause, in χ².", "judgement", BY_CHANCE, unit="χ²", decision="0028"
    )
    misfit_degrees: float = setting(
        6.0,
        "Effective degrees of freedom of the error of a real model.",
        "judgement",
        "One for every channel of the residuals.",
        unit="degrees of freedom",
        decision="0028",
    )
    dispersion_stds: float = setting(
        2.0,
        "Margin of χ² of the campaign over its expectation that counts as chance, where the misfit is treated as "
        "noise.",
        "convention",
        unit="std",
    )
    scatter_stds: float = setting(
        2.0,
        "Margin of χ² of the campaign over its expectation that counts as chance, for the scatter of the runs.",
        "convention",
        unit="std",
    )
    move_stds: float = setting(
        2.0, "Maximum chance difference between the two halves of the data.", "convention", unit="std"
    )
    least_half: float = setting(
        0.1, "Minimum share of the information on a coefficient in each half of the data.", "judgement"
    )
    small_form_std: float = setting(
        0.5,
        "Standard deviation of a small cause's change of a coefficient, as a share of the change, since its form "
        "is unknown.",
        "judgement",
        "Chosen after a blind test with too narrow intervals; tested on campaigns drawn afterwards.",
        decision="0028",
    )
    freed_form_std: float = setting(
        0.5,
        "Standard deviation for freed forms, as a share of the change by freeing them.",
        "judgement",
        "Another family of forms may change a coefficient by this much.",
        decision="0028",
    )
    unknown_std: float = setting(
        0.5,
        "Standard deviation for an unknown cause, as a share of the change by the answer.",
        "judgement",
        decision="0028",
    )
    separated_by: float = setting(
        3.0,
        "Minimum difference between two answers for a run to distinguish them.",
        "convention",
        "Odds of about 100:1.",
        unit="std",
    )
    hidden_stds: float = setting(
        2.0,
        "Distance of the upper limit of an undetected effect from its most probable size.",
        "convention",
        unit="std",
    )
    hidden_absorbed: float = setting(
        0.0001,
        "Unabsorbed share of a change below which the runs do not show the effect.",
        "judgement",
        "The accuracy of linear theory.",
    )
    remains_rate: float = setting(
        0.001,
        "False-alarm rate of the test for a residual gap, and for a further effect.",
        "convention",
        ONE_IN_1000,
    )
    material_share: float = setting(
        0.01,
        "Minimum relative change of a coefficient for the residual gap to be material.",
        "convention",
        "Derivatives are quoted to one per cent.",
    )
    undetermined_from: float = setting(
        10.0,
        "Ratio of the standard deviation to the value and the typical size of a parameter above which it is not "
        "determined.",
        "judgement",
        "Even its order of magnitude is then unknown.",
    )
    trades_off_from: float = setting(
        TRADE_OFF_CORRELATION,
        "Minimum absolute correlation of two parameters to be reported as poorly separable.",
        "convention",
        "The variance of each is ten times larger than with the other known: they are collinear.",
    )
    patched_misses: float = setting(
        0.02,
        "Maximum error of a polynomial in the patched model, as a share of the largest moment.",
        "judgement",
    )
    integrator_tolerance: float = setting(
        0.1,
        "Maximum difference between MuJoCo and the integrator of the fits.",
        "judgement",
        unit="std of a block mean",
    )
