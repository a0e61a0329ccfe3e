"""The definition of a campaign: the conditions of its runs, and the true rig, air and sensor."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FRONTAL_AREA = 0.036
REFERENCE_LENGTH = 0.625
WIDTH = 0.225
NOMINAL_INERTIA = 0.11
RESOLUTION = 2.0 * np.pi / 3.0 / 4096.0


@dataclass(frozen=True)
class TwistingRod:
    """A rod that twists between its upper end, with spring and sensor, and the body below.

    Args:
        compliance: 1/Krod, rad/(N m).
        share: share of Izz at the upper end.
        damping_ratio: damping ratio of the twist, relative to the inertia of the upper end.
        hardening: h, 1/rad²: the rod's moment is Krod ψ (1 + h ψ²) at twist ψ.
        held_body: whether the body is held until the release (the spring then twists the rod) or the upper end.
    """

    compliance: float
    share: float = 0.1
    damping_ratio: float = 0.01
    hardening: float = 0.0
    held_body: bool = True


@dataclass(frozen=True)
class Actuation:
    """Limits and lags between the input as written and the moment on the body.

    Args:
        limit: greatest moment, N m.
        soft: whether the limit is approached as a hyperbolic tangent.
        rate: greatest rate of change of the moment, N m/s.
        lags: time constants of lags of first order, one after the other, s.
    """

    limit: float = np.inf
    soft: bool = False
    rate: float = np.inf
    lags: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class DrivenInput:
    """The input of a campaign's runs; zero in its free decays.

    Args:
        column: ``moment_nm``, ``drive``, ``base_rad``, the angle of the spring's root, or
            ``base_acceleration_rad_s2``, the angular acceleration of the base from which all angles are counted.
        values: input at the samples, N m, units, rad or rad/s², shape (samples, runs).
        held: whether the values are held between samples, shape (runs,); else they are linear.
        peak: greatest angle of the linear rig's response, rad, shape (runs,); 0 for free decays.
        gain: N m per unit of a ``drive``; minus the inertia for the acceleration of a base; 1 for other columns.
        stated: whether the campaign states the gain.
        delay: time by which the input acts later than its samples, s, shape (runs,) or (1,).
        actuator: the actuator that exerts the moment; None where the moment equals the written one.
    """

    column: str
    values: Array
    held: NDArray[np.bool_]
    peak: Array
    gain: float = 1.0
    stated: bool = False
    delay: Array = field(default_factory=lambda: np.zeros(1))
    actuator: Actuation | None = None

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Whether a run is driven, shape (runs,)."""
        return self.peak > 0.0

    @property
    def on_body(self) -> bool:
        """Whether it is a moment on the body; else it moves the spring's root."""
        return self.column != "base_rad"

    @property
    def greatest(self) -> float:
        """Greatest demanded moment in any run, N m."""
        return float(self.gain * np.max(np.abs(self.values)))


