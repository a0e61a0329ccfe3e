"""Stated deviations of the coefficients of a diagnosis, from both sides: neither too small nor too large.

z is the error over the stated standard deviation. Over n campaigns, n times its mean square follows χ²(n), so both
ends have a stated false-alarm rate. Deviations of half or twice the size must fail.
"""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from diagnosis import diagnose
from diagnosis.findings.averaged_coefficients import Answers, Possible, coefficients
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.starting_points import starting_points
from tests.marks import slow
from tests.support.gap_campaigns import CN_BETA, CN_R, campaign, nominal
from tests.support.scattered_runs import SCATTERED, scattered
from tunnel_sim.effects import effect_class, effect_from

RATE = 1e-3  # of false alarms, for both ends together
TRUE = {"cn_beta": CN_BETA, "cn_r": CN_R}
CAUSES = {
    "none": (),
    "coulomb_friction": (effect_from("coulomb_friction", {"friction_moment": 0.01}),),
    "cubic_stiffness": (effect_from("cubic_stiffness", {"coefficient": 0.5}),),
}
KINDS = [
    effect_class(name) for name in (*SCATTERED, *list(CAUSES)[1:], "quadratic_damping", "wind_speed_drift")
]


def right(z):
    """Whether the root mean square of z, and the share within 1.96, are by chance what they should be."""
    z = np.array(z)
    low, high = chi2.ppf((RATE / 2.0, 1.0 - RATE / 2.0), z.size)
    least = binom.ppf(RATE / 2.0, z.size, 0.95)
    return bool(low <= z @ z <= high and np.count_nonzero(np.abs(z) < 1.96) >= least)


def of_the_known_cause(effects, seeds):
    """z of both coefficients in fits of the true cause, shape (2, n)."""
    found = []
    for seed in seeds:
        data = campaign(*effects, seed=seed, duration=4.0)
        best = base = nominal(data)
        for effect in effects:
            lead = starting_points(base, type(effect))[0]
            best = fit(lead.problem, lead.point, base=base)
        given = coefficients(Answers((Possible(1.0, best),), 0.0, base), data)
        found.append([(given[name].value - true) / given[name].std for name, true in TRUE.items()])
    return np.array(found).T


@pytest.mark.parametrize("cause", ["coulomb_friction", slow("cubic_stiffness"), slow("none")])
def test_deviations_beside_a_known_cause_are_right_from_both_sides(cause):
    assert all(map(right, of_the_known_cause(CAUSES[cause], range(100, 130))))


def test_deviations_of_half_or_twice_the_size_would_fail():
    z = of_the_known_cause(CAUSES["none"], range(200, 220))
    assert all(map(right, z))
    assert not any(map(right, 2.0 * z))
    assert not any(map(right, 0.5 * z))


@pytest.mark.slow
@pytest.mark.parametrize("cause", list(CAUSES))
def test_deviations_of_whole_diagnoses_are_right_from_both_sides(cause):
    z = []
    for seed in range(300, 340):
        found = diagnose(campaign(*CAUSES[cause], seed=seed), kinds=KINDS)
        if set(found.causes) == {cause} - {"none"}:
            after = found.coefficients.after
            z.append([(after[name].value - true) / after[name].std for name, true in TRUE.items()])
    assert len(z) > 35
    assert all(map(right, np.array(z).T))


@pytest.mark.slow
def test_deviations_beside_scatter_are_right_from_both_sides():
    z = []
    for seed in range(40):
        found = diagnose(scattered(seed), kinds=KINDS)
        if set(found.causes) <= set(SCATTERED):
            after = found.coefficients.after
            z.append([(after[name].value - true) / after[name].std for name, true in TRUE.items()])
    assert len(z) > 35
    assert all(map(right, np.array(z).T))
