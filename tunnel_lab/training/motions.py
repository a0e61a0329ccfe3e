"""Motions of drawn campaigns by the reference simulator, at the low sample rate of training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tunnel_reference.conditions import Conditions
from tunnel_reference.draw import CampaignDraw
from tunnel_reference.integrator import integrate
from tunnel_reference.severity import bind_effects
from tunnel_reference.terms import Motion, Term
from tunnel_sim.vocabulary.record import Array


def motions_of(draws: Sequence[CampaignDraw], substeps: int) -> list[Motion]:
    """Integrate campaigns together; those with a flexible rod, which act alone, in closed form.

    Args:
        substeps: Runge–Kutta steps per sample.
    """
    bound = [bind_effects(draw) for draw in draws]
    rigid = [place for place, (c, _) in enumerate(bound) if c.rod is None]
    terms = [[term for term in bound[place][1] if isinstance(term, Term)] for place in rigid]
    found: dict[int, Motion] = {}
    if rigid:
        found = dict(
            zip(rigid, integrate([bound[p][0] for p in rigid], terms, substeps=substeps), strict=True)
        )
    return [found[place] if place in found else flexible_motion(c) for place, (c, _) in enumerate(bound)]


def flexible_motion(c: Conditions) -> Motion:
    """The upper end of a linear rod, by the modes of its four states."""
    angle = np.empty((c.samples, c.runs))
    rate = np.empty_like(angle)
    time = np.arange(c.samples) / c.sample_rate
    for run in range(c.runs):
        matrix, start = _linear(c, run)
        values, modes = np.linalg.eig(matrix)
        weights = np.linalg.solve(modes, start.astype(complex))
        states = (modes * weights) @ np.exp(np.outer(values, time))
        angle[:, run], rate[:, run] = states[2].real, states[3].real
    return Motion(angle, rate)


def _linear(c: Conditions, run: int) -> tuple[Array, Array]:
    """The equations of body angle and rate, upper angle and rate, and their state at the release."""
    assert c.rod is not None
    spring, air, drag = c.true_stiffness[run], c.air_stiffness[run], c.air_damping[run]
    top, body = c.rod.share * c.yaw_inertia, (1.0 - c.rod.share) * c.yaw_inertia
    rod = 1.0 / c.rod.compliance
    damper = 2.0 * c.rod.damping_ratio * np.sqrt(rod * top)
    matrix = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [(air - rod) / body, (drag - damper) / body, rod / body, damper / body],
            [0.0, 0.0, 0.0, 1.0],
            [rod / top, damper / top, -(spring + rod) / top, -(c.mechanical_damping + damper) / top],
        ]
    )
    release = c.start_angle[run]
    held_body = np.array([release, 0.0, release * rod / (spring + rod), 0.0])
    held_top = np.array([release * rod / (rod - air), 0.0, release, 0.0])
    return matrix, held_body if c.rod.held_body else held_top
