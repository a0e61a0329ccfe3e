"""Whether an answer is decided, and the common part of the likely answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from diagnosis.settings import AnswerSettings
from tunnel_sim.effects import known_effects


@dataclass(frozen=True)
class Decision:
    """The decision that the probabilities of the answers allow.

    Args:
        decided: whether the answer is probable enough, and predicts held-out readings.
        credible: the fewest answers that together are credible, with their probabilities, most probable first.
        effects: effects common to the likely answers, with their probabilities.
        channels: channels on which all likely answers act, with their probabilities.
        unpredictive: the answer, where it is probable enough but does not predict them; else empty.
        elsewhere: the answer, where it is probable enough but the residuals show another place; else empty.
    """

    decided: bool
    credible: tuple[tuple[str, float], ...]
    effects: Mapping[str, float]
    channels: Mapping[str, float]
    unpredictive: str = ""
    elsewhere: str = ""

    def to_json_dict(self) -> dict[str, Any]:
        """The fields ``decided``, ``unpredictive``, ``elsewhere``, ``credible`` and ``common`` of a document."""
        return {
            "decided": self.decided,
            "unpredictive": self.unpredictive,
            "elsewhere": self.elsewhere,
            "credible": [{"effect": effect, "probability": value} for effect, value in self.credible],
            "common": {"effects": dict(self.effects), "channels": dict(self.channels)},
        }


def decision(
    answers: Sequence[tuple[str, float]],
    chosen: AnswerSettings,
    closed: float | None = None,
    *,
    elsewhere: bool = False,
) -> Decision:
    """Judge the answers by their probabilities, and the first of them by its predictions and its place.

    Args:
        answers: names joined by plus signs, ``none`` or ``unknown``, and probabilities, which sum to 1; the answer
            first.
        closed: share of the gap that the answer explains on held-out readings; None: not known.
        elsewhere: whether the residuals show a place at which none of its causes acts.
    """
    credible, together = [], 0.0
    for answer in sorted(answers, key=lambda given: -given[1]):
        credible.append(answer)
        together += answer[1]
        if together >= chosen.credible_from:
            break
    channel_of = {kind.name: kind.channel for kind in known_effects()}
    proper = {
        kind.name for kind in known_effects() if not kind.scatters
    }  # runs differ by chance beside any of them
    causes = [(set(effect.split(" + ")) & channel_of.keys(), value) for effect, value in answers]
    first, probable = answers[0][0], answers[0][1] >= chosen.decided_from
    names_effects = first not in ("none", "unknown")
    predicts = not names_effects or closed is None or closed >= chosen.predicted_from
    return Decision(
        decided=probable and predicts and not (names_effects and elsewhere),
        unpredictive=first if probable and not predicts else "",
        elsewhere=first if probable and names_effects and elsewhere else "",
        credible=tuple(credible),
        effects=_common(causes, chosen.in_common),
        channels=_common(
            [({channel_of[name] for name in names & proper}, value) for names, value in causes],
            chosen.in_common,
        ),
    )


def _common(held: Iterable[tuple[set[str], float]], least: float) -> dict[str, float]:
    """Elements common to answers of ``least`` of the probability, with that probability, most probable first."""
    found: dict[str, float] = {}
    for names, value in held:
        for name in sorted(names):
            found[name] = min(found.get(name, 0.0) + value, 1.0)
    ranked = sorted(found.items(), key=lambda item: -item[1])
    return {name: value for name, value in ranked if value >= least}
