"""The shape of the Davis model: a box with a slanted rear and a rounded front, as mesh vertices."""

from __future__ import annotations

from math import cos, pi, radians, sin, tan

import numpy as np

from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Body

_SLANT_DROP = 0.4  # height of the slant over that of the body: the paper gives its angle, not its length
_NOSE_RADIUS = 0.30  # share of the height, drawn only
_EDGE_RADIUS = 0.14  # of the long edges, share of the height, drawn only
_STEPS = 8  # facets of a quarter round


def davis_vertices(body: Body) -> Array:
    """Vertices whose convex hull is the body, in its own frame.

    Args:
        body: dimensions, m, and slant, degrees.

    Returns:
        Array of shape (n, 3), m: x forward, y to the left, z up, origin at the middle of the bounding box.
    """
    profile = np.array(_side_profile(body))
    radius = _EDGE_RADIUS * body.height
    layers = []
    for angle in np.linspace(0.0, pi / 2, _STEPS + 1):
        # the side profile, shrunk evenly along the quarter round of the long edges
        inward = radius * (1.0 - cos(angle))
        shrunk = profile * (1.0 - 2.0 * inward / np.array([body.length, body.height]))
        offset = body.width / 2 - radius * (1.0 - sin(angle))
        layers += [np.insert(shrunk, 1, side * offset, axis=1) for side in (-1.0, 1.0)]
    # angle 0: full profile at reduced width; angle pi/2: shrunk profile at full width
    return np.concatenate(layers)


def _side_profile(body: Body) -> list[tuple[float, float]]:
    nose, tail = body.length / 2, -body.length / 2
    top, bottom = body.height / 2, -body.height / 2
    drop = _SLANT_DROP * body.height if body.rear_slant_deg > 0 else 0.0
    run = drop / tan(radians(body.rear_slant_deg)) if drop else 0.0
    radius = _NOSE_RADIUS * body.height
    points = [(tail, bottom), (tail, top - drop), (min(tail + run, nose), top)]
    for angle in np.linspace(0.0, pi / 2, _STEPS + 1):  # both front edges are quarter rounds
        points.append((nose - radius * (1 - sin(angle)), top - radius * (1 - cos(angle))))
        points.append((nose - radius / 2 * (1 - sin(angle)), bottom + radius / 2 * (1 - cos(angle))))
    return points
