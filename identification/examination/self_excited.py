"""The growth and decay of each run, and runs that excite themselves, which are not free decays.

Motion that grows with the wind off is impossible for a passive rig, so the record or its labels are wrong. With the
wind on a run may excite itself: its motion grows, or is a limit cycle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import fdtrc

from identification import policy
from identification.show.numbers import in_degrees, significant
from identification.signal.decay_fit import Reading, project_run
from identification.signal.free_decay import envelope_amplitude
from identification.signal.frequency import PencilDecay, pencil_decay, starting_frequency, thinned_reading
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.quantities import Frequencies
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced

_UNKNOWNS = 5  # unknowns: decay rate, stiffness, zero, initial angle and rate
_LEAST_SAMPLES = 30  # minimum number of samples in a part of a record with separate poles
_E_FOLDING = 0.5  # e-folds in the first part: both parts then determine the frequency about equally well


@dataclass(frozen=True, eq=False)
class Swing:
    """One run's oscillation.

    Args:
        stiffness: k = ωn², 1/s².
        stiffness_std: standard deviation of k, 1/s². It includes the change of k along the run, which limits
            the accuracy of a frequency that depends on the amplitude.
        rate: a = ζωn, 1/s; negative where the motion grows.
        rate_std: standard deviation of a, 1/s.
        rate_error: standard deviation of a with the residual's own correlation and the change of a between the
            run's first part and the rest, 1/s.
        zero: the sensor's zero, rad.
        zero_std: standard deviation of the zero, rad.
        time: since the start of the record, thinned, shape (n,), s.
        motion: reading less the sensor's zero, thinned, shape (n,), rad.
        amplitude: amplitude of the fitted decay at the start of the record, rad.
    """

    run: Run
    stiffness: float
    stiffness_std: float
    rate: float
    rate_std: float
    rate_error: float
    zero: float
    zero_std: float
    time: Array
    motion: Array
    amplitude: float


def swing_of(run: Run) -> Swing | None:
    """Measure a run's oscillation by its poles, which need no starting values; None if there is none.

    The residual is assumed to be correlated over half a cycle, so a decay that does not explain the record has
    larger standard deviations. Spring and wind of the run are not used.
    """
    frequency = starting_frequency(run.record)
    if frequency is None:
        return None
    reading = thinned_reading(evenly_spaced(run.record), frequency)
    omega = 2.0 * np.pi * frequency
    poles = _poles(reading, omega)
    fitted = None if poles is None else project_run(reading, poles.decay)
    if poles is None or fitted is None:
        return None
    residual, zero = fitted[0].residual, fitted[1]
    half_cycle = np.pi / poles.decay.omega_d * residual.size / float(reading.time[-1])
    variance = float(residual @ residual) / max(residual.size - _UNKNOWNS, 1) * max(half_cycle, 1.0)
    rate_std, stiffness_std = np.sqrt(variance) * np.linalg.norm(poles.weights, axis=1)
    # Changes of k and a between the run's first part and the rest.
    half, change, slowing = 0.5 * float(reading.time[-1]), 0.0, 0.0
    split = half if poles.decay.rate <= 0.0 else min(half, _E_FOLDING / poles.decay.rate)
    at = int(np.searchsorted(reading.time, max(split, 2.0 * np.pi / poles.decay.omega_d)))
    if min(at, reading.time.size - at) >= _LEAST_SAMPLES:
        first, rest = (
            _poles(
                Reading(reading.time[part] - reading.time[part][0], reading.yaw[part]), poles.decay.omega_d
            )
            for part in (slice(None, at), slice(at, None))
        )
        if first is not None and rest is not None:
            change = abs(first.decay.stiffness - rest.decay.stiffness)
            slowing = abs(first.decay.rate - rest.decay.rate)
    return Swing(
        run,
        stiffness=poles.decay.stiffness,
        stiffness_std=float(np.hypot(stiffness_std, change)),
        rate=poles.decay.rate,
        rate_std=float(rate_std),
        rate_error=float(np.hypot(rate_std * _correlated(residual, half_cycle), slowing)),
        zero=zero,
        zero_std=float(np.sqrt(variance / residual.size)),
        time=reading.time,
        motion=reading.yaw - zero,
        amplitude=envelope_amplitude(poles.decay, fitted[0].angle, fitted[0].rate),
    )


def _correlated(residual: Array, half_cycle: float) -> float:
    """The factor, up to 1, on standard deviations that assume a residual correlated over half a cycle.

    Args:
        residual: residual, shape (n,), rad.
        half_cycle: in samples.
    """
    block = max(round(half_cycle), 1)
    count = residual.size // block
    if block == 1 or count < _LEAST_SAMPLES // 2:
        return 1.0
    means = residual[: count * block].reshape(count, block).mean(axis=1)
    slow = float(means @ means) / count * block / max(float(residual @ residual) / residual.size, 1e-300)
    return float(np.sqrt(np.clip(slow / block, 1.0 / block, 1.0)))


def _poles(reading: Reading, omega: float) -> PencilDecay | None:
    """The oscillation of a part of a record; None if its poles do not describe an oscillation."""
    found = pencil_decay(reading.yaw, float(reading.time[-1]) / (reading.time.size - 1), omega)
    return found if found is not None and found.decay.omega_d > 0.0 else None


_CYCLES = 3.0  # cycles of the strongest oscillation in a window
_KEYS = ("time_s", "amplitude_rad", "growth_rate", "frequency_hz")


@dataclass(frozen=True, eq=False)
class AmplitudeWindows:
    """The oscillation in consecutive windows.

    Args:
        time: mid-window, shape (n,), s.
        amplitude: at mid-window, shape (n,), rad.
    """

    time: Array
    amplitude: Array
    frequency: Frequencies

    @property
    def growth_rate(self) -> Array:
        """Rate of the amplitude's logarithm, shape (n,), 1/s."""
        return np.gradient(np.log(self.amplitude), self.time)

    def figures(self) -> dict[str, Any]:
        """Growth rate and frequency against amplitude, lists by name."""
        values = (self.time, self.amplitude, self.growth_rate, self.frequency)
        return {key: np.asarray(value).tolist() for key, value in zip(_KEYS, values, strict=True)}


