"""A random moment on the rig: its likelihood from a steady Kalman filter.

Turbulence, and vibration of the surroundings, are broad or about one frequency; vortex shedding with a wandering
phase is about a frequency that follows the wind. Two moments at once are one spectrum with two parts. Åström,
Introduction to Stochastic Control Theory (1970); Maine & Iliff, NASA RP-1077 (1981), filter error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.model.data import Data
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import NoiseWithMoment
from diagnosis.search.random_spectra import (
    BROAD,
    CENTRED,
    LONGEST_BANDWIDTH,
    STREAM,
    SURROUNDINGS,
    MomentSource,
    Spectrum,
    SpectrumForm,
    SpectrumPart,
    of_floor,
    of_surroundings,
    wandering,
)
from diagnosis.search.weights import FittedSet
from diagnosis.settings import RandomMomentSettings
from identification.signal.filter import discretised, steady_filters
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.caching import cached_while_in_use
from tunnel_sim.vocabulary.record import Array

PART_STDS: Final = 2.0
"""Margin of that drop over the minimum, in its scatter between runs, in standard deviations. Convention."""

_INTERVAL = 0.012  # s between the residuals the filter sees: well above the rig's frequencies
_SETTLE = 1.0  # s left out at the start: the transient of the filter
_FEWEST = 16  # residuals of a run: two in each band in which they are compared with white noise
_OF_NOISE = (0.3, 3.0, 30.0, 300.0)  # noise of first order in the reading tried, over its white noise
_RINGS_AT = 3  # strongest frequencies of the residual at which a sensor may ring
_RINGS_FOR = (0.003, 0.01, 0.03, 0.1, 0.3)  # its damping ratios tried
_UNSTEADY = np.linspace(-1.5, 1.5, 7) * np.log(2.0)  # logarithms of intensities over the fitted one
_EVALUATIONS = 60  # of the likelihood beyond the starting grid


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """A fitted random moment.

    Args:
        spectrum: the fitted spectrum, of one part or two.
        runs: ids of the runs in which it acts.
        drops: drop of −2 ln L against white measurement noise alone, by such run, shape (runs,), dimensionless.
        by_run: the drop of each such run over the predicted power of its response, in noise variances, shape
            (runs,), dimensionless; at least 0.
        cost: −2 ln L without constants, of all runs, dimensionless.
        excess: mean squared scaled innovation minus one, dimensionless.
        innovations: scaled innovations, by run in which it acts.
        interval: time between innovations, s.
        intensities: most likely intensity in each third of the runs over the fitted one, shape (3,), dimensionless.
        unsteady_drop: further drop of −2 ln L with these intensities, dimensionless.
    """

    spectrum: Spectrum
    runs: tuple[str, ...]
    drops: Array
    by_run: Array
    cost: float
    excess: float
    innovations: list[Array]
    interval: float
    intensities: Array
    unsteady_drop: float

    @property
    def drop(self) -> float:
        """Drop of −2 ln L of all runs, dimensionless."""
        return float(self.drops.sum())

    def price(self, of_part: float) -> float:
        """Price of −2 ln L beyond one part without a centre, ``of_part`` for each further one; dimensionless."""
        centres = sum(part.centre > 0.0 for part in self.spectrum)
        return of_part * (centres + len(self.spectrum) - 1)


@dataclass(frozen=True, eq=False)
class MomentLayer:
    """A random moment: a layer of noise under the effects of a set, and itself a cause.

    Args:
        kinds: the effects that its spectrum's parts are.
        process: the moment as fitted.
        left: the set with it, as input of the weighing. Its share is the excess of the innovations and of the other
            runs over the nominal excess, the same in every channel.
    """

    kinds: tuple[type[Effect], ...]
    process: ProcessNoise
    left: FittedSet


@dataclass(frozen=True, eq=False)
class _Channel:
    """One run for the filter."""

    run: RunData
    data: Data
    residual: Array  # rad
    variance: float  # rad2, of one residual
    interval: float
    oscillator: Array  # (2, 2): angle, rate
    per_moment: float  # over the inertia and the gain of the filter that the residual has passed, 1/(kg m²)
    reduced: float  # V/width, Hz

    @property
    def white_cost(self) -> float:
        """−2 ln L without constants of white noise alone."""
        kept = self.residual[_skip(self) :] / np.sqrt(self.variance)
        return float(kept.size * np.log(self.variance) + kept @ kept)

    def acceleration(self, source: MomentSource) -> float:
        """Acceleration per unit intensity of a source's moment, rad/s²; 0 where it does not act."""
        return self.per_moment * source.moment(self.run, self.data) if source.acts(self.run) else 0.0


