"""Forms beyond the textbook's: each against its equation, and equal to the textbook's at its default."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.reference.effect_cases import VALUES, settings
from tests.reference.effect_oracle import Setting
from tests.support.acting import acting
from tunnel_sim.effects import ALL_EFFECTS, Effect, EffectChain, effect_class, effect_from
from tunnel_sim.effects.parameters import SWING, WindOnRun, ramp
from tunnel_sim.engine.effect_laws import DRIVE
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion

RIG = load_rig()
TIME = np.linspace(0.0, 10.0, 1001)
ANGLE = 0.3 * np.exp(-0.1 * TIME) * np.cos(9.0 * TIME)
STATED = dataclasses.replace(settings(Setting(duration=10.0)), wind_speed=25.0)
FORMS = [(kind, info) for kind in ALL_EFFECTS for info in kind.parameters() if info.form]


def read(name: str, **parameters: float) -> np.ndarray:
    """What the sensor makes of the angle."""
    effect = effect_from(name, parameters)
    return effect.on_reading(effect.on_angle(ANGLE, TIME, STATED, None))


@pytest.mark.parametrize(("kind", "info"), FORMS, ids=[f"{k.name}-{i.name}" for k, i in FORMS])
def test_a_form_bends_the_effect_and_its_default_is_the_textbooks(kind, info) -> None:
    values = VALUES[kind.name] | ({"peak": 0.5} if info.name == "peak_rate" else {})
    plain, stated = (
        effect_from(kind.name, values),
        effect_from(kind.name, {**values, info.name: info.default}),
    )
    curved = effect_from(kind.name, {**values, info.name: info.default + 0.3 * info.scale})
    assert plain == stated

    def act(effect):
        settings = dataclasses.replace(STATED, drive=DRIVE) if kind.driven else STATED
        chain = EffectChain.draw(settings, [effect], np.random.default_rng(1))
        run, reading = chain.physics(), chain.reading(chain.angle(ANGLE, TIME))
        moment = run.drive.acting.values if run.drive is not None else np.zeros(0)
        return dataclasses.replace(run, duration=1.0, drive=None), reading, moment

    (run, *arrays), (curved_run, *curved_arrays) = act(plain), act(curved)
    assert run != curved_run or not all(map(np.array_equal, arrays, curved_arrays))


def settled(time: np.ndarray, constant: float) -> np.ndarray:
    """A drift over 10 s that settles with a time constant, 1 at the end."""
    return (1.0 - np.exp(-time / constant)) / (1.0 - np.exp(-10.0 / constant))


@pytest.mark.parametrize("constant", [4.0, -5.0])
def test_a_drift_settles_or_quickens(constant: float) -> None:
    drifted = read("sensor_drift", drift=0.01, settling=10.0 / constant)
    assert drifted - ANGLE == pytest.approx(0.01 * settled(TIME, constant), abs=1e-15)


def test_a_drifting_wind_settles() -> None:
    effect = effect_from("wind_speed_drift", {"drift": 0.1, "settling": 2.5})
    series = acting(effect, STATED).series["wind_speed"]
    place = np.arange(len(series.values)) * series.interval
    assert np.array(series.values) == pytest.approx(
        STATED.wind_speed * (1.0 + 0.1 * settled(place, 4.0)), rel=1e-12
    )
    assert place[-1] == pytest.approx(10.0)


@pytest.mark.parametrize("speed", [10.0, 20.0, 30.0])
def test_an_offset_and_a_misaligned_flow_follow_a_power_of_the_speed(speed: float) -> None:
    stated = dataclasses.replace(STATED, wind_speed=speed)
    offset = effect_from("wind_speed_offset", {"offset": 0.5, "exponent": -1.0})
    assert acting(offset, stated).wind_speed == pytest.approx(speed + 0.5 * 20.0 / speed)
    flow = effect_from("flow_misalignment", {"angle": 0.01, "exponent": 0.5})
    assert acting(flow, stated).parameters["flow_angle"] == pytest.approx(0.01 * np.sqrt(speed / 20.0))


def test_a_sensor_may_have_a_square_beside_its_cube() -> None:
    curved = read("sensor_nonlinearity", coefficient=0.1, quadratic=-0.05)
    assert curved == pytest.approx(ANGLE + 0.1 * ANGLE**3 - 0.05 * ANGLE**2)


def test_a_limit_may_lie_on_one_side() -> None:
    assert read("sensor_clipping", limit=1.0, centre=-0.8) == pytest.approx(np.minimum(ANGLE, 0.2))
    assert read("sensor_clipping", limit=1.0, centre=0.8) == pytest.approx(np.maximum(ANGLE, -0.2))


def test_a_soft_limit_bends_over_without_a_kink() -> None:
    limit, knee = 0.2, 0.25
    curved = read("sensor_clipping", limit=limit, knee=knee)
    below_knee = limit * (1.0 - knee)
    inside = np.abs(ANGLE) <= below_knee
    assert np.array_equal(curved[inside], ANGLE[inside])
    room = limit * knee
    expected = below_knee + room * (1.0 - np.exp(-(np.abs(ANGLE) - below_knee) / room))
    assert np.abs(curved[~inside]) == pytest.approx(expected[~inside])
    assert np.max(np.abs(curved)) < limit


@pytest.mark.parametrize(
    ("limit", "knee", "flat"), [(0.2, 0.25, True), (0.21, 0.25, False), (1.3, 0.8, False), (1.3, 0.0, True)]
)
def test_a_soft_limit_flattens_the_greatest_reading(limit: float, knee: float, flat: bool) -> None:
    """By a tenth beyond 0.155 and 0.163 rad from the centre; the third limit bends all readings alike."""
    clipping = effect_from("sensor_clipping", {"limit": limit, "centre": 0.01, "knee": knee})
    assert clipping.plausible(12.0, 60.0, (-0.15, 0.16)) == flat
    assert clipping.plausible(12.0, 60.0, (-0.14, 0.1)) == (knee == 0.0)


def test_rounded_backlash_is_the_mean_of_two_plays() -> None:
    wide, narrow = (read("sensor_hysteresis", half_width=w) for w in (0.013, 0.007))
    assert read("sensor_hysteresis", half_width=0.01, roundness=0.3) == pytest.approx(0.5 * (wide + narrow))


def test_the_loss_may_follow_the_motion_or_the_rig_in_still_air():
    """Worked out by hand for η = 0.01 and 20 N m/rad: 10 rad/s in still air, 8 and 12 rad/s in the wind."""
    damping = effect_from("structural_damping", {"loss_factor": 0.01})
    runs = [WindOnRun(20.0, omega, 10.0, per_cn_beta=2.0, per_cn_r=0.5) for omega in (8.0, 12.0)]
    moment, rate = damping.unseen_form(0.5, runs)
    stiffer = 2.0 / np.pi * 0.01 * 20.0 * np.log([10.0 / 8.0, 10.0 / 12.0]) / 2.0
    lost = 0.01 * np.array([20.0 / 8.0 - 2.0, 20.0 / 12.0 - 2.0]) / 0.5
    assert moment == pytest.approx(abs(stiffer.mean()) / np.sqrt(3.0))
    assert rate == pytest.approx(abs(lost.mean()) / np.sqrt(3.0))
    assert damping.unseen_form(0.5, []) == (0.0, 0.0)


@pytest.mark.parametrize("settling", [-3.0, -1e-4, 0.0, 2e-3, 6.0])
def test_the_stated_speed_may_be_that_at_the_release_or_the_mean_over_the_run(settling):
    """Truth: the mean of the drift over the run, by the trapezium rule."""
    drift = effect_from("wind_speed_drift", {"drift": 0.015, "settling": settling})
    time = np.linspace(0.0, 1.0, 20001)
    speed = 1.0 + 0.015 * np.trapezoid(ramp(time, settling), time)
    moment, rate = drift.unseen_form(-0.5, [WindOnRun(20.0, 9.0, 10.0, per_cn_beta=2.0, per_cn_r=0.5)])
    assert moment == pytest.approx(0.5 * (speed**2 - 1.0) / np.sqrt(3.0), rel=1e-6)
    assert rate == 0.0
    assert drift.unseen_form(-0.5, []) == (0.0, 0.0)


@pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
def test_a_smaller_swing_never_narrows_what_a_fit_may_take(kind: type[Effect]) -> None:
    for info in kind.parameters():
        assert info.fit_range(SWING) == info.fit_range(4.0) == (info.fit_lower, info.fit_upper)
        lower, upper = info.fit_range(0.1 * SWING)
        assert info.lower <= lower <= info.fit_lower
        assert info.fit_upper <= upper <= info.upper


def test_a_range_per_squared_angle_follows_the_swing() -> None:
    info = effect_class("cubic_stiffness").parameters()[0]
    assert info.fit_range(0.1 * SWING) == pytest.approx((100.0 * info.fit_lower, 100.0 * info.fit_upper))
    stiffness = effect_class("gravity_stiffness").parameters()[0]
    assert stiffness.fit_range(0.1 * SWING) == (stiffness.fit_lower, stiffness.fit_upper)
    contact = next(
        info for info in effect_class("coulomb_friction").parameters() if info.name == "presliding"
    )
    assert contact.fit_range(0.1 * SWING) == pytest.approx((0.1 * contact.fit_lower, contact.fit_upper))


def test_a_fit_may_take_a_reading_that_is_off_by_a_quarter() -> None:
    """At 20°: sensors that read the tangent, or an arm's chord, are off by that much and more."""
    lower, upper = effect_class("sensor_nonlinearity").parameters()[0].fit_range(SWING)
    assert min(-lower, upper) * np.deg2rad(20.0) ** 2 > 0.25


