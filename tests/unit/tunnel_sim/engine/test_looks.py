"""The drawn shapes: the body's sizes and slant, closed surfaces, nothing of it in the motion."""

from __future__ import annotations

from collections import Counter
from math import degrees

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from tunnel_sim.engine import model
from tunnel_sim.engine.model import build_model
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.rig import davis_vertices

RIG = load_rig()
PIECES = {
    "floor": model.floor_mesh(RIG.working_section),
    "glass": model.glass_mesh(RIG.working_section),
    "frame": model.frame_mesh(RIG),
    "marks": model.marks_mesh(RIG),
    "coil": model.coil_mesh(0.05, 0.005, 1.0, 1.2, 5),
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
def test_surface_is_closed_and_faces_outward(piece: model.Mesh) -> None:
    edges = Counter()
    for a, b, c in piece.faces.tolist():
        edges.update([(a, b), (b, c), (c, a)])
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    corners = piece.vertices[piece.faces]
    volume = np.sum(np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]) / 6.0
    assert volume > 0.0


def ends(piece: model.Mesh) -> list[float]:
    """Least x, y and z, then greatest x, y and z, m."""
    return [*piece.vertices.min(axis=0), *piece.vertices.max(axis=0)]


def test_a_box_reaches_from_corner_to_corner() -> None:
    assert ends(model.box_mesh((1.0, -2.0, 3.0), (1.5, 4.0, 7.0))) == [1.0, -2.0, 3.0, 1.5, 4.0, 7.0]
    quarter = model.box_mesh((1.0, -2.0, 3.0), (1.5, 4.0, 7.0), np.pi / 2.0)
    assert ends(quarter) == pytest.approx([-4.0, 1.0, 3.0, 2.0, 1.5, 7.0])


def test_the_working_section_has_its_sizes() -> None:
    section = RIG.working_section
    x, y, z = 0.5 * section.length, 0.5 * section.width, section.height
    low, high = np.split(np.array(ends(PIECES["floor"])), 2)
    assert (low[0], low[1], high[0], high[1], high[2]) == pytest.approx((-x, -y, x, y, 0.0))
    low, high = np.split(np.array(ends(PIECES["glass"])), 2)
    thickness = high[2] - z  # walls and ceiling are equally thick, outside the section
    assert 0.0 < thickness < 0.05
    assert (*low, *high[:2]) == pytest.approx((-x, -y - thickness, 0.0, x, y + thickness))
    low, high = np.split(np.array(ends(PIECES["frame"])), 2)
    beam = high[1] - y
    assert 0.0 < beam < 0.1
    assert (*low, high[0]) == pytest.approx((-x, -y - beam, -beam, x))
    assert high[2] == pytest.approx(z + RIG.rod.length_above_ceiling + 0.5 * beam)


def test_the_coil_has_its_radius_and_height() -> None:
    low, high = np.split(np.array(ends(PIECES["coil"])), 2)
    assert (low[2], high[2]) == pytest.approx((1.0, 1.2))
    radii = np.hypot(*PIECES["coil"].vertices[:, :2].T)
    assert (radii.min(), radii.max()) == pytest.approx((0.045, 0.055))


def test_scenery_neither_collides_nor_weighs() -> None:
    settings = RunSettings(16.12, AeroDerivatives(0.35, -0.7), 0.1014, 0.018)
    model = build_model(RIG, settings).mj
    assert not np.any(model.geom_contype)
    assert not np.any(model.geom_conaffinity)
    assert model.body_mass.sum() == pytest.approx(RIG.body.mass, rel=1e-15)
    assert model.body("davis").inertia[2] == pytest.approx(0.1014, rel=1e-15)
