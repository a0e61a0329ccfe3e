"""Computing the maps of a campaign's residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import resonance
from diagnosis.model.run_data import RunData
from diagnosis.where.along_motion import amplitude_about_rest, apparent_moment, backbones, phase_plane
from diagnosis.where.excess import (
    Profile,
    RunExcess,
    band_excesses,
    bands_beyond_chance,
    profile,
    residual_lines,
    run_excesses,
    within_bands,
)
from diagnosis.where.maps import (
    AmplitudeExcess,
    ExcessMap,
    ExcessSpectrum,
    GroupExcess,
    Maps,
    RunMap,
    RunTrace,
    TimeExcess,
)
from tunnel_sim.vocabulary.campaign import Campaign, speed_groups
from tunnel_sim.vocabulary.record import Array

_TIME_BINS = 60
_AMPLITUDE_BINS = 40
_FREQUENCY_BINS = 110  # number of bins of equal ratio, for the picture
_FINE_BINS = 1500  # number of bins of equal width, for the interval
_GRID_ROWS, _GRID_COLUMNS = 6, 8
_TRACE_POINTS = 20_000  # number of points of all runs together
_LEAST_POINTS = 200  # minimum number of points of a run
_CYCLE_POINTS = 24  # number of points in a cycle
_SHOWN_CYCLES = 6  # number of cycles in which the models differ most


@dataclass(frozen=True, eq=False)
class Survey:
    """Maps, and further figures for their text.

    Args:
        time_interval: shortest interval of time with most of the excess, s; None where there is no excess.
        amplitude_interval: shortest interval of amplitude with most of the excess, rad.
        frequency_interval: shortest interval of frequency with most of the excess, Hz.
        moment_energy: energy of the apparent moment beyond noise, by bin of time, shape (n,), in variances.
        moment_z: the sum of this energy over its standard deviation under white noise, a ratio.
    """

    maps: Maps
    excesses: list[RunExcess]
    time_interval: tuple[float, float] | None
    amplitude_interval: tuple[float, float] | None
    frequency_interval: tuple[float, float] | None
    moment_energy: Array
    moment_z: float


@dataclass(frozen=True, eq=False)
class _Samples:
    """Squared residuals by run, and their places.

    The misfit of a model is the same in a block mean as in its samples; the noise variance of the mean is
    smaller by the block's size. Powers are therefore shares of the variance of one sample.
    """

    time: list[Array]  # time since the start of the record, s
    amplitude: list[Array]  # amplitude, rad
    power: list[Array]
    expected: list[float]  # mean of the power under noise
    variance: list[float]  # variance of the power under noise

    @classmethod
    def of(cls, nominal: Fit, scaled: Fit, excesses: list[RunExcess], beyond: tuple[str, ...]) -> _Samples:
        """The residuals of a fit in the bands that show the gap."""
        runs = nominal.problem.data.runs
        inside = [within_bands(r, run, beyond) for r, run in zip(scaled.residuals, excesses, strict=True)]
        return cls(
            [_times(nominal, i) for i in range(len(runs))],
            [amplitude_about_rest(scaled, i) for i in range(len(runs))],
            [r**2 / run.block for (r, _), run in zip(inside, runs, strict=True)],
            [share / run.block for (_, share), run in zip(inside, runs, strict=True)],
            # squares of filtered noise are correlated: the number of independent ones is the number of passed
            # coefficients
            [2.0 * share / run.block**2 for (_, share), run in zip(inside, runs, strict=True)],
        )

    def over(self, edges: Array, place: list[Array]) -> Profile:
        return profile(edges, place, self.power, self.expected, self.variance)


def survey(nominal: Fit, scaled: Fit, excesses: list[RunExcess], chosen: tuple[str, ...]) -> Survey:
    """Draw up all maps of the nominal model's residuals.

    Args:
        scaled: the nominal fit with residuals in units of the reference noise.
        excesses: squared residuals of the fit, by run.
        chosen: ids of the runs for the phase plane; all if empty.

    Returns:
        Maps and interval in the measured rig's units.
    """
    runs, similarity = nominal.problem.data.runs, nominal.problem.data.similarity
    bands = band_excesses(excesses)
    settings = nominal.settings.where
    beyond = bands_beyond_chance(bands, settings)
    samples = _Samples.of(nominal, scaled, excesses, beyond)
    longest = max(float(time[-1] + 0.5 * (time[1] - time[0])) for time in samples.time)
    instants = np.linspace(0.0, longest, _TIME_BINS + 1)
    widest = 1.0001 * max(float(a.max()) for a in samples.amplitude)
    energy, z = _moment_energy(nominal, samples.time, instants)
    edges = _log_edges(excesses)
    resonances = [run.resonance for run in excesses]
    by_run = [
        profile(instants, [time], [left**2 / run.block], [1.0 / run.block], [2.0 / run.block**2]).mean
        for run, time, left in zip(runs, samples.time, scaled.residuals, strict=True)
    ]
    starts = [float(amplitude[0]) for amplitude in samples.amplitude]
    seconds, hertz, radians = (similarity.own(1.0, unit) for unit in ("s", "Hz", "rad"))
    over_time = replace(samples.over(instants, samples.time), edges=instants * seconds)
    swings = samples.over(np.linspace(0.0, widest, _AMPLITUDE_BINS + 1), samples.amplitude)
    swings = replace(swings, edges=swings.edges * radians)
    spectrum = _spectrum(excesses, edges)
    maps = Maps(
        runs=_run_maps(scaled, excesses, starts),
        groups=_groups(scaled, excesses, starts),
        time=TimeExcess(
            edges_s=over_time.edges,
            excess=over_time.mean,
            std=over_time.std,
            by_run=np.stack(by_run),
            moment_share=np.maximum(energy, 0.0) / max(float(np.maximum(energy, 0.0).sum()), 1e-300),
        ),
        amplitude=AmplitudeExcess(swings.edges, swings.mean, swings.std),
        frequency=ExcessSpectrum(
            edges_hz=edges * hertz,
            excess=spectrum.mean,
            std=spectrum.std,
            after=None,
            by_run=np.stack([_spectrum([run], edges).mean for run in excesses]),
            resonance_hz=(similarity.own(min(resonances), "Hz"), similarity.own(max(resonances), "Hz")),
        ),
        bands=bands,
        lines=tuple(
            replace(
                line,
                frequency_hz=similarity.own(line.frequency_hz, "Hz"),
                amplitude_rad=similarity.own(line.amplitude_rad, similarity.reading),
            )
            for line in residual_lines(excesses, runs, settings)
        ),
        backbones=tuple(backbones(nominal)),
        phase_plane=phase_plane(nominal, chosen),
        grid=_grid(samples, runs, np.linspace(0.0, widest, _GRID_ROWS + 1), (radians, seconds)),
        unit=similarity.reading,
        traces=_traces(nominal, None, excesses),
    )
    share = settings.interval_share
    return Survey(
        maps,
        excesses,
        over_time.interval(share),
        swings.interval(share),
        _frequency_interval(nominal, excesses, beyond),
        energy,
        z,
    )


def _moment_energy(nominal: Fit, times: Sequence[Array], instants: Array) -> tuple[Array, float]:
    """Energy of the apparent moment by time, in variances of its noise, and its sum over the scatter by chance.

    Args:
        times: times of the residuals, by run, shape (n,), s.
        instants: edges of the bins, shape (m + 1,), s.
    """
    energy, variance = np.zeros(instants.size - 1), 0.0
    for index, whole in enumerate(times):
        apparent = apparent_moment(nominal, index)
        if apparent is None:
            continue
        spread = float(apparent.kernel @ apparent.kernel) * apparent.noise_std**2
        time = whole[apparent.start : apparent.start + apparent.moment.size]
        energy += np.histogram(time, instants, weights=apparent.moment**2 / spread - 1.0)[0]
        # neighbours within the kernel are correlated
        variance += 2.0 * apparent.moment.size * apparent.kernel.size
    return energy, float(energy.sum()) / float(np.sqrt(max(variance, 1.0)))


def _frequency_interval(
    nominal: Fit, excesses: list[RunExcess], beyond: tuple[str, ...]
) -> tuple[float, float] | None:
    """The shortest interval of frequency with most of the excess of the bands that show the gap, Hz."""
    kept = [replace(run, power=np.where(run.inside(beyond), run.power, 1.0)) for run in excesses]
    high = max(float(run.frequency[-1]) for run in excesses)
    # no bin is narrower than the resolution of the shortest record
    resolved = max(float(run.frequency[1]) for run in excesses)
    fine = np.linspace(0.0, high * 1.0001, max(2, min(_FINE_BINS, int(high / resolved))) + 1)
    interval = _spectrum(kept, fine).interval(nominal.settings.where.interval_share)
    own = nominal.problem.data.similarity.own
    return None if interval is None else (own(interval[0], "Hz"), own(interval[1], "Hz"))


def with_answer(found: Survey, campaign: Campaign, nominal: Fit, answer: Fit) -> Maps:
    """The maps with the residuals of a fit with the causes added to the nominal model's."""
    after = _spectrum(run_excesses(campaign, answer), _log_edges(found.excesses)).mean
    return replace(
        found.maps,
        frequency=replace(found.maps.frequency, after=after),
        traces=_traces(nominal, answer, found.excesses),
    )