@cached_while_in_use
def random_moments(fit: Fit, source: MomentSource) -> list[ProcessNoise]:
    """The random moments of a source that may explain the residuals of a fit; its tests ask for them again.

    Returns:
        The best fit of each form, and of the likeliest with a second part where that pays; empty where it acts in
        no run, or the model is not stable. Two parts of one kind may fit a spectrum that is not of first order.
    """
    channels, narrow, chosen = _channels(fit), wandering(fit.problem.data), fit.settings.moment
    if not channels:
        return []
    stream = (BROAD, CENTRED) if narrow is None else (BROAD, CENTRED, narrow)
    own_forms = stream if source is STREAM else of_surroundings(_unit(channels))
    found = {form: one for form in own_forms if (one := _fit(channels, (form,))) is not None}
    if source is SURROUNDINGS and own_forms[1] in found:
        floor = of_floor(found[own_forms[1]].spectrum[0], _unit(channels))
        if (shaken := _fit(channels, (floor,))) is not None:
            found[floor] = shaken
    first = likeliest(found.values(), chosen)
    if first is None:
        return list(found.values())
    (own,) = (form for form in found if found[form] is first)
    beside = own_forms if source is STREAM else (*own_forms, *stream)
    both = [_fit(channels, (own, other), first, chosen.part_price) for other in beside]
    paying = (one for one in both if one is not None and _pays_in_all_runs(one, first, chosen))
    return [*found.values(), *paying]


def _pays_in_all_runs(both: ProcessNoise, first: ProcessNoise, chosen: RandomMomentSettings) -> bool:
    """Whether a second part lowers −2 ln L by more than chance, for any selection of runs.

    It acts in all runs, while a model error acts in the runs of one spring or speed. The scatter between the runs
    shows how much of the drop may be chance.
    """
    alone = dict(zip(first.runs, first.drops.tolist(), strict=True))
    gains = both.drops - np.array([alone.get(run, 0.0) for run in both.runs])
    if gains.size < 2:
        return False
    std = float(np.std(gains, ddof=1)) * np.sqrt(gains.size)
    return bool(gains.sum() - PART_STDS * std > chosen.part_price)


def acts_by(drop: float, chosen: RandomMomentSettings) -> bool:
    """Whether a drop of −2 ln L shows a random moment.

    Args:
        drop: drop of −2 ln L, dimensionless.
    """
    return drop > chosen.acts_from


def likeliest(tried: Iterable[ProcessNoise], chosen: RandomMomentSettings) -> ProcessNoise | None:
    """The random moment that explains residuals best; None where white noise explains them as well."""
    acting = [one for one in tried if acts_by(one.drop, chosen)]
    return min(acting, key=lambda one: one.cost + one.price(chosen.part_price), default=None)


def _fit(
    channels: Sequence[_Channel],
    forms: Sequence[SpectrumForm],
    known: ProcessNoise | None = None,
    price: float = 0.0,
) -> ProcessNoise | None:
    """The most likely spectrum of these parts.

    Args:
        known: the fit without the last part; the fit starts there.
        price: least drop of −2 ln L by the last part, dimensionless.

    Returns:
        None where they act in no run, or where no point of the last part's grid pays.
    """
    every_run, channels = channels, [c for c in channels if any(form.source.acts(c.run) for form in forms)]
    if not channels:
        return None
    ends = np.cumsum([len(form.bounds) for form in forms])[:-1]

    def spectrum(x: Array) -> Spectrum:
        split = np.split(np.exp(x), ends)
        return tuple(form.part(*own.tolist()) for form, own in zip(forms, split, strict=True))

    def cost(x: Array) -> float:
        return sum(c for c, _ in _filtered(channels, [spectrum(x)]))

    grid = np.log(forms[-1].grid)
    if known is not None:
        fixed = np.log([value for part in known.spectrum for value in part.parameters])
        grid = np.hstack([np.tile(fixed, (len(grid), 1)), grid])
    tried = _filtered(channels, [spectrum(x) for x in grid])
    costs = np.array([c for c, _ in tried]).reshape(len(grid), -1)
    totals = costs.sum(axis=1)
    if known is not None and not totals.min() < sum(c.white_cost for c in channels) - known.drop - price:
        return None
    start = grid[int(np.argmin(totals))]
    low, high = np.log([bound for form in forms for bound in form.bounds]).T
    steps = np.array([step for form in forms for step in form.steps])
    inward = np.where(start + steps > high, -steps, steps)  # a simplex on a bound would never leave it
    simplex = np.vstack([start, start + np.diag(inward)])
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={
            "maxfev": _EVALUATIONS * len(start) // 2,
            "xatol": 0.02,
            "fatol": 0.5,
            "initial_simplex": np.clip(simplex, low, high),
        },
    )
    still = sum(c.white_cost for c in every_run if c not in channels)
    return _fitted(channels, spectrum(found.x), float(found.fun) + still)


