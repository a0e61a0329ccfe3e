"""What is lost without a constant of the diagnosis? On campaigns whose truth is open.

Every number that decides is moved by a factor of two either way, or switched off, and campaigns are answered again:

- the constants of the weighing (decision 0007) on the fits that are there: the sets are only weighed again;
- any other constant of `diagnosis.policy` by whole diagnoses, which takes as long as they do.

    python -m docs.studies.ablation SET [--count N] [--rerun NAME ...]

SET is made by ``tunnel blind make``; its key is opened, so that it is no blind test any more. The table says how
many answers are exact, how many causes named are false, the mean logarithm of the probability of the truth, and how
often a wrong set is stated where one true effect is withheld, by deleting the sets that hold it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from diagnosis import diagnose, policy
from diagnosis import investigate as investigation
from diagnosis.attribution import decide
from diagnosis.attribution.decide import UNKNOWN, FittedSet, Weighed
from diagnosis.fitting.channels import Misfit
from diagnosis.policy import DECIDED_FROM
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError

WEIGHING = (
    "STEEPNESS",
    "SET_PRICE",
    "FORM_PRICE",
    "MODEL_ERROR",
    "LEAK",
    "NEEDLESS_CHI2",
    "CHANCE_STDS",
    "UNKNOWN_AT",
    "UNKNOWN_GAP",
    "UNKNOWN_LEFT",
    "UNKNOWN_CLOSED",
    "EVEN_SHARE",
)
"""Constants that only weigh fits."""
FACTORS = (0.0, 0.5, 2.0)
"""By which each is multiplied; 0 switches it off."""

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Case:
    """A campaign with its truth and its fitted sets.

    Args:
        truth: names of the true effects, sorted; ``("unknown",)`` outside the vocabulary.
        small: of those that need not be named.
        read_off: causes read off the records.
        sets: fitted sets; empty where nothing was weighed.
        nominal: what the nominal model leaves; None where nothing was weighed.
        causes: the answer where nothing was weighed.
    """

    truth: Names
    small: frozenset[str]
    read_off: Names = ()
    sets: tuple[FittedSet, ...] = ()
    nominal: Misfit | None = None
    causes: Names = ()

    def right(self, causes: Names) -> bool:
        """Whether an answer is the truth, but for small effects."""
        return set(causes) - self.small == set(self.truth)

    def answers(self, withheld: str | None = None) -> list[tuple[Names, float]]:
        """The answers with their probabilities, the answer first.

        Args:
            withheld: an effect whose sets are deleted.
        """
        if self.nominal is None:
            return [(self.causes, 1.0)]
        found = decide.weigh([s for s in self.sets if withheld not in s.effects], self.nominal)
        return [(self._named(answer), answer.probability) for answer in found]

    def _named(self, answer: Weighed) -> Names:
        return UNKNOWN if answer.effects == UNKNOWN else tuple(sorted({*self.read_off, *answer.effects}))


@dataclass(frozen=True)
class Tally:
    """How campaigns were answered.

    Args:
        exact: campaigns whose causes are exactly right.
        cases: campaigns.
        false: causes named that do not act.
        named: causes named.
        log_score: mean logarithm of the probability of the truth, at least ln 0.001.
        stated: trials without a true effect in which a set is stated with one half or more.
        trials: how many.
    """

    exact: int
    cases: int
    false: int
    named: int
    log_score: float
    stated: int
    trials: int

    def row(self, name: str) -> str:
        """A row of the table."""
        return (
            f"| {name} | {self.exact}/{self.cases} | {self.false}/{self.named} | {self.log_score:.3f} "
            f"| {self.stated}/{self.trials} |"
        )


def tally(cases: Sequence[Case]) -> Tally:
    """Answer all cases and count."""
    exact = false = named = stated = trials = 0
    logs = []
    for case in cases:
        answers = case.answers()
        causes = answers[0][0]
        exact += case.right(causes)
        logs.append(np.log(max(sum(p for names, p in answers if case.right(names)), 1e-3)))
        if causes != UNKNOWN:
            counted = set(causes) - case.small
            named, false = named + len(counted), false + len(counted - set(case.truth))
        if case.nominal is None or case.truth == UNKNOWN:
            continue
        for effect in set(case.truth) - set(case.read_off):
            causes, probability = case.answers(effect)[0]
            trials += 1
            stated += causes != UNKNOWN and probability >= DECIDED_FROM
    return Tally(exact, len(cases), false, named, float(np.mean(logs)), stated, trials)


@contextmanager
def changed(name: str, factor: float) -> Iterator[None]:
    """Multiply a constant of the policy wherever it is used.

    Args:
        name: of the constant.
        factor: dimensionless.
    """
    value = getattr(policy, name)
    users = [
        m for key, m in sys.modules.items() if key.startswith("diagnosis") and getattr(m, name, None) is value
    ]
    try:
        for module in users:
            setattr(module, name, type(value)(value * factor))
        yield
    finally:
        for module in users:
            setattr(module, name, value)


def read_case(folder: Path, truth: Sequence[str], small: Sequence[str]) -> Case:
    """Diagnose a campaign, and keep the sets that are weighed last.

    Args:
        folder: of the campaign.
        truth: names of the effects that act and matter.
        small: names of those that act and need not be found.
    """
    seen: list[tuple[Sequence[FittedSet], Misfit]] = []
    weigh = decide.weigh

    def kept(sets: Sequence[FittedSet], nominal: Misfit) -> list[Weighed]:
        seen.append((sets, nominal))
        return weigh(sets, nominal)

    given = Case(tuple(sorted(truth)), frozenset(small))
    investigation.weigh = kept  # type: ignore[attr-defined]
    try:
        found = diagnose(read_campaign(folder))
    except TunnelError:
        return replace(given, causes=("refused",))
    finally:
        investigation.weigh = weigh  # type: ignore[attr-defined]
    read_off = tuple(set(found.causes) & {"mains_hum", "sensor_quantisation"})
    if not seen or (found.causes == UNKNOWN and found.candidates[0].probability > 0.99):
        return replace(given, causes=tuple(found.causes), read_off=read_off)
    sets, nominal = seen[-1]
    return replace(given, read_off=read_off, sets=tuple(sets), nominal=nominal)


def read_cases(folder: Path, count: int) -> list[Case]:
    """The first campaigns of an opened set.

    Args:
        folder: of the set, with its key.
        count: of campaigns.
    """
    truths = json.loads((folder / "key.json").read_text("utf-8"))["truths"]
    folders = sorted(path.parent for path in folder.glob("*/campaign.toml"))[:count]
    return [read_case(f, truths[f.name]["effects"], truths[f.name]["small"]) for f in folders]


def table(folder: Path, count: int, rerun: Sequence[str]) -> Iterator[str]:
    """The table, line by line.

    Args:
        folder: of the set.
        count: of campaigns.
        rerun: further constants, by whole diagnoses.
    """
    cases = read_cases(folder, count)
    yield "| constant | exact | false | log score | wrong set stated |\n|---|---|---|---|---|"
    yield tally(cases).row("as they are")
    for name in WEIGHING:
        for factor in FACTORS:
            with changed(name, factor):
                yield tally(cases).row(f"`{name}` × {factor:g}")
    for name in rerun:
        for factor in FACTORS[1:]:
            with changed(name, factor):
                yield tally(read_cases(folder, count)).row(f"`{name}` × {factor:g}")


def main() -> None:
    """Print the table."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    reader.add_argument("set", type=Path, help="folder made by tunnel blind make")
    reader.add_argument("--count", type=int, default=100, help="campaigns, from the first")
    reader.add_argument("--rerun", nargs="*", default=(), help="further constants, by whole diagnoses")
    given = reader.parse_args()
    for line in table(given.set, given.count, given.rerun):
        print(line, flush=True)


if __name__ == "__main__":
    main()
