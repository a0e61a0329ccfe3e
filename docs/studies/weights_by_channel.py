"""Would sets of effects be weighed better by what they leave in each channel? On campaigns whose truth is open.

The weights of decision 0007 compare sets by the share of the whole gap that they leave. An error of the frequency,
whose χ² is large because phases add up, may then hide a cause in the damping. The rival law gives the error of the
model a scale of its own in every channel (`docs.studies.channels`):

    weight = 1/φ Π_c (1 + χ²_c/φ)^−γ

Both laws weigh the same fits: those that the diagnosis grows. Each campaign is also weighed with every true effect
withheld in turn, by deleting the sets that hold it; the answer should then be ``unknown`` or undecided.

    python -m docs.studies.weights_by_channel SET [--count N]

SET is made by ``tunnel blind make``; its key is opened, so that it is no blind test any more.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagnosis import investigate as investigation
from diagnosis import vocabulary
from diagnosis.attribution.decide import UNKNOWN, form_floor, weigh
from diagnosis.detection.comparable import comparable_runs
from diagnosis.detection.limit_cycles import diagnosable
from diagnosis.fitting.least_squares import Fit
from diagnosis.policy import (
    CHANCE_STDS,
    DECIDED_FROM,
    EVEN_SHARE,
    FORM_SHARE,
    NEEDLESS_CHI2,
    PAIR_SHARE,
    STEEPNESS,
)
from diagnosis.study import Study
from docs.studies.channels import Misfit, misfit
from tunnel_sim.files.campaign_io import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

UNKNOWN_LEFT, UNKNOWN_STEEPNESS = 0.04, 1.5
"""What an unknown cause leaves in every channel, a share, and the exponent beside it: tuned on 96 campaigns."""

Names = tuple[str, ...]
Answers = list[tuple[Names, float]]


@dataclass(frozen=True, eq=False)
class Fitted:
    """A set of effects, fitted.

    Args:
        names: of the effects, sorted.
        share: of the gap that it leaves, a fraction.
        chi2: that it leaves by channel beyond the noise, shape (6,).
        numbers: freed forms, less a spring that gravity replaces.
    """

    names: Names
    share: float
    chi2: Array
    numbers: int


@dataclass(frozen=True, eq=False)
class Case:
    """A campaign with its truth.

    Args:
        truth: names of the true effects, sorted.
        small: of those that need not be named.
        gap: excess of the nominal model's block means.
        count: number of block means.
        nominal: what the nominal model leaves, by channel.
        sets: fitted.
    """

    truth: Names
    small: frozenset[str]
    gap: float
    count: int
    nominal: Misfit
    sets: tuple[Fitted, ...]

    def right(self, names: Names) -> bool:
        """Whether a set is the true one, but for small effects."""
        return set(names) - self.small == set(self.truth)


def read_case(folder: Path, truth: Sequence[str], small: Sequence[str]) -> Case | None:
    """Fit the sets of a campaign as the diagnosis does.

    Returns:
        The case; None where there is no gap, or part of it is read off the records or random.
    """
    campaign = comparable_runs(diagnosable(read_campaign(folder)).campaign)[0]
    seen: list[tuple[Study, Fit]] = []
    weighed = investigation._weighed  # noqa: SLF001 - the fits that it is given last are those of the answer
    try:
        investigation._weighed = lambda found, base: seen.append((found, base)) or weighed(found, base)  # type: ignore[func-returns-value]  # noqa: SLF001
        investigation.investigate(campaign, vocabulary())
    finally:
        investigation._weighed = weighed  # noqa: SLF001
    if not seen or seen[-1][0].read_off or seen[-1][0].random:
        return None
    found, base = seen[-1]
    sets = [
        Fitted(h.names, h.share_left(base), misfit(h.fit).excess, h.further_numbers) for h in found.hypotheses
    ]
    return Case(tuple(sorted(truth)), frozenset(small), base.gap, base.count, misfit(base), tuple(sets))


def by_share(case: Case, withheld: str | None = None) -> Answers:
    """The answers by the law of decision 0007, most probable first."""
    kept = [one for one in case.sets if withheld not in one.names]
    found = weigh(
        [(one.names, one.share) for one in kept],
        chance=float(np.sqrt(2.0 / case.count)) / case.gap,
        excess=case.gap,
        numbers={one.names: one.numbers for one in kept},
    )
    return [(one.effects, one.probability) for one in found]


def by_channel(case: Case, withheld: str | None = None) -> Answers:
    """The answers by what is left in each channel, most probable first."""
    kept = [one for one in case.sets if withheld not in one.names]
    if not kept:
        return [(UNKNOWN, 1.0)]
    whole, chance = case.gap * case.count, CHANCE_STDS * np.sqrt(2.0 * case.nominal.count)
    least = np.min([np.zeros(chance.size), *(one.chi2 for one in kept)], axis=0)
    logs, against = [], []
    for one in kept:
        form, size = form_floor(case.gap, one.names), len(one.names) - 1
        floor = form * whole + NEEDLESS_CHI2
        prior = STEEPNESS * (size * np.log(PAIR_SHARE) + one.numbers * np.log(FORM_SHARE))
        left = np.log1p(np.maximum(one.chi2 - least, 0.0) / floor)
        logs.append(-STEEPNESS * float(left.sum()) - np.log(floor) + prior)
        unknown = _log_left(UNKNOWN_LEFT * case.nominal.excess, form_floor(case.gap) * whole + chance)
        known = _log_left(one.chi2, form * whole + chance)
        against.append(known - unknown + STEEPNESS * one.numbers * np.log(FORM_SHARE))
    weights = np.exp(np.array(logs) - max(logs))
    odds = float(np.exp(np.clip(max(against), -600.0, 600.0)))
    even = EVEN_SHARE / (len(kept) + 1)
    known_by = (1.0 - EVEN_SHARE) * odds / (1.0 + odds) * weights / weights.sum() + even
    found = [(one.names, float(p)) for one, p in zip(kept, known_by, strict=True)]
    found.append((UNKNOWN, (1.0 - EVEN_SHARE) / (1.0 + odds) + even))
    return sorted(found, key=lambda answer: -answer[1])


def _log_left(chi2: Array, floor: Array) -> float:
    return float(-UNKNOWN_STEEPNESS * np.sum(np.log1p(np.maximum(chi2, 0.0) / floor)))


LAWS = {"by share": by_share, "by channel": by_channel}


def table(cases: Sequence[Case]) -> Iterator[str]:
    """The two laws side by side.

    Yields:
        Lines: exact answers, mean logarithm of the probability of the truth, named causes that are false, and wrong
        sets stated where a true effect is withheld.
    """
    for name, law in LAWS.items():
        exact = named = false = stated = trials = 0
        logs = []
        for case in cases:
            found = law(case)
            exact += case.right(found[0][0])
            logs.append(np.log(max((p for names, p in found if case.right(names)), default=1e-4)))
            if found[0][0] != UNKNOWN:
                named += len(found[0][0])
                false += len(set(found[0][0]) - set(case.truth) - case.small)
            for effect in case.truth if case.truth != UNKNOWN else ():
                top, probability = law(case, effect)[0]
                trials += 1
                stated += top != UNKNOWN and probability >= DECIDED_FROM
        yield (
            f"{name:<11} exact {exact}/{len(cases)}, log score {np.mean(logs):.2f}, false {false}/{named}, "
            f"wrong set stated without a true effect {stated}/{trials}"
        )


def main() -> None:
    """Weigh the campaigns of an opened set by both laws."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    reader.add_argument("set", type=Path, help="folder made by tunnel blind make")
    reader.add_argument("--count", type=int, default=100, help="campaigns, from the first")
    given = reader.parse_args()
    truths = json.loads((given.set / "key.json").read_text("utf-8"))["truths"]
    cases = []
    for folder in sorted(path.parent for path in given.set.glob("*/campaign.toml"))[: given.count]:
        truth = truths[folder.name]
        try:
            case = read_case(folder, truth["effects"], truth.get("small", ()))
        except TunnelError as error:
            print(f"{folder.name}: {error}")
            continue
        if case is not None:
            cases.append(case)
    print(*table(cases), sep="\n")


if __name__ == "__main__":
    main()
