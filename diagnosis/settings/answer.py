"""Settings of the answer: where the gap is, what is decided, and with which uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting
from identification.policy import TRADE_OFF_CORRELATION


@dataclass(frozen=True)
class WhereSettings:
    """Where the gap is."""

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
        "Standard deviation of a single run's noise about that of the campaign.",
        "judgement",
        "Quantisation colours the noise.",
    )
    named_run: float = setting(
        0.1, "Share of the largest excess from which another run is named.", "judgement"
    )
    one_run: float = setting(
        0.8,
        "Share of the excess in one run from which it cannot tell whether the gap needs wind.",
        "judgement",
    )
    one_run_of: int = setting(
        3, "Fewest runs among which one may have most of the excess.", "judgement", unit="runs"
    )
    interval_share: float = setting(0.8, "Share of the excess in a stated interval.", "judgement")
    blow_share: float = setting(
        0.5, "Share of the missing moment's energy in the time of a blow.", "convention", "Most of it."
    )
    blow_stds: float = setting(
        5.0, "Distance beyond which the missing moment stands out of the noise.", "convention", unit="std"
    )
    blow_length: float = setting(0.1, "Greatest share of a record that a blow takes.", "judgement")
    blow_after: float = setting(
        0.05, "Share of a record at its start in which a moment is the release.", "judgement"
    )
    fastest_moment: float = setting(
        30.0,
        "Highest frequency of a moment; a faster line is the sensor's.",
        "physics",
        "The rig's inertia keeps the response to faster ones below any noise.",
        unit="Hz of the similar rig",
    )
    line_share: float = setting(
        0.25, "Share of a run's excess from which a line, with others, is its place.", "judgement"
    )
    line_one_in: int = setting(3, "One run in so many must have such a line.", "judgement", unit="runs")
    fast_share: float = setting(
        0.5,
        "Share of the excess above the motion from which it is the sensor's.",
        "convention",
        "Most of it.",
    )
    slow_share: float = setting(
        0.5,
        "Share of the excess below the motion from which it is a shift of the centre.",
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
        0.2, "Share of the excess that fits to single runs may leave for every run to be linear.", "judgement"
    )
    drift_ratio: float = setting(
        1.5, "Ratio of the drifts of frequency and damping from which one of them is the place.", "judgement"
    )
    run_departs: float = setting(
        1.5, "Mean squared residual of a run over the noise from which its model departs.", "judgement"
    )


@dataclass(frozen=True)
class AnswerSettings:
    """What is decided, and with which uncertainty."""

    decided_from: float = setting(
        0.5,
        "Probability from which the answer is decided.",
        "convention",
        "More probable than all others together.",
    )
    predicted_from: float = setting(
        0.1,
        "Share of the gap on held-out readings that an answer must close to be decided.",
        "judgement",
        "An answer that predicts less has followed the readings that it was fitted to.",
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
        "Length of that interval from which it is stated; below it value ± 1.96 std is the interval.",
        "convention",
        "Value ± one standard deviation is as long. A shorter one leaves out rare rivals, most of the variance.",
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
        "Effects that sets of small causes are made of: those that alone lower χ² most.",
        "judgement",
        "Time against coverage.",
        unit="effects",
        decision="0028",
    )
    small_causes_from: float = setting(
        0.05, "Probability of an answer from which small causes are considered beside it.", "judgement"
    )
    small_cause_price: float = setting(
        20.0, "χ² that every small cause costs.", "judgement", BY_CHANCE, unit="χ²", decision="0028"
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
        "χ² of the campaign beyond its count that is chance where the misfit is taken as noise.",
        "convention",
        unit="std",
    )
    scatter_stds: float = setting(
        2.0,
        "χ² of the campaign beyond its count that is chance where the scatter of the runs is asked.",
        "convention",
        unit="std",
    )
    move_stds: float = setting(
        2.0, "Difference between two halves of the data that is chance.", "convention", unit="std"
    )
    least_half: float = setting(
        0.1, "Least share of the information on a coefficient in a part of the data.", "judgement"
    )
    small_form_std: float = setting(
        0.5,
        "Standard deviation of a small cause's move of a coefficient, as a share of it, since its "
        "form is unknown.",
        "judgement",
        "Made when a blind test showed intervals too narrow, and tested on campaigns drawn afterwards.",
        decision="0028",
    )
    freed_form_std: float = setting(
        0.5,
        "Standard deviation for freed forms, as a share of the change that freeing them makes.",
        "judgement",
        "Another family of forms may change a coefficient as much.",
        decision="0028",
    )
    unknown_std: float = setting(
        0.5,
        "Standard deviation for an unknown cause, as a share of the change that the answer makes.",
        "judgement",
        decision="0028",
    )
    separated_by: float = setting(
        3.0,
        "Separation of two answers by a run from which it distinguishes them.",
        "convention",
        "Odds of about 100:1.",
        unit="std",
    )
    hidden_stds: float = setting(
        2.0, "Largest size of an effect that could hide, from its likeliest size.", "convention", unit="std"
    )
    hidden_absorbed: float = setting(
        0.0001,
        "Share of a change beyond what the fit absorbs that counts as none.",
        "judgement",
        "The accuracy of linear theory.",
    )
    remains_rate: float = setting(
        0.001,
        "Rate at which the noise is said to be something that remains, and chance to be a further effect.",
        "convention",
        ONE_IN_1000,
    )
    material_share: float = setting(
        0.01,
        "Change of a coefficient from which what remains is material.",
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
        "The variance of each is ten times what it would be with the other known: collinear, as regression has it.",
    )
    patched_misses: float = setting(
        0.02,
        "Share of a moment's greatest value that a polynomial in the patched model may miss.",
        "judgement",
    )
    integrator_tolerance: float = setting(
        0.1,
        "Greatest difference between MuJoCo and the fits' integrator.",
        "judgement",
        unit="std of a block mean",
    )
