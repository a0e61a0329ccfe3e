"""Whether an answer is decided, by probability and by prediction, and the common part of the likely answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from diagnosis.findings.terms import CHANNELS, among_answers, without_scatter
from diagnosis.settings import AnswerSettings
from identification.show.numbers import alternatives, listed, plain, probability, share, significant
from tunnel_sim.effects import BetweenRuns, known_effects
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.files.writing import as_json

PREDICTED_FROM: Final = 0.1
"""Minimum share of the gap on held-out readings that a decided answer must explain. Judgement. An answer that
predicts less is fitted to chance."""
LEFT_OF_SWING: Final = 0.1
"""Maximum root mean square residual of a decided answer, as a share of the readings' root mean square about
their mean.
Judgement. A model that misses a tenth of the motion lacks a part of it."""
CANCELS_FROM: Final = 2.0
"""Minimum root mean square misfit with a part of the causes, over the gap's, for the causes to cancel each other.
Estimated. It is 1.0 at most in 58 answers of several causes in simulated campaigns, most of them right, and 21 and
47 in two false answers for a stiffness that relaxes within each run. They are not an independent test."""
SIZE_DIFFERS: Final = 0.15
"""Minimum standard deviation of a cause's size between the runs, beyond its errors and as a share of the size, for
its law not to be common to the runs. Estimated. In decided answers to simulated campaigns it is 0.05 at most where
the causes are right, and 0.3 to 0.5 in five of eleven false answers without the true cause; dry friction of a
measured pendulum differs by 0.25. They are not an independent test."""
SIZE_ODDS: Final = 10.0
"""Minimum odds of an answer with such a cause against an unknown cause for it to be decided. Judgement. A law that
is not common to the runs is some ten times as frequent in false answers as in right ones."""
STILL_AIR_LEAVES: Final = 0.02
"""Maximum share of the gap in still air that the steady causes beside a random moment leave in these runs
alone, for a decided answer. Estimated. It is 0.003 at most for seven right sets of steady causes in simulated
campaigns, and 0.05 in a false answer. They are not an independent test."""
WIDE_SCATTER: Final = 2.0
"""Maximum lower end of the interval of a scatter between runs, over its stated or usual width, for a decided
answer. Estimated. In decided answers to simulated campaigns it is 1.8 at most where the causes are right; of ten
answers beyond 2.0 none is right. They are not an independent test."""
ANSWERS_NAMED: Final = 5
"""Maximum number of likely answers in a sentence. Judgement."""
IN_COMMON: Final = 0.9
"""Minimum probability of an effect or a channel that is common to the likely answers. Convention."""


@dataclass(frozen=True)
class Doubt:
    """A prediction by which a probable answer fails.

    Args:
        kind: a field of `Predictions`, with spaces, such as ``held out``.
        share: the share found, a fraction; None for a doubt about the place.
    """

    kind: str
    share: float | None

    def words(self, *, one: bool) -> str:
        """The reason, as a predicate of the answer.

        Args:
            one: whether the answer is one effect.
        """
        return _REASONS[self.kind.replace(" ", "_")].words(self.share or 0.0, "s" if one else "")


def _little(explained: float, s: str) -> str:
    return f"explain{s} only {share(explained)}" if explained > 0.0 else f"explain{s} nothing"


@dataclass(frozen=True)
class _Reason:
    """A reason not to decide on the best-fitting answer.

    Args:
        fails: whether a prediction fails, from its value and the odds of the answer against an unknown cause.
        words: predicate of the answer, from the value and the ending of the verb.
    """

    fails: Callable[[float, float], bool]
    words: Callable[[float, str], str]


def _explains_too_little(explained: float, _: float) -> bool:
    return explained < PREDICTED_FROM


_REASONS: Mapping[str, _Reason] = {
    "held_out": _Reason(
        _explains_too_little, lambda found, s: f"{_little(found, s)} of the gap on held-out readings"
    ),
    "ahead": _Reason(
        _explains_too_little,
        lambda found, s: (
            f"{_little(found, s)} of the gap in the later half of the runs, fitted to the earlier"
        ),
    ),
    "patched": _Reason(
        _explains_too_little,
        lambda found, s: f"{_little(found, s)} of the gap when written into the model and simulated",
    ),
    "under_load": _Reason(
        lambda *_: True,
        lambda found, s: f"leave{s} {share(found)} of the gap: friction under load may follow another law",
    ),
    "left": _Reason(
        lambda found, _: found > LEFT_OF_SWING,
        lambda found, s: f"leave{s} a residual of {share(found)} of the swing on held-out readings",
    ),
    "part": _Reason(
        lambda found, _: found > CANCELS_FROM,
        lambda found, s: (
            f"explain{s} the gap by cancelling: with a part of the causes the misfit is {significant(found, 2)} "
            "times the gap"
        ),
    ),
    "size": _Reason(
        lambda found, odds: found > SIZE_DIFFERS and odds < SIZE_ODDS,
        lambda found, s: (
            f"{'differs' if s else 'one of them differs'} by {significant(100.0 * found, 2)} % in size between the "
            "runs, beyond its errors"
        ),
    ),
    "still_air": _Reason(
        lambda found, _: found > STILL_AIR_LEAVES,
        lambda found, s: f"leave{s} {share(found)} of the gap in the runs in still air, fitted alone",
    ),
    "pattern": _Reason(
        lambda *_: True,
        lambda found, s: (
            f"leave{s} a difference of {significant(100.0 * found, 2)} % between the runs that follows a condition "
            "of the plan"
        ),
    ),
    "scatter": _Reason(
        lambda found, _: found > WIDE_SCATTER,
        lambda found, s: (
            f"need{s} at least {significant(found, 2)} times the scatter that is stated or usual"
        ),
    ),
    "elsewhere": _Reason(lambda found, _: bool(found), lambda *_: "the residuals point elsewhere"),
}
"""Reasons by the field of `Predictions`, the most basic first."""


@dataclass(frozen=True)
class Predictions:
    """Success of the answer's predictions, beside its probability; None: not known, or nothing to predict.

    Args:
        held_out: share of the gap that it explains on held-out readings.
        ahead: share of the gap in the later half of driven runs that it explains, fitted to the earlier half.
        patched: share of the gap that the user's model explains, with the answer written into it.
        under_load: share of the gap that remains with friction that depends on an actuator's load.
        left: root mean square residual over the readings' root mean square about their mean, a ratio.
        part: largest root mean square misfit with a part of the causes, over the gap's, a ratio.
        size: largest standard deviation of a cause's size between the runs, beyond its errors, over the size.
        still_air: share of the gap that the steady causes beside a random moment leave in still air, fitted alone.
        pattern: largest relative difference between the runs that follows a condition of the plan, a fraction.
        scatter: lower end of the interval of the scatter between runs, over its stated or usual width, a ratio.
        elsewhere: whether the residuals show a place at which no cause of the answer acts.
    """

    held_out: float | None = None
    ahead: float | None = None
    patched: float | None = None
    under_load: float | None = None
    left: float | None = None
    part: float | None = None
    size: float | None = None
    still_air: float | None = None
    pattern: float | None = None
    scatter: float | None = None
    elsewhere: bool = False

    def doubts(self, against_unknown: float = math.inf) -> tuple[Doubt, ...]:
        """The reasons not to decide on the answer, the most basic first.

        Args:
            against_unknown: odds of the answer against an unknown cause.
        """
        known = {name: getattr(self, name) for name in _REASONS}
        return tuple(
            Doubt(name.replace("_", " "), None if value is True else value)
            for name, value in known.items()
            if value is not None and _REASONS[name].fails(value, against_unknown)
        )


@dataclass(frozen=True)
class Decision:
    """The judgement whether an answer is decided, and what the likely answers have in common.

    Args:
        decided: whether the answer is probable enough, and its predictions leave no doubt.
        credible: the fewest answers that together are credible, with their probabilities, most probable first.
        effects: effects common to the likely answers, with their probabilities.
        channels: channels on which all likely answers act, with their probabilities.
        unpredictive: the answer, where it is probable enough but its predictions leave a doubt; else empty.
        doubts: the reasons for the doubt.
    """

    decided: bool
    credible: tuple[tuple[str, float], ...]
    effects: Mapping[str, float]
    channels: Mapping[str, float]
    unpredictive: str = ""
    doubts: tuple[Doubt, ...] = ()

    def in_doubt(self, kind: str) -> bool:
        """Whether a prediction leaves a doubt about the answer.

        Args:
            kind: of the doubt, as in `Doubt`.
        """
        return any(one.kind == kind for one in self.doubts)

    def words(self, runs: str) -> str:
        """Sentences on an undecided diagnosis: the common part of its answers and the alternatives.

        Args:
            runs: that show the gap, in words.
        """
        channels = {kind.name: kind.channel for kind in known_effects()}
        effects = {name: self.effects[name] for name in without_scatter(self.effects)}
        named = {channels[name] for name in effects}
        common_to_all = [f"{plain(name)} ({probability(value)})" for name, value in effects.items()]
        parts = [f"contain {listed(common_to_all)}"] if common_to_all else []
        for name, value in self.channels.items():
            if name not in named:
                parts.append(f"act on {CHANNELS[name]} ({probability(value)})")
        said = f"The likely answers {' and '.join(parts)}. " if parts else ""
        together = probability(sum(value for _, value in self.credible))
        if self.unpredictive:
            best = among_answers(self.unpredictive).capitalize()
            alone = len(without_scatter(self.unpredictive.split(" + "))) <= 1
            doubts = " and ".join(doubt.words(one=alone) for doubt in self.doubts)
            said += f"{best} fit{'s' if alone else ''} best, but {doubts}"
            said += f": look at {runs} there first. " if self.in_doubt("elsewhere") else ". "
        return (
            f"{said}The answer is one of these, with a total probability of {together}: {self._likeliest()}."
        )

    def _likeliest(self) -> str:
        """The likely answers with their probabilities, most probable first."""
        shown = self.credible[:ANSWERS_NAMED]
        answers = [f"{among_answers(effect)} ({probability(value)})" for effect, value in shown]
        if more := len(self.credible) - len(shown):
            answers.append(f"{more} more")
        return alternatives(answers)

    def to_json_dict(self) -> dict[str, Any]:
        """The fields ``decided``, ``unpredictive``, ``doubts``, ``credible`` and ``common`` of a document."""
        return {
            "decided": self.decided,
            "unpredictive": self.unpredictive,
            "doubts": as_json(self.doubts),
            "credible": [{"effect": effect, "probability": value} for effect, value in self.credible],
            "common": {"effects": dict(self.effects), "channels": dict(self.channels)},
        }

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, from a whole document."""
        kept = {name: data[name] for name in ("decided", "unpredictive", "doubts") if name in data}
        likely = [(one["effect"], one["probability"]) for one in data["credible"]]
        return {**kept, "credible": likely, **data["common"]}


