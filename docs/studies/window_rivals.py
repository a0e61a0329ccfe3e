"""Effects that reproduce both columns of a table of windows, such as the paper's Table III.

Every effect of the vocabulary with a trend within one run is fitted to the table by simulation, then pairs of an
effect on the frequency with an effect on the damping; they are weighed by BIC. The likelihood of a column is
Student's: its scatter is estimated from few windows, and normal tails would be overconfident.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import log

import numpy as np
from scipy.optimize import least_squares

from docs.studies.window_table import Columns, RigState, freedom, read_table, rig_state, simulate_windows
from identification.datasets import WindowRow, paper_windows
from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.capabilities import OwnNumbers
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_SCAN = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # first tried severities, in the effect's own scale
_STEP = 0.01  # step of the finite differences, in units of the parameters' scales
_FAR = 1e3  # residual of a trial that does not oscillate through the table, in standard deviations
_SCALES = (0.02, 5e-4)  # scales of the base ωn (rad/s) and ζ
_SLOWEST, _LEAST_ZETA, _MOST_ZETA = 0.1, 0.05, 0.2  # bounds of the base: a share of ωn, and ζ
_ADJUSTMENTS = 3  # rounds of adjusting the base, which a severe effect changes considerably
_MOVES = (
    3.84  # decrease of a column's χ² exceeded by chance once in twenty: more shows an effect on the column
)
#: Odds of 20:1 as a difference of BIC; smaller differences count as "cannot be distinguished".
DISTINGUISHED = 2.0 * log(20.0)

Kinds = tuple[type[Effect], ...]


@dataclass(frozen=True, eq=False)
class Explanation:
    """One hypothesis fitted to both columns.

    Args:
        effects: with their fitted severities; empty for the linear model.
        omega_n: base natural frequency, before the effects are added, rad/s.
        zeta: base damping ratio.
        columns: simulated columns, windowed like the table.
        chi2_zeta: sum of squared residuals of the ζ column over its scatter², dimensionless.
        chi2_omega: sum of squared residuals of the ωn column over its scatter², dimensionless.
        bic: Bayesian information criterion, dimensionless.
        probability: probability among the weighed hypotheses, with equal priors, a fraction.
    """

    effects: tuple[Effect, ...]
    omega_n: float
    zeta: float
    columns: Columns
    chi2_zeta: float
    chi2_omega: float
    bic: float
    probability: float = 0.0

    @property
    def name(self) -> str:
        """Names of the effects joined by `` + ``, or ``none``."""
        return " + ".join(effect.name for effect in self.effects) or "none"

    @property
    def kinds(self) -> Kinds:
        """The effects' classes."""
        return tuple(type(effect) for effect in self.effects)


@dataclass(frozen=True, eq=False)
class WindowDiagnosis:
    """The diagnosis of a table of windows.

    Args:
        measured: the table, with the mean of an entry's two readings.
        std: scatter of every entry.
        explanations: explanations, best first.
        flat: names of effects without influence on either column, which the table cannot show.
    """

    state: RigState
    measured: Columns
    std: Columns
    explanations: tuple[Explanation, ...]
    flat: tuple[str, ...]

    @property
    def tied(self) -> tuple[Explanation, ...]:
        """Explanations that the table cannot distinguish from the best: odds of less than 20:1."""
        best = self.explanations[0].bic
        return tuple(e for e in self.explanations if e.bic - best < DISTINGUISHED)

    def probability_of(self, *names: str) -> float:
        """Total weight of the hypotheses with at least one of the named effects."""
        held = [e for e in self.explanations if {k.name for k in e.kinds} & set(names)]
        return sum(e.probability for e in held)

    def explanation(self, *names: str) -> Explanation:
        """The hypothesis with exactly these effects, in any order; none for the linear model.

        Raises:
            TunnelError: when it was not weighed, because one of its effects changes neither column.
        """
        for e in self.explanations:
            if {kind.name for kind in e.kinds} == set(names):
                return e
        raise TunnelError(
            f"{' + '.join(names)} was not weighed",
            remedy="ask for one of " + ", ".join(e.name for e in self.explanations),
        )

    def separation(self, one: Explanation, other: Explanation, state: RigState) -> float:
        """Separation of two explanations by the table of a further run.

        Both keep their fitted severities, inertia and mechanical damping.

        Returns:
            Distance of the two predicted tables in standard deviations of this table's scatter, √Σ(Δ/std)².

        Raises:
            TunnelError: when either would not oscillate through all windows.
        """
        count = self.measured.zeta.size
        a, b = (
            simulate_windows(state, e.effects, e.omega_n, e.zeta, count, base=self.state)
            for e in (one, other)
        )
        if a is None or b is None:
            raise TunnelError("the run would not oscillate through all windows", remedy="choose another run")
        return float(np.linalg.norm(_residuals(a, b, self.std)))


