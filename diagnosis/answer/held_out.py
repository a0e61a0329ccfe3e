"""The gap with each cause added, on held-out runs or stretches of time (decision 0016)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from diagnosis.likelihood.least_squares import Fit, FitError, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.likelihood.partial import fit_seen, refit_releases
from diagnosis.likelihood.residuals import resonance
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.data import FOLDS, folds
from diagnosis.model.parameters import Point
from diagnosis.search.prepared import COARSE_STEP, HUM
from diagnosis.search.process_noise import MomentLayer
from diagnosis.search.scatter import with_scatter, without_deviations
from diagnosis.search.study import Study
from tunnel_sim.effects import Effect
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.caching import cached_while_in_use
from tunnel_sim.vocabulary.record import Array


def share_closed(before: float, after: float) -> float:
    """Explained share of a gap, from 0 to 1.

    Args:
        before: excess of the nominal model, in noise variances of a sample.
        after: excess with the causes, in noise variances of a sample.
    """
    return min(max(1.0 - max(after, 0.0) / before, 0.0), 1.0) if before > 0.0 else 0.0


@dataclass(frozen=True)
class Step:
    """The model with one more cause.

    Args:
        effect: name of the cause added; None for the nominal model.
        excess: excess with this cause and all causes before it, on held-out readings, in noise variances of a
            sample.
    """

    effect: str | None
    excess: float


@dataclass(frozen=True)
class Waterfall:
    """The residual gap as the causes are added one after another.

    Args:
        steps: the nominal model first, then the cause that closes most of the gap, and so on.
        without: held-out excess by cause, with only that cause removed and the others refitted. Beside a random
            moment a cause has none: the random moment would absorb it.
    """

    steps: tuple[Step, ...] = ()
    without: Mapping[str, float] = field(default_factory=dict)
    held_out: str = ""

    @property
    def of_a_part(self) -> float:
        """Largest root mean square misfit with a part of the causes, over the gap's; 0 without a part or a gap."""
        first, *parts = [max(step.excess, 0.0) for step in self.steps[:-1]] or [0.0]
        return math.sqrt(max(parts, default=0.0) / first) if first else 0.0

    def to_json_dict(self) -> dict[str, Any]:
        """The fields of a document: ``waterfall``, ``waterfall_on`` and ``without``."""
        return {
            "waterfall": as_json(self.steps),
            "waterfall_on": self.held_out,
            "without": dict(self.without),
        }

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, from a whole document."""
        return {"steps": data["waterfall"], "without": data["without"], "held_out": data["waterfall_on"]}


ON_RUNS = "on held-out runs"


ON_STRETCHES = "on held-out stretches of time"


ON_BOTH = f"{ON_RUNS}, and on stretches of time where a run is the only one of its kind"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Predictions of runs held out of the fit.

    Args:
        residuals: by run id: reading minus prediction in noise standard deviations, with only the run's own
            parameters refitted.
        points: by run id: the common parameters found without the run, and the run's own parameters.
    """

    residuals: dict[str, Array]
    points: dict[str, tuple[Array, Array]]


@cached_while_in_use
def predict_held_out(whole: Fit) -> HeldOut:
    """Refit without each group of runs, from the fit of all, and predict the group.

    The waterfall, the patch and the remainder ask for the same predictions.
    """
    data = whole.problem.data
    residuals: dict[str, Array] = {}
    points: dict[str, tuple[Array, Array]] = {}
    ids = [run.id for run in data.runs]
    for group in folds(data):
        out = [i for i, run_id in enumerate(ids) if run_id in group]
        seen = [np.full(run.reading.size, run.id not in group) for run in data.runs]
        try:
            common = fit_seen(whole, seen)[0].common
            released, remaining = refit_releases(
                replace(whole.problem, data=data.subset(tuple(ids[i] for i in out))),
                Point(common, whole.point.per_run[out]),
                [whole.jacobian[i][1] for i in out],
            )
        except (FitError, np.linalg.LinAlgError):
            continue
        for k, i in enumerate(out):
            residuals[ids[i]] = remaining[k]
            points[ids[i]] = (released.common, released.per_run[k])
    return HeldOut(residuals, points)