def decision(
    answers: Sequence[tuple[str, float]], chosen: AnswerSettings, predictions: Predictions = Predictions()
) -> Decision:
    """Judge the answers by their probabilities, and the first of them by its predictions and its place.

    Args:
        answers: names joined by plus signs, ``none`` or ``unknown``, and probabilities, which sum to 1; the answer
            first.
        predictions: predictions of the first answer; they count where it names effects.
    """
    credible, together = [], 0.0
    for answer in sorted(answers, key=lambda given: -given[1]):
        credible.append(answer)
        together += answer[1]
        if together >= chosen.credible_from:
            break
    channel_of = {kind.name: kind.channel for kind in known_effects()}
    proper = {
        kind.name for kind in known_effects() if not issubclass(kind, BetweenRuns)
    }  # chance differences of the runs may act beside any answer
    causes = [(set(effect.split(" + ")) & channel_of.keys(), value) for effect, value in answers]
    first, probable = answers[0][0], answers[0][1] >= chosen.decided_from
    names_effects = first not in ("none", "unknown")
    unknown = dict(answers).get("unknown", 0.0)
    odds = answers[0][1] / unknown if unknown else math.inf
    doubts = predictions.doubts(odds) if probable and names_effects else ()
    return Decision(
        decided=probable and not doubts,
        unpredictive=first if doubts else "",
        doubts=doubts,
        credible=tuple(credible),
        effects=_common(causes),
        channels=_common(({channel_of[name] for name in names & proper}, value) for names, value in causes),
    )


def _common(held: Iterable[tuple[set[str], float]]) -> dict[str, float]:
    """Elements common to answers with a total probability of `IN_COMMON`, with it, most probable first."""
    found: dict[str, float] = {}
    for names, value in held:
        for name in sorted(names):
            found[name] = min(found.get(name, 0.0) + value, 1.0)
    ranked = sorted(found.items(), key=lambda item: -item[1])
    return {name: value for name, value in ranked if value >= IN_COMMON}
