"""Labels of several runs against their frequencies: exchanged, renumbered, or off the line of the others.

Every run obeys Kr = Izz ωn² + Ka with a common Izz and with Ka proportional to ½ρV². The runs of one spring lie
on a straight line of ωn² against ½ρV², whatever the error of the spring. If the statements contradict the
frequencies beyond chance, and agree after an exchange of two runs' labels, these were exchanged.

The stated springs agree where Kr/ωn² with the wind off is the same inertia for all, and equals the stated one.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, fdtri, ndtri

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import STIFFNESS_UNITS, SlipEvidence
from identification.status import WITHHOLDS, Outcome, Remark
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.record import Array

_CANDIDATES = 12  # number of worst-fitting runs, each tried against all others
_LEAST_RUNS = 2
_SPRINGS = "spring_stiffness"


@dataclass(frozen=True, eq=False)
class Labels:
    """Stated and measured quantities, run by run.

    Args:
        spring: stated Kr, shape (n,), N m/rad.
        pressure: stated ½ρV², shape (n,), Pa.
        stiffness: k = ωn², shape (n,), 1/s².
        std: standard deviation of k, shape (n,), 1/s².
    """

    spring: Array
    pressure: Array
    stiffness: Array
    std: Array

    @classmethod
    def of(cls, swings: Sequence[Swing]) -> Labels:
        """Labels of runs that all state their spring."""
        runs = [swing.run for swing in swings]
        seen = np.array([swing.stiffness for swing in swings])
        std = np.array([swing.stiffness_std for swing in swings])
        return cls(
            np.array([float(run.spring_stiffness or 0.0) for run in runs]),
            np.array([0.5 * (run.air_density or 0.0) * run.wind_speed**2 for run in runs]),
            seen,
            np.maximum(std, policy.LEAST_STIFFNESS_STD * seen),
        )


@dataclass(frozen=True)
class _Misfit:
    """Weighted sum of squared residuals, and its degrees of freedom."""

    squares: float
    freedom: int

    @property
    def agrees(self) -> bool:
        """Whether the residuals are within chance."""
        return self.squares <= float(chdtri(self.freedom, policy.MISFIT_RATE))


def labels_exchanged(evidence: SlipEvidence) -> Remark | None:
    """Springs or wind speeds of two runs, or of all runs of two settings, are exchanged. Refused."""
    known = [swing for swing in evidence.swings if swing.run.spring_stiffness is not None]
    if len(known) < _LEAST_RUNS:
        return None
    labels = Labels.of(known)
    for what in (_SPRINGS, "wind_speed"):
        stated, away = _misfit(labels, what)
        if not (stated.freedom > 0 and stated.squares > float(chdtri(stated.freedom, policy.REFUSAL_RATE))):
            continue
        trials = [(places, _misfit(other, what)[0]) for places, other in _exchanged(labels, away, what)]
        mended = []  # exchanges that agree, or agree better than the statements beyond chance
        for places, found in trials:
            ratio, freedom = stated.squares / max(found.squares, 1e-300), found.freedom
            if found.agrees or ratio > float(
                fdtri(freedom, freedom, 1.0 - policy.REFUSAL_RATE / len(trials))
            ):
                mended.append((places, found))
        if not mended:
            continue
        # Exchanges that fit as well as the best one cannot be distinguished.
        limit = min(found.squares for _, found in mended) + float(chdtri(1, policy.MISFIT_RATE))
        names = [[known[i].run.id for i in places] for places, found in mended if found.squares <= limit]
        ids = tuple(dict.fromkeys(itertools.chain.from_iterable(names)))
        pairs = ", or ".join(" and ".join(pair) for pair in names)
        said = f"the stated {what} contradicts the frequencies, but agrees if {pairs} are exchanged"
        return Remark(Outcome.REFUSED, ids, said, f"correct {what} or the file names of these runs")
    return None


def _other_fits(swings: Sequence[Swing]) -> list[tuple[float, float | None]]:
    """Possible values of Izz and Ka if the stated springs contradict the frequencies.

    Returns:
        Izz in kg m² and Ka over ½ρV² in m³/rad (None where it is not determined): without each spring in turn;
        with a stiffness common to all runs, such as a tilted axis adds; and with the wind speeds of two
        settings exchanged, if the statements then agree.
    """
    labels = Labels.of([swing for swing in swings if swing.run.spring_stiffness is not None])
    found = [_fitted(labels, labels.spring != spring) for spring in np.unique(labels.spring)]
    found.append(_fitted(labels, labels.spring > 0.0, common=True))
    for _, exchanged in _speeds_exchanged(labels):
        if _misfit(exchanged, _SPRINGS)[0].agrees:
            found.append(_fitted(exchanged, labels.spring > 0.0))
    return [one for one in found if one is not None and one[0] > 0.0]


def _fitted(
    labels: Labels, used: NDArray[np.bool_], *, common: bool = False
) -> tuple[float, float | None] | None:
    """Izz and C of Kr = Izz k + C ½ρV², or with a common stiffness added; None where they cannot be separated."""
    spring, seen, pressure = labels.spring[used], labels.stiffness[used], labels.pressure[used]
    windy = bool(np.any(pressure > 0.0))
    columns = [seen, *([pressure] * windy), *([np.ones_like(seen)] * common)]
    scaled = np.column_stack(columns) / spring[:, None]  # errors of springs are relative
    lengths = np.linalg.norm(scaled, axis=0)
    if (
        spring.size < lengths.size
        or np.linalg.svd(scaled / lengths, compute_uv=False)[-1] < policy.LEAST_SPRING_SPREAD
    ):
        return None
    solution = np.linalg.lstsq(scaled / lengths, np.ones_like(spring), rcond=None)[0] / lengths
    return float(solution[0]), float(solution[1]) if windy else None


def _misfit(labels: Labels, what: str) -> tuple[_Misfit, Array]:
    """Misfit of all runs, and the residual of each.

    For stated springs: of Kr = Izz k + C ½ρV², weighted by the frequencies and the springs' tolerance. The runs
    of one spring share its error, so they count once together. For stated wind speeds: of k = k0(spring) − c
    ½ρV².
    """
    springs, place, count = np.unique(labels.spring, return_inverse=True, return_counts=True)
    if what == _SPRINGS:
        columns, target = labels.stiffness[:, None], labels.spring
        if np.any(labels.pressure > 0.0):
            columns = np.column_stack((columns, labels.pressure))
        std = (
            labels.spring
            * np.hypot(policy.SPRING_TOLERANCE, labels.std / labels.stiffness)
            * np.sqrt(count[place])
        )
        freedom = springs.size - 1
    else:
        columns, target, std = (
            np.zeros((labels.stiffness.size, springs.size + 1)),
            labels.stiffness,
            labels.std,
        )
        columns[np.arange(labels.stiffness.size), place] = 1.0
        columns[:, -1] = labels.pressure
        rank = np.linalg.matrix_rank(columns / np.maximum(columns.max(axis=0), 1e-300))
        freedom = labels.stiffness.size - int(rank)
    columns, target = columns / std[:, None], target / std
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solution = np.linalg.lstsq(columns / scale, target, rcond=1e-10)[0]
    away = np.asarray(target - columns / scale @ solution)
    return _Misfit(float(away @ away), freedom), np.abs(away)


def _exchanged(labels: Labels, away: Array, what: str) -> Iterator[tuple[tuple[int, ...], Labels]]:
    """Statements exchanged between two runs, if one of them fits badly, or between all runs of two settings."""
    worst: NDArray[np.intp] = np.argsort(-away)[:_CANDIDATES]
    pairs = sorted({(min(i, j), max(i, j)) for i in worst.tolist() for j in range(away.size) if i != j})
    values = labels.spring if what == _SPRINGS else labels.pressure
    for i, j in pairs:
        low, high = sorted((values[i], values[j]))
        if high - low > (0.0 if what == _SPRINGS else policy.SAME_PRESSURE * high):
            other = values.copy()
            other[[i, j]] = other[[j, i]]
            yield (
                (i, j),
                replace(labels, spring=other) if what == _SPRINGS else replace(labels, pressure=other),
            )
    if what != _SPRINGS:
        yield from _speeds_exchanged(labels)
        return
    for a, b in itertools.combinations(np.unique(labels.spring).tolist(), 2):
        places = np.flatnonzero((labels.spring == a) | (labels.spring == b))
        if places.size > 2:
            other = labels.spring.copy()
            other[places] = a + b - other[places]
            yield tuple(places.tolist()), replace(labels, spring=other)


def _speeds_exchanged(labels: Labels) -> Iterator[tuple[tuple[int, ...], Labels]]:
    """The wind speeds of all runs of two settings."""
    order = np.argsort(labels.pressure)
    rises = np.diff(labels.pressure[order]) > policy.SAME_PRESSURE * labels.pressure[order][1:]
    settings = np.split(order, np.flatnonzero(rises) + 1)
    for one, two in itertools.combinations(settings, 2):
        if one.size + two.size == 2:
            continue  # already covered by the exchange of two runs
        other = labels.pressure.copy()
        other[one], other[two] = other[two].mean(), other[one].mean()
        yield tuple(np.sort(np.concatenate([one, two])).tolist()), replace(labels, pressure=other)


_LEAST = 3  # minimum number of springs for identifying the wrong one

#: Ratios of Kr/ωn² to the stated inertia for a value in another unit.
_SLIPS = {
    **{factor: f"spring_stiffness in {unit}" for unit, factor in STIFFNESS_UNITS.items()},
    1e6: "time_s in milliseconds",
    1.0 / 3600.0: "time_s in minutes",
    1e-3: "yaw_inertia in g m2",
    1e-4: "yaw_inertia in kg cm2",
    1e-6: "yaw_inertia in kg mm2",
    1e-7: "yaw_inertia in g cm2",
}


@dataclass(frozen=True, eq=False)
class _Springs:
    """Wind-off values by spring: Kr, ids of the runs, ln(Kr/ωn²) and its standard deviation, shape (springs,)."""

    stiffness: Array
    runs: tuple[tuple[str, ...], ...]
    inertia: Array
    std: Array

    @classmethod
    def of(cls, swings: Sequence[Swing]) -> _Springs:
        stiffness = sorted({float(s.run.spring_stiffness or 0.0) for s in swings})
        groups = [[s for s in swings if s.run.spring_stiffness == value] for value in stiffness]
        seen = [np.mean([np.log(s.stiffness) for s in group]) for group in groups]
        # Std of the mean of ln k: the effect of the amplitude on k is common to the runs of a spring.
        std = [
            np.hypot(policy.SPRING_TOLERANCE, float(np.mean([s.stiffness_std / s.stiffness for s in group])))
            for group in groups
        ]
        return cls(
            np.array(stiffness),
            tuple(tuple(s.run.id for s in group) for group in groups),
            np.log(stiffness) - np.array(seen),
            np.array(std, dtype=np.float64),
        )

    def without(self, place: int) -> _Springs:
        keep = [i for i in range(self.stiffness.size) if i != place]
        return _Springs(
            self.stiffness[keep], tuple(self.runs[i] for i in keep), self.inertia[keep], self.std[keep]
        )

    def mean(self) -> tuple[float, float]:
        """Weighted mean of ln(Kr/ωn²), and its standard deviation."""
        weights = 1.0 / self.std**2
        return float(weights @ self.inertia / weights.sum()), float(weights.sum() ** -0.5)

    def disagree(self) -> bool:
        """Whether the springs' inertias differ beyond chance."""
        away = (self.inertia - self.mean()[0]) / self.std
        return float(away @ away) > float(chdtri(self.stiffness.size - 1, policy.MISFIT_RATE))


