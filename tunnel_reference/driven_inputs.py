"""The inputs of driven runs: their draws, their value at any time, and the linear rig's response to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tunnel_reference.true_conditions import (
    FRONTAL_AREA,
    REFERENCE_LENGTH,
    Actuation,
    Array,
    DrivenInput,
    TrueConditions,
)

_MIXED = 0.3  # probability of free decays among driven runs
_FREE = 0.4  # share of free decays in that case
_BAND = (0.3, 3.0)  # of the run's own frequency
_UNKNOWN_GAIN = 0.25
_BASE = 0.15
_FINER = 8  # samples of an actuator's moment for each one of the input
WAVEFORMS = ("multisine", "chirp", "square", "random")


def draw_inputs(rng: np.random.Generator, c: TrueConditions, *, by_root: bool = True) -> TrueConditions:
    """Drive all runs of a campaign, or some.

    Args:
        rng: source of all random numbers.
        c: conditions of free decays, which give the rig's frequencies.
        by_root: whether the input may be the motion of the spring's root.

    Returns:
        The conditions with an input. Its linear response reaches half of the stated release angle or more; the
        initial angles and rates are small in comparison.
    """
    kind = rng.random()
    column = (
        "base_rad"
        if by_root and kind < _BASE
        else "drive"
        if kind < _BASE + 2.0 * _UNKNOWN_GAIN
        else "moment_nm"
    )
    gain = float(np.exp(rng.uniform(np.log(0.05), np.log(20.0)))) if column == "drive" else 1.0
    driven = np.ones(c.runs, dtype=np.bool_)
    if rng.random() < _MIXED:
        driven = rng.random(c.runs) >= _FREE
        driven[rng.permutation(c.runs)[:2]] = True, False
    own = np.sqrt((c.true_stiffness - c.air_stiffness) / c.yaw_inertia) / (2.0 * np.pi)
    time, waves = np.arange(c.samples) / c.sample_rate, []
    for frequency in own.tolist():  # around it, and of about unit size
        form = WAVEFORMS[int(rng.integers(len(WAVEFORMS)))]
        low, high = _BAND[0] * frequency, _BAND[1] * frequency
        if form == "square":
            turns = 2.0 * np.pi * frequency * rng.uniform(0.3, 1.2) * time
            wave = np.sign(np.sin(turns + rng.uniform(0.0, 6.0)))
        elif form == "chirp":
            begin, end = (low, high) if rng.random() < 0.5 else (high, low)
            wave = np.sin(2.0 * np.pi * time * (begin + 0.5 * (end - begin) * time / c.duration))
        else:
            lines = np.arange(np.ceil(low * c.duration), np.floor(high * c.duration) + 1.0)
            phase = rng.uniform(0.0, 2.0 * np.pi, lines.size)
            size = np.ones(lines.size) if form == "multisine" else np.abs(rng.standard_normal(lines.size))
            wave = np.zeros(c.samples)
            for line, angle, weight in zip(lines, phase, size, strict=True):
                wave += weight * np.cos(2.0 * np.pi * line / c.duration * time + angle)
            wave = wave / np.sqrt(lines.size)
        waves.append(np.asarray(wave))
    held = np.full(c.runs, rng.random() < 0.5)
    peak = np.where(driven, c.release_angle * rng.uniform(0.5, 1.0, c.runs), 0.0)
    unit = DrivenInput(column, np.stack(waves, axis=1), held, peak, gain, bool(rng.random() < 0.5))
    parameters = np.array([c.yaw_inertia, c.mechanical_damping, c.cn_beta, c.cn_r])
    reached = np.max(np.abs(linear_response(replace(c, drive=unit), parameters)), axis=1)
    start = peak * rng.uniform(-0.3, 0.3, c.runs)
    return replace(
        c,
        drive=replace(unit, values=unit.values * (peak / reached)),
        start_angle=np.where(driven, start, c.start_angle),
        start_rate=2.0 * np.pi * own * peak * rng.uniform(-0.3, 0.3, c.runs),
    )


def linear_response(c: TrueConditions, parameters: Array) -> Array:
    """The nominal rig's response to its input from rest at zero, exact for both holds.

    Args:
        c: conditions with an input; stiffness and speed are the stated ones.
        parameters: Izz, Cr, Cnβ, Cnr, shape (4,).

    Returns:
        Angles at the samples, rad, shape (runs, samples).
    """
    assert c.drive is not None
    inertia, damping, cn_beta, cn_r = parameters
    flow = 0.5 * c.air_density * c.wind_speed * FRONTAL_AREA * REFERENCE_LENGTH
    sigma = (damping - flow * REFERENCE_LENGTH * cn_r) / (2.0 * inertia)
    square = (c.spring_stiffness - flow * c.wind_speed * cn_beta) / inertia
    omega = np.sqrt(np.maximum(square - sigma**2, 0.25))
    out = oscillator_response(c, -sigma + 1j * omega)
    per = np.ones(c.runs) if c.drive.on_body else c.spring_stiffness
    return np.asarray(out * (c.drive.gain * per / inertia)[:, None])


def oscillator_response(c: TrueConditions, pole: np.ndarray) -> Array:
    """The response of q̈ − 2 Re λ q̇ + |λ|² q = u from rest to the input as written, exact for both holds.

    Args:
        c: conditions with an input.
        pole: λ by run, shape (runs,), 1/s.

    Returns:
        q at the samples, shape (runs, samples), in units of the input times s².
    """
    assert c.drive is not None
    h, n = 1.0 / c.sample_rate, len(c.drive.values)
    turn = np.exp(pole * h)
    whole = (turn - 1.0) / pole
    later = np.where(c.drive.held, 0.0, (turn - 1.0 - pole * h) / (pole**2 * h))
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    shift = np.exp(-2j * np.pi * np.arange(size) / size)
    out = np.empty((c.runs, n))
    for r in range(c.runs):
        u = c.drive.values[:, r]
        # z' = λ z + u from one sample to the next; the sums over all earlier samples by Fourier transforms
        moved = np.zeros(n, dtype=np.complex128)
        moved[1:] = (whole[r] - later[r]) * u[:-1] + later[r] * u[1:]
        powers = (1.0 - turn[r] ** n * shift**n) / (1.0 - turn[r] * shift)
        z = np.fft.ifft(np.fft.fft(moved, size) * powers)[:n]
        out[r] = z.imag / pole[r].imag
    return out


def finer(values: Array, held: NDArray[np.bool_]) -> Array:
    """The inputs at more samples, shape (samples, runs): between the given samples held, or linear."""
    place = np.arange(len(values) * _FINER) / _FINER
    before = place.astype(np.intp)
    after = np.minimum(before + 1, len(values) - 1)
    part = (place - before)[:, None] * ~held
    return np.asarray(values[before] + part * (values[after] - values[before]))


def exerted(
    asked: Array, actuator: Actuation, step: float, held: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """The moment of an actuator that starts at the first demand.

    Args:
        asked: demanded moment at the samples, N m, shape (samples, runs).
        step: time between samples, s.
        held: whether the demand is held between samples, shape (runs,).

    Returns:
        The moment, N m, in the same shape, and whether it is held between samples.
    """
    limit, most = actuator.limit, actuator.rate * step
    out = limit * np.tanh(asked / limit) if actuator.soft else np.clip(asked, -limit, limit)
    if not (np.isfinite(most) or actuator.lags):
        return out, held
    out[1:] = np.where(held, out[:-1], out[1:])  # the demand just before the sample
    jumps = held
    if np.isfinite(most):
        jumps = np.zeros_like(held)
        for k in range(1, len(out)):
            out[k] = out[k - 1] + np.clip(out[k] - out[k - 1], -most, most)
    for lag in actuator.lags:
        over = np.where(jumps, out, 0.5 * (out + np.roll(out, 1, axis=0)))  # its mean over each step
        part, jumps = 1.0 - np.exp(-step / lag), np.zeros_like(held)
        for k in range(1, len(out)):
            out[k] = out[k - 1] + part * (over[k] - out[k - 1])
    return out, np.zeros_like(held)


@dataclass(frozen=True, eq=False)
class Inputs:
    """The inputs of all runs of a batch, in N m or rad.

    Args:
        values: shape (samples, rows).
        linear: 1 where they are linear between samples, 0 where they are held, shape (rows,).
        delay: delay of each input, s, shape (rows,).
        on_body: whether they are moments on the body; else angles of the spring's root, shape (rows,).
        rate: sample rate, Hz.
    """

    values: Array
    linear: Array
    delay: Array
    on_body: NDArray[np.bool_]
    rate: float

    @classmethod
    def of(cls, conditions: Sequence[TrueConditions]) -> Inputs | None:
        """The inputs of these campaigns, zero in free decays; None if no run is driven."""
        if all(c.drive is None for c in conditions):
            return None
        runs = [c.runs for c in conditions]
        longest = max(c.samples for c in conditions)
        columns = [
            np.zeros((longest, c.runs))
            if c.drive is None
            else c.drive.gain
            * np.pad(c.drive.values, ((0, longest - len(c.drive.values)), (0, 0)), mode="edge")
            for c in conditions
        ]
        held = [np.zeros(c.runs, np.bool_) if c.drive is None else c.drive.held for c in conditions]
        rate = conditions[0].sample_rate
        if any(c.drive is not None and c.drive.actuator is not None for c in conditions):
            rate *= _FINER
            for place, c in enumerate(conditions):
                actuator = None if c.drive is None else c.drive.actuator
                columns[place] = finer(columns[place], held[place])
                if actuator is not None:
                    columns[place], held[place] = exerted(columns[place], actuator, 1.0 / rate, held[place])
        delay = [np.broadcast_to(0.0 if c.drive is None else c.drive.delay, (c.runs,)) for c in conditions]
        on_body = np.repeat([c.drive is None or c.drive.on_body for c in conditions], runs)
        return cls(
            np.concatenate(columns, axis=1), (1.0 - np.concatenate(held)).astype(np.float64),
            np.concatenate(delay), on_body, rate,
        )  # fmt: skip

    def moment(self, time: float, middle: float) -> Array:
        """The moment on the bodies at a time within the step about ``middle``, s, N m, shape (rows,)."""
        return np.where(self.on_body, self._at(time, middle), 0.0)

    def root(self, time: float, middle: float) -> Array | float:
        """The angle of the springs' roots, rad, shape (rows,); 0 for fixed roots."""
        return 0.0 if self.on_body.all() else np.where(self.on_body, 0.0, self._at(time, middle))

    def _at(self, time: float, middle: float) -> Array:
        """The value; the preceding sample is taken at the step's middle."""
        last = len(self.values) - 1
        if not self.delay.any():
            k = min(int(middle * self.rate + 1e-9), last)
            before, after = self.values[k], self.values[min(k + 1, last)]
            return np.asarray(before + self.linear * (time * self.rate - k) * (after - before))
        at = np.clip((middle - self.delay) * self.rate, 0.0, last).astype(np.intp)
        rows = np.arange(at.size)
        before, after = self.values[at, rows], self.values[np.minimum(at + 1, last), rows]
        part = np.clip((time - self.delay) * self.rate, 0.0, last) - at
        return np.asarray(before + self.linear * part * (after - before))
