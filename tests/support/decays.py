"""Free decays in closed form, to be spoiled in one way each; the truth is in the arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.signal.free_decay import Decay, free_decay
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

INERTIA, DAMPING, CN_BETA, CN_R = 0.1, 0.015, 0.45, -0.1
AREA, LENGTH, DENSITY = 0.036, 0.625, 1.2
RATE, NOISE, ANGLE = 500.0, 4e-4, 0.35


def run(
    name: str,
    spring: float,
    speed: float,
    *,
    actual: float | None = None,
    angle: float = ANGLE,
    seed: int = 0,
) -> Run:
    """One decay of ten seconds, of the spring `actual` where that is not the one stated, N m/rad."""
    load = 0.5 * DENSITY * speed**2 * AREA * LENGTH
    loss = 0.5 * DENSITY * speed * AREA * LENGTH**2 * CN_R
    decay = Decay((DAMPING - loss) / (2.0 * INERTIA), ((actual or spring) - load * CN_BETA) / INERTIA)
    time = np.arange(int(10.0 * RATE)) / RATE
    noise = np.random.default_rng([seed, *name.encode()]).normal(0.0, NOISE, time.size)
    record = Record(time, free_decay(time, decay, angle, 0.0) + 0.003 + noise)
    return Run(name, record, speed, spring, DENSITY if speed else None, angle)


def campaign(runs: Sequence[Run]) -> Campaign:
    """The runs with the sizes of their rig."""
    return Campaign("c", RigProperties(None, AREA, LENGTH), SensorProperties(RATE), tuple(runs))


def grid(
    springs: Sequence[float] = (16.0, 35.0, 68.0), speeds: Sequence[float] = (0.0, 15.0, 25.0)
) -> Campaign:
    """Every spring at every speed."""
    return campaign([run(f"k{k:g}-v{v:g}", k, v) for k in springs for v in speeds])


def reading(one: Run, yaw: Array) -> Run:
    """The run with another reading of as many samples or more, at its own rate."""
    return replace(one, record=Record(np.arange(yaw.size) / RATE, yaw))


def stated(data: Campaign, name: str, **other: float) -> Campaign:
    """The campaign with other statements for one run."""
    return replace(data, runs=tuple(replace(r, **other) if r.id == name else r for r in data.runs))
