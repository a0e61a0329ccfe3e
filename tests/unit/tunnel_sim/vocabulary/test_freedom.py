"""The units and words of a linear freedom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from tunnel_sim.effects.registry import known_effects
from tunnel_sim.vocabulary.dimensions import angle_power, dimension
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import ANGLE, DISPLACEMENT, linear_unit


@pytest.mark.parametrize(
    ("angle", "displacement"),
    [
        ("rad", "m"),
        ("rad/s", "m/s"),
        ("rad/s2", "m/s2"),
        ("N m", "N"),
        ("N m/rad", "N/m"),
        ("N m s/rad", "N s/m"),
        ("N m s2/rad2", "N s2/m2"),
        ("rad/(N m)", "m/N"),
        ("kg m2", "kg"),
        ("kg m²", "kg"),
        ("1/rad2", "1/m2"),
        ("N m/s", "N/s"),
        ("1/s", "1/s"),
        ("m/s", "m/s"),
    ],
)
def test_every_unit_has_a_twin(angle: str, displacement: str) -> None:
    assert DISPLACEMENT.unit(angle) == displacement
    assert DISPLACEMENT.unit(displacement) == displacement
    assert ANGLE.unit(angle) == angle


def test_the_twins_of_effects_have_the_dimension_of_a_displacement() -> None:
    """An angle becomes a length, and a moment a force: metres are gained with radians and lost with moments."""
    units = {
        info.unit for kind in known_effects() for info in kind.parameters() if kind.possible(DISPLACEMENT)
    }
    assert "N m" in units
    for unit in units - {"l/V"}:
        own = dimension(DISPLACEMENT.unit(unit))
        # N m is N times m: without the radian its metre is lost, with it a metre is gained
        gained = angle_power(unit) - 2.0 * dimension(unit)[0]
        assert own == (dimension(unit)[0], dimension(unit)[1] + gained, dimension(unit)[2]), unit


@pytest.mark.parametrize(
    ("text", "own"),
    [
        ("The angle jumps", "The displacement jumps"),
        ("Angles from other runs", "Displacements from other runs"),
        ("an angular acceleration", "an acceleration"),
        ("a constant moment of 3 N m", "a constant force of 3 N"),
        ("its inertia of 0.1 kg m2", "its mass of 0.1 kg"),
        ("name the column yaw_deg", "name the column x_mm"),
        ("state quantity = 'angle' under [sensor]", "leave quantity out of [sensor]"),
        ("two degrees of freedom", "two degrees of freedom"),
        ("−Kr β − Cr β\u0307", "−k x − c x\u0307"),
        ("ωn [rad/s]", "ωn [1/s]"),
        (
            "The formula k*b*Kr explains 90 %",
            "The formula k*b*Kr in the displacement b and the spring's Kr explains 90 %",
        ),
        ("The formula k*sign(r) explains 90 %", "The formula k*sign(r) in the rate r explains 90 %"),
    ],
)
def test_words(text: str, own: str) -> None:
    assert DISPLACEMENT.words(text) == own
    assert DISPLACEMENT.words(own) == own
    assert ANGLE.words(text) == text


def test_names_of_runs_are_kept() -> None:
    assert DISPLACEMENT.words("run angle-1 at an angle", ["angle-1"]) == "run angle-1 at a displacement"


def test_constants_of_forms_are_stated_at_the_size_of_the_motion() -> None:
    assert DISPLACEMENT.words("unchanged at 0.2 rad", scale=32.0) == "unchanged at 0.00625 m"


def test_the_air_and_the_angle_in_the_room_are_not_offered() -> None:
    names = {kind.name for kind in known_effects() if not kind.possible(DISPLACEMENT)}
    assert {"gravity_stiffness", "rod_flexibility", "flow_misalignment", "nonlinear_yaw_moment"} <= names
    assert not names & {
        "coulomb_friction",
        "quadratic_damping",
        "cubic_stiffness",
        "free_play",
        "sensor_drift",
    }
    assert all(kind.possible(ANGLE) for kind in known_effects())


@pytest.mark.parametrize("size", [1e-7, 2e-4, 0.02, 0.03, 0.3, 3.0, 7.0, 400.0])
def test_a_motion_is_computed_as_an_angle_of_a_rig(size: float) -> None:
    scale = DISPLACEMENT.scale(size)
    assert np.frexp(scale)[0] == 0.5  # a power of two
    assert 0.03 <= scale * size <= 3.0
    assert scale == 1.0 or not 0.03 <= size <= 3.0
    assert ANGLE.scale(size) == 1.0


def test_refusals_are_in_own_words() -> None:
    with (
        pytest.raises(TunnelError, match="the displacement is wrong; give it in metres"),
        DISPLACEMENT.errors(),
    ):
        raise TunnelError("the angle is wrong", remedy="give it in radians")


@dataclass(frozen=True)
class _Value:
    value: float
    unit: str


@dataclass(frozen=True)
class _Document:
    omega_n: _Value
    rate: _Value
    note: str
    name: str
    gain: str = ""


def test_a_document_has_own_units_and_the_same_numbers() -> None:
    given = _Document(_Value(2.0, "rad/s"), _Value(3.0, "rad/s"), "an angle", "an angle", "tells an angle")
    own = DISPLACEMENT.document(given)
    assert own == _Document(
        _Value(2.0, "1/s"), _Value(3.0, "m/s"), "a displacement", "an angle", "tells a displacement"
    )
    assert ANGLE.document(given) is given


def test_units_of_instruments() -> None:
    assert linear_unit("mm") == ("angle", "mm", 1e-3)
    assert linear_unit("m/s²") == ("acceleration", "m/s2", 1.0)
    assert linear_unit("g") == ("acceleration", "g", 9.80665)
    assert linear_unit("deg") is None
