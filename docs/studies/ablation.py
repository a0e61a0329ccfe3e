"""The effect of each setting of the diagnosis when it is changed, on campaigns of known truth.

Every deciding number is doubled, halved or switched off, and the campaigns are answered again:

- the settings of the weighing (decision 0007) on the existing fits: the sets are only reweighed;
- any other setting by repeating whole diagnoses, at their full cost.

    python -m docs.studies.ablation SET [--count N] [--rerun NAME ...] [--odds] [--search]

``--odds`` fits the constants of the odds against ``unknown`` to the same fits: it maximises the probability of the
truth, and of ``unknown`` where a true effect is withheld. For every wrong answer, ``--search`` fits the true set
alone to show whether the search missed it or the answer has more weight.

SET is made by ``tunnel blind make``; its key is opened, so it is no longer a blind test. The table gives the
numbers of exact answers and of false causes, the mean logarithm of the probability of the truth, and the
frequency of wrong sets when one true effect is withheld by deleting the sets that contain it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from diagnosis import Settings, diagnose
from diagnosis.likelihood.residuals import ChannelMisfit
from diagnosis.search import sets as weighed_sets
from diagnosis.search import weigh as decide
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.weights import FittedSet
from diagnosis.settings import WeighingSettings
from tunnel_sim.effects import effect_class
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

WEIGHING = (
    "weighing.steepness",
    "weighing.set_price",
    "weighing.form_price",
    "weighing.model_error",
    "weighing.form_error",
    "weighing.leak",
    "weighing.needless_chi2",
    "weighing.chance_stds",
    "weighing.unknown_at",
    "weighing.unknown_gap",
    "weighing.unknown_left",
    "weighing.least_closed",
    "weighing.unknown_from",
    "weighing.even_share",
)
"""Settings that only weigh fits."""
FACTORS = (0.0, 0.5, 2.0)
"""Factors that multiply each setting; 0 switches it off."""

ODDS = ("weighing.unknown_at", "weighing.unknown_gap", "weighing.unknown_left")
_LEAST = 0.02  # least probability, because a single certain and wrong answer must not decide

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Case:
    """A campaign with its truth and its fitted sets.

    Args:
        truth: names of the true effects, sorted; ``("unknown",)`` outside the vocabulary.
        small: names of the true effects that need not be found.
        read_off: causes detected in the records.
        sets: fitted sets; empty if none were weighed.
        nominal: misfit of the nominal model; None if no sets were weighed.
        causes: the answer if no sets were weighed.
    """

    truth: Names
    small: frozenset[str]
    read_off: Names = ()
    sets: tuple[FittedSet, ...] = ()
    nominal: ChannelMisfit | None = None
    causes: Names = ()

    def right(self, causes: Names) -> bool:
        """Whether an answer equals the truth, except for small effects."""
        return set(causes) - self.small == set(self.truth)

    def answers(
        self, withheld: str | None = None, chosen: WeighingSettings = Settings().weighing
    ) -> list[tuple[Names, float]]:
        """The answers with their probabilities, the answer first.

        Args:
            withheld: an effect; the sets with it are deleted.
            chosen: settings of the weighing.
        """
        if self.nominal is None:
            return [(self.causes, 1.0)]
        found = decide.weigh([s for s in self.sets if withheld not in s.effects], self.nominal, chosen)
        return [
            (UNKNOWN if a.effects == UNKNOWN else tuple(sorted({*self.read_off, *a.effects})), a.probability)
            for a in found
        ]


@dataclass(frozen=True)
class Tally:
    """Counts of the answers.

    Args:
        exact: campaigns with exactly right causes.
        cases: number of campaigns.
        false: number of named causes that do not act.
        named: number of named causes.
        log_score: mean logarithm of the probability of the truth, at least ln 0.001.
        stated: trials with a withheld effect in which a set has a probability of one half or more.
        trials: number of these trials.
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


def tally(cases: Sequence[Case], settings: Settings = Settings()) -> Tally:
    """Answer all cases and count."""
    chosen, decided_from = settings.weighing, settings.answer.decided_from
    exact = false = named = stated = trials = 0
    logs = []
    for case in cases:
        answers = case.answers(chosen=chosen)
        causes = answers[0][0]
        exact += case.right(causes)
        logs.append(np.log(max(sum(p for names, p in answers if case.right(names)), 1e-3)))
        if causes != UNKNOWN:
            counted = set(causes) - case.small
            named, false = named + len(counted), false + len(counted - set(case.truth))
        if case.nominal is None or case.truth == UNKNOWN:
            continue
        for effect in set(case.truth) - set(case.read_off):
            causes, probability = case.answers(effect, chosen)[0]
            trials += 1
            stated += causes != UNKNOWN and probability >= decided_from
    return Tally(exact, len(cases), false, named, float(np.mean(logs)), stated, trials)


def moved(name: str, factor: float) -> Settings:
    """The settings with one of them multiplied.

    Args:
        name: name of the setting, with its stage.
        factor: factor, dimensionless.
    """
    value = Settings().values()[name]
    return Settings().changed({name: type(value)(value * factor)})


@contextmanager
def _weighings(seen: list[tuple[Sequence[FittedSet], ChannelMisfit]]) -> Iterator[None]:
    """Record the sets weighed inside the context."""
    weigh = decide.weigh

    def kept(
        sets: Sequence[FittedSet],
        nominal: ChannelMisfit,
        chosen: WeighingSettings,
        whole: ChannelMisfit | None = None,
    ) -> list[Answer]:
        seen.append((sets, nominal))
        return weigh(sets, nominal, chosen, whole)

    weighed_sets.weigh = kept  # type: ignore[attr-defined]
    try:
        yield
    finally:
        weighed_sets.weigh = weigh  # type: ignore[attr-defined]


