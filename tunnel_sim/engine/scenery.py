"""Shapes that are drawn but do not affect the motion: the working section, its marks, the spring.

Each is a single mesh, because MuJoCo computes the pose of every geom in every step.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig, WorkingSection

_BEAM = 0.03  # m, width of the frame's beams
_GLASS = 0.012  # m, thickness of the walls
_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
_BOX_FACES = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface of triangles.

    Args:
        vertices: shape (n, 3), m.
        faces: shape (m, 3), indices of vertices, counter-clockwise seen from outside.
    """

    vertices: Array
    faces: NDArray[np.int64]


def box(low: tuple[float, float, float], high: tuple[float, float, float], turn: float = 0.0) -> Mesh:
    """A box between two corners, rotated about the vertical axis.

    Args:
        low: least x, y and z, m.
        high: greatest x, y and z, m.
        turn: rotation, rad, counter-clockwise seen from above.
    """
    vertices = np.asarray(low) + np.array(_CORNERS, dtype=float) * (np.asarray(high) - np.asarray(low))
    rotation = np.array([[cos(turn), -sin(turn), 0.0], [sin(turn), cos(turn), 0.0], [0.0, 0.0, 1.0]])
    return Mesh(vertices @ rotation.T, np.array(_BOX_FACES))


def merged(parts: list[Mesh]) -> Mesh:
    """Several surfaces as one mesh."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def coil(radius: float, wire: float, low: float, high: float, turns: int) -> Mesh:
    """A coil spring about the vertical axis.

    Args:
        radius: of the coil, m.
        wire: radius of the wire, m.
        low: height of the lower end, m.
        high: height of the upper end, m.
        turns: number of turns.
    """
    around, along = 8, 24 * turns + 1
    turn = np.linspace(0.0, 2 * pi * turns, along)[:, None]
    ring = np.linspace(0.0, 2 * pi, around, endpoint=False)[None, :]
    out = radius + wire * np.cos(ring)
    height = np.linspace(low + wire, high - wire, along)[:, None] + wire * np.sin(ring)
    grid = np.stack([out * np.cos(turn), out * np.sin(turn), height], axis=-1)
    faces = []
    for i in range(along - 1):
        for k in range(around):
            here, beside = i * around + k, i * around + (k + 1) % around
            faces += [(here, here + around, beside), (beside, here + around, beside + around)]
    last = (along - 1) * around
    for k in range(1, around - 1):
        faces += [(0, k, k + 1), (last, last + k + 1, last + k)]
    return Mesh(grid.reshape(-1, 3), np.array(faces))


def floor(section: WorkingSection) -> Mesh:
    """The floor: a slab with its top at height 0."""
    x, y = section.length / 2, section.width / 2
    return box((-x, -y, -_BEAM), (x, y, 0.0))


def glass(section: WorkingSection) -> Mesh:
    """Two walls and the ceiling; the section is open along the flow."""
    x, y, z = section.length / 2, section.width / 2, section.height
    left, right = box((-x, y, 0.0), (x, y + _GLASS, z)), box((-x, -y - _GLASS, 0.0), (x, -y, z))
    return merged([left, right, box((-x, -y, z), (x, y, z + _GLASS))])


def frame(rig: Rig) -> Mesh:
    """The beams along the edges of the working section, and the yoke above it that carries spring and sensor."""
    section = rig.working_section
    x, y, z = section.length / 2, section.width / 2, section.height
    b, parts = _BEAM, []
    for side in (-y - b, y):
        for end in (-x, x - b):
            parts.append(box((end, side, -b), (end + b, side + b, z + b)))
        parts += [box((-x, side, low), (x, side + b, low + b)) for low in (-b, z)]
    parts += [box((end, -y, low), (end + b, y, low + b)) for end in (-x, x - b) for low in (-b, z)]
    half, top = 0.14, z + rig.rod.length_above_ceiling
    for side in (-half, half - b):
        parts.append(box((-b / 2, side, z + _GLASS), (b / 2, side + b, top)))
    parts.append(box((-b / 2, -y, z), (b / 2, y, z + b)))  # the beam across the ceiling below it
    return merged([*parts, box((-b, -half, top), (b, half, top + b / 2))])


def marks(rig: Rig) -> Mesh:
    """Lines on the floor: the wind direction, and a mark every ten degrees of yaw around the body."""
    reach, height = 0.62 * rig.body.length, 0.002
    parts = [
        box((-rig.working_section.length / 2, -0.003, 0.0), (rig.working_section.length / 2, 0.003, height))
    ]
    for degrees in range(-60, 61, 10):
        length = 0.07 if degrees % 30 == 0 else 0.04
        for turn in (radians(degrees), radians(degrees) + pi):
            parts.append(box((reach, -0.003, 0.0), (reach + length, 0.003, height), turn))
    return merged(parts)
