"""Settings of the words: the explainable residual, and the facts worth a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class RemainderSettings:
    """Explainable part of the residual."""

    known_to: float = setting(
        0.5,
        "Maximum standard deviation of a law's explained share for the share to be determined.",
        "judgement",
    )
    closes_at_most: float = setting(
        1.5,
        "Maximum explained share of a law that counts as determined.",
        "judgement",
        "Laws may explain more than all of a small excess.",
    )
    closable_from: float = setting(
        0.1, "Minimum share of the residual explained by some law to be more than noise.", "judgement"
    )
    common_first: float = setting(
        0.8,
        "Share of a law of all runs, relative to laws of single runs, above which it is preferred.",
        "judgement",
    )
    closes_alike: float = setting(
        0.02, "Maximum shortfall of a simpler law for it to be preferred.", "judgement"
    )
    named_alike: float = setting(
        0.02, "Maximum shortfall of a law to be called indistinguishable.", "judgement"
    )
    noise_stds: float = setting(
        2.0,
        "Margin of the upper bound on the explainable share, where the residual is noise.",
        "convention",
        unit="std",
    )
    events_from: float = setting(
        0.1, "Minimum part of a run to be listed as an event, as a share of the largest part.", "judgement"
    )
    event_share: float = setting(0.8, "Share of the energy of an event within the stated times.", "judgement")
    steady_line_rate: float = setting(
        0.01, "False-alarm rate of a steady line, all frequencies combined.", "convention"
    )
    steady_line_contrast: float = setting(
        8.0,
        "Minimum ratio of the power of a steady line to the power nearby.",
        "judgement",
        "The skirt of a resonance has less.",
    )
    steady_line_halves: float = setting(
        0.8, "Minimum share of a line in one half of a run that the other half must predict.", "judgement"
    )
    formula_closes: float = setting(
        0.1, "Minimum share of the residual that a formula must explain on held-out runs.", "judgement"
    )
    term_rate: float = setting(
        0.001,
        "False-alarm rate of a term of a formula, all terms combined.",
        "convention",
        ONE_IN_1000,
    )
    term_gain: float = setting(
        0.02, "Minimum part of the explainable share that a further term must add.", "judgement"
    )
    formula_open: float = setting(
        0.02, "Maximum part of the explainable share that a complete formula may miss.", "judgement"
    )
    wider_open: float = setting(
        0.02,
        "Part of the explainable share missed by a formula of angle or rate above which a formula of both is "
        "tried.",
        "judgement",
    )
    first_start: float = setting(
        0.02,
        "Maximum unexplained share of the excess at which a fitted formula needs no other starting point.",
        "judgement",
    )
    most_terms: int = setting(3, "Maximum number of terms in a formula.", "judgement", unit="terms")
    laws_fitted: int = setting(
        3,
        "Number of laws that are fitted to driven runs, those of greatest predicted drop of χ² first.",
        "judgement",
        "Time against coverage.",
        unit="laws",
    )


@dataclass(frozen=True)
class WordsSettings:
    """Sentences and tables."""

    file_off_stds: float = setting(
        2.0,
        "Maximum deviation of a coefficient, in standard deviations, at which the value in the model's file fits.",
        "convention",
        unit="std",
    )
    file_off_share: float = setting(
        0.01,
        "Maximum deviation of a coefficient, as a share, at which the value in the file fits.",
        "judgement",
    )
    runs_without_caution: int = setting(
        3, "Number of runs below which a caution is given.", "judgement", unit="runs"
    )
    noise_contradicted: float = setting(
        3.0,
        "Error factor of the stated noise above which a caution is given.",
        "judgement",
        "Rounding to one digit can cause half of it.",
    )
    same_release: float = setting(
        1.1,
        "Maximum ratio of the largest to the smallest swing of runs of one release amplitude.",
        "judgement",
        "Releases by hand to one mark scatter by a few per cent.",
    )
    nearly_explains: float = setting(
        0.8, "Minimum share of an unexplained gap that effects must explain to be mentioned.", "judgement"
    )
    nearly_alike: float = setting(0.02, "Maximum shortfall of a rival that explains as much.", "judgement")
    nearly_rival: float = setting(
        0.5,
        "Minimum probability of that rival, relative to the mentioned effects, to be the reason for naming none.",
        "judgement",
    )
    nearly_misfit_stds: float = setting(
        2.0,
        "Margin of χ² of a channel over its expectation above which its misfit is the reason for naming none.",
        "convention",
        unit="std",
    )
    hold_rate: float = setting(
        0.001,
        "Rate at which the correct hold of an input is not mentioned beside a delay of half a sample.",
        "convention",
        ONE_IN_1000,
    )
    rival_explains: float = setting(
        0.8,
        "Minimum share of a gap that an explanation outside the vocabulary must explain to be mentioned.",
        "judgement",
    )
    immaterial: float = setting(
        0.01,
        "Maximum relative change of the coefficients by an immaterial gap.",
        "convention",
        "Derivatives are quoted to one per cent.",
    )
    second_mode_left: float = setting(
        0.5,
        "Maximum ratio of the residual with two free decays to the residual with one, for a second mode to be "
        "named.",
        "judgement",
    )
    second_mode_cycles: float = setting(
        3.0,
        "Minimum number of cycles of a mode within its lifetime and within its record.",
        "judgement",
        "Fewer do not distinguish an oscillation from a drift or an impulse.",
        unit="cycles",
    )
    runs_listed: int = setting(12, "Maximum number of runs in a sentence.", "judgement", unit="runs")
    one_wind: float = setting(
        0.02,
        "Ratio of the powers with and without wind below which nearly all of the gap belongs to one of them.",
        "judgement",
    )
    zeros_close: float = setting(
        0.5,
        "Minimum share of an unexplained gap that a zero per run must explain to be mentioned.",
        "convention",
        "Most of it.",
    )
    zeros_rate: float = setting(
        0.001,
        "False-alarm rate of differences between the zeros of runs.",
        "convention",
        ONE_IN_1000,
    )
    width_known_within: float = setting(
        10.0,
        "Ratio of the ends of the interval of a width above which the width is poorly known.",
        "convention",
        "An order of magnitude.",
    )
    deviation_named: float = setting(
        3.0,
        "Minimum deviation of the frequency or damping of an outlying run to be stated, in the scatter of the "
        "others.",
        "convention",
        unit="std",
    )
    interval_located: float = setting(
        0.8, "Maximum length of an interval, as a share of the range, for it to locate the gap.", "judgement"
    )
    band_listed: float = setting(0.05, "Minimum share of the excess in a band to be listed.", "judgement")
    answers_named: int = setting(
        5, "Maximum number of likely answers in a sentence.", "judgement", unit="answers"
    )
    answers_listed: int = setting(6, "Maximum number of answers in a table.", "judgement", unit="answers")
    answer_listed: float = setting(0.005, "Minimum probability of an answer in a table.", "judgement")
    answer_drawn: float = setting(
        0.01, "Minimum probability of an answer in the charts of the report.", "judgement"
    )
    effect_listed: float = setting(
        0.01, "Minimum probability of an effect in the list of causes.", "judgement"
    )