def _fitted(channels: Sequence[_Channel], spectrum: Spectrum, cost: float) -> ProcessNoise:
    costs, innovations = zip(*_filtered(channels, [spectrum]), strict=True)
    count = sum(i.size for i in innovations)
    drops = np.array([c.white_cost for c in channels]) - np.array(costs)
    broad = tuple(SpectrumPart(part.intensity, LONGEST_BANDWIDTH, source=part.source) for part in spectrum)
    return ProcessNoise(
        spectrum,
        tuple(c.run.id for c in channels),
        drops,
        np.maximum(drops, 0.0) / _powers(channels, broad),
        cost,
        sum(float(i @ i) for i in innovations) / count - 1.0,
        list(innovations),
        channels[0].interval,
        *_by_third(channels, spectrum),
    )


def _by_third(channels: Sequence[_Channel], spectrum: Spectrum) -> tuple[Array, float]:
    """The most likely intensity in each third of the runs, over the fitted one, and the drop of −2 ln L by them."""
    costs = np.zeros((_UNSTEADY.size, 3))
    for row, factor in zip(costs, np.exp(_UNSTEADY).tolist(), strict=True):
        other = tuple(replace(part, intensity=factor * part.intensity) for part in spectrum)
        for cost, scaled in _filtered(channels, [other]):
            if not np.isfinite(cost):
                return np.ones(3), 0.0
            log_spread = (cost - scaled @ scaled) / scaled.size
            row += [part.size * log_spread + part @ part for part in np.array_split(scaled, 3)]
    place = np.clip(np.argmin(costs, axis=0), 1, _UNSTEADY.size - 2)
    below, at, above = (costs[place + step, range(3)] for step in (-1, 0, 1))
    turn = np.clip((below - above) / np.maximum(2.0 * (below - 2.0 * at + above), 1e-12), -1.0, 1.0)
    least = at - 0.25 * turn * (below - above)  # of the parabola through three intensities
    step = _UNSTEADY[1] - _UNSTEADY[0]
    drop = float(costs[_UNSTEADY.size // 2].sum() - least.sum())
    return np.exp(_UNSTEADY[place] + turn * step), drop


def _powers(channels: Sequence[_Channel], spectrum: Spectrum) -> Array:
    """Power of the response at the end of each run, from rest, in noise variances."""
    power = []
    for channel, a, q in zip(channels, *_discrete(channels, [spectrum]), strict=True):
        for _ in range(int(np.log2(channel.residual.size))):
            a, q = a @ a, q + a @ q @ a.T
        power.append(q[0, 0] / channel.variance)
    return np.array(power)


def _unit(channels: Sequence[_Channel]) -> float:
    """The surroundings' moment whose response equals the noise in the median run, N m."""
    one = (SpectrumPart(1.0, LONGEST_BANDWIDTH, source=SURROUNDINGS),)
    return 1.0 / float(np.sqrt(np.median(_powers(channels, one))))


def is_of_reading(fit: Fit, process: ProcessNoise) -> bool:
    """Whether noise of the reading explains the runs better than a random moment does.

    A wandering zero, and coloured noise of the sensor, are of first order in the reading itself. A sensor that
    rings is of second order, at a frequency of its own. A random moment shows through the motion that it drives:
    its spectrum has a peak at the natural frequency of every run.
    """
    channels = [c for c in _channels(fit) if c.run.id in process.runs]
    noise = float(np.sqrt(np.median([c.variance for c in channels])))
    wanders = [(r * noise, b) for r in _OF_NOISE for b in (0.01, 0.1, 1.0, LONGEST_BANDWIDTH)]
    swing = float(np.sqrt(np.median([np.mean(c.residual**2) for c in channels])))
    rings = [(swing, z, f) for z in _RINGS_FOR for f in _strongest(channels)]
    return any(
        _reading_drop(channels, system, grid) > process.drop
        for system, grid in ((_wandering_zero, wanders), (_ringing_sensor, rings))
    )


def _strongest(channels: Sequence[_Channel]) -> list[float]:
    """The strongest angular frequencies of the residuals of all runs, rad/s, each apart from the others."""
    grid = np.geomspace(
        1.0 / min(c.residual.size * c.interval for c in channels),
        0.4 / max(c.interval for c in channels),
        400,
    )
    power = np.zeros(grid.size)
    for channel in channels:
        spectrum = (
            np.abs(np.fft.rfft(channel.residual, 4 * channel.residual.size)) ** 2 / channel.residual.size
        )
        power += np.interp(grid, np.fft.rfftfreq(4 * channel.residual.size, channel.interval), spectrum)
    found = list[float]()
    for _ in range(_RINGS_AT):
        best = float(grid[int(np.argmax(power))])
        found.append(2.0 * np.pi * best)
        power[np.abs(grid / best - 1.0) < 0.05] = 0.0
    return found


def _wandering_zero(std: float, bandwidth: float) -> tuple[Array, Array]:
    """Dynamics and drive of noise of first order; std in rad, bandwidth in Hz."""
    corner = 2.0 * np.pi * bandwidth
    return np.array([[-corner]]), np.array([[2.0 * corner * std**2]])


def _ringing_sensor(std: float, damping_ratio: float, omega: float) -> tuple[Array, Array]:
    """Dynamics and drive of noise of second order; std in rad, omega in rad/s."""
    dynamics = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping_ratio * omega]])
    return dynamics, np.diag([0.0, 4.0 * damping_ratio * omega**3 * std**2])


