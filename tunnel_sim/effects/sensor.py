"""Effects of the sensor, its logger and the clock of the input, and a second oscillation in the reading."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np

from tunnel_sim.effects.base import REFERENCE_RELEASE, Drawn, beats_with
from tunnel_sim.effects.capabilities import (
    Clock,
    CoarseSteps,
    InputClock,
    MainsPickup,
    ReadingEffect,
    SecondOscillation,
)
from tunnel_sim.effects.evidence import Residuals, Sought
from tunnel_sim.effects.parameters import EQUATION, Circumstances, Trial, exponent, parameter, ramp, settling
from tunnel_sim.physics.forward import backlash
from tunnel_sim.physics.input_moment import InputMoment, Same
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array, read_only

_REFERENCE = 0.2  # rad: angle at which every exponent gives the same error


@dataclass(frozen=True)
class SensorNonlinearity(ReadingEffect):
    """A sensor whose gain changes with the angle."""

    name = "sensor_nonlinearity"
    place = 16
    channel = "sensor"
    condition = "always"
    advice = "Calibrate the sensor over the whole swing"
    equation = "y = β + s β³; general form: |β|^p sgn β for β³, plus q β²"
    signature = (
        "A third harmonic of s A³/4; the frequency is unchanged, and the decay looks faster by the relative "
        "amount (3/2) s A² for every spring and wind speed."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.2,)

    # a judgement: a reading that is off by more than 60 % at 20° comes from another sensor
    coefficient: float = parameter(
        "s", "1/rad2", "cubic coefficient", scale=0.05, lower=-1e6, upper=1e6, fit_lower=-5.0, fit_upper=5.0
    )
    exponent: float = exponent("p", "power of the angle in the error (unchanged at 0.2 rad)", 3.0)
    quadratic: float = parameter(
        "q", "1/rad", "coefficient of an additional quadratic error",
        scale=0.02, lower=-1e6, upper=1e6, fit_lower=-1.0, fit_upper=1.0, form=True,
    )  # fmt: skip

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """First a cubic error, then a mostly quadratic error."""
        scale = {info.name: info.scale for info in cls.parameters()}
        mostly_square = {"coefficient": 0.01 * scale["coefficient"], "quadratic": scale["quadratic"]}
        return [*super().trials(campaign), Trial(mostly_square, "quadratic")]

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Apply the nonlinear characteristic."""
        del time_s, stated, drawn
        if self.is_null:
            return angle
        if self.exponent == 3.0:
            cubed = angle * angle * angle  # a tenth of the time of a power
        else:
            cubed = np.sign(angle) * _REFERENCE**3 * (np.abs(angle) / _REFERENCE) ** self.exponent
        shown = angle + self.coefficient * cubed
        return shown if self.quadratic == 0.0 else shown + self.quadratic * angle**2


@dataclass(frozen=True)
class SensorHysteresis(ReadingEffect):
    """Backlash between rod and sensor."""

    name = "sensor_hysteresis"
    place = 18
    channel = "sensor"
    condition = "always"
    jumps = True
    size = "backlash of {half_width} to each side at the sensor"
    advice = "Remove the backlash between rod and sensor"
    advice_for_joint = "Remove the backlash between joint and sensor"
    equation = "y follows β when pushed: play of half width w; general form: mean of two plays, (1 ± k) w"
    signature = "The reading pauses at each reversal of the motion and lags by w in between."
    references = (
        "Visintin, Differential Models of Hysteresis, Springer 1994, doi 10.1007/978-3-662-11557-2",
    )
    example = (0.003,)
    autonomous = False
    remembers = True
    ahead_of_sensor = True

    half_width: float = parameter("w", "rad", "half width of the play", scale=0.001, lower=0.0, upper=0.2)
    roundness: float = parameter(
        "k", "1", "relative difference between two plays; the reading is their mean",
        scale=0.3, lower=0.0, upper=1.0, form=True,
    )  # fmt: skip

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Follow when pushed; the release has just pushed the reading outwards."""
        del time_s, stated, drawn
        if self.is_null:
            return angle
        widths = {self.half_width * (1.0 + self.roundness), self.half_width * (1.0 - self.roundness)}
        plays = [backlash(angle, w, float(angle[0] - np.sign(angle[0]) * w)) for w in sorted(widths)]
        return np.asarray(sum(plays) / len(plays), dtype=np.float64)


@dataclass(frozen=True)
class SensorDrift(ReadingEffect):
    """A sensor zero that drifts during the run."""

    name = "sensor_drift"
    place = 19
    channel = "sensor"
    condition = "always"
    size = "a zero that drifts by {drift} over a run"
    advice = "Let the sensor warm up, and record its zero before and after each run"
    equation = f"y = β + d t/T over a run of length T; general form: {EQUATION} for t/T"
    signature = (
        "The centre of the oscillation moves with time, in the same way for every wind speed and spring."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.01,)
    autonomous = False

    drift: float = parameter("d", "rad", "drift over the run", scale=0.002, lower=-1.0, upper=1.0)
    settling: float = settling()

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Add the drift."""
        del drawn
        if self.is_null:
            return angle
        return angle + self.drift * ramp(time_s / stated.duration, self.settling)