@dataclass(frozen=True, eq=False)
class TrueConditions:
    """One campaign's runs and truth; arrays have shape (runs,).

    Args:
        spring_stiffness: stated Kr, N m/rad.
        wind_speed: stated V, m/s.
        release_angle: nominal release angle, rad.
        start_angle: true release angle (at rest), rad.
        air_density: ρ, kg/m³, the same in all runs or by run.
        duration: duration of every run as simulated, s.
        yaw_inertia: Izz, kg m².
        mechanical_damping: Cr, N m s/rad.
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        noise_std: standard deviation of the reading's white noise, rad.
        stated_noise: the standard deviation as stated in the campaign; None where it is not stated.
        zero: the sensor's reading at rest in still air, rad.
        resolution: step of the reading, rad.
        sample_rate: sample rate, Hz.
        stiffness_scale: true over stated stiffness.
        speed_offset: true minus stated speed where the wind is on, m/s.
        cn_beta_scale: ratio of the run's Cnβ to the campaign's.
        rod: the flexible rod; None where it is rigid.
        noise_corner: corner frequency of the coloured part of the noise, Hz.
        coloured_share: share of the noise's variance that is coloured.
        clock_jitter: greatest delay of a sample, as a share of the sample interval; the time stamps show it.
        clock_seed: seed of the delays.
        stamp_step: step to which the written time stamps are rounded, s; 0: not rounded.
        time_scale: ratio of times as written to times as simulated. All other times here are as simulated.
        moment_scale: ratio of moments as written to moments as simulated. All other moments here are as
            simulated.
        drive: the input of driven runs; None where all runs are free decays.
        start_rate: rate of the motion at the start, rad/s.
        noise_scale: ratio of a run's own noise to the campaign's.
        noise_tails: degrees of freedom of Student's t for the white noise; 0: it is normal.
        zero_shift: a run's own zero less the campaign's, rad.
        kept: share of the duration that is written.
        every: one of this many samples is written.
        time_start: time stamp of the first sample, s.
        gaps: stretches of every run that are not written, from and to, shares of the duration, shape (gaps, 2).
        offset: angle subtracted from all readings as written, rad.
        speed_deviation: a run's own deviation of the speed, as a share of the stated one.
        stiffness_deviation: a run's own deviation of the spring, as a share of its stiffness.
        damping_deviation: a run's own deviation of Cr, as a share of it.
        zero_deviation: a run's own zero less the campaign's, which does not state it, rad.
    """

    spring_stiffness: Array
    wind_speed: Array
    release_angle: Array
    start_angle: Array
    air_density: float | Array
    duration: float
    yaw_inertia: float
    mechanical_damping: float
    cn_beta: float
    cn_r: float
    noise_std: float
    stated_noise: float | None = None
    zero: float = 0.0
    resolution: float = RESOLUTION
    sample_rate: float = 1000.0
    stiffness_scale: Array = field(default_factory=lambda: np.ones(1))
    speed_offset: Array = field(default_factory=lambda: np.zeros(1))
    cn_beta_scale: Array = field(default_factory=lambda: np.ones(1))
    rod: TwistingRod | None = None
    noise_corner: float = 10.0
    coloured_share: float = 0.0
    clock_jitter: float = 0.0
    clock_seed: int = 0
    stamp_step: float = 0.0
    time_scale: float = 1.0
    moment_scale: float = 1.0
    drive: DrivenInput | None = None
    start_rate: Array = field(default_factory=lambda: np.zeros(1))
    noise_scale: Array = field(default_factory=lambda: np.ones(1))
    noise_tails: float = 0.0
    zero_shift: Array = field(default_factory=lambda: np.zeros(1))
    kept: Array = field(default_factory=lambda: np.ones(1))
    every: NDArray[np.int64] = field(default_factory=lambda: np.ones(1, np.int64))
    time_start: Array = field(default_factory=lambda: np.zeros(1))
    gaps: Array = field(default_factory=lambda: np.zeros((0, 2)))
    offset: float = 0.0
    speed_deviation: Array = field(default_factory=lambda: np.zeros(1))
    stiffness_deviation: Array = field(default_factory=lambda: np.zeros(1))
    damping_deviation: Array = field(default_factory=lambda: np.zeros(1))
    zero_deviation: Array = field(default_factory=lambda: np.zeros(1))

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self.spring_stiffness.size

    @property
    def samples(self) -> int:
        """Samples per run."""
        return round(self.duration * self.sample_rate)

    @property
    def time(self) -> Array:
        """Sample times from the release, s, shape (samples,)."""
        even = np.arange(self.samples) / self.sample_rate
        if self.clock_jitter == 0.0:
            return even
        late = np.random.default_rng(self.clock_seed).random(self.samples)
        return even + late * self.clock_jitter / self.sample_rate

    @property
    def reach(self) -> float:
        """Approximate greatest angle of the runs, rad: of the release or of the response to the input."""
        peak = 0.0 if self.drive is None else float(np.max(self.drive.peak))
        return max(float(np.max(np.abs(self.start_angle))), peak)

    @property
    def length_scale(self) -> float:
        """Lengths as written over lengths as simulated: at the same density a moment scales as length⁵/time²."""
        return float((self.moment_scale * self.time_scale**2) ** 0.2)

    @property
    def wind_on(self) -> NDArray[np.bool_]:
        """Whether the wind is on, shape (runs,)."""
        return self.wind_speed > 0.0

    @property
    def true_stiffness(self) -> Array:
        """The springs' true stiffness, N m/rad, shape (runs,)."""
        return self.spring_stiffness * self.stiffness_scale * (1.0 + self.stiffness_deviation)

    @property
    def true_damping(self) -> Array:
        """The mechanical damping of every run, N m s/rad, shape (runs,)."""
        return np.broadcast_to(self.mechanical_damping * (1.0 + self.damping_deviation), (self.runs,))

    @property
    def true_speed(self) -> Array:
        """The true wind speed, m/s, shape (runs,)."""
        own = self.wind_speed * self.speed_deviation
        return np.where(self.wind_on, self.wind_speed + self.speed_offset + own, 0.0)

    @property
    def reference_moment(self) -> Array:
        """½ρV²Al at the true speed, N m, shape (runs,)."""
        return 0.5 * self.air_density * self.true_speed**2 * FRONTAL_AREA * REFERENCE_LENGTH

    @property
    def air_stiffness(self) -> Array:
        """Ka = ½ρV²Al Cnβ, N m/rad, shape (runs,)."""
        return self.reference_moment * self.cn_beta * self.cn_beta_scale

    @property
    def air_damping(self) -> Array:
        """Ca = ½ρVAl² Cnr, N m s/rad, shape (runs,)."""
        return 0.5 * self.air_density * self.true_speed * FRONTAL_AREA * REFERENCE_LENGTH**2 * self.cn_r

    @property
    def noise_power(self) -> float:
        """Variance of noise and quantisation, mean over the runs, rad²."""
        return float(self.noise_std**2 * np.mean(self.noise_scale**2) + self.resolution**2 / 12.0)

    def written(self, run: int) -> NDArray[np.int64]:
        """The written samples of a run, shape (n,)."""
        kept, every = (np.broadcast_to(value, (self.runs,))[run] for value in (self.kept, self.every))
        samples = np.arange(0, round(float(kept) * self.samples), int(every))
        share = samples / self.samples
        missing = np.any((share[:, None] > self.gaps[:, 0]) & (share[:, None] < self.gaps[:, 1]), axis=1)
        return np.asarray(samples[~missing], np.int64)

    @property
    def wind_off_omega(self) -> Array:
        """√(Kr/Izz), rad/s, shape (runs,)."""
        return np.sqrt(self.true_stiffness / self.yaw_inertia)
