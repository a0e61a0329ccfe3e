"""The explainable part of an answer's residual: by kind, with its curve, events, line or formula."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc

from diagnosis.likelihood.ceiling import (
    GAPS,
    INCLUDED_IN,
    Ceiling,
    Evidence,
    Ridge,
    Unexplained,
    gaps,
    normal,
    ratio,
)
from diagnosis.likelihood.paths import COMMON, OF_READING, SINGLE, Path, Places, paths
from diagnosis.likelihood.residuals import block_gain, resonance, smooth_spectra
from diagnosis.model.similarity import Similarity
from diagnosis.remainder.closable import Closable, Curve, Law, Line
from diagnosis.remainder.formula import choose, propose
from diagnosis.remainder.laws import held_out_share, stated_law
from diagnosis.search.scatter import with_scatter
from diagnosis.search.study import Study
from diagnosis.settings import RemainderSettings
from diagnosis.where.excess import away_from_motion
from tunnel_sim.vocabulary.quantities import Hertz
from tunnel_sim.vocabulary.record import Array

CLOSABLE_FROM: Final = 0.1
"""Minimum share of the residual that a law must explain for the residual to be more than noise. Judgement."""
COMMON_FIRST: Final = 0.8
"""Share of a common law, relative to laws of single runs, above which the common law is preferred. Judgement."""
CLOSES_ALIKE: Final = 0.02
"""Maximum difference in share to a better law for a simpler law to be preferred. Judgement."""
NAMED_ALIKE: Final = 0.02
"""Maximum difference in share to the best law for a law to be called indistinguishable. Judgement."""
EVENTS_FROM: Final = 0.1
"""Minimum part of a run to be listed as an event, as a share of the largest part. Judgement."""
EVENT_SHARE: Final = 0.8
"""Share of the energy of an event within the stated times. Judgement."""
STEADY_LINE_CONTRAST: Final = 8.0
"""Minimum ratio of the power of a steady line to the power nearby. Judgement. The skirt of a resonance has
less."""
STEADY_LINE_HALVES: Final = 0.8
"""Minimum share of a line in one half of a run that the other half must predict. Judgement."""

Events = tuple[Mapping[str, Any], ...]
"""By run, the largest part first: ``run``, its ``share`` of the explained part, and the times ``from_s`` and
``to_s`` since the start of the record."""


def closable(study: Study, *, significant: bool, decided: bool = True) -> Closable | None:
    """Find the share of an answer's residual that could be explained, and the law for it.

    Args:
        decided: whether the answer is decided; if not, the residual is the whole gap of the nominal model, less
            chance differences between the runs under the most likely answer.
        significant: whether the residual exceeds chance.

    Returns:
        In the measured campaign's units. None where the residual is within chance or too small for a share, or
        if the answer includes a random moment, which could explain anything.

    Raises:
        LinAlgError: when the equations of a kind cannot be solved.
    """
    similarity, fitted = study.similarity, study.chosen
    if not decided:
        fitted = with_scatter(study.nominal, study.chosen.problem.scatter)
    if not study.causes or not significant or study.moment is not None:
        return None
    # a run of few blocks has no row of an eighth of a cycle
    if fitted.excess <= 0.0 or any(path.residual.size == 0 for path in paths(fitted)):
        return None
    unexplained = Unexplained(fitted)
    windy = any(path.speed > 0.0 for path in unexplained.paths)
    common = {kind: unexplained.common(kind) for kind in COMMON if windy or kind != "wind"}
    line = steady_line(unexplained)
    single = {} if line is None else {"line": line.evidence}
    single |= {kind: unexplained.single(kind) for kind in SINGLE}
    chosen = study.settings.remainder
    kind = chosen_kind(common, single)
    if kind is None:
        return None
    law, shape = None, None
    largest: Events = ()
    if kind in common:
        shape = curve(unexplained, common[kind], similarity)
        law = _law(unexplained, kind, common[kind].drop, similarity)
        # few runs may make a function of angle and rate look like a function of one of them: the formula
        # corrects that
        formula = "" if law is None else str(law.effect.get("moment", ""))
        other = {"angle": "r", "rate": "b"}.get(kind)
        kind = "state" if other and re.search(rf"\b{other}\b", formula) else kind
    elif line is not None and kind == "line":
        largest = line.events
    elif kind in single:
        largest = events(unexplained, kind, single[kind].precision)
    where = tuple(
        {**one, **{end: similarity.own(one[end], "s") for end in ("from_s", "to_s")}} for one in largest
    )
    ceilings = tuple(one.ceiling for one in (*common.values(), *single.values()))
    alike, next_most = _others(kind, ceilings)
    return Closable(
        excess=fitted.excess / fitted.problem.data.mean_block,
        ceilings=ceilings,
        kind=kind,
        events=where,
        curve=shape,
        law=law,
        alike=alike,
        next_most=next_most,
        line=_own_line(line, similarity, chosen) if line is not None and kind == "line" else None,
    )


def chosen_kind(common: Mapping[str, Evidence], single: Mapping[str, Evidence]) -> str | None:
    """The simplest kind of `KINDS` that explains about as much as any; simpler common laws come first.

    None if only kinds with undetermined shares could explain more than a small share.
    """
    of_all, of_one = (
        {kind: one.ceiling for kind, one in kinds.items() if one.ceiling.determined()}
        for kinds in (common, single)
    )
    most_of_all, most_of_one = (
        max((c.closed for c in kinds.values()), default=0.0) for kinds in (of_all, of_one)
    )
    if max(most_of_all, most_of_one) < CLOSABLE_FROM:
        return "noise" if len(of_all) + len(of_one) == len(common) + len(single) else None
    among = of_all if most_of_all >= COMMON_FIRST * most_of_one else of_one
    best = max(among.values(), key=lambda one: one.closed)
    least = best.closed - max(CLOSES_ALIKE, best.std)
    return next(kind for kind, one in among.items() if one.closed >= least)


def _law(unexplained: Unexplained, kind: str, drop: float, similarity: Similarity) -> Law | None:
    """The formula of a kind in the measured campaign's units, if held-out data support one."""
    formula = choose(unexplained, kind, drop)
    proposal = None if formula is None else propose(unexplained.fit, formula, kind)
    if proposal is None:
        return None
    closed, std, _ = held_out_share(unexplained.fit, proposal.fit)
    return stated_law(proposal, similarity, closed, std)