SLIDING = {
    "exponent": ({"exponent": 0.3}, lambda v: (v / 2.0) ** 0.3),
    "saturation": ({"saturation": 0.5}, lambda v: np.tanh(v / 0.5)),
    "peak": ({"peak": 0.8, "peak_rate": 0.4}, lambda v: 1.0 + 0.8 * np.exp(-((v / 0.4) ** 2))),
}


@pytest.mark.parametrize(("form", "factor"), SLIDING.values(), ids=SLIDING)
def test_sliding_friction_depends_on_the_rate_and_is_tc_at_the_reference_rate(form, factor) -> None:
    """A body on no spring that slides for half a millisecond: its rate falls by the friction alone."""
    friction = effect_from("coulomb_friction", {"friction_moment": 0.02, **form})
    run = dataclasses.replace(
        STATED, spring_stiffness=0.0, wind_speed=0.0, mechanical_damping=0.0, release_angle=0.0, duration=0.002,
        timestep=0.0005,
    )  # fmt: skip
    for speed in (0.1, 0.4, 2.0):
        slid = acting(friction, dataclasses.replace(run, release_rate=-speed))
        lost = forward_motion(RIG, slid, 2000.0).rate[1] + speed
        assert lost * run.yaw_inertia / slid.timestep == pytest.approx(0.02 * factor(speed), rel=2e-3)
    assert factor(2.0) == pytest.approx(1.0, abs=1e-3)