_STRETCHES = 9  # stretches in a run: each is a ninth of it, or a cycle if the run is short

Turns = Sequence[NDArray[np.int64]]


def turns_of(nominal: Fit, ids: Collection[str]) -> list[NDArray[np.int64]]:
    """For every block of every run, the number of the refit from which it is held out.

    See docs/decisions/0016-held-out-cause-by-cause.md.

    Returns:
        By run, shape (n,): the number, or −1 in runs that are not divided. Every third stretch has the same
        number.
    """
    found = []
    for index, run in enumerate(nominal.problem.data.runs):
        count = run.reading.size
        cycles = int(run.duration * resonance(nominal, index))
        stretches = min(max(cycles, FOLDS), _STRETCHES)
        turn = (np.arange(count) * stretches // count) % FOLDS
        found.append(np.where(run.id in ids, turn, -1))
    return found


def predict_stretches(whole: Fit, turns: Turns) -> dict[str, Array]:
    """Refit without the stretches of each number, and predict them. No parameter uses the held-out readings.

    Returns:
        By id of the divided runs: reading minus prediction in noise standard deviations. Every block is
            predicted by the fit that did not use it, unless that fit failed.
    """
    runs = whole.problem.data.runs
    predicted = {
        run.id: r.copy() for run, r, turn in zip(runs, whole.residuals, turns, strict=True) if turn[0] >= 0
    }
    for number in range(FOLDS if predicted else 0):
        out = [turn == number for turn in turns]
        try:
            _, residuals = fit_seen(whole, [~held_out for held_out in out])
        except np.linalg.LinAlgError:
            continue
        for run, residual, held_out in zip(runs, residuals, out, strict=True):
            if held_out.any():
                predicted[run.id][held_out] = residual[held_out]
    return predicted


def share_ahead(study: Study, whole: Collection[str]) -> float | None:
    """Share of the gap in the later half of driven runs that the answer explains, fitted to the earlier half.

    Stretches between fitted ones test interpolation only. The input of a driven run has no order in amplitude.
    In a free decay the later half has smaller amplitudes than the earlier one.

    Args:
        whole: ids of the runs that can be held out as a whole.

    Returns:
        None if no driven run is held out in stretches, if the later halves show no gap, or if the answer
        includes a random moment, which cannot be predicted.
    """
    nominal, chosen = study.nominal, study.chosen
    runs = nominal.problem.data.runs
    driven = {run.id for run in nominal.problem.data.driven_runs}
    ahead = [run.id in driven.difference(whole) for run in runs]
    if not study.named or study.moment is not None or chosen is nominal or not any(ahead):
        return None
    earlier = [
        np.arange(run.reading.size) < (run.reading.size // 2 if later else run.reading.size)
        for run, later in zip(runs, ahead, strict=True)
    ]
    predicted = []
    for fitted in (nominal, chosen):
        try:
            _, residuals = fit_seen(fitted, earlier)
        except np.linalg.LinAlgError:
            return None if fitted is nominal else 0.0
        predicted.append(np.concatenate([r[~known] for r, known in zip(residuals, earlier, strict=True)]))
    before, after = (float(np.mean(one**2)) for one in predicted)
    if chdtrc(predicted[0].size, predicted[0].size * before) >= study.settings.answer.remains_rate:
        return None
    return share_closed(before - 1.0, after - 1.0) if np.isfinite(after) else 0.0


@dataclass(frozen=True)
class Base:
    """The reference noise of an excess.

    Args:
        variance: variance of one sample's noise with the stated resolution, rad².
        extra: variance that a coarse step adds, as a share of this variance.
        hum: variance that a hum adds, as a share of this variance.
    """

    variance: float
    extra: float
    hum: float


def excess_base(study: Study) -> Base:
    """The noise that would remain with a perfect model.

    Returns:
        The stated noise, if the records or the step of the readings contradict it; else the noise estimated
        from the records.
    """
    estimated = float(np.mean(list(study.prepared.noise.variance.values())))
    stated = study.prepared.noise.stated_variance
    hum = 0.0 if study.prepared.hum is None else study.prepared.hum.excess
    if stated is not None and (study.prepared.coarse or study.gap.test.noisy):
        return Base(stated, max(estimated / stated - 1.0, 0.0), hum * estimated / stated)
    if study.prepared.coarse:
        fine = (study.campaign.sensor.resolution or 0.0) ** 2 / 12.0
        alone = max(estimated - study.prepared.step**2 / 12.0, 0.05 * estimated) + fine
        return Base(alone, estimated / alone - 1.0, hum * estimated / alone)
    return Base(estimated, 0.0, hum)


_ITERATIONS = 6  # the fit of all causes is close in the other parameters
_NO_GAIN = 0.999  # ratio to the χ² of fewer causes above which another start is tried

Names = frozenset[str]


class Subsets:
    """Fits by the set of their causes, each made once."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self.causes: Names = frozenset(kind.name for kind in study.chosen.problem.effects)
        # with fewer causes the scatter of the runs stays as it is with all of them
        none = with_scatter(study.nominal, study.chosen.problem.scatter)
        self._fits: dict[Names, Fit] = {self.causes: study.chosen, frozenset(): none}

    def __call__(self, names: Collection[str]) -> Fit:
        """The best fit found with these causes.

        Returns:
            The study's own fit, or one started from the fit of all causes. If a fit of fewer causes is better,
            the missing cause is added to it; a cause without gain leaves the fit unchanged.
        """
        key = frozenset(names)
        if key not in self._fits:
            fewer = min((known for known in self._fits if known < key), key=lambda k: self._fits[k].total)
            known, answer = self._fits[fewer], self._study.of(key)
            own = None if answer is None or answer.moment is not None else answer.hypothesis
            if own is None:
                start = restricted(self._study.chosen, key)
                refitted = try_fit(
                    start.problem, start.point, base=start, tolerance=1e-3, max_iterations=_ITERATIONS
                )
                refitted = _finite(refitted)
            else:
                refitted = own.fit
            if refitted is None or refitted.total > _NO_GAIN * known.total:
                added: Fit | None = known
                for kind in self._study.chosen.problem.effects:
                    if kind.name in key - fewer and added is not None:
                        added = one_more(added, kind)
                refitted = added or refitted
            self._fits[key] = known if refitted is None or refitted.total > known.total else refitted
        return self._fits[key]


def one_more(base: Fit, kind: type[Effect]) -> Fit | None:
    """A fit with one more effect, from the better of its first two starting points; None where both fail."""
    tried = (_finite(try_fit(start.problem, start.point)) for start in starting_points(base, kind)[:2])
    return min((found for found in tried if found), key=lambda found: found.total, default=None)


def _finite(found: Fit | None) -> Fit | None:
    return found if found is not None and np.isfinite(found.total) else None


def waterfall(study: Study, base: Base) -> Waterfall:
    """Add the causes one after another in their best order, and remove each alone from the full set.

    The excesses come from the fits' own integrator. The order is greedy: the next cause is always the one that
    explains most of the fitted readings. A random moment comes last, since it absorbs the other causes.
    """
    models = _Models(study, base)
    names: Names = frozenset()
    steps = models.first_steps()
    left = sorted(models.causes)
    while left:
        best = min(left, key=lambda name: models.fitted_excess(names | {name}))
        names |= {best}
        left.remove(best)
        steps.append(Step(best, models.excess(names)))
    moment = study.moment
    if moment is None:
        without = {name: models.excess(models.causes - {name}) for name in sorted(models.causes)}
        if len(steps) > 1 and study.scattering:
            without[" + ".join(study.scattering)] = models.repeating()
    else:
        last = models.random_excess(moment)
        without = {name: last + size for name, size in models.read_off.items()}
        acting = [kind.name for kind in moment.kinds]  # a cause may also act steadily, and be among the steps
        words = " + ".join([name for name in acting if name not in names] or acting)
        without[words] = steps[-1].excess
        steps.append(Step(words, last))
    return Waterfall(tuple(steps), without, models.words)


def both_ends(study: Study, base: Base) -> Waterfall:
    """Only the first and the last step: the nominal model, and all causes together."""
    models = _Models(study, base)
    names = sorted({*models.causes, *study.scattering})
    last = Step(" + ".join(names), models.excess(models.causes))
    return Waterfall((models.first_steps()[0], last), {}, models.words)


class _Models:
    """Residual gaps of the model with some of the causes."""

    def __init__(self, study: Study, base: Base) -> None:
        self._study, self._base = study, base
        powers = {HUM.name: base.hum, COARSE_STEP.name: base.extra}
        # contributions of the causes detected in the records
        self.read_off = {name: powers[name] for name in study.read_off if study.named}
        self._ratio = 1.0 + base.extra  # estimated noise over the reference noise
        self._always = base.hum + base.extra - sum(self.read_off.values())
        self._fit = Subsets(study)
        self.causes: Names = self._fit.causes | self.read_off.keys()
        out = predict_held_out(study.nominal)
        self._ids = [run.id for run in study.nominal.problem.data.runs]
        self._turns: Turns = turns_of(study.nominal, {run for run in self._ids if run not in out.residuals})
        self._excess: dict[Fit, float] = {}

    @property
    def words(self) -> str:
        """The kind of readings held out of the fits."""
        runs = len(predict_held_out(self._study.nominal).residuals)
        if runs == len(self._ids):
            return ON_RUNS
        return ON_STRETCHES if runs == 0 else ON_BOTH

    def first_steps(self) -> list[Step]:
        """The nominal model, and, if the runs differ by chance, the residual gap with their chance differences."""
        none: Names = frozenset()
        steps = [Step(None, self._excess_of(self._study.nominal) + self._left(none))]
        if self._study.scattering:
            steps.append(Step(" + ".join(self._study.scattering), self.excess(none)))
        return steps

    def repeating(self) -> float:
        """Residual gap of the causes in runs that repeat exactly, in noise variances of a sample."""
        problem, point = without_deviations(self._study.chosen)
        fitted = _finite(try_fit(problem, point)) or self._study.nominal
        return self._excess_of(fitted) + self._left(self.causes)

    def fitted_excess(self, names: Names) -> float:
        """Residual gap of the causes in the fitted readings, in noise variances of a sample."""
        fitted = self._fit(names - self.read_off.keys())
        return self._in_samples(dict(zip(self._ids, fitted.residuals, strict=True))) + self._left(names)

    def excess(self, names: Names) -> float:
        """Residual gap of the causes in held-out readings, in noise variances of a sample."""
        return self._excess_of(self._fit(names - self.read_off.keys())) + self._left(names)

    def _excess_of(self, fitted: Fit) -> float:
        if fitted not in self._excess:
            self._excess[fitted] = self._in_samples(self._predicted(fitted))
        return self._excess[fitted]

    def random_excess(self, moment: MomentLayer) -> float:
        """Residual gap of all causes and a random moment: the moment's innovations where it acts."""
        runs = self._study.nominal.problem.data.runs
        still = self._predicted(self._study.chosen)
        acts = moment.process.runs
        by_run = {
            run.id: moment.process.excess if run.id in acts else float(np.mean(still[run.id] ** 2)) - 1.0
            for run in runs
        }
        return self._weighted(by_run) + self._left(self.causes)

    def _left(self, names: Names) -> float:
        """Excess of the causes detected in the records that are not among the names."""
        return self._always + sum(size for name, size in self.read_off.items() if name not in names)

    def _predicted(self, fitted: Fit) -> dict[str, Array]:
        seen = dict(zip(self._ids, fitted.residuals, strict=True))
        found = seen | predict_held_out(fitted).residuals | predict_stretches(fitted, self._turns)
        still = {run.id: run.scaled(run.reading) for run in fitted.problem.data.runs}
        # a diverging prediction counts as no prediction
        return {run: r if np.all(np.isfinite(r)) else still[run] for run, r in found.items()}

    def _in_samples(self, residuals: Mapping[str, Array]) -> float:
        return self._weighted({run: float(np.mean(r**2)) - 1.0 for run, r in residuals.items()})

    def _weighted(self, excess: Mapping[str, float]) -> float:
        """Mean over the runs' samples of an excess in block means, in noise variances of a sample."""
        runs = self._study.nominal.problem.data.runs
        sizes = np.array([run.reading.size * run.block for run in runs], np.float64)
        own = np.array([excess[run.id] / run.block for run in runs])
        return float(sizes @ own / sizes.sum() * self._ratio)