def _others(kind: str, ceilings: tuple[Ceiling, ...]) -> tuple[tuple[str, ...], float | None]:
    """The other kinds that explain about as much as the chosen one, and the greatest share of the rest.

    A kind counts only if the chosen kind is not a special case of it, and if it is measured in the same way.
    """
    best = next((ceiling for ceiling in ceilings if ceiling.kind == kind), None)
    if best is None:
        return (), None
    included = (kind, INCLUDED_IN.get(kind))
    others = [
        ceiling
        for ceiling in ceilings
        if ceiling.determined() and ceiling.held_out == best.held_out and ceiling.kind not in included
    ]
    least = best.closed - max(NAMED_ALIKE, best.std)
    alike = tuple(ceiling.kind for ceiling in others if ceiling.closed >= least)
    return alike, max((ceiling.closed for ceiling in others), default=None)


def _own_line(line: SteadyLine, similarity: Similarity, chosen: RemainderSettings) -> Line:
    """The line in the measured campaign's units."""
    unit = similarity.reading
    return Line(
        frequency_hz=similarity.own(line.frequency, "Hz"),
        frequency_std_hz=similarity.own(line.frequency_std, "Hz"),
        amplitude=similarity.own(line.amplitude, unit),
        amplitude_std=similarity.own(line.amplitude_std, unit),
        unit=unit,
        false_alarm_rate=chosen.steady_line_rate,
    )


_POINTS, _MAP = 41, 13

_OVER: Mapping[str, tuple[str, ...]] = {
    "angle": ("angle",), "rate": ("rate",), "state": ("angle", "rate"), "wind": ("angle", "rate"),
    "time": ("time",), "reading": ("angle",),
}  # fmt: skip


def curve(unexplained: Unexplained, evidence: Evidence, similarity: Similarity) -> Curve | None:
    """The law of a kind without a formula, in the measured campaign's units; None where it has no common law.

    It is given for the median spring, and a law of the wind for the greatest wind speed; a moment in time is
    given at the greatest angle, without rate. The part absorbed by the model's own coefficients and its zero is
    removed.
    """
    kind = evidence.ceiling.kind
    if evidence.solution is None or kind not in _OVER:
        return None
    r = unexplained.ranges
    count = _MAP if len(_OVER[kind]) > 1 else _POINTS
    reach = {
        "angle": np.linspace(-r.angle, r.angle, count),
        "rate": np.linspace(-r.rate, r.rate, count),
        "time": np.linspace(0.0, r.time, count),
    }
    axes = [reach[name] for name in _OVER[kind]]
    grid = dict(zip(_OVER[kind], (g.ravel() for g in np.meshgrid(*axes, indexing="ij")), strict=True))
    size = next(iter(grid.values())).size
    still = {
        "angle": np.full(size, r.angle if kind == "time" else 0.0),
        "rate": np.zeros(size),
        "time": np.zeros(size),
    }
    at = Places(**{**still, **grid}, stiffness=r.stiffness, speed=r.speed if kind == "wind" else 0.0)
    basis, free = COMMON[kind](at, r), evidence.solution.normal.free
    line = np.column_stack([np.ones(size), *(grid[name] for name in _OVER[kind] if name != "time")])
    own = np.linalg.qr(line)[0]
    rows = basis - own @ (own.T @ basis)
    variance = np.einsum("ij,jk,ik->i", rows, evidence.solution.covariance[free:, free:], rows)
    values, std = rows @ evidence.solution.solution[free:], np.sqrt(np.maximum(variance, 0.0))
    unit = unexplained.fit.problem.data.model.moment_unit
    if kind in OF_READING:
        values, std, unit = values * r.angle, std * r.angle, "rad"

    def given(values: Array, unit: str) -> tuple[float, ...]:
        return tuple(float(f"{similarity.own(value, unit):.6g}") for value in values.tolist())

    units = {"angle": "rad", "rate": "rad/s", "time": "s"}
    places = tuple(given(reach[name], units[name]) for name in _OVER[kind])
    return Curve(_OVER[kind], places, given(values, unit), given(std, unit), unit)


