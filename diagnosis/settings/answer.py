"""Settings of the answer: the place of the gap, the decision, and the uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting
from identification.policy import TRADE_OFF_CORRELATION


@dataclass(frozen=True)
class WhereSettings:
    """The place of the gap."""

    run_rate: float = setting(
        0.01, "Rate at which a run is falsely said to show the gap, all runs together.", "convention"
    )
    still_rate: float = setting(
        0.01, "Rate at which wind-off runs without a gap are said to show it.", "convention"
    )
    band_rate: float = setting(
        0.01, "Rate at which a band is falsely said to show the gap, all bands together.", "convention"
    )
    line_rate: float = setting(
        0.01, "Rate at which a line in a run is chance, all runs and frequencies together.", "convention"
    )
    line_contrast: float = setting(
        8.0,
        "Power of a line in a run over the median around it.",
        "judgement",
        "The skirt of a resonance has less.",
    )
    run_noise_std: float = setting(
        0.015,
        "Standard deviation of the noise between runs.",
        "judgement",
        "Quantisation colours the noise.",
    )
    named_run: float = setting(
        0.1, "Share of the largest excess from which a further run is named.", "judgement"
    )
    one_run: float = setting(
        0.8,
        "Share of the excess in one run from which the runs do not tell whether the gap needs wind.",
        "judgement",
    )
    one_run_of: int = setting(
        3, "Fewest runs for which one may have most of the excess.", "judgement", unit="runs"
    )
    interval_share: float = setting(0.8, "Share of the excess in a stated interval.", "judgement")
    blow_share: float = setting(
        0.5, "Share of the missing moment's energy within the time of a blow.", "convention", "Most of it."
    )
    blow_stds: float = setting(
        5.0,
        "Distance from the noise beyond which the missing moment is significant.",
        "convention",
        unit="std",
    )
    blow_length: float = setting(0.1, "Greatest duration of a blow, as a share of a record.", "judgement")
    blow_after: float = setting(
        0.05, "Share of a record at its start that belongs to the release.", "judgement"
    )
    fastest_moment: float = setting(
        30.0,
        "Highest frequency of a moment; a faster line is an error of the sensor.",
        "physics",
        "The rig's inertia keeps the response to faster moments below any noise.",
        unit="Hz of the similar rig",
    )
    line_share: float = setting(
        0.25, "Share of a run's excess from which its lines are the place of the gap.", "judgement"
    )
    line_one_in: int = setting(3, "One run in this many must have such a line.", "judgement", unit="runs")
    fast_share: float = setting(
        0.5,
        "Share of the excess above the motion from which the gap is in the sensor.",
        "convention",
        "Most of it.",
    )
    slow_share: float = setting(
        0.5,
        "Share of the excess below the motion from which the gap is a shift of the centre.",
        "convention",
        "Most of it.",
    )
    shifted_centre: float = setting(
        0.05, "Share of the excess in the second harmonic that shows a shifted centre.", "judgement"
    )
    harmonic_share: float = setting(
        0.5, "Share of the excess in harmonics from which they are its place.", "convention", "Most of it."
    )
    alone_leaves: float = setting(
        0.2,
        "Residual share of the excess in fits to single runs up to which every run is linear.",
        "judgement",
    )
    drift_ratio: float = setting(
        1.5, "Ratio of the drifts of frequency and damping from which the larger is the place.", "judgement"
    )
    run_departs: float = setting(
        1.5, "Mean squared residual of a run over the noise from which the model misfits it.", "judgement"
    )


@dataclass(frozen=True)
class AnswerSettings:
    """The decision, and the uncertainties."""

    decided_from: float = setting(
        0.5,
        "Probability from which the answer is decided.",
        "convention",
        "More probable than all others together.",
    )
    predicted_from: float = setting(
        0.1,
        "Share of the gap on held-out readings that a decided answer must explain.",
        "judgement",
        "An answer that predicts less is fitted to chance.",
    )
    credible_from: float = setting(
        0.9, "Probability of the smallest set of answers that is stated.", "convention"
    )
    in_common: float = setting(
        0.9, "Probability from which an effect or a channel is common to the likely answers.", "convention"
    )
    rivals_from: float = setting(
        0.05, "Probability from which a rival answer is stated, and a run against it planned.", "tuned"
    )
    coefficient_interval: float = setting(0.95, "Probability of a coefficient's interval.", "convention")
    skewed_from: float = setting(
        0.1,
        "Departure of its ends from those of a normal distribution from which the interval is stated.",
        "judgement",
        unit="std",
    )
    interval_from: float = setting(
        2.0,
        "Length from which that interval is stated; below it, value ± 1.96 std is the interval.",
        "convention",
        "As long as value ± one standard deviation. A shorter one excludes rare rivals, which cause most "
        "of the variance.",
        unit="std",
    )
    small_causes: int = setting(
        3,
        "Unnamed small causes considered at once.",
        "judgement",
        "Time against coverage.",
        unit="effects",
        decision="0028",
    )
    small_causes_tried: int = setting(
        8,
        "Effects in the sets of small causes: those that lower χ² most by themselves.",
        "judgement",
        "Time against coverage.",
        unit="effects",
        decision="0028",
    )
    small_causes_from: float = setting(
        0.05, "Probability of an answer from which small causes are considered beside it.", "judgement"
    )
    small_cause_price: float = setting(
        20.0, "Price of every small cause in χ².", "judgement", BY_CHANCE, unit="χ²", decision="0028"
    )
    misfit_degrees: float = setting(
        6.0,
        "Effective degrees of freedom of a real model's error.",
        "judgement",
        "One for every channel of the residuals.",
        unit="degrees of freedom",
        decision="0028",
    )
    dispersion_stds: float = setting(
        2.0,
        "Excess of the χ² of the campaign over its count that is chance, where the misfit is taken as noise.",
        "convention",
        unit="std",
    )
    scatter_stds: float = setting(
        2.0,
        "Excess of the χ² of the campaign over its count that is chance, for the scatter of the runs.",
        "convention",
        unit="std",
    )
    move_stds: float = setting(
        2.0, "Difference between two halves of the data that is chance.", "convention", unit="std"
    )
    least_half: float = setting(
        0.1, "Least share of the information on a coefficient in one half of the data.", "judgement"
    )
    small_form_std: float = setting(
        0.5,
        "Standard deviation of a small cause's move of a coefficient, as a share of the move, since its "
        "form is unknown.",
        "judgement",
        "Chosen after a blind test showed intervals too narrow; tested on campaigns drawn afterwards.",
        decision="0028",
    )
    freed_form_std: float = setting(
        0.5,
        "Standard deviation for freed forms, as a share of the change by freeing them.",
        "judgement",
        "Another family of forms may change a coefficient as much.",
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
        "Separation from which a run distinguishes two answers.",
        "convention",
        "Odds of about 100:1.",
        unit="std",
    )
    hidden_stds: float = setting(
        2.0,
        "Distance of the largest size of an effect that could hide from its likeliest size.",
        "convention",
        unit="std",
    )
    hidden_absorbed: float = setting(
        0.0001,
        "Unabsorbed share of a change below which the runs do not show it.",
        "judgement",
        "The accuracy of linear theory.",
    )
    remains_rate: float = setting(
        0.001,
        "Rate at which noise is called a remainder, and chance a further effect.",
        "convention",
        ONE_IN_1000,
    )
    material_share: float = setting(
        0.01,
        "Change of a coefficient from which the remainder is material.",
        "convention",
        "Derivatives are quoted to a per cent.",
    )
    undetermined_from: float = setting(
        10.0,
        "Standard deviation over a parameter's value and usual size from which it is not determined.",
        "judgement",
        "Even its order of magnitude is then unknown.",
    )
    trades_off_from: float = setting(
        TRADE_OFF_CORRELATION,
        "Absolute correlation of two parameters from which they are said to trade off.",
        "convention",
        "The variance of each is ten times that with the other known: collinear, in terms of regression.",
    )
    patched_misses: float = setting(
        0.02,
        "Greatest error of a polynomial in the patched model, as a share of a moment's greatest value.",
        "judgement",
    )
    integrator_tolerance: float = setting(
        0.1,
        "Greatest difference between MuJoCo and the fits' integrator.",
        "judgement",
        unit="std of a block mean",
    )
