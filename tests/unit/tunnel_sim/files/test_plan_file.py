from math import pi, radians, sqrt
from pathlib import Path

import pytest

from tests.support.plans import planned
from tunnel_sim.files.plan_file import load_plan, paper_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import EffectSetting, SensorModel, aerodynamic_damping, aerodynamic_stiffness

SMALL = """
name = "two"
seed = 1
springs = [5, 8]
wind_speeds = [0, 10.0]
release_angles_deg = [20, -8.5]
duration = 20
truth.cn_beta = 0.4719
truth.cn_r = -0.1033
"""


def test_every_combination_once_in_the_stated_order(tmp_path: Path) -> None:
    plan = planned(tmp_path, SMALL)
    assert [c.id for c in plan.conditions] == [
        f"s{s}-v{v}-a{a}" for s in (5, 8) for v in (0, 10) for a in ("20", "-8.5")
    ]
    stiffness = {5: 16.12, 8: 44.84}
    for condition in plan.conditions:
        spring, speed, angle = condition.id[1:].split("-", 2)
        assert condition.spring_stiffness == stiffness[int(spring)]
        assert condition.wind_speed == float(speed[1:])
        assert condition.release_angle == radians(float(angle[1:]))
        assert condition.duration == 20.0


def test_repeats_get_ids_of_their_own(tmp_path: Path) -> None:
    plan = planned(tmp_path, "repeats = 3\n" + SMALL)
    assert len(plan.conditions) == 24
    assert len({c.id for c in plan.conditions}) == 24
    assert [c.id for c in plan.conditions[:3]] == ["s5-v0-a20-1", "s5-v0-a20-2", "s5-v0-a20-3"]


def test_stiffnesses_stand_beside_or_instead_of_numbers(tmp_path: Path) -> None:
    both = planned(tmp_path, "spring_stiffness = [30.5]\n" + SMALL)
    assert [c.spring_stiffness for c in both.conditions[::4]] == [16.12, 44.84, 30.5]
    alone = planned(tmp_path, "spring_stiffness = [30.5]\n" + SMALL.replace("springs = [5, 8]\n", ""))
    assert {c.id.split("-")[0] for c in alone.conditions} == {"k30.5"}


def test_what_is_not_stated_comes_from_the_rig(tmp_path: Path) -> None:
    plan, rig = planned(tmp_path, SMALL), load_rig()
    assert plan.truth.yaw_inertia == rig.dynamics.yaw_inertia
    assert plan.truth.mechanical_damping == rig.dynamics.mechanical_damping
    assert {c.air_density for c in plan.conditions} == {rig.air.density}
    assert plan.sensor == SensorModel()
    assert plan.sensor.resolution == pytest.approx(rig.potentiometer.resolution, rel=1e-15)
    assert plan.effects == ()


def test_what_is_stated_is_taken(tmp_path: Path) -> None:
    text = (
        "air_density = 1.1\n" + SMALL + "truth.yaw_inertia = 0.2\ntruth.mechanical_damping = 0\n"
        "sensor.resolution = 0\nsensor.zero = -0.01\n"
        '[[effects]]\nname = "b"\nparameters = { y = 2, x = 0.1 }\n[[effects]]\nname = "a"\n'
    )
    plan = planned(tmp_path, text)
    assert (plan.truth.yaw_inertia, plan.truth.mechanical_damping) == (0.2, 0.0)
    assert plan.sensor == SensorModel(resolution=0.0, zero=-0.01)
    assert plan.effects == (EffectSetting("b", {"y": 2.0, "x": 0.1}), EffectSetting("a"))
    assert {c.air_density for c in plan.conditions} == {1.1}