def events(unexplained: Unexplained, kind: str, precision: float) -> Events:
    """The runs and times of a residual that differs from run to run, in the units of the fit.

    Args:
        unexplained: the residual.
        kind: of `diagnosis.likelihood.paths.SINGLE`.
        precision: one over the variance of a coefficient in the prior, in the basis' units.

    Returns:
        The times that contain most of a run's part.
    """
    drops, spans = [], []
    for unit, columns in zip(unexplained.runs, unexplained.columns(kind), strict=True):
        path = unit.path
        part = normal(unit.without_release(path.residual), unit.without_release(columns))
        solution = Ridge(part, precision).solution
        drops.append(max(part.power - part.cost(solution), 0.0))
        # the shortest interval of time with most of the energy
        energy = (SINGLE[kind](path, unexplained.ranges) @ solution) ** 2
        sums = np.concatenate([[0.0], np.cumsum(energy)])
        ends = np.minimum(np.searchsorted(sums, sums[:-1] + EVENT_SHARE * sums[-1]), sums.size)
        lengths = np.where(ends < sums.size, ends - np.arange(energy.size), energy.size + 1)
        first = int(np.argmin(lengths))
        time = path.time + path.run.start
        spans.append((float(time[first]), float(time[min(int(ends[first]), energy.size) - 1])))
    return _listed(unexplained, drops, max(sum(drops), 1e-300), spans)


def _listed(
    unexplained: Unexplained, drops: list[float], whole: float, spans: list[tuple[float, float]]
) -> Events:
    ranked = sorted(zip(unexplained.paths, drops, spans, strict=True), key=lambda one: -one[1])
    least = EVENTS_FROM * max(drops)
    return tuple(
        {"run": path.run.id, "share": drop / whole, "from_s": first, "to_s": last}
        for path, drop, (first, last) in ranked
        if drop > least
    )


_AROUND = 61  # number of frequencies for the median that is the floor beside a line
_MEDIAN = 2.0 * np.log(2.0)  # of χ² with two degrees of freedom
_NYQUIST = 0.45  # share of the sample rate: lines above may be images


@dataclass(frozen=True)
class SteadyLine:
    """A prominent line in the residuals of all runs together, in the units of the fit.

    Args:
        frequency_std: standard deviation of the frequency, Hz.
        amplitude: in the unit of the reading, root mean square over the runs.
        amplitude_std: standard deviation of the amplitude, in the same unit.
        events: the runs that show it, over their whole duration.
    """

    frequency: Hertz
    frequency_std: float
    amplitude: float
    amplitude_std: float
    evidence: Evidence
    events: Events


