"""Settings of what is said: what more could be closed, and what is worth a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class RemainderSettings:
    """What could be closed of what an answer leaves."""

    known_to: float = setting(
        0.5,
        "Standard deviation of the share that a law closes, from which it is not determined.",
        "judgement",
    )
    closes_at_most: float = setting(
        1.5,
        "Share that a law closes, from which it is not determined.",
        "judgement",
        "Of a small excess, laws may close more than all.",
    )
    closable_from: float = setting(
        0.1, "Share of what is left that some law must close for it to be more than noise.", "judgement"
    )
    common_first: float = setting(
        0.8, "Share of what laws of single runs close from which a law of all runs is preferred.", "judgement"
    )
    closes_alike: float = setting(
        0.02, "Share by which a simpler law may close less and be preferred.", "judgement"
    )
    named_alike: float = setting(
        0.02, "Share by which a law may close less and be said to be as good.", "judgement"
    )
    noise_stds: float = setting(
        2.0, "Bound on the share that could be closed, where the rest is noise.", "convention", unit="std"
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
        "Power of a steady line over what is beside it.",
        "judgement",
        "The skirt of a resonance has less.",
    )
    steady_line_halves: float = setting(
        0.8, "Share of a line in one half of a run that the other half must predict.", "judgement"
    )
    formula_closes: float = setting(
        0.1, "Share of what is left that a formula must close on held-out runs.", "judgement"
    )
    term_rate: float = setting(
        0.001,
        "Rate at which chance is said to be a term of a formula, all terms together.",
        "convention",
        ONE_IN_1000,
    )
    term_gain: float = setting(
        0.02, "Share of what could be closed that a further term must close.", "judgement"
    )
    formula_open: float = setting(
        0.02, "Share of what could be closed that a formula may leave to be complete.", "judgement"
    )
    wider_open: float = setting(
        0.02,
        "Share of what could be closed that a formula of angle or rate may leave before one of both"
        " is tried.",
        "judgement",
    )
    first_start: float = setting(
        0.02,
        "Share of the excess that a fitted formula may leave for no other start to be tried.",
        "judgement",
    )
    most_terms: int = setting(3, "Terms of a formula at most.", "judgement", unit="terms")


@dataclass(frozen=True)
class WordsSettings:
    """What is said."""

    file_off_stds: float = setting(
        2.0,
        "How far a coefficient may be from the value in a model's file that is said to fit.",
        "convention",
        unit="std",
    )
    file_off_share: float = setting(
        0.01, "The same as a share of the coefficient: less is not worth a sentence.", "judgement"
    )
    runs_without_caution: int = setting(3, "With fewer runs a caution is given.", "judgement", unit="runs")
    noise_contradicted: float = setting(
        3.0,
        "A caution is given where the stated noise is wrong by this factor.",
        "judgement",
        "Rounding to one digit reaches half of it.",
    )
    nearly_explains: float = setting(
        0.8, "Share of an unexplained gap from which effects that close it are mentioned.", "judgement"
    )
    nearly_alike: float = setting(
        0.02, "Share by which a rival may leave more and be said to close as much.", "judgement"
    )
    nearly_rival: float = setting(
        0.5,
        "Probability of that rival over theirs from which it is the reason why none is named.",
        "judgement",
    )
    nearly_misfit_stds: float = setting(
        2.0, "χ² of a channel that is chance where their misfit is the reason.", "convention", unit="std"
    )
    hold_rate: float = setting(
        0.001,
        "Rate at which the right hold of an input is not mentioned beside a delay of half a sample.",
        "convention",
        ONE_IN_1000,
    )
    rival_explains: float = setting(
        0.8,
        "Share of a gap that a rival from outside the vocabulary must close to be mentioned.",
        "judgement",
    )
    immaterial: float = setting(
        0.01,
        "Change of the coefficients up to which a gap is said to be immaterial.",
        "convention",
        "Derivatives are quoted to a per cent.",
    )
    second_mode_left: float = setting(
        0.5,
        "Share of what one free decay leaves that two may leave for a second mode to be named.",
        "judgement",
    )
    second_mode_cycles: float = setting(
        0.5,
        "Cycles in its lifetime from which a decaying part is a mode.",
        "judgement",
        "What dies out sooner never swings to the other side.",
        unit="cycles",
    )
    runs_listed: int = setting(12, "Runs listed in a sentence at most.", "judgement", unit="runs")
    one_wind: float = setting(
        0.02, "Ratio of powers below which nearly all of the gap needs one wind.", "judgement"
    )
    zeros_close: float = setting(
        0.5,
        "Share of an unexplained gap from which zeros of the runs' own that would close it are mentioned.",
        "convention",
        "Most of it.",
    )
    zeros_rate: float = setting(
        0.001,
        "Rate at which zeros of the runs that are apart by chance are mentioned.",
        "convention",
        ONE_IN_1000,
    )
    width_known_within: float = setting(
        10.0,
        "Ratio of the ends of a width's interval from which the width is said to be poorly known.",
        "convention",
        "An order of magnitude.",
    )
    deviation_named: float = setting(
        3.0,
        "Scatter of the other runs from which the frequency or damping of an outlying run is stated.",
        "convention",
        unit="std",
    )
    interval_located: float = setting(
        0.8, "Share of a range from which an interval locates nothing.", "judgement"
    )
    band_listed: float = setting(0.05, "Share of the excess from which a band is listed.", "judgement")
    answers_named: int = setting(
        5, "Likely answers named in a sentence at most.", "judgement", unit="answers"
    )
    answers_listed: int = setting(6, "Answers listed in a table at most.", "judgement", unit="answers")
    answer_listed: float = setting(
        0.005, "Probability from which an answer is listed in a table.", "judgement"
    )
    answer_drawn: float = setting(
        0.01, "Probability from which an answer is drawn in the report.", "judgement"
    )
    answer_described: float = setting(
        0.01, "Probability from which an answer is described in the report.", "judgement"
    )
    effect_listed: float = setting(
        0.01, "Probability from which an effect is listed among the causes.", "judgement"
    )