def _reading_drop(
    channels: Sequence[_Channel],
    system: Callable[..., tuple[Array, Array]],
    grid: Sequence[tuple[float, ...]],
) -> float:
    """Drop of −2 ln L by noise of the reading, from linear dynamics of positive parameters."""
    from scipy.signal import lfilter  # only here: slow to load

    interval, variance = (np.array([getattr(c, name) for c in channels]) for name in ("interval", "variance"))

    def cost(x: Array) -> float:
        dynamics, drive = (np.stack([one] * len(channels)) for one in system(*np.exp(x).tolist()))
        filters = steady_filters(*discretised(dynamics, drive, interval), variance)
        return sum(
            _cost(lfilter(numerator, denominator, c.residual)[_skip(c) :], spread)
            if 0.0 < spread < np.inf
            else np.inf
            for c, (numerator, denominator, spread) in zip(channels, filters, strict=True)
        )

    points = np.log(grid)
    start = points[int(np.argmin([cost(x) for x in points]))]
    steps = np.diag([0.5, 0.5, 0.02][: len(start)])
    simplex = np.vstack([start, start + steps])
    found = minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={"maxfev": _EVALUATIONS * len(start) // 2, "fatol": 0.5, "initial_simplex": simplex},
    )
    return sum(c.white_cost for c in channels) - float(found.fun)


def with_response(fit: Fit, spectrum: Spectrum) -> Data | None:
    """The runs of a fit, with the response to a random moment added to their noise.

    Args:
        spectrum: spectrum of the moment.

    Returns:
        The data, scaled as the innovations of the steady filter; None where it acts in no run, or the filter does
        not settle.
    """
    runs = list(fit.problem.data.runs)
    acts = [i for i, run in enumerate(runs) if any(part.source.acts(run) for part in spectrum)]
    channels = {i: c for i in acts if (c := _channel(fit, i, 0.0)) is not None}
    if not channels:
        return None
    filters = _filters(list(channels.values()), [spectrum])
    for (i, channel), (numerator, denominator, spread) in zip(channels.items(), filters, strict=True):
        if not (np.isfinite(spread) and spread > 0.0):
            return None
        before = runs[i].noise
        noise = NoiseWithMoment(before.variance * spread / channel.variance, before, numerator, denominator)
        runs[i] = replace(runs[i], noise=noise)
    return fit.problem.data.with_runs(tuple(runs))


