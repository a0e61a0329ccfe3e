"""What the diagnosis says of measured records whose cause is known from their sources.

The rotary pendulum swings on a shaft with dry friction, its stiffness gravity's; the ship's roll at zero speed is
damped by vortices off its bilge keels, with the square of the rate (identification/data/measured, SOURCE.md).
"""

import pytest

from diagnosis import diagnose
from identification.datasets import measured_campaign

pytestmark = pytest.mark.slow


def test_dry_friction_and_gravity_are_named_for_the_rotary_pendulum():
    found = diagnose(measured_campaign("rotary-pendulum"))
    assert found.causes == ("coulomb_friction", "gravity_stiffness")
    assert found.gap.closed > 0.95
    first, second, *_ = found.candidates
    assert first.probability > 2.0 * second.probability
    assert set(found.coefficients.after) == {"omega_n", "zeta"}


def test_quadratic_damping_is_named_for_the_ship_at_zero_speed():
    found = diagnose(measured_campaign("kvlcc2-roll-decay-0kn"))
    assert "quadratic_damping" in found.causes
    assert found.gap.closed > 0.5
    coefficient = next(
        value
        for name, value in found.candidates[0].parameters.items()
        if name in ("coefficient", "quadratic_damping.coefficient")
    )
    assert coefficient.value > 0.0
