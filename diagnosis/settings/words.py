"""Settings of the words: the explainable residual, and the facts worth a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class RemainderSettings:
    """Explainable part of the residual."""

    steady_line_rate: float = setting(
        0.01, "False-alarm rate of a steady line, all frequencies combined.", "convention"
    )
    term_rate: float = setting(
        0.001,
        "False-alarm rate of a term of a formula, all terms combined.",
        "convention",
        ONE_IN_1000,
    )


@dataclass(frozen=True)
class WordsSettings:
    """Sentences and tables."""

    hold_rate: float = setting(
        0.001,
        "Rate at which the correct hold of an input is not mentioned beside a delay of half a sample.",
        "convention",
        ONE_IN_1000,
    )
    zeros_rate: float = setting(
        0.001,
        "False-alarm rate of differences between the zeros of runs.",
        "convention",
        ONE_IN_1000,
    )