def springs_renumbered(evidence: SlipEvidence) -> Remark | None:
    """All springs are one number off, in the campaign's own order or in the packaged list. Refused."""
    if evidence.campaign.sensor.plausible is False:
        return None
    still = [s for s in evidence.swings if not s.run.wind_on and s.run.spring_stiffness is not None]
    stated = _Springs.of(still)
    if stated.stiffness.size < 2 or np.ptp(stated.inertia) < np.log1p(policy.OTHER_NUMBER):
        return None
    own = sorted({float(s.run.spring_stiffness or 0.0) for s in evidence.swings})
    for table in (np.array(list(load_rig().springs.values())), np.array(own)):
        places = [
            np.flatnonzero(np.abs(table / value - 1.0) < policy.SPRING_AT_BEST) for value in stated.stiffness
        ]
        if any(place.size != 1 for place in places):
            continue
        number = np.array([int(place[0]) for place in places])
        for shift in (-1, 1):
            inside = (number + shift >= 0) & (number + shift < table.size)
            meant = table[(number + shift)[inside]]
            known = int(np.sum(inside))
            if known < 2 or (known == 2 and not np.all(inside)):
                continue  # two springs of three may agree by chance
            inertia = stated.inertia[inside] + np.log(meant / stated.stiffness[inside])
            std = np.hypot(stated.std[inside], policy.SPRING_AT_BEST)
            away = inertia - np.average(inertia, weights=std**-2)
            if float(np.sum((away / std) ** 2)) <= float(chdtri(known - 1, policy.SLIP_AGREES)):
                return _renumbered(stated, inside, meant, shift)
    return None


