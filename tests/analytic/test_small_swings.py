"""Small swings of a body on a flexible rod: the natural frequency that a record shows, whatever the rod's part."""

import numpy as np
import pytest

from diagnosis.model.rig import PerInertia
from tunnel_sim.effects import ALL_EFFECTS, effect_class

STIFFNESS, DAMPING = 30.0, 0.05  # 1/s², 1/s
NAMES = (
    "stiffness",
    "mechanical_damping",
    "zero",
    "rod_flexibility.compliance",
    "rod_flexibility.inertia_share",
)
ROD = effect_class("rod_flexibility")


def coefficients(compliance: float, share: float = 0.2, names=NAMES) -> tuple[float, float]:
    model = PerInertia.__new__(PerInertia)
    common = np.array([STIFFNESS, DAMPING, 0.0, compliance, share])[: len(names)]
    return tuple(model.coefficient(names, common, name) for name in ("omega_n", "zeta"))


@pytest.mark.parametrize("share", [0.05, 0.2, 0.6])
@pytest.mark.parametrize("compliance", [1e-5, 1e-4])
def test_a_rod_softens_the_slow_motion_by_rayleighs_quotient(share, compliance):
    """To first order in the twist φ = −K c (1 − s) θ of the lower part: ω² = K [1 − K c (1 − s)²]."""
    omega, _ = coefficients(compliance, share)
    softer = STIFFNESS * compliance * (1.0 - share) ** 2
    assert omega**2 == pytest.approx(
        STIFFNESS * (1.0 - softer), rel=3.0 * (STIFFNESS * compliance) ** 2 + 1e-9
    )


def test_both_modes_are_those_of_the_two_inertias():
    """The product and the sum of both squared frequencies are those of the undamped characteristic equation."""
    twist, share = 0.004, 0.3
    slow, _ = ROD.small_swings(STIFFNESS, 0.0, {"compliance": twist, "inertia_share": share})
    both = (STIFFNESS + 1.0 / twist) / share + 1.0 / twist / (1.0 - share)
    fast = both - slow
    assert slow * fast == pytest.approx(STIFFNESS / twist / share / (1.0 - share), rel=1e-9)
    assert slow < fast


def test_a_stiff_rod_changes_nothing_and_no_other_effect_does():
    rigid = coefficients(0.0, names=NAMES[:3])
    assert coefficients(0.0) == pytest.approx(rigid, rel=1e-12)
    assert coefficients(1e-9) == pytest.approx(rigid, rel=1e-6)
    for kind in ALL_EFFECTS:
        if kind is not ROD:
            assert kind.small_swings(STIFFNESS, DAMPING, {}) == (STIFFNESS, DAMPING)


def test_the_gradient_is_that_of_the_coefficients():
    model, common = PerInertia.__new__(PerInertia), np.array([STIFFNESS, DAMPING, 0.0, 0.002, 0.2])
    for name in ("omega_n", "zeta"):
        gradient = model.gradient(NAMES, common, name)
        for place, step in enumerate((1e-3, 1e-6, 1e-6, 1e-7, 1e-5)):
            moved = common.copy()
            moved[place] += step
            change = model.coefficient(NAMES, moved, name) - model.coefficient(NAMES, common, name)
            assert gradient[place] * step == pytest.approx(change, rel=2e-3, abs=1e-12)
