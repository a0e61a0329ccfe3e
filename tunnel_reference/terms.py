"""The types of the integrator: stages, laws, terms and the resulting motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tunnel_reference.conditions import Array

Params = Mapping[str, Array]
Places = NDArray[np.intp]
Rows = Places | slice


class Phase(IntEnum):
    """When a law acts within a stage."""

    WIND = 0  # changes the speed ratio
    ANGLE = 1  # changes the angle on which air or spring acts
    MOMENT = 2  # adds a moment
    FRICTION = 3  # adds a friction level


@dataclass(eq=False)
class Stage:
    """One RK4 stage of a batch; arrays have shape (rows,). Laws may change the marked arrays.

    Args:
        time: s.
        beta: body angle, rad.
        rate: body rate, rad/s.
        theta: angle of the rod's upper end, rad (that of the body where the rod is rigid).
        omega: rate of the upper end, rad/s.
        stiffness: true Kr, N m/rad.
        air_stiffness: Ka at the run's true speed, N m/rad.
        air_damping: Ca at the run's true speed, N m s/rad.
        speed_ratio: V(t)/V; changed by laws.
        air_angle: the angle on which Ka acts, rad; changed by laws.
        spring_angle: the angle on which Kr acts, rad; changed by laws.
        top: moment on the upper end, N m; changed by laws.
        body: moment on the body, N m; changed by laws.
        level: friction level at the upper end, N m; changed by laws.
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
"""law(stage, rows, parameters, states, derivative of the states); states have shape (states, rows)."""


@dataclass(frozen=True, eq=False)
class Term:
    """A law bound to the runs of one campaign.

    Args:
        params: arrays whose first axis is the campaign's runs.
        memory: initial states of the law, shape (states, runs); None where it has none.
    """

    law: Law
    phase: Phase
    params: dict[str, Array]
    memory: Array | None = None


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of the rod's upper end in one campaign.

    Args:
        angle: shape (samples, runs), rad.
        rate: shape (samples, runs), rad/s.
    """

    angle: Array
    rate: Array