def _run_maps(fit: Fit, excesses: list[RunExcess], starts: list[float]) -> tuple[RunMap, ...]:
    own = fit.problem.data.similarity.own
    energy = [max(float(run.power.sum()) - run.power.size, 0.0) for run in excesses]
    whole = max(sum(energy), 1e-300)
    return tuple(
        RunMap(
            id=run.id,
            spring_stiffness=None if run.spring_stiffness is None else own(run.spring_stiffness, "N m/rad"),
            wind_speed=run.wind_speed,
            amplitude_rad=own(start, "rad"),
            frequency_hz=own(excess.resonance, "Hz"),
            excess=excess.excess / run.block,
            std=excess.std / run.block,
            p_value=excess.p_value(),
            share=part / whole,
        )
        for run, excess, start, part in zip(fit.problem.data.runs, excesses, starts, energy, strict=True)
    )


def _groups(fit: Fit, excesses: list[RunExcess], starts: list[float]) -> tuple[GroupExcess, ...]:
    """Mean excess of the runs that share a condition; conditions that do not vary are left out."""
    runs, similarity = fit.problem.data.runs, fit.problem.data.similarity
    levels = [(e.excess / run.block, e.std / run.block) for e, run in zip(excesses, runs, strict=True)]
    speeds = speed_groups(run.wind_speed for run in runs)
    places = 2 + max(math.ceil(math.log10(similarity.angle)), 0)
    keys = {
        "wind": ["on" if run.wind_on else "off" for run in runs],
        "spring": [
            ""
            if run.spring_stiffness is None
            else f"{similarity.own(run.spring_stiffness, 'N m/rad'):g} N m/rad"
            for run in runs
        ],
        "speed": [f"{speeds[run.wind_speed]:g} m/s" for run in runs],
        "amplitude": [
            f"{similarity.own(0.05 * round(start / 0.05), 'rad'):.{places}f} rad" for start in starts
        ],
    }

    def first_number(label: str) -> tuple[float, str]:
        head = label.split(" ")[0]
        return (float(head) if head.replace(".", "", 1).isdigit() else 0.0, label)

    result = []
    for by, labels in keys.items():
        distinct = sorted(set(labels), key=first_number)
        if len(distinct) < 2:
            continue
        for label in distinct:
            group = [pair for pair, own in zip(levels, labels, strict=True) if own == label]
            mean = float(np.mean([e for e, _ in group]))
            std = float(np.sqrt(np.sum([s**2 for _, s in group]))) / len(group)
            result.append(GroupExcess(by, label, len(group), mean, std))
    return tuple(result)