def read_case(
    folder: Path,
    truth: Sequence[str],
    small: Sequence[str],
    only: Sequence[str] | None = None,
    settings: Settings = Settings(),
) -> Case:
    """Diagnose a campaign, and keep the last weighed sets.

    Args:
        truth: names of the effects that act and matter.
        small: names of acting effects that need not be found.
        only: names of the effects to try; None: all.
    """
    seen: list[tuple[Sequence[FittedSet], ChannelMisfit]] = []
    given = Case(tuple(sorted(truth)), frozenset(small))
    kinds = None if only is None else [effect_class(name) for name in only]
    try:
        with _weighings(seen):
            found = diagnose(read_campaign(folder), kinds=kinds, settings=settings)
    except TunnelError:
        return replace(given, causes=("refused",))
    read_off = tuple(set(found.causes) & {"mains_hum", "sensor_quantisation"})
    if not seen or (found.causes == UNKNOWN and found.candidates[0].probability > 0.99):
        return replace(given, causes=tuple(found.causes), read_off=read_off)
    sets, nominal = seen[-1]
    return replace(given, read_off=read_off, sets=tuple(sets), nominal=nominal)


def read_cases(folder: Path, count: int, settings: Settings = Settings()) -> list[Case]:
    """The first campaigns of an opened set, with its key."""
    return [
        read_case(folder / name, effects, small, settings=settings)
        for name, effects, small in _truths(folder, count)
    ]


def _truths(folder: Path, count: int) -> list[tuple[str, list[str], list[str]]]:
    """Name, effects and small effects of the first campaigns."""
    truths = json.loads((folder / "key.json").read_text("utf-8"))["truths"]
    names = sorted(path.parent.name for path in folder.glob("*/campaign.toml"))[:count]
    return [(name, truths[name]["effects"], truths[name]["small"]) for name in names]


def fitted_odds(cases: Sequence[Case]) -> dict[str, float]:
    """The settings of the odds against ``unknown`` with the greatest probability of the truth.

    Args:
        cases: cases; their sets are reweighed, with all effects and without each true effect in turn.
    """
    start = [Settings().values()[name] for name in ODDS]

    def log_probability(case: Case, chosen: WeighingSettings) -> float:
        """Log probability of the truth, plus half the log probability of ``unknown`` without each true effect."""
        right = sum(p for names, p in case.answers(chosen=chosen) if case.right(names))
        total = float(np.log(max(right, _LEAST)))
        if case.truth != UNKNOWN:
            for effect in set(case.truth) - set(case.read_off):
                total += 0.5 * float(np.log(max(dict(case.answers(effect, chosen))[UNKNOWN], _LEAST)))
        return total

    def loss(values: Array) -> float:
        chosen = Settings().changed(dict(zip(ODDS, values.tolist(), strict=True))).weighing
        return -sum(log_probability(case, chosen) for case in cases if case.nominal is not None)

    found = minimize(loss, start, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 0.01})
    return dict(zip(ODDS, found.x.tolist(), strict=True))


def misses(folder: Path, count: int) -> Iterator[str]:
    """A line for every wrong answer: whether the search or the weighing missed the truth."""
    for name, effects, small in _truths(folder, count):
        case = read_case(folder / name, effects, small)
        answer = case.answers()[0][0]
        if case.right(answer) or case.truth == UNKNOWN or case.nominal is None or not case.truth:
            continue
        alone = read_case(folder / name, effects, small, only=case.truth)
        both = replace(case, sets=(*case.sets, *alone.sets))
        why = "the search missed it" if both.right(both.answers()[0][0]) else "the answer weighs more"
        yield f"{name}: {' + '.join(case.truth)}; answered {' + '.join(answer) or 'none'}; {why}"


def table(folder: Path, count: int, rerun: Sequence[str]) -> Iterator[str]:
    """The table, line by line; ``rerun`` names further settings, changed by whole diagnoses."""
    cases = read_cases(folder, count)
    yield "| setting | exact | false | log score | wrong set stated |\n|---|---|---|---|---|"
    yield tally(cases).row("as they are")
    for name in WEIGHING:
        for factor in FACTORS:
            yield tally(cases, moved(name, factor)).row(f"`{name}` × {factor:g}")
    for name in rerun:
        for factor in FACTORS[1:]:
            settings = moved(name, factor)
            yield tally(read_cases(folder, count, settings), settings).row(f"`{name}` × {factor:g}")


def main() -> None:
    """Print the table."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    reader.add_argument("set", type=Path, help="folder made by tunnel blind make")
    reader.add_argument("--count", type=int, default=100, help="campaigns, from the first")
    reader.add_argument("--rerun", nargs="*", default=(), help="further settings, by whole diagnoses")
    reader.add_argument("--odds", action="store_true", help="fit the odds against unknown instead")
    reader.add_argument(
        "--search", action="store_true", help="say of wrong answers what missed the truth instead"
    )
    given = reader.parse_args()
    if given.odds:
        print(
            *(f"{n} = {v:.3g}" for n, v in fitted_odds(read_cases(given.set, given.count)).items()), sep="\n"
        )
        return
    if given.search:
        print(*misses(given.set, given.count), sep="\n")
        return
    for line in table(given.set, given.count, given.rerun):
        print(line, flush=True)


if __name__ == "__main__":
    main()