def steady_line(unexplained: Unexplained) -> SteadyLine | None:
    """The strongest line at one frequency in a fit's residual, away from the motion and its harmonics.

    None where chance may explain the line, at one joint rate for all frequencies, where it is the skirt of a
    broader feature, or where its phase changes within a run.
    """
    start, floor = _strongest(unexplained)
    if start is None:
        return None
    runs = [path.run for path in unexplained.paths]
    width = 1.0 / max(run.duration for run in runs)
    minimum = minimize_scalar(
        lambda f: -_drops(unexplained, f).sum(), bounds=(start - width, start + width), method="bounded"
    )
    frequency = float(minimum.x)
    # Share of the line in one half of a run that the other half predicts: 1 at constant phase and amplitude.
    # Chance lowers the prediction by 2 in every half, and raises the fit.
    predicted, fitted = 0.0, 0.0
    for path in unexplained.paths:
        waves, residual = _waves(path, frequency)
        first = np.arange(residual.size) < residual.size // 2
        ways = [np.linalg.lstsq(waves[own], residual[own], rcond=None)[0] for own in (first, ~first)]
        for own, mine, other in ((first, *ways), (~first, *ways[::-1])):
            before = float(residual[own] @ residual[own])
            predicted += before - float(np.sum((residual[own] - waves[own] @ other) ** 2)) + 2.0 * floor
            fitted += before - float(np.sum((residual[own] - waves[own] @ mine) ** 2)) - 2.0 * floor
    if predicted / max(fitted, 1e-300) < STEADY_LINE_HALVES:
        return None
    drops = _drops(unexplained, frequency)
    whole = float(drops.sum())
    # Cramér–Rao bounds of sinusoids of unknown phase, in the noise beside the line
    sharpness = float(drops @ np.array([run.duration**2 for run in runs]))
    frequency_std = float(np.sqrt(12.0 * floor / sharpness) / (2.0 * np.pi))
    noise = np.array([float(run.noise_at(frequency) / block_gain(frequency, run)) for run in runs])
    sizes = np.array([run.reading.size for run in runs])
    squares = 2.0 * np.maximum(drops - 2.0, 0.0) / sizes * noise**2  # chance adds two to the drop
    amplitude = float(np.sqrt(np.mean(squares)))
    # short gaps are predicted from the line around them, as for every kind that differs from run to run
    closed, excesses = [], []
    for path in unexplained.paths:
        waves, residual = _waves(path, frequency)
        turn, after = gaps(residual.size, path.group), 0.0
        for out in (turn == t for t in np.unique(turn)):
            size = np.linalg.lstsq(waves[~out], residual[~out], rcond=None)[0]
            after += float(np.sum((residual[out] - waves[out] @ size) ** 2))
        power = float(residual @ residual)
        closed.append(power - after)
        excesses.append(power - residual.size)
    ceiling = Ceiling("line", *ratio(np.array(closed), np.array(excesses)), GAPS)
    times = [path.time + path.run.start for path in unexplained.paths]
    spans = [(float(time[0]), float(time[-1])) for time in times]
    return SteadyLine(
        frequency,
        frequency_std,
        amplitude,
        amplitude * float(np.sqrt(floor / whole)),
        Evidence(ceiling, sum(closed), 0.0),
        _listed(unexplained, drops.tolist(), whole, spans),
    )


def _strongest(unexplained: Unexplained) -> tuple[float | None, float]:
    """Frequency of the most significant line, Hz, and the power beside it over the noise's."""
    from scipy.ndimage import median_filter  # imported here because it is slow to load

    spectra = smooth_spectra(unexplained.fit)
    longest = max(spectra, key=lambda one: one.duration)
    top = _NYQUIST / max(path.run.interval for path in unexplained.paths)
    grid = longest.frequency[(longest.frequency > 0.0) & (longest.frequency < top)]
    power, count, floors = np.zeros(grid.size), np.zeros(grid.size), np.zeros(grid.size)
    for index, spectrum in enumerate(spectra):
        # the floor is the median power around each frequency over white noise's, at least 1
        step = max(1, round(1.0 / (spectrum.duration * spectrum.frequency[1])))  # the padding
        frequency = spectrum.frequency[::step]
        around = median_filter(spectrum.power(frequency), _AROUND, mode="nearest")
        floor = np.interp(grid, frequency, np.maximum(around / _MEDIAN, 1.0))
        seen = away_from_motion(grid / resonance(unexplained.fit, index))
        power += np.where(seen, spectrum.power(grid) / floor, 0.0)
        count += seen
        floors += np.where(seen, floor, 0.0)
    with np.errstate(divide="ignore"):
        chance = np.where(count > 0, np.log(chdtrc(2.0 * np.maximum(count, 1.0), power)), 0.0)
    best = int(np.argmin(chance))
    chosen = unexplained.fit.settings.remainder
    clear = power[best] >= STEADY_LINE_CONTRAST * 2.0 * count[best]
    if not clear or chance[best] + np.log(grid.size) > np.log(chosen.steady_line_rate):
        return None, 1.0
    return float(grid[best]), float(floors[best] / count[best])


def _waves(path: Path, frequency: float) -> tuple[Array, Array]:
    """Sine and cosine at the residuals' times, shape (n, 2), and the residuals, shape (n,)."""
    phase = 2.0 * np.pi * frequency * path.time
    return np.column_stack([np.sin(phase), np.cos(phase)]), path.fit.residuals[path.index]


def _drops(unexplained: Unexplained, frequency: float) -> Array:
    """Drop of χ² when the line is removed, by run, shape (runs,)."""
    found = []
    for path in unexplained.paths:
        waves, residual = _waves(path, frequency)
        seen = waves.T @ residual
        found.append(float(seen @ np.linalg.solve(waves.T @ waves, seen)))
    return np.array(found)
