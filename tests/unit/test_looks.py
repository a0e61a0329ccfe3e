"""The drawn shapes: the body's sizes and slant, closed surfaces, nothing of it in the motion."""

from __future__ import annotations

from collections import Counter
from math import degrees

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from tunnel_sim.engine import scenery
from tunnel_sim.engine.model import build_model
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.aero import AeroDerivatives
from tunnel_sim.vocabulary.davis import davis_vertices

RIG = load_rig()
PIECES = {
    "floor": scenery.floor(RIG.working_section),
    "glass": scenery.glass(RIG.working_section),
    "frame": scenery.frame(RIG),
    "marks": scenery.marks(RIG),
    "coil": scenery.coil(0.05, 0.005, 1.0, 1.2, 5),
}


def test_body_has_the_sizes_of_the_description() -> None:
    spread = np.ptp(davis_vertices(RIG.body), axis=0)
    assert spread == pytest.approx([RIG.body.length, RIG.body.width, RIG.body.height], rel=1e-12)


def test_rear_slant_has_its_angle() -> None:
    hull = ConvexHull(davis_vertices(RIG.body))
    normals = hull.equations[:, :3]
    # faces that look up and back without a part sideways: the slant
    slant = normals[(np.abs(normals[:, 1]) < 1e-9) & (normals[:, 0] < -0.05) & (normals[:, 2] > 0.05)]
    assert len(slant) > 0
    angles = [degrees(np.arctan2(-n[0], n[2])) for n in slant]
    assert angles == pytest.approx([RIG.body.rear_slant_deg] * len(angles), abs=1e-6)


@pytest.mark.parametrize("piece", PIECES.values(), ids=PIECES)
def test_surface_is_closed_and_faces_outward(piece: scenery.Mesh) -> None:
    edges = Counter()
    for a, b, c in piece.faces.tolist():
        edges.update([(a, b), (b, c), (c, a)])
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    corners = piece.vertices[piece.faces]
    volume = np.sum(np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]) / 6.0
    assert volume > 0.0


def test_scenery_neither_collides_nor_weighs() -> None:
    settings = RunSettings(16.12, AeroDerivatives(0.35, -0.7), 0.1014, 0.018)
    model = build_model(RIG, settings).mj
    assert not np.any(model.geom_contype)
    assert not np.any(model.geom_conaffinity)
    assert model.body_mass.sum() == pytest.approx(RIG.body.mass, rel=1e-15)
    assert model.body("davis").inertia[2] == pytest.approx(0.1014, rel=1e-15)
