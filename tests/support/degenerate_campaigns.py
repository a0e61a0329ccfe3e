"""Campaigns that no rig would give and that a reader lets through: every one is made from a seed alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

Shape = Callable[[Array, np.random.Generator], Array]


def _decay(time: Array, rng: np.random.Generator, *, zeta: float | None = None, k: float = 1.0) -> Array:
    omega = rng.uniform(4.0, 20.0) * k
    ratio = 10.0 ** rng.uniform(-3.0, -1.0) if zeta is None else zeta
    shape = np.exp(-ratio * omega * time) * np.cos(omega * np.sqrt(max(1.0 - ratio**2, 0.0)) * time)
    return np.asarray(0.3 * shape)


def _spike(time: Array, rng: np.random.Generator) -> Array:
    values = np.zeros_like(time)
    values[rng.integers(time.size)] = 10.0 ** rng.uniform(-8.0, 0.5)
    return values


def _steps(time: Array, rng: np.random.Generator) -> Array:
    size = int(rng.integers(2, 9))
    return np.asarray(rng.standard_normal(size)[np.arange(time.size) * size // time.size])


def _over_damped(time: Array, rng: np.random.Generator) -> Array:
    fast, slow = rng.uniform(2.0, 30.0), rng.uniform(0.01, 2.0)
    return np.asarray(0.3 * (fast * np.exp(-slow * time) - slow * np.exp(-fast * time)) / (fast - slow))


def _critical(time: Array, rng: np.random.Generator) -> Array:
    rate = rng.uniform(0.2, 10.0)
    return np.asarray(0.3 * (1.0 + rate * time) * np.exp(-rate * time))


def _growth(time: Array, rng: np.random.Generator) -> Array:
    return _decay(time, rng, zeta=-(10.0 ** rng.uniform(-3.0, -0.7)))


def _saturated(time: Array, rng: np.random.Generator) -> Array:
    limit = 0.3 * rng.uniform(0.01, 0.9)
    return np.clip(_decay(time, rng), -limit, limit)


def _two_per_cycle(time: Array, rng: np.random.Generator) -> Array:
    signs = np.where(np.arange(time.size) % 2, -1.0, 1.0)
    return np.asarray(0.3 * signs * np.exp(-rng.uniform(0.0, 0.5) * time))


def _square(time: Array, rng: np.random.Generator) -> Array:
    return np.asarray(0.3 * np.sign(_decay(time, rng)))


def _late(time: Array, rng: np.random.Generator) -> Array:
    begun = int(rng.integers(1, time.size))
    return np.concatenate((np.full(begun, 0.3), _decay(time[: time.size - begun], rng)))


def _stopped(time: Array, rng: np.random.Generator) -> Array:
    values = _decay(time, rng)
    values[rng.integers(1, time.size) :] = 0.0
    return values


SHAPES: dict[str, Shape] = {
    "decay": _decay,
    "constant": lambda time, rng: np.full_like(time, rng.choice([0.0, 0.3, 1e-300, 3.0])),
    "one sample off": lambda time, rng: np.append(
        np.full(time.size - 1, 0.1), 0.1 + rng.choice([1e-16, 1e-12])
    ),
    "spike": _spike,
    "steps": _steps,
    "noise": lambda time, rng: 10.0 ** rng.uniform(-8.0, 0.0) * rng.standard_normal(time.size),
    "ramp": lambda time, rng: rng.uniform(-1.0, 1.0) + rng.uniform(-1.0, 1.0) * time / time[-1],
    "parabola": lambda time, _: np.asarray((time / time[-1]) ** 2 - 0.3),
    "exponential": lambda time, rng: np.exp(-rng.uniform(-5.0, 50.0) * time / time[-1]),
    "over-damped": _over_damped,
    "critical": _critical,
    "growth": _growth,
    "undamped": lambda time, rng: _decay(time, rng, zeta=0.0),
    "slow": lambda time, rng: _decay(time, rng, k=float(10.0 ** rng.uniform(-2.0, -1.0))),
    "fast": lambda time, rng: _decay(time, rng, k=float(rng.uniform(5.0, 50.0))),
    "saturated": _saturated,
    "two per cycle": _two_per_cycle,
    "square": _square,
    "triangle": lambda time, rng: np.arcsin(np.clip(np.sin(rng.uniform(2.0, 20.0) * time), -1.0, 1.0)),
    "late": _late,
    "stopped": _stopped,
    "random walk": lambda time, rng: 0.01 * np.cumsum(rng.standard_normal(time.size)),
    "one level": lambda time, rng: 0.1 * np.round(_decay(time, rng) / 0.1),
    "two values": lambda time, rng: rng.integers(0, 2, time.size).astype(np.float64),
}
SCALES = (
    1.0,
    1.0,
    1.0,
    1.0,
    1.0,
    1e-3,
    1e-9,
    1e-30,
    1e-160,
    1e-200,
    5e-324,
    1e-308,
    3.0,
    30.0,
    1e6,
    1e100,
    1e160,
)
SPRINGS: tuple[tuple[float | None, ...], ...] = (
    (16.12, 44.84),
    (16.12, 16.12),
    (16.12, 16.12 * (1.0 + 1e-9)),
    (16.12, 16.12 * (1.0 + 1e-5)),
    (16.12, 16.12 * (1.0 + 1e-13)),
    (1e-12, 1e12),
    (1e-300, 1e300),
    (5e-324, 16.12),
    (None, 16.12),
    (None, None),
    (3.0, 5.0, 9.0),
)
SPEEDS: tuple[tuple[float, ...], ...] = (
    (0.0,),
    (0.0, 20.0),
    (20.0,),
    (20.0, 20.0),
    (10.0, 20.0),
    (0.0, 1e-9),
    (0.0, 1e-160),
    (0.0, 1e9),
    (0.0, 20.0, 30.0),
)


def record(rng: np.random.Generator) -> tuple[str, Record]:
    """One record of a shape, a size, a length and a noise that are all drawn.

    Args:
        rng: draws them.

    Returns:
        What it is, and the record.
    """
    count = int(rng.choice([2, 3, 5, 8, 17, 40, 100, 300, 300, 300, 800]))
    rate = float(rng.choice([5.0, 50.0, 50.0, 50.0, 200.0]))
    time = np.arange(count) / rate + float(rng.choice([0.0, 0.0, 3.0, 1e4]))
    name = str(rng.choice(list(SHAPES)))
    scale = float(rng.choice(SCALES))
    values = SHAPES[name](time - time[0], rng) + float(rng.choice([0.0, 0.0, 0.1, 3.1]))
    values = values + float(rng.choice([0.0, 0.0, 1e-6, 1e-3])) * rng.standard_normal(count)
    return f"{name} × {scale:g}, {count} at {rate:g} Hz", Record(time, scale * values)


def degenerate_campaign(seed: int) -> Campaign:
    """A campaign drawn from a seed.

    Args:
        seed: 0 or more.

    Returns:
        One to six runs; its description names the shapes.
    """
    rng = np.random.default_rng(seed)
    springs = SPRINGS[rng.integers(len(SPRINGS))]
    speeds = SPEEDS[rng.integers(len(SPEEDS))]
    alike = bool(rng.random() < 0.4)
    words, held = record(rng)
    shapes, runs = [words], []
    for k in range(int(rng.integers(1, 7))):
        if not alike and k:
            words, held = record(rng)
            shapes.append(words)
        speed = speeds[k % len(speeds)]
        runs.append(
            Run(
                f"r{k}",
                held,
                speed,
                springs[(k // len(speeds)) % len(springs)],
                1.2 if speed > 0.0 else None,
            )
        )
    rig = RigProperties(0.1, 0.036, 0.625, 0.225) if rng.random() < 0.7 else RigProperties()
    noise = rng.choice([None, None, 5e-4, 1e-30, 1e3])
    step = rng.choice([None, None, 5e-4, 1.0])
    return Campaign("degenerate", rig, SensorProperties(50.0, step, noise), tuple(runs), "; ".join(shapes))


def same_runs(campaign: Campaign, count: int) -> Campaign:
    """The first run of a campaign several times over, under names of its own.

    Args:
        campaign: at least one run.
        count: of the runs.
    """
    first = campaign.runs[0]
    return replace(campaign, runs=tuple(replace(first, id=f"r{k}") for k in range(count)))
