"""Motions that no effect of one degree of freedom explains: a second mode; a limit cycle in every run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from identification.examination.self_excited import in_limit_cycle
from identification.show.numbers import joined_mark, listed, significant, span, unit_shown
from identification.signal.frequency import starting_frequency, thinned_reading
from identification.status import Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError, counted
from tunnel_sim.vocabulary.record import Array, evenly_spaced

SECOND_MODE_LEFT: Final = 0.5
"""Maximum ratio of the residual with two free decays to the residual with one, for a second mode to be named.
Judgement."""
SECOND_MODE_CYCLES: Final = 3.0
"""Minimum number of cycles of a mode within its lifetime and within its record. Judgement. Fewer do not
distinguish an oscillation from a drift or an impulse."""


@dataclass(frozen=True)
class Mode:
    """A decaying oscillation.

    Args:
        amplitude_rad: amplitude at the start, rad.
        frequency_hz: Hz.
        decay_per_s: decay rate, 1/s.
    """

    amplitude_rad: float
    frequency_hz: float
    decay_per_s: float


@dataclass(frozen=True)
class TwoModes:
    """Two modes in a run.

    Args:
        run: id of the run.
        main: the mode that one free decay fits.
        second: the mode beside it.
        closes: share of the residual of one free decay that the second mode explains, a fraction.
    """

    run: str
    main: Mode
    second: Mode
    closes: float


_MOST = 1024  # number of thinned readings used: fifty cycles
_LEAST = 64
# parts of the record, from the start: in the whole record a quickly decaying mode is lost
_PARTS = (1.0, 0.5, 0.25)
_ROWS = 1.0 / 3.0  # rows of a Hankel matrix over the readings, as in the matrix pencil


@dataclass(frozen=True, eq=False)
class _Modes:
    """The fit of a sum of decaying oscillations to a reading."""

    frequency: Array  # Hz, shape (m,)
    rate: Array  # decay rate, 1/s, shape (m,)
    amplitude: Array  # amplitude at the first reading, rad, shape (m,)
    left: float  # sum of squared residuals, rad²


def second_modes(campaign: Campaign, mains: float | None = None) -> tuple[TwoModes, ...]:
    """Find a second mode in each run that shows one.

    Args:
        mains: frequency of a hum in the records, Hz; it is no mode, and neither are its harmonics.

    Returns:
        One result for each run with a second mode. A second mode is found where two decaying oscillations leave
        a much smaller residual than one, and their frequencies are farther apart than the sum of their
        half-power widths; harmonics of the motion do not count. The whole run, its first half and its first
        quarter are tried. A motion of fewer than three cycles is not a mode. Driven runs are left out.
    """
    modes = []
    for run in campaign.decays:
        frequency = starting_frequency(run.record)
        if frequency is None:
            continue
        reading = thinned_reading(evenly_spaced(run.record), frequency)
        interval = float(reading.time[-1]) / (reading.time.size - 1)
        parts = [reading.yaw[: int(part * min(reading.yaw.size, _MOST))] for part in _PARTS]
        for values in (part for part in parts if part.size >= _LEAST):
            hankel = sliding_window_view(values, values.size - int(values.size * _ROWS) + 1)
            vectors = np.linalg.svd(hankel - hankel.mean(axis=1, keepdims=True), full_matrices=False)[0]
            one, two = (_fit_modes(values, interval, count, vectors) for count in (1, 2))
            if one is None or two is None or two.left > SECOND_MODE_LEFT * one.left:
                continue
            if two.rate.min() < 0.0:
                continue
            order = np.argsort(np.abs(two.frequency - one.frequency[0]))
            resolution = float(two.rate.sum()) / np.pi
            lifetime = np.minimum(1.0 / np.maximum(two.rate, 1e-300), interval * values.size)
            if np.any(two.frequency * lifetime < SECOND_MODE_CYCLES):
                continue  # an impulse or a drift, not an oscillation
            turns = max(1, round(two.frequency[order[1]] / two.frequency[order[0]]))
            if abs(two.frequency[order[1]] - turns * two.frequency[order[0]]) < resolution:
                continue  # an unresolved frequency, or a harmonic of the motion
            main, second = (
                Mode(float(two.amplitude[i]), float(two.frequency[i]), float(two.rate[i])) for i in order
            )
            if mains is None or not _is_hum(second.frequency_hz, mains):
                modes.append(TwoModes(run.id, main, second, 1.0 - two.left / one.left))
            break
    return tuple(modes)


def _is_hum(frequency: float, mains: float) -> bool:
    """Whether a frequency is within a per cent of the mains' or of a multiple of it."""
    ratio = frequency / mains
    return abs(ratio - max(1, round(ratio))) < 0.01 * ratio


