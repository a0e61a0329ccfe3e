"""The vocabulary of the integrator: stages, laws, terms and the motion that comes out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tunnel_reference.conditions import Array

Params = Mapping[str, Array]
Rows = NDArray[np.intp] | slice


class Phase(IntEnum):
    """When in a stage a law acts."""

    WIND = 0  # changes the speed ratio
    ANGLE = 1  # changes the angle the air or the spring works on
    MOMENT = 2  # adds a moment
    FRICTION = 3  # adds a friction level


@dataclass(eq=False)
class Stage:
    """One RK4 stage of a batch; arrays have shape (rows,). Laws change what is marked so.

    Args:
        time: s.
        beta: body angle, rad.
        rate: body rate, rad/s.
        theta: angle of the spring and sensor end, rad (the body's where the rod is rigid).
        omega: its rate, rad/s.
        stiffness: true Kr, N m/rad.
        air_stiffness: Ka at the run's true speed, N m/rad.
        air_damping: Ca at the run's true speed, N m s/rad.
        speed_ratio: V(t)/V; changed by laws.
        air_angle: the angle Ka works on, rad; changed by laws.
        spring_angle: the angle Kr works on, rad; changed by laws.
        top: moment on the spring end, N m; changed by laws.
        body: moment on the body, N m; changed by laws.
        level: friction level on the spring end, N m; changed by laws.
    """

    time: float
    beta: Array
    rate: Array
    theta: Array
    omega: Array
    stiffness: Array
    air_stiffness: Array
    air_damping: Array
    speed_ratio: Array
    air_angle: Array
    spring_angle: Array
    top: Array
    body: Array
    level: Array


Law = Callable[[Stage, Rows, Params, Array, Array], None]
"""law(stage, rows, parameters, memory, memory's derivative); memory has shape (states, rows)."""


@dataclass(frozen=True, eq=False)
class Term:
    """A law bound to the runs of one campaign.

    Args:
        law: the law.
        phase: when it acts.
        params: arrays whose first axis is the campaign's runs.
        memory: initial memory, shape (states, runs); None where the law has none.
    """

    law: Law
    phase: Phase
    params: dict[str, Array]
    memory: Array | None = None


@dataclass(frozen=True, eq=False)
class Motion:
    """What the sensor end did in one campaign.

    Args:
        angle: shape (samples, runs), rad.
        rate: shape (samples, runs), rad/s.
    """

    angle: Array
    rate: Array
