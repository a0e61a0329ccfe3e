"""Settings of the answer: the place of the gap, the decision, and the uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting


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
    interval_share: float = setting(0.8, "Share of the excess in a stated interval.", "judgement")


@dataclass(frozen=True)
class AnswerSettings:
    """Decision and uncertainties."""

    decided_from: float = setting(
        0.5,
        "Minimum probability of a decided answer.",
        "convention",
        "More probable than all others together.",
    )
    credible_from: float = setting(
        0.9, "Total probability of the stated set of likely answers.", "convention"
    )
    rivals_from: float = setting(
        0.05, "Minimum probability of a rival answer to be stated and to plan a run for.", "tuned"
    )
    coefficient_interval: float = setting(0.95, "Probability of the interval of a coefficient.", "convention")
    small_cause_price: float = setting(
        20.0, "Cost of every small cause, in χ².", "judgement", BY_CHANCE, unit="χ²", decision="0028"
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
    remains_rate: float = setting(
        0.001,
        "False-alarm rate of the test for a residual gap, and for a further effect.",
        "convention",
        ONE_IN_1000,
    )