_FAR = 2.0  # rad: the other limit, if only one side clips
# Least drop of the sensor's sensitivity at the greatest reading. Judgement: 0.77 to 0.96 for three drawn soft
# limits, 0.01 for a limit that took up a friction.
_FLATTENED = 0.1


@dataclass(frozen=True)
class SensorClipping(ReadingEffect):
    """A reading that saturates."""

    name = "sensor_clipping"
    place = 21
    channel = "sensor"
    condition = "always"
    size = "a sensor that clips beyond {limit}"
    advice = "Widen the sensor's range, or use smaller angles"
    equation = "|y| ≤ L; general form: |y − c| ≤ L, approached exponentially within k L of the limit"
    signature = "The peaks of the largest swings are flat; all other readings are unchanged."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.2,)
    tries = 2

    limit: float = parameter(
        "L", "rad", "greatest possible reading (0: no limit)", scale=0.3, lower=0.0, upper=10.0
    )
    centre: float = parameter(
        "c", "rad", "middle of the possible readings", scale=0.05, lower=-5.0, upper=5.0, form=True
    )
    knee: float = parameter(
        "k", "1", "share of the limit over which the reading saturates gradually",
        scale=0.05, lower=0.0, upper=0.9, form=True,
    )  # fmt: skip

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Limits slightly below the greatest reading: first on both sides, then on one side only."""
        limits = [campaign.greatest_reading * share for share in (0.999, 0.99, 0.97, 0.93, 0.87, 0.8)]
        both = [Trial({"limit": limit}, None) for limit in limits]
        one = [
            Trial({"limit": _FAR, "centre": side * (_FAR - limit)}, None)
            for limit in limits
            for side in (-1.0, 1.0)
        ]
        return [*both, *one]

    def plausible(self, omega: float, duration: float, readings: tuple[float, float]) -> bool:
        """Whether a soft limit flattens the greatest reading; else it is another effect."""
        del omega, duration
        if self.knee == 0.0:
            return True
        room = self.knee * self.limit
        return max(abs(one - self.centre) for one in readings) > self.limit - room + _FLATTENED * room

    def on_reading(self, reading: Array) -> Array:
        """Clip at the limit, or saturate gradually."""
        if self.is_null:
            return reading
        if self.knee == 0.0:
            return np.clip(reading, self.centre - self.limit, self.centre + self.limit)
        room = self.knee * self.limit
        size = np.abs(reading - self.centre)
        linear = self.limit - room
        over = np.maximum(size - linear, 0.0)
        limited = np.minimum(size, linear) - room * np.expm1(-over / room)
        return self.centre + np.copysign(limited, reading - self.centre)


@dataclass(frozen=True)
class SensorQuantisation(CoarseSteps):
    """A resolution that is coarser than stated."""

    name = "sensor_quantisation"
    place = 17
    channel = "sensor"
    condition = "always"
    size = "readings in steps of {step}"
    advice = "State the sensor's real resolution, or use a finer one"
    equation = "y = q round(y/q); a step finer than the stated resolution has no effect"
    signature = (
        "The readings are multiples of a coarser step than stated; their error is a sawtooth of the angle."
    )
    references = ("Widrow & Kollár, Quantization Noise, CUP 2008, doi 10.1017/CBO9780511754661",)
    example = (0.004,)

    step: float = parameter("q", "rad", "true step of the reading", scale=0.002, lower=0.0, upper=1.0)

    def on_sensor(self, sensor: SensorModel) -> SensorModel:
        """Use the true step if it is coarser than the stated one."""
        return dataclasses.replace(sensor, resolution=max(self.step, sensor.resolution))


_MARGIN = 0.1  # s of motion beyond the readings: samples need not divide the lost time


@dataclass(frozen=True)
class DroppedSamples(Clock):
    """Samples missing without a gap in the time stamps."""

    name = "dropped_samples"
    place = 25
    channel = "calibration"
    condition = "always"
    size = "{lost_time} of lost samples in every run"
    advice = "Replace the logger, or state the time of every sample"
    equation = (
        "y(t) = β(t) until the instant and β(t + τ) after it, with the change spread over one sample interval; "
        "the instant is drawn for every run. With n instants in a run, τ/n is lost at each. In driven runs the "
        "input is lost with the reading (k = 0), or recorded separately and complete (k = 1)"
    )
    signature = (
        "The phase jumps at an instant of a run; frequency and damping are the same before and after it."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.02,)
    tries = 2

    lost_time: float = parameter(
        "τ", "s", "time that the missing samples would have taken", scale=0.005, lower=0.0, upper=1.0
    )
    input_kept: float = parameter(
        "k", "1", "whether the input of a driven run is complete: 0 or 1",
        scale=1.0, lower=0.0, upper=1.0, of_input=True,
    )  # fmt: skip

    @classmethod
    def sought(cls, residuals: Residuals) -> Iterable[Sought | None]:
        """Jumps of the reading alone, or of the input as well."""
        return (residuals.skips(with_input=False), residuals.skips(with_input=True))

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """The instant, as a share of the run, well inside the run."""
        del stated
        return float(rng.uniform(0.1, 0.9))

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Extend the motions to the end of the readings; where the input is lost too, it is linear."""
        lost = cls.column(effects, "lost_time")
        runs["duration"][:] += np.where(lost != 0.0, lost + _MARGIN, 0.0)
        for place, drive in runs.inputs.items():
            effect, as_stated = effects[place], stated.drive[place]
            if as_stated is None or effect.is_null or effect.input_kept == 1.0:
                continue
            instants = cls._instants(effect, drawn[place]) * stated["duration"][place]
            times, delay = Same(drive.time_s), as_stated.delay
            late = _after_losses(times, delay, effect.lost_time, tuple(instants.tolist()))
            runs.drive[place] = replace(drive, time_s=late)

    def on_time(self, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """The true time runs ahead of the stamps after every instant."""
        if self.is_null:
            return time_s
        instants = (self._instants(drawn) * stated.duration).tolist()
        return _after_losses(Same(read_only(time_s)), 0.0, self.lost_time, tuple(instants))

    def _instants(self, drawn: Drawn) -> Array:
        """Shares of the run, shape (n,)."""
        return drawn if isinstance(drawn, np.ndarray) else np.array([self.drawn_number(drawn)])


def _lost(time_s: Array, lost_time: float, instants: Sequence[float]) -> Array:
    """Time lost until each time stamp, s, in equal parts at the instants, s."""
    interval = time_s[1] - time_s[0]
    after = sum(np.clip((time_s - instant) / interval + 0.5, 0.0, 1.0) for instant in instants)
    return np.asarray(lost_time * (after / len(instants)), np.float64)


@lru_cache(maxsize=64)
def _after_losses(times: Same, delay: float, lost_time: float, instants: tuple[float, ...]) -> Array:
    """The true times of samples, s: one object for equal losses, so that lines and responses are computed once."""
    return read_only(times.array + _lost(times.array + delay, lost_time, instants))


@dataclass(frozen=True)
class MainsHum(MainsPickup):
    """Mains hum in the reading."""

    name = "mains_hum"
    place = 20
    channel = "sensor"
    condition = "always"
    size = "mains hum of {amplitude} at {frequency}"
    advice = "Shield the sensor's cable, or ground it at one end only"
    equation = "y = β + a sin(2π f t + φ), φ drawn for every run"
    signature = "A spectral line at the mains frequency in every run, independent of the motion."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.002, 60.0)

    amplitude: float = parameter("a", "rad", "amplitude of the hum", scale=0.0005, lower=0.0, upper=1.0)
    frequency: float = parameter(
        "f", "Hz", "mains frequency", scale=0.05, lower=45.0, upper=65.0, default=50.0
    )

    @classmethod
    def sought(cls, residuals: Residuals) -> Iterable[Sought | None]:
        """A line of the mains."""
        return (residuals.mains_line(),)

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Add the hum at the phase drawn for the run."""
        del stated
        if self.is_null:
            return angle
        phase = self.drawn_number(drawn)
        return angle + self.amplitude * np.sin(2.0 * np.pi * self.frequency * time_s + phase)


_LEAST_DAMPING = (
    1e-4  # least damping ratio of a structure: judgement; a line that does not decay is not a mode
)
_DECAYS = 1.01  # a fit that ends at the least damping has found a driven line
# cycles within the record and within the decay: fewer do not show an oscillation; judgement
_LEAST_CYCLES = 3.0
# share of the motion's frequency: judgement; anything slower is a drift in a record of ten cycles
_SLOWEST = 0.1
_LEAST_SPRING = 1e-9  # N m/rad: a fit may try zero


@dataclass(frozen=True)
class SecondMode(SecondOscillation):
    """A second oscillation, such as bending of the sting or a coupled degree of freedom."""

    name = "second_mode"
    place = 24
    channel = "sensor"
    condition = "always"
    advice = "Stiffen the part that oscillates beside the body, or model both modes"
    equation = (
        "y = β + a exp(−ζ2 ω2 t) cos(ω2 t + φ), φ drawn for every run; other form: a (|β0|/0.35 rad)^n for a, "
        "β0 the release angle. In driven runs with k = 0 it starts with the run; with k = ±1 the input M "
        "excites it: y = β + k a q/0.35 rad, q̈ + 2 ζ2 ω2 q̇ + ω2² q = ω2² M/Kr"
    )
    signature = (
        "A decaying line that starts at the release, at one frequency for all springs and wind speeds. In driven "
        "runs a second resonance, or a decaying line that starts with the run."
    )
    references = ("Meirovitch, Fundamentals of Vibrations, McGraw-Hill 2001",)
    example = (0.005, 60.0, 0.01)
    resembles = (
        "stiffness",
        "damping",
        "forcing",
    )  # it beats with the motion, so that phase and amplitude change
    tries = 2
    ahead_of_sensor = True

    amplitude: float = parameter(
        "a", "rad", "amplitude at the release", scale=0.002, lower=0.0, upper=1.0, default=0.0
    )
    frequency: float = parameter(
        "ω2", "rad/s", "undamped angular frequency", scale=50.0, lower=0.01, upper=1e5, default=50.0
    )
    damping_ratio: float = parameter(
        "ζ2", "1", "share of critical damping",
        scale=0.01, lower=0.0, upper=0.9, default=0.01, fit_lower=_LEAST_DAMPING, fit_upper=0.2,
    )  # fmt: skip
    exponent: float = parameter(
        "n", "1", "power of the release angle", scale=1.0, lower=0.0, upper=3.0, default=0.0, form=True
    )
    by_input: float = parameter(
        "k", "1", "whether the input of a driven run excites it: 0 or 1, or -1 with the opposite sign",
        scale=1.0, lower=-1.0, upper=1.0, of_input=True,
    )  # fmt: skip

    @classmethod
    def sought(cls, residuals: Residuals) -> Iterable[Sought | None]:
        """The ringing from the release on, and the oscillation excited by the input."""
        return (residuals.ringing(), residuals.excited())

    def plausible(self, omega: float, duration: float, readings: tuple[float, float]) -> bool:
        """Whether the oscillation is separate from the motion, with three cycles in the record.

        It must decay, but not within three cycles; beat with the motion; and not be as slow as a drift.
        """
        del readings
        decays = self.damping_ratio > _DECAYS * _LEAST_DAMPING
        lasts = 2.0 * np.pi * self.damping_ratio * _LEAST_CYCLES < 1.0
        lasting = min(duration, 1.0 / max(self.damping_ratio * self.frequency, 1e-300))
        beats = bool(beats_with(self.frequency / (2.0 * np.pi), omega / (2.0 * np.pi), lasting))
        apart = self.frequency > _SLOWEST * omega and beats
        shown = self.frequency * duration >= 2.0 * np.pi * _LEAST_CYCLES
        return decays and lasts and apart and shown

    def oscillation(self, time_s: Array, stated: RunSettings, drawn: Drawn, derivative: int = 0) -> Array:
        """The second oscillation, at the run's own phase or as excited by the input."""
        if stated.drive is None or self.by_input == 0.0:
            return self._ringing(time_s, stated, drawn, derivative)
        mode = self.frequency, self.damping_ratio
        spring = max(stated.spring_stiffness, _LEAST_SPRING)
        static = self.amplitude / (REFERENCE_RELEASE * spring)  # rad per N m
        return self.by_input * static * stated.drive.oscillation(*mode, time_s, derivative)

    def _ringing(self, time_s: Array, stated: RunSettings, drawn: Drawn, derivative: int) -> Array:
        phase = self.drawn_number(drawn)
        release = REFERENCE_RELEASE if stated.drive else abs(stated.release_angle)
        size = self.amplitude * (release / REFERENCE_RELEASE) ** self.exponent
        since = np.maximum(time_s, 0.0)  # the body is held before the release
        turn = self.frequency * since
        # a derivative multiplies exp(s t) by s, s = ω2 (i − ζ2)
        factor, lead = (
            self.frequency * np.hypot(1.0, self.damping_ratio),
            np.arctan2(1.0, -self.damping_ratio),
        )
        wave = (
            size
            * factor**derivative
            * np.exp(-self.damping_ratio * turn)
            * np.cos(turn + phase + derivative * lead)
        )
        return np.asarray(wave if derivative == 0 else np.where(time_s >= 0.0, wave, 0.0), np.float64)