def _times(fit: Fit, index: int) -> Array:
    """Times of a run's residuals since the start of its record, s."""
    run = fit.problem.data.runs[index]
    return run.start + (np.arange(run.reading.size, dtype=np.float64) + 0.5) * run.interval


def _grid(samples: _Samples, runs: Sequence[RunData], rows: Array, units: tuple[float, float]) -> ExcessMap:
    """Excess by amplitude and wind speed; by amplitude and time where the runs have one speed.

    Args:
        units: radian and second of the similar rig in the measured rig's.
    """
    setting = speed_groups(run.wind_speed for run in runs)
    speeds = sorted(set(setting.values()))
    shared = len(speeds) == 1
    longest = max(float(time[-1]) for time in samples.time)
    edges = np.linspace(0.0, 1.0001 * longest, _GRID_COLUMNS + 1)
    places = [
        np.digitize(time, edges) - 1 if shared else np.full(time.size, speeds.index(setting[run.wind_speed]))
        for run, time in zip(runs, samples.time, strict=True)
    ]
    columns = []
    for column in range(_GRID_COLUMNS if shared else len(speeds)):
        kept = [place == column for place in places]
        amplitude = [a[keep] for a, keep in zip(samples.amplitude, kept, strict=True)]
        power = [p[keep] for p, keep in zip(samples.power, kept, strict=True)]
        columns.append(replace(samples, power=power).over(rows, amplitude))
    return ExcessMap(
        rows * units[0],
        None if shared else np.array(speeds),
        edges * units[1] if shared else None,
        np.stack([column.mean for column in columns], axis=1),
        np.stack([column.std for column in columns], axis=1),
    )


