"""The shape of the Davis model: a box with a slanted rear and a rounded front, as mesh vertices."""

from __future__ import annotations

from math import cos, pi, radians, sin, tan

import numpy as np

from tunnel_sim.record import Array
from tunnel_sim.rig import Body

_SLANT_DROP = 0.4  # share of the height the slant takes: the paper gives its angle, not its length
_NOSE_RADIUS = 0.28  # share of the height, drawn only
_EDGE = 0.10  # share of the half width by which roof and floor draw in, drawn only


def davis_vertices(body: Body) -> Array:
    """Vertices whose convex hull is the body, in its own frame.

    Args:
        body: dimensions, m, and slant, degrees.

    Returns:
        Array of shape (n, 3), m: x forward, y to the left, z up, origin at the middle of the bounding box.
    """
    profile = _side_profile(body)
    half_width = body.width / 2
    # full width at mid height, drawn in at roof and floor, so that light catches the edges
    vertices = []
    for x, z in profile:
        inset = half_width * _EDGE
        for side in (-1.0, 1.0):
            vertices.append((x, side * (half_width - inset), z))
            vertices.append((x * 0.985, side * half_width, z * 0.86))
    return np.array(vertices)


def _side_profile(body: Body) -> list[tuple[float, float]]:
    nose, tail = body.length / 2, -body.length / 2
    top, bottom = body.height / 2, -body.height / 2
    drop = _SLANT_DROP * body.height
    slant_start = tail + drop / tan(radians(body.rear_slant_deg)) if body.rear_slant_deg > 0 else tail
    radius = _NOSE_RADIUS * body.height
    points = [
        (tail, bottom),
        (tail, top - drop if body.rear_slant_deg > 0 else top),
        (min(slant_start, nose), top),
    ]
    for step in range(7):  # upper and lower front edges are quarter rounds
        angle = pi / 2 * step / 6
        points.append((nose - radius * (1 - sin(angle)), top - radius * (1 - cos(angle))))
        points.append((nose - radius / 2 * (1 - sin(angle)), bottom + radius / 2 * (1 - cos(angle))))
    return points