def diagnose_windows(
    table: Sequence[WindowRow] | None = None,
    state: RigState | None = None,
    *,
    kinds: Sequence[type[Effect]] = ALL_EFFECTS,
) -> WindowDiagnosis:
    """Weigh the effects that reproduce both columns of a table of windows.

    Args:
        table: rows in the order of time; None takes the paper's Table III.
        state: the rig in that run; None takes the inference of `rig_state`.

    Raises:
        TunnelError: when the table is too short for an estimate of its scatter.
    """
    measured, std = read_table(paper_windows() if table is None else table)
    task = _Task(rig_state() if state is None else state, measured, std)
    none = task.fit((), np.zeros(2))
    if none is None:
        raise TunnelError(
            "the linear model does not oscillate through this table",
            remedy="give damping ratios well below 1",
        )
    found, singles = [none], []
    for kind in kinds:
        start = task.scan(kind) if has_trend(kind) else None
        single = None if start is None else task.fit((kind,), start)
        singles += [] if single is None else [single]
    moving = [e for e in singles if _moves_zeta(e, none) or _moves_omega(e, none)]
    found += moving
    for a in moving:
        for b in moving:
            if a is not b and _moves_omega(a, none) and _moves_zeta(b, none):
                pair = task.fit(*task.together(a, b))
                found += [] if pair is None else [pair]
    flat = {kind.name for kind in kinds} - {e.name for e in moving}
    unique = {frozenset(e.kinds): e for e in sorted(found, key=lambda e: -e.bic)}  # the best of each set
    ordered = sorted(unique.values(), key=lambda e: e.bic)
    weight = np.exp(-0.5 * np.array([e.bic - ordered[0].bic for e in ordered]))
    weight /= weight.sum()
    weighed = [dataclasses.replace(e, probability=float(w)) for e, w in zip(ordered, weight, strict=True)]
    return WindowDiagnosis(task.state, measured, std, tuple(weighed), tuple(sorted(flat)))


def has_trend(kind: type[Effect]) -> bool:
    """Whether an effect has a trend within one run: it is not random, periodic or a mere step."""
    return kind.fitted and not issubclass(kind, OwnNumbers)


def _moves_zeta(e: Explanation, none: Explanation) -> bool:
    return none.chi2_zeta - e.chi2_zeta > _MOVES


def _moves_omega(e: Explanation, none: Explanation) -> bool:
    return none.chi2_omega - e.chi2_omega > _MOVES


def _residuals(columns: Columns, target: Columns, std: Columns) -> Array:
    zeta = (columns.zeta - target.zeta) / std.zeta
    return np.concatenate((zeta, (columns.omega_n - target.omega_n) / std.omega_n))


def _effects(kinds: Kinds, x: Array) -> tuple[Effect, ...]:
    return tuple(
        kind(**{kind.parameters()[0].name: float(u) * kind.parameters()[0].scale})
        for kind, u in zip(kinds, x, strict=False)
    )


