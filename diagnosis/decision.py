"""Whether one answer is decided, and what the likely answers have in common where none is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from diagnosis.policy import CREDIBLE, DECIDED_FROM
from tunnel_sim.effects import known_effects


def plain(*names: str) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    *first, last = (name.replace("_", " ") for name in names)
    return f"{', '.join(first)} and {last}" if first else last


Answers = Sequence[tuple[str, float]]
_SHOWN = 5  # answers in words; the document lists all


@dataclass(frozen=True)
class Decision:
    """What the probabilities of the answers allow to be said.

    Args:
        decided: whether the answer has at least one half of the probability.
        credible: the fewest answers that together have nine tenths, with their probabilities, most probable first.
        effects: effects that nine tenths of the probability have among the causes, with their probabilities.
        channels: channels on which nine tenths of the probability act, likewise.
    """

    decided: bool
    credible: tuple[tuple[str, float], ...]
    effects: Mapping[str, float]
    channels: Mapping[str, float]

    def to_json_dict(self) -> dict[str, Any]:
        """The fields ``decided``, ``credible`` and ``common`` of a document."""
        return {
            "decided": self.decided,
            "credible": [{"effect": effect, "probability": value} for effect, value in self.credible],
            "common": {"effects": dict(self.effects), "channels": dict(self.channels)},
        }


def decision(answers: Answers) -> Decision:
    """Judge the answers by their probabilities.

    Args:
        answers: names joined by plus signs, ``none`` or ``unknown``, and probabilities, which sum to 1; the answer
            first.
    """
    credible, together = [], 0.0
    for answer in sorted(answers, key=lambda given: -given[1]):
        credible.append(answer)
        together += answer[1]
        if together >= CREDIBLE:
            break
    channel_of = {kind.name: kind.channel for kind in known_effects()}
    causes = [(set(effect.split(" + ")) & channel_of.keys(), value) for effect, value in answers]
    return Decision(
        decided=answers[0][1] >= DECIDED_FROM,
        credible=tuple(credible),
        effects=_common(causes),
        channels=_common([({channel_of[name] for name in names}, value) for names, value in causes]),
    )


def _common(held: Iterable[tuple[set[str], float]]) -> dict[str, float]:
    """What answers of nine tenths of the probability hold, with that probability, the most probable first."""
    found: dict[str, float] = {}
    for names, value in held:
        for name in sorted(names):
            found[name] = min(found.get(name, 0.0) + value, 1.0)
    ranked = sorted(found.items(), key=lambda item: -item[1])
    return {name: value for name, value in ranked if value >= CREDIBLE}


def probability(value: float) -> str:
    """A probability to two decimals, never rounded to 0 or 1.

    Args:
        value: probability.

    Returns:
        Text such as ``0.97`` or ``> 0.99``.
    """
    if value >= 0.995:
        return "> 0.99"
    return f"{value:.2f}" if value >= 0.005 else "< 0.01"


def undecided_words(found: Decision) -> str:
    """What an undecided diagnosis does say, in sentences."""
    answers = [f"{_words(effect)} ({probability(value)})" for effect, value in found.credible[:_SHOWN]]
    if len(found.credible) > _SHOWN:
        answers.append(f"{len(found.credible) - _SHOWN} more")
    most = answers[0] if len(answers) == 1 else f"{', '.join(answers[:-1])} or {answers[-1]}"
    together = probability(sum(value for _, value in found.credible))
    return f"{_common_words(found)} The answer is one of these, with probability {together} together: {most}."


def _common_words(found: Decision) -> str:
    channels = {kind.name: kind.channel for kind in known_effects()}
    named = {channels[name] for name in found.effects}
    parts = [f"contain {plain(name)} ({probability(value)})" for name, value in found.effects.items()]
    parts += [
        f"act on the {name} ({probability(value)})"
        for name, value in found.channels.items()
        if name not in named
    ]
    if not parts:
        return "The likely answers have no effect and no channel in common."
    return f"The likely answers {' and '.join(parts)}."


def _words(effect: str) -> str:
    """An answer as words."""
    return "no effect of the vocabulary" if effect == "unknown" else plain(*effect.split(" + "))
