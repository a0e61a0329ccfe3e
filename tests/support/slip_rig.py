"""Four runs of a rig in closed form, and everyday slips that spoil what is stated of them or how they are recorded.

Nothing here is shared with the simulators or the estimators. A slip takes the honest campaign and returns the
spoiled one. The truth is in the constants.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

AREA, LENGTH, DENSITY = 0.036, 0.625, 1.2  # m2, m, kg/m3
INERTIA, DAMPING, CN_BETA, CN_R = 0.11, 0.018, 0.495, -0.114  # kg m2, N m s/rad, 1/rad, 1/rad
SPRINGS, SPEEDS = (16.12, 44.84), (0.0, 15.0)  # N m/rad, m/s
RATE, DURATION = 500.0, 10.0  # Hz, s
RELEASE, ZERO, NOISE = 0.26, 0.004, 5e-4  # rad

Slip = Callable[[Campaign], Campaign]


@dataclass(frozen=True)
class Condition:
    """What one run is and does.

    Args:
        release: angle at the release, rad.
        clock: relative change of the clock's rate over the run; the stamps follow the clock.
    """

    spring: float
    speed: float
    release: float = RELEASE
    clock: float = 0.0


def motion(condition: Condition, time: Array) -> Array:
    """The angle after a release from rest, from the two roots of the characteristic equation, rad."""
    load = 0.5 * DENSITY * condition.speed * AREA * LENGTH
    stiffness = (condition.spring - load * condition.speed * CN_BETA) / INERTIA
    damping = (DAMPING - load * LENGTH * CN_R) / INERTIA
    root = -0.5 * damping + 1j * np.sqrt(stiffness - 0.25 * damping**2)
    weight = 1.0 + 1j * root.real / root.imag
    return np.asarray(condition.release * np.real(weight * np.exp(root * time)))


def honest(
    conditions: Sequence[Condition] | None = None,
    *,
    seed: int = 0,
    zero: float = ZERO,
    inertia: float | None = None,
    release: bool = False,
) -> Campaign:
    """A campaign without a slip.

    Args:
        conditions: of the runs; two springs with the wind off and on where None.
        inertia: stated Izz, kg m2.
        release: whether the release angles are stated.
    """
    conditions = conditions or [Condition(spring, speed) for spring in SPRINGS for speed in SPEEDS]
    time, runs = np.arange(round(DURATION * RATE)) / RATE, []
    for number, one in enumerate(conditions, 1):
        true_time = time * (1.0 - 0.5 * one.clock + 0.5 * one.clock * time / DURATION)
        noise = np.random.default_rng([seed, number]).normal(0.0, NOISE, time.size)
        runs.append(
            Run(
                f"r{number}",
                Record(time, motion(one, true_time) + zero + noise),
                one.speed,
                one.spring,
                DENSITY if one.speed else None,
                one.release if release else None,
            )
        )
    return Campaign("slips", RigProperties(inertia, AREA, LENGTH), SensorProperties(RATE), tuple(runs))


def repeated(count: int = 3, **how: object) -> Campaign:
    """Every condition ``count`` times."""
    return honest([Condition(k, v) for k in SPRINGS for v in SPEEDS for _ in range(count)], **how)  # type: ignore[arg-type]


def stating(*names: str, **values: float | None) -> Slip:
    """The slip of stating other values for some runs; for all where none is named."""

    def slip(data: Campaign) -> Campaign:
        runs = tuple(replace(r, **values) if not names or r.id in names else r for r in data.runs)  # type: ignore[arg-type]
        return replace(data, runs=runs)

    return slip


def scaling(*names: str, **factors: float) -> Slip:
    """The slip of stating what is stated in another unit."""

    def slip(data: Campaign) -> Campaign:
        runs = []
        for run in data.runs:
            chosen = not names or run.id in names
            values = {key: (getattr(run, key) or 0.0) * factor for key, factor in factors.items()}
            runs.append(replace(run, **values) if chosen else run)
        return replace(data, runs=tuple(runs))

    return slip


def recording(change: Callable[[Array, Array], tuple[Array, Array]], *names: str) -> Slip:
    """The slip of recording something else in some runs: new times and readings from the old ones."""

    def slip(data: Campaign) -> Campaign:
        runs = []
        for run in data.runs:
            chosen = not names or run.id in names
            record = run.record
            runs.append(
                replace(run, record=Record(*change(record.time_s, record.yaw_rad))) if chosen else run
            )
        return replace(data, runs=tuple(runs))

    return slip


def reading(change: Callable[[Array], Array], *names: str) -> Slip:
    """The slip of reading something else at the same times."""
    return recording(lambda time, yaw: (time, change(yaw)), *names)


def clocking(change: Callable[[Array], Array], *names: str) -> Slip:
    """The slip of stamping the same readings with other times."""
    return recording(lambda time, yaw: (change(time), yaw), *names)


def twice(change: Callable[[Array, Array], tuple[Array, Array]], name: str = "r1", **stated: float) -> Slip:
    """The slip of listing a record again, changed a little."""

    def slip(data: Campaign) -> Campaign:
        run = next(r for r in data.runs if r.id == name)
        again = replace(
            run, id="again", record=Record(*change(run.record.time_s, run.record.yaw_rad)), **stated
        )  # type: ignore[arg-type]
        return replace(data, runs=(*data.runs, again))

    return slip


def exchanged(one: str, other: str, *keys: str) -> Slip:
    """The slip of exchanging what is stated of two runs."""

    def slip(data: Campaign) -> Campaign:
        a, b = (next(r for r in data.runs if r.id == name) for name in (one, other))
        swapped = {
            one: replace(a, **{key: getattr(b, key) for key in keys}),
            other: replace(b, **{key: getattr(a, key) for key in keys}),
        }
        return replace(data, runs=tuple(swapped.get(r.id, r) for r in data.runs))

    return slip


def both(*slips: Slip) -> Slip:
    """Several slips, one after the other."""

    def slip(data: Campaign) -> Campaign:
        for one in slips:
            data = one(data)
        return data

    return slip


def sensing(**values: object) -> Slip:
    """The slip of stating other properties of the sensor."""
    return lambda data: replace(data, sensor=replace(data.sensor, **values))  # type: ignore[arg-type]


def high_passed(constant: float, held: bool) -> Callable[[Array], Array]:
    """What an AC-coupled sensor reads.

    Args:
        constant: time constant, s.
        held: whether the body was held long before the record begins, so that the reading begins at zero.
    """

    def change(yaw: Array) -> Array:
        keep = np.exp(-1.0 / (RATE * constant))
        out, last, before = np.empty_like(yaw), 0.0 if held else yaw[0], yaw[0]
        for i, value in enumerate(yaw):
            last = keep * (last + value - before)
            before, out[i] = value, last
        return out

    return change


def padded(share: float, value: float | None = 0.0) -> Callable[[Array], Array]:
    """The last share of a record replaced by a constant; by its last reading where None."""

    def change(yaw: Array) -> Array:
        at = round((1.0 - share) * yaw.size)
        return np.concatenate([yaw[:at], np.full(yaw.size - at, yaw[at - 1] if value is None else value)])

    return change


def wrapped(rest: float = np.pi - 0.05) -> Callable[[Array], Array]:
    """An encoder that hangs near π and wraps there."""
    return lambda yaw: np.asarray((yaw + rest + np.pi) % (2.0 * np.pi) - np.pi)