@dataclass(frozen=True, eq=False)
class _Task:
    """A table to fit. Unknowns: severities in units of the effects' scales, then base ωn and ζ."""

    state: RigState
    measured: Columns
    std: Columns

    def together(self, a: Explanation, b: Explanation) -> tuple[Kinds, Array]:
        """A pair, and the start of its fit: both severities, and the base of the first explanation."""
        kinds = (*a.kinds, *b.kinds)
        units = [e.severity / e.parameters()[0].scale for e in (*a.effects, *b.effects)]
        base = self.measured.omega_n.mean(), self.measured.zeta.mean()
        x = np.array([*units, (a.omega_n - base[0]) / _SCALES[0], (a.zeta - base[1]) / _SCALES[1]])
        start = self.adjusted(kinds, x)
        return kinds, x if start is None else start

    def columns(self, kinds: Kinds, x: Array) -> Columns | None:
        omega_n, zeta = self._base(x)
        return simulate_windows(self.state, _effects(kinds, x), omega_n, zeta, self.measured.zeta.size)

    def _base(self, x: Array) -> tuple[float, float]:
        mean_omega, mean_zeta = float(self.measured.omega_n.mean()), float(self.measured.zeta.mean())
        return mean_omega + float(x[-2]) * _SCALES[0], mean_zeta + float(x[-1]) * _SCALES[1]

    def residuals(self, kinds: Kinds, x: Array) -> Array:
        columns = self.columns(kinds, x)
        if columns is None:
            return np.full(2 * self.measured.zeta.size, _FAR)
        return _residuals(columns, self.measured, self.std)

    def scan(self, kind: type[Effect]) -> Array | None:
        """The start of a fit: the severity with the best-fitting columns for an adjusted base."""
        info = kind.parameters()[0]
        best, least = None, np.inf
        for unit in (sign * size for size in _SCAN for sign in (1.0, -1.0)):
            if not info.fit_lower <= unit * info.scale <= info.fit_upper:
                continue
            x = self.adjusted((kind,), np.array([unit, 0.0, 0.0]))
            cost = np.inf if x is None else float(np.sum(self.residuals((kind,), x) ** 2))
            if cost < least:
                best, least = x, cost
        return best

    def adjusted(self, kinds: Kinds, x: Array) -> Array | None:
        """Correct the base by the errors of both columns' means: ωn as a ratio, ζ as a difference."""
        for _ in range(_ADJUSTMENTS):
            columns = self.columns(kinds, x)
            if columns is None:
                return None
            ratio = float(self.measured.omega_n.mean() / columns.omega_n.mean())
            missing = float(self.measured.zeta.mean() - columns.zeta.mean())
            moved = [self._base(x)[0] * (ratio - 1.0) / _SCALES[0], missing / _SCALES[1]]
            x = np.concatenate((x[:-2], x[-2:] + moved))
        return x

    def fit(self, kinds: Kinds, start: Array) -> Explanation | None:
        """Least squares from a start that can be simulated."""
        infos = [kind.parameters()[0] for kind in kinds]
        mean, ratio = float(self.measured.omega_n.mean()), float(self.measured.zeta.mean())
        least = [_SLOWEST * mean - mean, -_LEAST_ZETA - ratio]
        base = np.array([least, [mean, _MOST_ZETA - ratio]]) / _SCALES
        lower = np.array([info.fit_lower / info.scale for info in infos] + base[0].tolist())
        upper = np.array([info.fit_upper / info.scale for info in infos] + base[1].tolist())

        residuals = partial(self.residuals, kinds)

        def jacobian(x: Array) -> Array:
            here = residuals(x)
            steps = np.where(x + _STEP > upper, -_STEP, _STEP) * np.eye(x.size)
            return np.stack([(residuals(x + s) - here) / s.sum() for s in steps], axis=1)

        solution = least_squares(
            residuals,
            np.clip(start, lower + 1e-6, upper - 1e-6),  # a bounded solver starts inside
            jac=jacobian,
            bounds=(lower, upper),
            xtol=1e-4,
            ftol=1e-6,
            x_scale="jac",
            max_nfev=25,
        )
        x = solution.x
        columns = self.columns(kinds, x)
        if columns is None:
            return None
        zeta, omega = _residuals(columns, self.measured, self.std).reshape(2, -1)
        chi2, count = (float(zeta @ zeta), float(omega @ omega)), self.measured.zeta.size
        nu = freedom(count)
        bic = sum((nu + count) * log(1.0 + c / nu) for c in chi2) + x.size * log(2 * count)
        return Explanation(_effects(kinds, x), *self._base(x), columns, *chi2, bic)