@dataclass(frozen=True)
class InputDelay(InputClock):
    """An input that acts later than its time stamps.

    Both holds and any delay are exact in a single motion. In a fit, a step that contains a kink keeps the
    impulse and the first moment of the input. Beyond its samples the input keeps its first and its last value.
    """

    name = "input_delay"
    place = 26
    channel = "calibration"
    condition = "always"
    size = "an input that acts {delay} later than recorded"
    advice = (
        "Record input and angle with one clock and equal filters, or correct the stamps of the input by τ"
    )
    equation = "u(t − τ) instead of the stated input u(t), in driven runs"
    signature = (
        "In driven runs the phase between input and angle falls by ωτ, over the whole band and in proportion to "
        "the frequency; a free decay does not change."
    )
    references = ("Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall 1999",)
    example = (0.02,)

    delay: float = parameter(
        "τ",
        "s",
        "time by which the input acts later than its stamp",
        scale=0.002,
        lower=-1.0,
        upper=1.0,
        fit_lower=-0.05,  # s, for a resonance of 2 Hz: a tenth of a period early
        fit_upper=0.2,  # and four tenths of a period late, below the delay of half a turn of phase
    )

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Shift the inputs; a free decay has none."""
        del stated, drawn
        runs.change_inputs(effects, cls._later)

    def _later(self, drive: InputMoment) -> InputMoment:
        return drive if self.is_null else dataclasses.replace(drive, delay=drive.delay + self.delay)
