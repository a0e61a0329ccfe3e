"""False alarms at the stated rate, and effects found, on truths that share no code with the fits.

Gap-free campaigns are closed forms; planted effects come from MuJoCo or from the reference simulator. Seeds are
fixed. Limits are binomial at one verdict in a thousand.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import binom

from diagnosis import diagnose
from diagnosis.search.investigate import investigate
from diagnosis.settings import Settings
from tests.reference.free_decays import RESOLUTION, Setting, campaign, with_records
from tests.reference.rigs import rig
from tests.support.plans import planned
from tunnel_lab.experiments.blind.sets import make_blind
from tunnel_reference import draw
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.plan import EffectSetting

NOISE = 5e-4
CAMPAIGNS = 400
SETTINGS = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0, 24.0))

pytestmark = pytest.mark.slow


def gap_free(seed, stated=NOISE, **changes):
    rng = np.random.default_rng(seed)
    shape = {
        "duration": 10.0,
        "rate": 500.0,
        "noise": NOISE,
        "stated_noise": stated,
        "resolution": RESOLUTION,
    }
    return campaign(SETTINGS, rng=rng, **{**shape, **changes})


@pytest.mark.parametrize("stated", [NOISE, None])
def test_a_gap_free_campaign_is_given_no_cause(stated, record_property):
    alarms = [seed for seed in range(CAMPAIGNS) if investigate(gap_free(seed, stated), ()).gap.test.detected]
    record_property("alarms", f"{len(alarms)} of {CAMPAIGNS}: {alarms}")
    assert len(alarms) <= binom.isf(1e-3, CAMPAIGNS, Settings().gap.detection_rate)


def test_planted_drift_of_the_noises_own_size_is_detected_every_time():
    """The case that must fail the test above: power half that of the noise."""
    for seed in range(20):
        drifting = with_records(gap_free(seed), lambda t, y: y + NOISE * 2.4 * t / t[-1])
        assert investigate(drifting, ()).gap.test.detected


def test_noise_that_is_not_the_stated_is_detected_every_time():
    assert all(investigate(gap_free(seed, NOISE / 2.0), ()).gap.test.detected for seed in range(10))


PLAN = """
name = "planted"
seed = 11
springs = [5, 6, 8]
wind_speeds = [0.0, 15.0, 25.0]
release_angles_deg = [20.0]
duration = 10.0
truth = { cn_beta = 0.45, cn_r = -0.12 }
"""


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("coulomb_friction", {"friction_moment": 0.004}),
        ("cubic_stiffness", {"coefficient": 0.05}),
        ("sensor_drift", {"drift": 0.004}),
        ("mains_hum", {"amplitude": 0.001}),
        ("nonlinear_yaw_moment", {"coefficient": 0.5}),
    ],
)
def test_an_effect_planted_in_mujoco_is_found(tmp_path, name, parameters):
    plan = planned(tmp_path, PLAN)
    from dataclasses import replace

    data = simulate_campaign(replace(plan, effects=(EffectSetting(name, parameters),)))
    found = diagnose(data)
    assert found.causes == (name,)
    (parameter, value), *_ = parameters.items()
    estimate = found.candidates[0].parameters[parameter]
    assert abs(estimate.value - value) < 5.0 * estimate.std
    truth = {"cn_beta": 0.45, "cn_r": -0.12}
    for key, after in found.coefficients.after.items():
        assert abs(after.value - truth[key]) < 5.0 * after.std
    assert found.gap.closed > 0.9


def test_effects_of_the_reference_simulator_are_found(tmp_path, monkeypatch):
    """Textbook forms by another integrator, in six runs of 6 s; sizes as drawn.

    Of single effects 93 % are exact in the blind check: two or more wrong sets of four have a rate of 2.5 %.
    """
    springs, speeds = (21.02, 21.02, 21.02, 67.98, 67.98, 67.98), (0.0, 15.0, 25.0) * 2
    conditions = rig(springs, speeds, (0.35,) * 6, 6.0)
    monkeypatch.setattr(draw, "draw_conditions", lambda _rng: conditions)
    wanted = ["coulomb_friction", "quadratic_damping", "sensor_nonlinearity", "nonlinear_yaw_damping"]
    monkeypatch.setattr("tunnel_reference.make._in_turn", lambda _order, number, _families: wanted[:number])
    mixture = draw.Mixture(textbook=1.0, rare=0.0)
    key = make_blind(tmp_path / "set", count=4, seed=9, shares={"single": 1.0}, mixture=mixture)
    truths = json.loads(key.read_text(encoding="utf-8"))["truths"]
    assert sorted(effect for truth in truths.values() for effect in truth["effects"]) == sorted(wanted)
    wrong = []
    for name, truth in truths.items():
        found = set(diagnose(read_campaign(tmp_path / "set" / name)).causes)
        assert set(truth["effects"]) <= found, name
        wrong += [name] * (found - set(truth["small"]) != set(truth["effects"]))
    assert len(wrong) < 2, wrong