def test_the_paper_plan_can_be_flown() -> None:
    plan, rig = paper_plan(), load_rig()
    assert len(plan.conditions) == 16
    assert {c.wind_speed for c in plan.conditions} == {0.0, 10.0, 15.0, 20.0}
    assert (plan.truth.cn_beta, plan.truth.cn_r, plan.truth.yaw_inertia) == (0.4719, -0.1033, 0.1014)
    for c in plan.conditions:
        flow = rig.body.flow(c.air_density, c.wind_speed)
        stiffness = c.spring_stiffness - aerodynamic_stiffness(plan.truth.cn_beta, **flow)
        damping = plan.truth.mechanical_damping - aerodynamic_damping(plan.truth.cn_r, **flow)
        assert stiffness > 0.0
        assert damping > 0.0
        assert c.duration * sqrt(stiffness / plan.truth.yaw_inertia) / (2.0 * pi) > 3.0
        assert c.release_angle == radians(20.0)
    still = next(c for c in plan.conditions if c.id == "s5-v0-a20")
    zeta = plan.truth.mechanical_damping / (2.0 * sqrt(still.spring_stiffness * plan.truth.yaw_inertia))
    assert zeta == pytest.approx(0.007, abs=0.0005)


BAD = {
    "unknown key": (SMALL.replace("wind_speeds", "wind_speed"), "did you mean 'wind_speeds'"),
    "unknown truth": (SMALL.replace("truth.cn_r", "truth.cnr"), "did you mean 'cn_r'"),
    "no truth": (SMALL.replace("truth.cn_r = -0.1033", ""), "'cn_r' is missing"),
    "no seed": (SMALL.replace("seed = 1\n", ""), "'seed' is missing"),
    "negative seed": (SMALL.replace("seed = 1", "seed = -1"), "'seed' = -1"),
    "seed of parts": (SMALL.replace("seed = 1", "seed = 1.5"), "'seed' = 1.5 is not a whole number"),
    "no such spring": (SMALL.replace("[5, 8]", "[5, 11]"), "no spring 11; use one of 1, 2, 3"),
    "spring by stiffness": (SMALL.replace("[5, 8]", "[16.12]"), "'springs'.*not a whole number"),
    "no springs": (SMALL.replace("[5, 8]", "[]"), "no spring; give springs"),
    "spring twice": (SMALL.replace("[5, 8]", "[5, 5]"), "springs holds 5 twice.*repeats"),
    "speed twice": (SMALL.replace("[0, 10.0]", "[0, 10.0, 10]"), "wind_speeds holds 10 twice"),
    "no speeds": (SMALL.replace("[0, 10.0]", "[]"), "'wind_speeds' is empty"),
    "negative speed": (SMALL.replace("[0, 10.0]", "[-1]"), "'wind_speeds' = -1"),
    "one speed": (SMALL.replace("[0, 10.0]", "10"), "'wind_speeds' = 10 is not a list"),
    "endless speed": (SMALL.replace("[0, 10.0]", "[inf]"), "'wind_speeds' = inf is not a finite number"),
    "no release": (SMALL.replace("[20, -8.5]", "[0]"), "not a release angle"),
    "release beyond": (SMALL.replace("[20, -8.5]", "[270]"), "greater than 180"),
    "no duration": (SMALL.replace("duration = 20", "duration = 0"), "'duration' = 0"),
    "no repeats": ("repeats = 0\n" + SMALL, "'repeats' = 0"),
    "soft spring": ("spring_stiffness = [0.0]\n" + SMALL, "'spring_stiffness' = 0.0"),
    "no inertia": (SMALL + "truth.yaw_inertia = 0", "'yaw_inertia' = 0"),
    "negative damping": (SMALL + "truth.mechanical_damping = -1", "'mechanical_damping' = -1"),
    "noise as text": (SMALL + 'sensor.noise_std = "0"', r"\[sensor\].*'noise_std' = '0' is not a number"),
    "nameless effect": (
        SMALL + "[[effects]]\nparameters = {}",
        r"\[\[effects\]\] number 1.*'name' is missing",
    ),
    "effect by text": (
        SMALL + '[[effects]]\nname = "a"\nparameters = { x = "1" }',
        "'x' = '1' is not a number",
    ),
    "effect flat": (SMALL + '[[effects]]\nname = "a"\nx = 1', "unknown key 'x'"),
    "malformed": (SMALL + "[", "not valid TOML"),
    "empty": ("", "empty"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_plan_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    text, message = BAD[case]
    with pytest.raises(TunnelError, match=message) as caught:
        planned(tmp_path, text)
    assert str(tmp_path / "plan.toml") in str(caught.value)
    assert caught.value.remedy
    assert str(caught.value).isprintable()


def test_a_missing_plan_is_named(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"nowhere\.toml: no such file; name a campaign description"):
        load_plan(tmp_path / "nowhere.toml")
