"""Units: their dimensions, and what is refused."""

from __future__ import annotations

import pytest

from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.dimensions import angle_power, beside, dimension, in_si
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("1", (0, 0, 0)),
        ("rad", (0, 0, 0)),
        ("N m/rad", (1, 2, -2)),
        ("N m s2/rad2", (1, 2, 0)),
        ("rad/(N m)", (-1, -2, 2)),
        ("1/s^2", (0, 0, -2)),
        ("m/s", (0, 1, -1)),
        ("kg m2", (1, 2, 0)),
    ],
)
def test_a_unit_has_the_dimension_of_its_factors(unit: str, expected: tuple[int, ...]) -> None:
    assert dimension(unit) == expected
    assert dimension(in_si(dimension(unit))) == expected  # what messages print can be read again


def test_every_unit_of_the_vocabulary_is_known() -> None:
    units = {info.unit for kind in ALL_EFFECTS for info in kind.parameters()}
    assert len({dimension(unit) for unit in units}) > 5
    assert dimension("l/V") == dimension("1")  # a number of times l/V


@pytest.mark.parametrize("unit", ["", "deg", "N*m", "N m/rad/s", "Nm", "m-2", "/s", "s2s", "rad/(N m", "1²"])
def test_what_is_not_a_unit_is_refused(unit: str) -> None:
    with pytest.raises(TunnelError, match="write it of kg, m, s, rad, N and Hz"):
        dimension(unit)


@pytest.mark.parametrize(
    ("unit", "power"),
    [
        ("rad", 1),
        ("N m", 1),
        ("1/rad2", -2),
        ("1/rad", -1),
        ("N m/rad", 0),
        ("N m s2/rad2", -1),
        ("rad/(N m)", 0),
        ("1", 0),
    ],
)
def test_moments_grow_with_the_angles(unit: str, power: float) -> None:
    assert angle_power(unit) == power


@pytest.mark.parametrize(("unit", "shown"), [("N m", "in N m"), ("1", "")])
def test_a_dimensionless_number_is_not_in_a_unit(unit: str, shown: str) -> None:
    assert beside(unit, "in ") == shown
