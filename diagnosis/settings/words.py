"""Settings of the words: the explainable residual, and the facts worth a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class RemainderSettings:
    """The part of an answer's residual that could be explained."""

    known_to: float = setting(
        0.5,
        "Standard deviation of a law's share from which the share is not determined.",
        "judgement",
    )
    closes_at_most: float = setting(
        1.5,
        "Share of a law from which it is not determined.",
        "judgement",
        "Laws may explain more than all of a small excess.",
    )
    closable_from: float = setting(
        0.1, "Share of the residual explained by some law from which it is more than noise.", "judgement"
    )
    common_first: float = setting(
        0.8,
        "Share of a law of all runs, relative to laws of single runs, from which it is preferred.",
        "judgement",
    )
    closes_alike: float = setting(
        0.02, "Shortfall of a simpler law up to which it is preferred.", "judgement"
    )
    named_alike: float = setting(0.02, "Shortfall of a law up to which it is called as good.", "judgement")
    noise_stds: float = setting(
        2.0, "Bound on the explainable share, where the rest is noise.", "convention", unit="std"
    )
    events_from: float = setting(
        0.1, "Share of the largest run's part from which a run is among the events.", "judgement"
    )
    event_share: float = setting(0.8, "Share of an event's energy within the times stated.", "judgement")
    steady_line_rate: float = setting(
        0.01, "Rate at which a steady line is chance, all frequencies together.", "convention"
    )
    steady_line_contrast: float = setting(
        8.0,
        "Ratio of the power of a steady line to that beside it.",
        "judgement",
        "The skirt of a resonance has less.",
    )
    steady_line_halves: float = setting(
        0.8, "Share of a line in one half of a run that the other half must predict.", "judgement"
    )
    formula_closes: float = setting(
        0.1, "Share of the residual that a formula must explain on held-out runs.", "judgement"
    )
    term_rate: float = setting(
        0.001,
        "Rate at which chance is taken for a term of a formula, all terms together.",
        "convention",
        ONE_IN_1000,
    )
    term_gain: float = setting(
        0.02, "Part of the explainable share that a further term must add.", "judgement"
    )
    formula_open: float = setting(
        0.02, "Part of the explainable share up to which a formula is complete without it.", "judgement"
    )
    wider_open: float = setting(
        0.02,
        "Part of the explainable share missed by a formula of angle or rate from which one of both is tried.",
        "judgement",
    )
    first_start: float = setting(
        0.02,
        "Residual share of the excess up to which a fitted formula needs no other start.",
        "judgement",
    )
    most_terms: int = setting(3, "Greatest number of terms in a formula.", "judgement", unit="terms")


@dataclass(frozen=True)
class WordsSettings:
    """Sentences and tables."""

    file_off_stds: float = setting(
        2.0,
        "Deviation of a coefficient up to which the value in a model's file fits.",
        "convention",
        unit="std",
    )
    file_off_share: float = setting(
        0.01, "The same deviation as a share of the coefficient: a smaller one is not mentioned.", "judgement"
    )
    runs_without_caution: int = setting(
        3, "Number of runs below which a caution is given.", "judgement", unit="runs"
    )
    noise_contradicted: float = setting(
        3.0,
        "Error factor of the stated noise from which a caution is given.",
        "judgement",
        "Rounding to one digit reaches half of it.",
    )
    nearly_explains: float = setting(
        0.8, "Explained share of an unexplained gap from which the effects are mentioned.", "judgement"
    )
    nearly_alike: float = setting(0.02, "Shortfall of a rival up to which it explains as much.", "judgement")
    nearly_rival: float = setting(
        0.5,
        "Probability of that rival relative to theirs from which it is the reason for naming none.",
        "judgement",
    )
    nearly_misfit_stds: float = setting(
        2.0, "χ² of a channel that is chance, where the misfit is the reason.", "convention", unit="std"
    )
    hold_rate: float = setting(
        0.001,
        "Rate at which the right hold of an input is omitted beside a delay of half a sample.",
        "convention",
        ONE_IN_1000,
    )
    rival_explains: float = setting(
        0.8,
        "Share of a gap explained by a rival from outside the vocabulary from which it is mentioned.",
        "judgement",
    )
    immaterial: float = setting(
        0.01,
        "Change of the coefficients up to which a gap is immaterial.",
        "convention",
        "Derivatives are quoted to a per cent.",
    )
    second_mode_left: float = setting(
        0.5,
        "Residual of two free decays relative to that of one up to which a second mode is named.",
        "judgement",
    )
    second_mode_cycles: float = setting(
        0.5,
        "Cycles within its lifetime from which a decaying part is a mode.",
        "judgement",
        "A motion that decays sooner never reverses.",
        unit="cycles",
    )
    runs_listed: int = setting(12, "Greatest number of runs in a sentence.", "judgement", unit="runs")
    one_wind: float = setting(
        0.02, "Ratio of powers below which nearly all of the gap needs one state of the wind.", "judgement"
    )
    zeros_close: float = setting(
        0.5,
        "Share of an unexplained gap explained by a zero per run from which these are mentioned.",
        "convention",
        "Most of it.",
    )
    zeros_rate: float = setting(
        0.001,
        "Rate at which chance differences between the zeros of runs are mentioned.",
        "convention",
        ONE_IN_1000,
    )
    width_known_within: float = setting(
        10.0,
        "Ratio of the ends of a width's interval from which the width is poorly known.",
        "convention",
        "An order of magnitude.",
    )
    deviation_named: float = setting(
        3.0,
        "Deviation from which the frequency or damping of an outlying run is stated, in the scatter of "
        "the others.",
        "convention",
        unit="std",
    )
    interval_located: float = setting(
        0.8, "Share of a range from which an interval is too wide to locate the gap.", "judgement"
    )
    band_listed: float = setting(0.05, "Share of the excess from which a band is listed.", "judgement")
    answers_named: int = setting(
        5, "Greatest number of likely answers in a sentence.", "judgement", unit="answers"
    )
    answers_listed: int = setting(6, "Greatest number of answers in a table.", "judgement", unit="answers")
    answer_listed: float = setting(
        0.005, "Probability from which an answer is listed in a table.", "judgement"
    )
    answer_drawn: float = setting(
        0.01, "Probability from which an answer is drawn in the report.", "judgement"
    )
    effect_listed: float = setting(
        0.01, "Probability from which an effect is listed among the causes.", "judgement"
    )