def _channels(fit: Fit) -> list[_Channel]:
    return [c for i in range(len(fit.residuals)) if (c := _channel(fit, i)) is not None]


def _channel(fit: Fit, run_index: int, least_interval: float = _INTERVAL) -> _Channel | None:
    run = fit.problem.data.runs[run_index]
    if run.derivative:  # the filter's reading is an angle
        return None
    inertia, damping, stiffness = linear_coefficients(fit, run_index)
    if stiffness <= 0.0 or damping <= 0.0:
        return None
    group = max(1, round(least_interval / run.interval))
    count = run.reading.size // group
    if count < _FEWEST:
        return None
    scale = run.noise.scale
    residual = (fit.residuals[run_index][: count * group] * scale).reshape(count, group).mean(axis=1)
    # residuals are white: the rig's response, a narrow band, has passed through the same filter
    passed = scale / float(run.noise_at(resonance(fit, run_index)))
    data = fit.problem.data
    oscillator = np.array([[0.0, 1.0], [-stiffness / inertia, -damping / inertia]])
    reduced = run.wind_speed / data.width if data.width > 0.0 else 0.0
    interval = group * run.interval
    variance = run.noise.variance / group
    return _Channel(run, data, residual, variance, interval, oscillator, passed / inertia, reduced)


def _skip(channel: _Channel) -> int:
    return min(channel.residual.size // 4, round(_SETTLE / channel.interval))


def _filtered(channels: Sequence[_Channel], spectra: Sequence[Spectrum]) -> list[tuple[float, Array]]:
    """−2 ln L (without constants) and scaled innovations of the steady filter, by spectrum and run."""
    from scipy.signal import lfilter  # only here: slow to load

    results = []
    every = [channel for _ in spectra for channel in channels]
    for channel, (numerator, denominator, spread) in zip(every, _filters(channels, spectra), strict=True):
        if not (np.isfinite(spread) and spread > 0.0):
            results.append((np.inf, np.zeros(0)))
            continue
        innovations = lfilter(numerator, denominator, channel.residual)[_skip(channel) :]
        results.append((_cost(innovations, spread), innovations / np.sqrt(spread)))
    return results


def _cost(innovations: Array, spread: float) -> float:
    """−2 ln L of innovations of a variance, without constants."""
    return float(innovations.size * np.log(spread) + innovations @ innovations / spread)


def _filters(channels: Sequence[_Channel], spectra: Sequence[Spectrum]) -> list[tuple[Array, Array, float]]:
    """The filter from residuals to innovations, numerator and denominator, and their variance, rad².

    By spectrum and run.
    """
    transition, disturbance = _discrete(channels, spectra)
    variance = np.array([c.variance for c in channels] * len(spectra))
    return steady_filters(transition, disturbance, variance)


def _discrete(channels: Sequence[_Channel], spectra: Sequence[Spectrum]) -> tuple[Array, Array]:
    """Transition and disturbance over one interval, shape (spectra · runs, n, n); all spectra are of the same form.

    States: angle, rate, and the states of each part.
    """
    size = 2 + sum(part.states for part in spectra[0])
    dynamics = np.zeros((len(spectra), len(channels), size, size))
    drive = np.zeros_like(dynamics)
    dynamics[..., :2, :2] = np.array([channel.oscillator for channel in channels])
    reduced = np.array([channel.reduced for channel in channels])
    sources = {part.source for part in spectra[0]}
    moved = {source: np.array([channel.acceleration(source) for channel in channels]) for source in sources}
    for own, noise, spectrum in zip(dynamics, drive, spectra, strict=True):
        first = 2
        for part in spectrum:
            last = first + part.states
            driven = np.array([1, *range(first, last)])
            own[:, first:last, first:last], own[:, 1, first:last], white = part.dynamics(
                moved[part.source], reduced
            )
            noise[:, driven[:, None], driven] += white
            first = last
    interval = np.array([channel.interval for channel in channels] * len(spectra))
    systems = (-1, size, size)
    transition, disturbance = discretised(dynamics.reshape(systems), drive.reshape(systems), interval)
    return transition, disturbance + 1e-18 * np.eye(size)