def test_the_textbook_friction_has_no_term_of_the_rate() -> None:
    plain = acting(effect_from("coulomb_friction", {"friction_moment": 0.02}), STATED)
    assert dict(plain.parameters) == {"friction_moment": 0.02}


def test_friction_that_vanishes_at_rest_holds_nothing() -> None:
    def stands(**form: float) -> float:
        return effect_from("coulomb_friction", {"friction_moment": 0.02, **form}).stands(4.0)

    assert stands() == pytest.approx(0.005)
    assert stands(peak=0.5) == pytest.approx(0.0075)
    assert stands(exponent=0.3) == stands(saturation=0.1) == 0.0


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ({}, "dry friction of 0.02 N m"),
        ({"exponent": 0.3}, "dry friction of 0.02 N m that rises as the rate to the power of 0.3 1"),
        ({"saturation": 0.1}, "dry friction of 0.02 N m that fades below a rate of 0.1 rad/s"),
        (
            {"peak": 0.5, "peak_rate": 0.1},
            "dry friction of 0.02 N m and up to 50 % more below a rate of 0.1 rad/s",
        ),
        ({"load": 0.1}, "dry friction of 0.02 N m and 10 % of the moment carried by the joint"),
    ],
)
def test_the_form_of_friction_is_said(form: dict[str, float], said: str) -> None:
    kind = effect_class("coulomb_friction")
    assert kind.phrase({"friction_moment": 0.02, **form}, {}, lambda v, _std, unit: f"{v:g} {unit}") == said


@pytest.mark.parametrize(
    ("form", "power"),
    [
        ({}, "the square of the rate"),
        ({"exponent": 2.04}, "the square of the rate"),
        ({"exponent": 4.08}, "the rate to the power of 4.1"),
    ],
)
def test_the_power_of_a_damping_moment_is_said(form: dict[str, float], power: str) -> None:
    kind = effect_class("quadratic_damping")
    said = kind.phrase({"coefficient": 0.02, **form}, {}, lambda v, _std, unit: f"{v:g} {unit}")
    assert said == f"a damping moment of 0.02 N m s2/rad2 that grows with {power}"


def test_a_presliding_range_is_said_where_it_is_more_than_its_error() -> None:
    def said(std: float | None, **form: float) -> str:
        given = {"friction_moment": 0.02, "presliding": 0.01, **form}
        return effect_class("coulomb_friction").phrase(
            given, {"presliding": std}, lambda v, _std, unit: f"{v:g} {unit}"
        )

    assert said(0.001) == "dry friction of 0.02 N m whose contact deflects by 0.01 rad before it slides"
    assert said(0.006) == said(None) == "dry friction of 0.02 N m"
    assert said(0.001, load=0.08) == (
        "dry friction of 0.02 N m whose contact deflects by 0.01 rad before it slides, and 8 % of the moment "
        "carried by the joint"
    )


def test_a_form_of_the_load_shows_only_where_the_load_varies() -> None:
    friction = effect_class("coulomb_friction")
    hidden = set(friction.forms()) - set(friction.shown_forms(load_varies=False))
    assert hidden == {("load",), ("presliding", "load")}
    assert all(kind.shown_forms(load_varies=True) == kind.forms() for kind in ALL_EFFECTS)


def test_an_effect_of_the_wind_acts_with_the_wind_on() -> None:
    acts = {(kind.condition, on, kind.acts(wind_on=on)) for kind in ALL_EFFECTS for on in (True, False)}
    assert acts == {
        ("always", True, True),
        ("always", False, True),
        ("wind_on", True, True),
        ("wind_on", False, False),
    }
