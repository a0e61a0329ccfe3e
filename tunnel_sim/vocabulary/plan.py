"""The definition of a simulation: aerodynamic derivatives, the plan of a campaign, its runs and their waveforms.

Sign convention: yaw angle β and yaw rate r = β̇ have the same positive direction about the rod's axis; the
aerodynamic moment is N = Ka β + Ca r on the right-hand side of Izz β̈ + Cr β̇ + Kr β = N. A positive Cnβ
lowers the frequency; a negative Cnr adds damping.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.between_runs import Repeatability, Scatter
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.quantities import Hertz, PerSample, Times
from tunnel_sim.vocabulary.record import Array

#: A number of one run, or of several, shape (runs,).
Number: TypeAlias = float | Array


@dataclass(frozen=True)
class AeroDerivatives:
    """Yaw-moment derivatives.

    Args:
        cn_beta, cn_r: Cnβ = ∂Cn/∂β and Cnr = ∂Cn/∂(r l/V), 1/rad.
    """

    cn_beta: float
    cn_r: float


@overload
def aerodynamic_stiffness(
    cn_beta: float, *, air_density: float, wind_speed: float, frontal_area: float, reference_length: float
) -> float: ...
@overload
def aerodynamic_stiffness(
    cn_beta: Number, *, air_density: Array, wind_speed: Array, frontal_area: Number, reference_length: Number
) -> Array: ...
def aerodynamic_stiffness(
    cn_beta: Number,
    *,
    air_density: Number,
    wind_speed: Number,
    frontal_area: Number,
    reference_length: Number,
) -> Number:
    """Ka = ½ρV²·A·l·Cnβ (paper, eq. 4), N m/rad, of one run or several, shape (runs,).

    Args:
        cn_beta: Cnβ, 1/rad.
        air_density: ρ, kg/m³.
        wind_speed: V, m/s.
        frontal_area: A, m².
        reference_length: l, m.
    """
    return 0.5 * air_density * wind_speed**2 * frontal_area * reference_length * cn_beta


@overload
def aerodynamic_damping(
    cn_r: float, *, air_density: float, wind_speed: float, frontal_area: float, reference_length: float
) -> float: ...
@overload
def aerodynamic_damping(
    cn_r: Number, *, air_density: Array, wind_speed: Array, frontal_area: Number, reference_length: Number
) -> Array: ...
def aerodynamic_damping(
    cn_r: Number, *, air_density: Number, wind_speed: Number, frontal_area: Number, reference_length: Number
) -> Number:
    """Ca = ½ρV·A·l²·Cnr (paper, eq. 5), N m s/rad, of one run or several, shape (runs,).

    Args:
        cn_r: Cnr, 1/rad.
        air_density: ρ, kg/m³.
        wind_speed: V, m/s.
        frontal_area: A, m².
        reference_length: l, m.
    """
    return 0.5 * air_density * wind_speed * frontal_area * reference_length**2 * cn_r


DEFAULT_SAMPLE_RATE = 1000.0
"""Default sample rate of the potentiometer, Hz."""

POTENTIOMETER_RESOLUTION = 2.0 * pi / 3.0 / 4096.0
"""Step of a 12-bit converter over ±60°, rad."""


@dataclass(frozen=True)
class Truth:
    """The coefficients of the simulation, which the estimators should recover.

    Args:
        cn_beta, cn_r: Cnβ and Cnr, 1/rad.
        yaw_inertia: Izz of model and support, kg m².
        mechanical_damping: Cr, N m s/rad.
    """

    cn_beta: float
    cn_r: float
    yaw_inertia: float
    mechanical_damping: float


@dataclass(frozen=True)
class Condition:
    """One run to simulate.

    Args:
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        air_density: ρ, kg/m³.
        release_angle: release angle, rad, nose-right positive; 0 for a driven run, which starts at rest.
        duration: duration of the record, s.
        gain: true gain of an input that takes a gain, unknown to the estimators: N m per unit.
    """

    id: str
    spring_stiffness: float
    wind_speed: float
    air_density: float
    release_angle: float
    duration: float
    drive: Input | None = None
    gain: float = 1.0


@dataclass(frozen=True)
class SensorModel:
    """The potentiometer: it adds its zero and noise to the angle, then quantises.

    Args:
        sample_rate: sample rate, Hz.
        noise_std: standard deviation of the noise, rad.
        resolution: step of the reading, rad; 0: no quantisation.
        zero: offset added to the angle, rad; the same in all runs and unknown to the estimators.
    """

    sample_rate: float = DEFAULT_SAMPLE_RATE
    noise_std: float = 0.0005
    resolution: float = POTENTIOMETER_RESOLUTION
    zero: float = 0.0


@dataclass(frozen=True)
class EffectSetting:
    """One effect to inject, by name; ``tunnel_sim.effects`` validates it.

    Args:
        parameters: its parameters by name, SI units.
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class CampaignPlan:
    """All properties of a simulated campaign, apart from the rig.

    Args:
        conditions: the runs, at least one, with unique ids.
        effects: effects added to the nominal model.
        scatter: differences between the runs, which the campaign does not state.
        repeatability: the campaign's statement on these differences.
    """

    name: str
    seed: int
    truth: Truth
    conditions: tuple[Condition, ...]
    sensor: SensorModel = SensorModel()
    effects: tuple[EffectSetting, ...] = ()
    description: str = ""
    scatter: Scatter = field(default_factory=Scatter)
    repeatability: Repeatability | None = None