def _fit_modes(values: Array, interval: float, count: int, vectors: Array) -> _Modes | None:
    """Fit ``count`` decaying oscillations by the poles of a Hankel matrix with these left singular vectors."""
    left = vectors[:, : 2 * count]
    poles = np.linalg.eigvals(np.linalg.pinv(left[:-1]) @ left[1:]).astype(np.complex128)
    exponents = np.asarray(np.log(poles[np.abs(poles) > 0.0]) / interval, np.complex128)
    upper = exponents[exponents.imag > 0.0]
    if upper.size != count:
        return None
    waves = np.exp(np.outer(np.arange(values.size) * interval, upper))
    columns = np.column_stack((waves.real, waves.imag, np.ones(values.size)))
    weights = np.linalg.lstsq(columns, values, rcond=None)[0]
    residual = values - columns @ weights
    amplitude = np.hypot(weights[:count], weights[count : 2 * count])
    return _Modes(upper.imag / (2.0 * np.pi), -upper.real, amplitude, float(residual @ residual))


def refused_limit_cycles(remarks: Sequence[Remark]) -> TunnelError:
    """The error for runs in a limit cycle to which not even the nominal model can be fitted."""
    what = ". ".join(f"{remark.runs[0]}: {remark.what}" for remark in recognised_limit_cycles(remarks))
    return TunnelError(f"no run is a free decay: {what}", remedy="add decays at a lower wind speed")


def recognised_limit_cycles(remarks: Sequence[Remark]) -> tuple[Remark, ...]:
    """The remarks on runs in a limit cycle."""
    return tuple(remark for remark in remarks if in_limit_cycle(remark.figures))


def second_mode_words(found: Sequence[TwoModes], unit: str) -> str:
    """The second modes of some runs, with amplitudes in a unit of readings; empty without any."""
    if not found:
        return ""
    runs = [mode.run for mode in found]
    contain = (
        f"Run {runs[0]} contains"
        if len(runs) == 1
        else f"{counted(len(runs), 'run')} ({listed(runs)}) contain"
    )
    main, second = (
        _modes_words(modes, unit) for modes in zip(*((one.main, one.second) for one in found), strict=True)
    )
    closes = span([100.0 * mode.closes for mode in found], partial(significant, digits=2))
    return (
        f"{contain} a second mode: {second}. The main mode is {main}. The second mode explains {closes} % of the "
        "residual of one free decay. A rig with one degree of freedom has one mode: look for another motion, such "
        "as heave or a motion of the mount."
    )


def _modes_words(modes: Sequence[Mode], unit: str) -> str:
    """Amplitudes, frequencies and decay rates of modes, each from the least to the greatest."""
    mark, factor = unit_shown(unit)
    two, three = (partial(significant, digits=digits) for digits in (2, 3))
    amplitude = span([factor * mode.amplitude_rad for mode in modes], two) + joined_mark(mark)
    frequency, rate = [mode.frequency_hz for mode in modes], [mode.decay_per_s for mode in modes]
    return f"{amplitude} at {span(frequency, three)} Hz, decaying at {span(rate, two)} 1/s"