def self_excited_runs(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Find wind-on runs with motion that grows, or stays constant, with a remark and figures for each.

    A run that settles in a limit cycle is cut to its linear growth, or left out if it has none.
    """
    kept, remarks = [], []
    for run in campaign.runs:
        part, remark = _examined(run) if run.wind_on else (run, None)
        kept += [] if part is None else [part]
        remarks += [] if remark is None else [remark]
    return (replace(campaign, runs=tuple(kept)) if remarks else campaign), tuple(remarks)


def _examined(run: Run) -> tuple[Run | None, Remark | None]:
    windows = windows_of(run.record)
    if windows is None:
        return run, None
    if _is_steady(windows, 0):
        slope, std = _slope(windows.time, windows.amplitude)
        length = float(np.ptp(windows.time))
        amplitude, frequency = float(np.median(windows.amplitude)), float(np.median(windows.frequency))
        what = (
            f"steady oscillation with the wind on, self-excited or forced: {in_degrees(amplitude)} at "
            f"{significant(frequency, 3)} Hz for {length * frequency:.0f} cycles (its amplitude changes by "
            f"{100.0 * slope / frequency:+.1g} ± {100.0 * std / frequency:.1g} % per cycle), "
            "which has no damping ratio"
        )
        remedy = "record its growth from rest, or a decay at a lower wind speed"
        figures = {"kind": "steady", "settled_rad": amplitude, **windows.figures()}
        return None, Remark(Outcome.LEFT_OUT, (run.id,), what, remedy, figures)
    # Whether the last quarter's power exceeds the first quarter's beyond variations of a buffeted rig's envelope.
    # A window's power is then exponentially distributed: χ² of two degrees of freedom.
    quarter = windows.amplitude.size // 4
    first, last = (
        float(np.mean(part**2)) for part in (windows.amplitude[:quarter], windows.amplitude[-quarter:])
    )
    grows = bool(fdtrc(2 * quarter, 2 * quarter, last / first) < policy.REFUSAL_RATE)
    # First window of the limit cycle; None where the amplitude still grows at the end. A record that begins late
    # has a short growth, and is recognised by an amplitude that is constant for most of it.
    below = np.flatnonzero(windows.amplitude < policy.SETTLED_SHARE * _last(windows.amplitude))
    start, settled = int(below[-1]) + 1 if below.size else 0, None
    if windows.time.size - start >= policy.LEAST_GROWTH_WINDOWS:
        slope, std = _slope(windows.time[start:], windows.amplitude[start:])
        if slope + policy.MISFIT_DEVIATIONS * std < float(windows.growth_rate[:start].max(initial=0.0)):
            settled = start
    if not grows and not (0 < start < windows.time.size // 2 and _is_steady(windows, start)):
        return run, None
    limit = np.inf if settled is None else policy.LINEAR_SHARE * _last(windows.amplitude)
    # From the smallest amplitude to the last window below the limit, rad.
    above = np.flatnonzero(windows.amplitude > limit)
    end = int(above[0]) if above.size else windows.time.size
    part = slice(int(np.argmin(windows.amplitude[:end])) if end else 0, end)
    enough = part.stop - part.start >= policy.LEAST_GROWTH_WINDOWS
    remark = _growth_remark(run, windows, part if enough else None, settled)
    if settled is None:
        return run, remark
    if not enough:
        return None, remark
    half = 0.5 * float(windows.time[1] - windows.time[0])
    time = run.record.time_s - run.record.time_s[0]
    inside = (time >= windows.time[part][0] - half) & (time <= windows.time[part][-1] + half)
    return replace(run, record=Record(run.record.time_s[inside], run.record.yaw_rad[inside])), remark


def _is_steady(windows: AmplitudeWindows, start: int) -> bool:
    """Whether the amplitude is constant from a window on, by the upper end of the interval of its change."""
    time, amplitude = windows.time[start:], windows.amplitude[start:]
    length = float(np.ptp(time))
    if length * float(np.median(windows.frequency[start:])) < policy.LEAST_STEADY_CYCLES:
        return False
    slope, std = _slope(time, amplitude)
    changes = (abs(slope) + policy.MISFIT_DEVIATIONS * std) * length
    return bool(max(changes, np.log(amplitude).std()) < policy.STEADY_CHANGE)


def windows_of(record: Record) -> AmplitudeWindows | None:
    """Amplitude and frequency in windows of about three cycles; None where they are too few to show growth."""
    frequency = starting_frequency(record)
    if frequency is None:
        return None
    reading = thinned_reading(evenly_spaced(record), frequency)
    count = int(float(reading.time[-1]) * frequency / _CYCLES)
    if count < 2 * policy.LEAST_GROWTH_WINDOWS:
        return None
    rows = []
    for part in np.array_split(np.arange(reading.time.size), count):
        time, yaw = reading.time[part], reading.yaw[part]
        window = Reading(time - time[0], yaw)
        found = _poles(window, 2.0 * np.pi * frequency)
        fitted = None if found is None else project_run(window, found.decay)
        if found is None or fitted is None:
            continue
        decay, run = found.decay, fitted[0]
        length = float(time[-1] - time[0])
        amplitude = envelope_amplitude(decay, run.angle, run.rate) * np.exp(-0.5 * decay.rate * length)
        if np.isfinite(amplitude) and amplitude > 0.0:
            rows.append((float(time.mean()), float(amplitude), decay.omega_d / (2.0 * np.pi)))
    if len(rows) < max(2 * policy.LEAST_GROWTH_WINDOWS, count // 2):
        return None
    return AmplitudeWindows(*np.array(rows).T)


def _last(amplitude: Array) -> float:
    return float(np.median(amplitude[-policy.LEAST_GROWTH_WINDOWS :]))


def _slope(time: Array, amplitude: Array) -> tuple[float, float]:
    """Rate of the amplitude's logarithm and its standard deviation by the scatter, 1/s."""
    (slope, _), covariance = np.polyfit(time, np.log(amplitude), 1, cov=True)
    return float(slope), float(np.sqrt(covariance[0, 0]))


def _growth_remark(run: Run, windows: AmplitudeWindows, part: slice | None, settled: int | None) -> Remark:
    amplitude, frequency = windows.amplitude, windows.frequency
    shown = slice(int(np.argmin(amplitude[: settled or None])), settled) if part is None else part
    rate, std = _slope(windows.time[shown], amplitude[shown]) if part is not None else (None, None)
    grown = float(windows.growth_rate[:settled].max())
    at = float(amplitude[int(np.argmax(windows.growth_rate[:settled]))])
    last = _last(amplitude)
    said = f"at up to {grown:.2g} 1/s" if rate is None else f"at {rate:.2g} ± {std:.1g} 1/s"
    end = f"reaches {in_degrees(last)}" if settled is None else f"settles at {in_degrees(last)}"
    if rate is not None and grown > rate + policy.MISFIT_DEVIATIONS * (std or 0.0):
        said += f" (at most {grown:.2g} 1/s, at {in_degrees(at)})"
    if settled is None:
        outcome, remedy = Outcome.NOTED, "its damping is negative as long as the growth is linear"
    elif part is None:
        outcome, remedy = Outcome.LEFT_OUT, "start from a smaller motion to record its linear growth"
    else:
        share = f"{100.0 * policy.LINEAR_SHARE:.0f} %"
        outcome = Outcome.CUT
        remedy = f"frequency and damping describe its growth up to {share} of the limit cycle"
    return Remark(
        outcome,
        (run.id,),
        f"self-excited: grows {said} from {in_degrees(float(amplitude[shown.start]))}, {end}; "
        f"frequency {significant(float(np.median(frequency[shown][:3])), 3)} → "
        f"{significant(float(np.median(frequency[-3:])), 3)} Hz",
        remedy,
        {
            "kind": "growth",
            "growth_rate_per_s": rate,
            "growth_rate_std": std,
            "settled_rad": None if settled is None else last,
            **windows.figures(),
        },
    )


def in_limit_cycle(figures: Mapping[str, Any]) -> bool:
    """Whether a remark's figures describe a run that settles in a limit cycle, or is steady."""
    return figures.get("settled_rad") is not None
