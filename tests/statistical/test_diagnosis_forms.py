"""Effects that are not of the textbook's form, by the reference simulator: the family's name still comes out.

Six runs of 5 s at 500 Hz. The forms are the reference's own; sizes are several times the noise variance.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose
from tests.reference.rigs import rig
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.forms import forms_of
from tunnel_reference.make import as_campaign
from tunnel_reference.severity import read_and_fit, simulate_motions

pytestmark = pytest.mark.slow

SPRINGS, SPEEDS = (16.12, 16.12, 16.12, 44.84, 44.84, 44.84), (0.0, 15.0, 25.0) * 2
RELEASES = (0.35, 0.35, 0.14, 0.2, 0.35, 0.35)  # without small ones a settling wind is a nonlinear moment
CONDITIONS = rig(SPRINGS, SPEEDS, RELEASES, 5.0, sample_rate=500.0, cn_r=-0.12, stated_noise=4e-4)

CASES = {
    "coulomb_friction": ("tanh", {"speed": 0.01}, 1, 0.004),
    "quadratic_damping": ("power", {"exponent": 1.8}, 1, 0.002),
    "cubic_stiffness": ("tanh", {}, 1, 0.06),
    "asymmetric_stiffness": ("bilinear", {}, 1, 0.03),
    "nonlinear_yaw_moment": ("saturation", {}, 1, 0.5),
    "wind_speed_drift": ("settling", {"part": 0.4}, 1, 0.02),
    "sensor_nonlinearity": ("sine", {}, -1, 0.2),
    "sensor_drift": ("warming", {"part": 0.5}, 1, 0.004),
    "wind_speed_offset": ("falling", {"exponent": 0.3}, 1, 0.3),
    "reynolds_dependence": ("power", {}, 1, 0.05),
}


def simulated(effects, seed):
    draw = CampaignDraw("single" if effects else "none", CONDITIONS, effects, seed)
    (motion,) = simulate_motions([draw], fine=False)
    return read_and_fit(draw, motion)


@pytest.mark.parametrize("family", CASES)
def test_the_family_of_an_unusual_form_is_named(family):
    name, extra, sign, value = CASES[family]
    form = next(form for form in forms_of(family) if form.name == name)
    drawn = {key: float(v) for key, v in form.draw(np.random.default_rng(1), CONDITIONS).items()} | extra
    case = simulated((EffectDraw(form, drawn, sign, 0.0, value),), 21)
    assert case.excess > 1.0  # the effect is there to be found
    found = diagnose(as_campaign(case, family))
    named = [candidate for candidate in found.candidates if candidate.effect != "unknown"]
    assert named[0].effect == family
    assert found.causes == (family,)
    assert found.gap.closed > 0.8
    for key, truth in (("cn_beta", CONDITIONS.cn_beta), ("cn_r", CONDITIONS.cn_r)):
        after = found.coefficients.after[key]
        assert abs(after.value - truth) < 4.0 * after.std


@pytest.mark.parametrize("seed", range(6))
def test_gap_free_campaigns_come_out_without_cause(seed):
    found = diagnose(as_campaign(simulated((), 100 + seed), "none"))
    assert found.causes == ()
    assert found.gap.closed == 0.0
    assert [c.effect for c in found.candidates][:1] == ["none"]


def test_the_gap_is_as_large_as_it_was_made():
    """Two independent nominal fits agree on the excess."""
    form = forms_of("quadratic_damping")[0]
    case = simulated((EffectDraw(form, {}, 1, 0.0, 0.003),), 5)
    found = diagnose(as_campaign(replace(case), "size"))
    fitted = [run.excess for run in found.maps.runs]
    assert np.mean(fitted) == pytest.approx(case.excess, rel=0.05, abs=0.05)
