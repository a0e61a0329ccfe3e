"""Kinds of driven campaigns in one table: input, springs, sensor and clock; and what may be planted in them.

The truth is the equation of motion, integrated by the classical Runge–Kutta method, whose steps end at the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import tanh
from typing import Literal

import numpy as np

from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Hold, Input
from tunnel_sim.vocabulary.record import Array, Record

RATE, COUNT, STEPS = 100.0, 1200, 8  # Hz, samples of a run, steps of a sample
INERTIA, DAMPING, GAIN, ZERO = 0.1, 0.05, 2.5, 0.01
NOISE = {"angle": 3e-4, "rate": 5e-3}
TRUTH = {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING}
SIZES: dict[InputColumn, float] = {
    "moment_nm": 0.06, "drive": 0.06 / GAIN, "base_rad": 0.003, "base_acceleration_rad_s2": 0.6
}  # fmt: skip
"""Of a line of the input: runs swing by about 0.1 rad."""

Slope = Callable[[list[float], float], list[float]]
"""Derivatives of the states from the states, of which the first is the angle that is read, and the input."""


@dataclass(frozen=True)
class Kind:
    """A kind of campaign.

    Args:
        runs: spring, N m/rad, and input of every run; a run without an input is a free decay.
        stated: whether the campaign states its springs.
        known_gain: whether it states the gain of a ``drive``.
    """

    runs: tuple[tuple[float, InputColumn | None], ...]
    hold: Hold = "linear"
    reads: Literal["angle", "rate"] = "angle"
    even: bool = True
    stated: bool = True
    known_gain: bool = False
    zero: Literal["common", "per_run"] | None = None

    @property
    def finds_gain(self) -> bool:
        return not self.known_gain and any(column == "drive" for _, column in self.runs)


def both(column: InputColumn) -> tuple[tuple[float, InputColumn | None], ...]:
    return (16.0, column), (36.0, column)


KINDS: dict[str, Kind] = {
    "moment": Kind(both("moment_nm")),
    "held moment": Kind(both("moment_nm"), "zero"),
    "one run": Kind(both("moment_nm")[:1]),
    "unknown gain": Kind(both("drive")),
    "held, unknown gain": Kind(both("drive"), "zero"),
    "stated gain": Kind(both("drive"), known_gain=True),
    "no spring stated": Kind(both("drive")[:1] * 2, stated=False),
    "turning base, no spring stated": Kind(both("base_acceleration_rad_s2"), stated=False),
    "root": Kind(both("base_rad")),
    "held root": Kind(both("base_rad"), "zero"),
    "turning base": Kind(both("base_acceleration_rad_s2")),
    "turning base, rates": Kind(both("base_acceleration_rad_s2"), reads="rate"),
    "moment, then released": Kind(((16.0, "moment_nm"), (36.0, None))),
    "released, then unknown gain": Kind(((16.0, None), (36.0, "drive")), "zero"),
    "rates": Kind(both("moment_nm"), reads="rate"),
    "held, rates": Kind(both("moment_nm"), "zero", "rate"),
    "uneven": Kind(both("moment_nm"), even=False),
    "loose": Kind(((0.0, "moment_nm"),), "zero"),
    "loose, stated gain": Kind(((0.0, "drive"),), "zero", known_gain=True),
    "loose, root and released": Kind(
        ((0.0, "drive"), (16.0, "base_rad"), (36.0, None)), "zero", zero="per_run"
    ),
}


@dataclass(frozen=True)
class Planted:
    """What acts beside the linear law.

    Args:
        cubic: κ of the spring, 1/rad²; friction: N m; delay: of the input, s.
        mode: of the sensor, excited by the moment: amplitude, angular frequency, damping ratio.
    """

    cubic: float = 0.0
    friction: float = 0.0
    delay: float = 0.0
    mode: tuple[float, float, float] | None = None


NOTHING = Planted()


def slope_of(spring: float, column: InputColumn | None, planted: Planted) -> Slope:
    """The equation of motion; an input without a unit has the gain of the table."""
    gain = {"moment_nm": 1.0, "drive": GAIN}.get(column or "", 0.0)
    root = float(column == "base_rad")
    base = float(column == "base_acceleration_rad_s2")

    def pulled(angle: float, rate: float, u: float) -> float:
        bent = angle - root * u
        rubbed = planted.friction * tanh(rate / 1e-3) if planted.friction else 0.0
        return -spring * (bent + planted.cubic * bent**3) - DAMPING * rate - rubbed

    def plain(y: list[float], u: float) -> list[float]:
        return [y[1], (pulled(y[0], y[1], u) + gain * u) / INERTIA - base * u]

    if planted.mode is not None:
        size, omega, zeta = planted.mode
        per_moment = omega**2 * size / (0.35 * spring)

        def ringing(y: list[float], u: float) -> list[float]:
            forced = per_moment * gain * u - 2.0 * zeta * omega * y[3] - omega**2 * y[2]
            return [*plain(y, u), y[3], forced]

        return ringing
    return plain


def moved(time: Array, values: Array, kind: Kind, slope: Slope, start: list[float], late: int = 0) -> Array:
    """The states at the samples; the input may act some steps late."""
    step = np.repeat(np.diff(time) / STEPS, STEPS).tolist()
    first, turn = np.repeat(values[:-1], STEPS), np.repeat(np.diff(values), STEPS)
    part = np.tile(np.arange(STEPS) / STEPS, time.size - 1)
    ends = [
        first + (part + share) * turn * (kind.hold == "linear") for share in (0.0, 0.5 / STEPS, 1.0 / STEPS)
    ]
    given = [np.r_[np.full(late, one[0]), one][: one.size].tolist() for one in ends]
    y, seen = start, [start]
    for count, (h, now, half, then) in enumerate(zip(step, *given, strict=True), 1):
        a = slope(y, now)
        b = slope([p + 0.5 * h * q for p, q in zip(y, a, strict=True)], half)
        c = slope([p + 0.5 * h * q for p, q in zip(y, b, strict=True)], half)
        d = slope([p + h * q for p, q in zip(y, c, strict=True)], then)
        y = [p + h * (q + 2.0 * (r + s) + t) / 6.0 for p, q, r, s, t in zip(y, a, b, c, d, strict=True)]
        if count % STEPS == 0:
            seen.append(y)
    return np.array(seen)


def stamps(kind: Kind, rng: np.random.Generator) -> Array:
    """Even, or with jitter of a third of the interval and every fortieth sample lost."""
    even = np.arange(COUNT) / RATE
    if kind.even:
        return even
    jittered = even + np.append(0.0, rng.uniform(-0.15, 0.15, COUNT - 1)) / RATE
    return np.asarray(jittered[rng.uniform(size=COUNT) > 0.025])


@cache
def exact(name: str, planted: Planted = NOTHING) -> Campaign:
    """The campaign without noise: multisines of 0.5 to 6 Hz, and decays from 0.2 rad."""
    kind, runs = KINDS[name], []
    for place, (spring, column) in enumerate(kind.runs):
        rng = np.random.default_rng(place)
        time = stamps(kind, rng)
        lines = 2.0 * np.pi * np.arange(0.5, 6.0, 2.0 / time[-1])
        phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
        values = SIZES.get(column, 0.0) * np.cos(np.outer(time, lines) + phases).sum(axis=1)  # type: ignore[arg-type]
        slope = slope_of(spring, column, planted)
        state = [0.02 if column else 0.2, 0.0]
        start = [*state, 0.0, 0.0] if planted.mode else state
        states = moved(time, values, kind, slope, start, round(planted.delay * RATE * STEPS))
        reading = states[:, 1] if kind.reads == "rate" else states[:, 0]
        if planted.mode:
            reading = reading + states[:, 2]
        gain = GAIN if kind.known_gain else None
        drive = None if column is None else Input(column, values, kind.hold, gain)
        stiffness, release = spring if kind.stated else None, None if column else 0.2
        record = Record(time, reading + ZERO)
        runs.append(Run(f"r{place}", record, 0.0, stiffness, release_angle=release, drive=drive))
    sensor = SensorProperties(RATE if kind.even else None, quantity=kind.reads, zero=kind.zero)
    return Campaign(name, RigProperties(), sensor, tuple(runs))


def driven(name: str, planted: Planted = NOTHING, seed: int = 0) -> Campaign:
    """A campaign of a kind as its sensor reads it."""
    return with_noise(exact(name, planted), seed)


def with_noise(clean: Campaign, seed: int) -> Campaign:
    """White noise on every reading, of the table's standard deviation."""
    runs, size = [], NOISE[clean.sensor.quantity]
    for place, run in enumerate(clean.runs):
        noise = size * np.random.default_rng([seed, place, 1]).standard_normal(run.record.time_s.size)
        runs.append(replace(run, record=Record(run.record.time_s, run.record.yaw_rad + noise)))
    return replace(clean, runs=tuple(runs))