def _renumbered(stated: _Springs, inside: NDArray[np.bool_], meant: Array, shift: int) -> Remark:
    """The refusal that names the intended springs."""
    spread = 100.0 * np.expm1(float(np.ptp(stated.inertia)))
    pairs = ", ".join(
        f"{new:g} for {old:g}" for new, old in zip(meant, stated.stiffness[inside], strict=True)
    )
    what = (
        f"with the wind off Kr/omega_n^2 differs by {spread:.0f} % between the stated springs, and agrees if all "
        f"springs are the next {'stiffer' if shift > 0 else 'softer'} ones of the list ({pairs} N m/rad)"
    )
    if meant.size == 2:
        what += "; or one of the two is off"
    remedy = "correct spring_stiffness, or state plausible = false under [sensor] if the numbers are right"
    return Remark(Outcome.REFUSED, tuple(name for group in stated.runs for name in group), what, remedy)


def spring_off_the_line(evidence: SlipEvidence) -> Remark | None:
    """A spring that is not as stiff as stated, according to the others. Noted."""
    still = [s for s in evidence.swings if not s.run.wind_on and s.run.spring_stiffness is not None]
    if len({s.run.spring_stiffness for s in still}) < 2:
        return None
    springs = _Springs.of(still)
    if not springs.disagree():
        return None
    fits = _other_fits(evidence.swings)
    figures = {"inertias_kg_m2": [one for one, _ in fits], "air_stiffnesses_m3": [air for _, air in fits]}
    # the spring that differs beyond chance while the others agree
    count, scores = springs.stiffness.size, []
    for place in range(count if count >= _LEAST else 0):
        rest = springs.without(place)
        mean, std = rest.mean()
        score = abs(springs.inertia[place] - mean) / float(np.hypot(std, springs.std[place]))
        scores.append(-1.0 if rest.disagree() else score)
    if scores and max(scores) > float(-ndtri(0.5 * policy.MISFIT_RATE / count)):
        place = int(np.argmax(scores))
        percent = 100.0 * np.expm1(springs.without(place).mean()[0] - springs.inertia[place])
        how = f"{abs(percent):.0f} % {'stiffer' if percent > 0.0 else 'softer'}"
        what = (
            f"their spring appears {how} than the stated {springs.stiffness[place]:g} N m/rad, judged by the "
            f"frequencies of the other springs"
        )
        remedy = (
            "calibrate that spring again; a tilted axis or a flexible rod looks similar, run the diagnosis"
        )
        return Remark(Outcome.NOTED, springs.runs[place], what, remedy, figures)
    spread = 100.0 * np.expm1(float(np.ptp(springs.inertia)))
    ids = tuple(name for group in springs.runs for name in group)
    what = (
        f"with the wind off Kr/omega_n^2 differs by {spread:.0f} % between the stated springs; which one is "
        "wrong cannot be determined"
    )
    remedy = "calibrate the springs again; a tilted axis or a flexible rod looks similar, run the diagnosis"
    return Remark(Outcome.NOTED, ids, what, remedy, figures)