# Waveforms of peak value 1 at the times of the samples, from 0 on and evenly spaced. A band ends below half the
# sample rate, and contains a multiple of one over the length of the record.


def stepped_sine(time_s: Times, frequencies_hz: Sequence[float]) -> PerSample:
    """A sine that dwells equally long at each frequency, without a jump of its phase; a single one gives a sine."""
    rates = np.asarray(frequencies_hz, dtype=np.float64)
    dwell = time_s.size * (time_s[1] - time_s[0]) / rates.size
    ends = np.append(dwell * np.arange(rates.size), np.inf)
    cycles = np.interp(time_s, ends[:-1], np.append(0.0, np.cumsum(dwell * rates[:-1])))
    last = time_s > ends[-2]
    cycles[last] += rates[-1] * (time_s[last] - ends[-2])
    values: Array = np.sin(2.0 * pi * cycles)
    return values


def chirp(time_s: Times, start_hz: Hertz, end_hz: Hertz) -> PerSample:
    """A sine with a frequency that changes linearly with time, from the first to the last sample."""
    slope = (end_hz - start_hz) / time_s[-1]
    values: Array = np.sin(2.0 * pi * (start_hz + 0.5 * slope * time_s) * time_s)
    return values


def square(time_s: Times, frequency_hz: Hertz) -> PerSample:
    """A square wave that begins with 1."""
    half_cycles = np.floor(2.0 * frequency_hz * time_s + 1e-9)  # a sample may be rounded to before its edge
    return 1.0 - 2.0 * (half_cycles % 2.0)


def lines_in_band(size: int, interval: float, low_hz: float, high_hz: float) -> Array:
    """The multiples of one over the record's length within a band, below half the sample rate; shape (k,).

    Args:
        size: number of samples n (a count).
        interval: interval between samples, s.
        low_hz, high_hz: ends of the band, included, Hz.
    """
    length = size * interval
    first, last = np.ceil(low_hz * length - 1e-9), np.floor(high_hz * length + 1e-9)
    return np.arange(max(first, 1.0), min(last, (size - 1) // 2) + 1.0)


def multisine(
    time_s: Times, low_hz: Hertz, high_hz: Hertz, rng: np.random.Generator | None = None
) -> PerSample:
    """Cosines of equal amplitude at all multiples of one over the record's length within a band.

    Args:
        rng: generator of the phases; None: Schroeder's phases, −π k (k − 1)/N of the k-th of N lines, which
            keep the peak low (doi:10.1109/TIT.1970.1054411).
    """
    lines = lines_in_band(time_s.size, time_s[1] - time_s[0], low_hz, high_hz)
    k = np.arange(1.0, lines.size + 1.0)
    phases = -pi * k * (k - 1.0) / lines.size if rng is None else rng.uniform(0.0, 2.0 * pi, lines.size)
    return _of_lines(time_s.size, lines, np.exp(1j * phases))


def band_noise(time_s: Times, low_hz: Hertz, high_hz: Hertz, rng: np.random.Generator) -> PerSample:
    """Gaussian noise that is white within a band and absent outside it."""
    lines = lines_in_band(time_s.size, time_s[1] - time_s[0], low_hz, high_hz)
    return _of_lines(
        time_s.size, lines, rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)
    )


def _of_lines(size: int, lines: Array, weights: NDArray[np.complex128]) -> Array:
    spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
    spectrum[lines.astype(np.int64)] = weights
    values: Array = np.fft.irfft(spectrum, size)
    values /= np.max(np.abs(values))
    return values