def _log_edges(excesses: list[RunExcess]) -> Array:
    low = min(float(run.frequency[1]) for run in excesses)
    high = max(float(run.frequency[-1]) for run in excesses)
    edges = np.geomspace(low, high * 1.0001, _FREQUENCY_BINS + 1)
    edges[0] = 0.0
    return edges


def _spectrum(excesses: list[RunExcess], edges: Array) -> Profile:
    ones = [1.0] * len(excesses)
    places, powers = [run.frequency for run in excesses], [run.power for run in excesses]
    return profile(edges, places, powers, ones, [2.0] * len(excesses))


def _traces(nominal: Fit, best: Fit | None, excesses: list[RunExcess]) -> tuple[RunTrace, ...]:
    """Every run against time, the largest excess first."""
    order = sorted(range(len(excesses)), key=lambda i: -excesses[i].excess)
    most = max(_LEAST_POINTS, _TRACE_POINTS // len(order))
    similarity = nominal.problem.data.similarity
    factor = similarity.own(1.0, similarity.reading)
    traces = []
    for index in order:
        run, frequency = nominal.problem.data.runs[index], resonance(nominal, index)
        # more points would not show more of a cycle
        enough = int(1.0 / (_CYCLE_POINTS * frequency * run.interval))
        group = max(1, min(enough, run.reading.size // _LEAST_POINTS), -(-run.reading.size // most))
        seen = [_times(nominal, index), run.reading, run.unscaled(nominal.residuals[index])]
        if best is not None:
            seen.append(run.unscaled(best.residuals[index]))
        filled = _means(run.counts.astype(np.float64), group) > 0.0
        time, reading, before, *after = (_means(values, group)[filled] for values in seen)
        # the few cycles with most of the difference's energy; the whole record if it is shorter
        first, last, length = float(time[0]), float(time[-1]), _SHOWN_CYCLES / frequency
        if last - first > length:
            difference = before - after[0] if after else before
            energy = np.concatenate([[0.0], np.cumsum(difference**2)])
            ends = np.searchsorted(time, time + length, side="right")
            whole = time <= last - length
            first = float(time[int(np.argmax(np.where(whole, energy[ends] - energy[:-1], -1.0)))])
            last = first + length
        trace = RunTrace(
            run.id,
            time * similarity.own(1.0, "s"),
            reading * factor + similarity.rest,
            before * factor,
            after[0] * factor if after else None,
            run.noise_std / float(np.sqrt(group)) * factor,
            (similarity.own(first, "s"), similarity.own(last, "s")),
        )
        traces.append(trace)
    return tuple(traces)


def _means(values: Array, group: int) -> Array:
    """Means of groups of neighbouring values; an incomplete last group is left out."""
    count = values.size // group
    return np.asarray(values[: count * group].reshape(count, group).mean(axis=1), np.float64)