def inertia_off_the_springs(evidence: SlipEvidence) -> Remark | None:
    """A stated inertia that the springs contradict. Noted.

    A nominal inertia may be slightly wrong. The remark names the probable error of units; there is none where the
    campaign states ``plausible = false``.
    """
    campaign = evidence.campaign
    still = [s for s in evidence.swings if not s.run.wind_on and s.run.spring_stiffness is not None]
    stated = campaign.rig.yaw_inertia
    if stated is None or not still or campaign.sensor.plausible is False:
        return None
    found = float(np.exp(_Springs.of(still).mean()[0]))
    off = {ratio: abs(np.log(found / stated / ratio)) for ratio in (1.0, *_SLIPS)}
    if off[1.0] <= np.log(policy.INERTIA_FACTOR):
        return None
    nearest = min(_SLIPS, key=off.__getitem__)
    slip = f": it looks like {_SLIPS[nearest]}" if off[nearest] <= np.log(policy.INERTIA_FACTOR) else ""
    what = (
        f"with the wind off Kr/omega_n^2 is {found:.4g} kg m2, {found / stated:.4g} times the stated "
        f"yaw_inertia of {stated:.4g} kg m2{slip}"
    )
    remedy = "correct the stiffness, the inertia or the times, or state plausible = false under [sensor]"
    figures: dict[str, Any] = {"inertias_kg_m2": [stated], "air_stiffnesses_m3": [None]}
    if abs(np.log(found / stated)) > np.log(policy.WITHHELD_INERTIA):
        figures[WITHHOLDS] = True
    return Remark(Outcome.NOTED, tuple(s.run.id for s in still), what, remedy, figures)
