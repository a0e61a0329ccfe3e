"""The slow motion with the ringing added, against the integration of both inertias in short steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic.law_cases import RIG
from tests.marks import slow
from tunnel_sim.physics.forward import forward_run, integrate
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.moment_law import parameter_vector
from tunnel_sim.physics.rod_modes import Ringing, separate_ringing
from tunnel_sim.physics.run_settings import RodTwist, RunSettings, SettingsTable, spring_end_angle
from tunnel_sim.physics.steps import compensated, fit_stride
from tunnel_sim.vocabulary.input_kinds import INPUTS
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array

MOMENT, ROOT = INPUTS["moment_nm"], INPUTS["base_rad"]

INTERVAL = 4e-3
SAMPLES = 1251
TURN = 0.04  # greatest phase of the ringing in a step, rad


def run(compliance=1e-3, share=0.3, speed=25.0, spring=44.84, **terms: float) -> RunSettings:
    rod = RodTwist(compliance, share)
    body = 0.35 * (1.0 + spring * compliance)
    return RunSettings(
        spring, AeroDerivatives(0.49, -0.11), 0.1014, 0.012, speed, 1.2, body, parameters=terms, rod_twist=rod
    )


def followed(settings: RunSettings) -> Array:
    """The upper end's angle in steps that follow the rod."""
    row, keep_alive = forward_run(settings)
    rod = settings.rod_twist
    fastest = 0.0 if rod is None else rod.free_frequency(settings.yaw_inertia)
    row["steps"] = steps = max(40, round(INTERVAL * fastest / TURN))
    row["step"] = INTERVAL / steps
    angle, _, status = integrate(parameter_vector(settings.law(RIG))[None], row, SAMPLES)
    del keep_alive
    assert status == 0
    return angle[0]


def released_at_the_end(settings: RunSettings) -> SettingsTable:
    """A table of one run, with the release angle of the spring's end."""
    table = SettingsTable.of([settings])
    table["release_angle"][0] = spring_end_angle(settings)
    return table


def separated(settings: RunSettings) -> Array:
    """The upper end's angle as slow motion and ringing."""
    table = released_at_the_end(settings)
    slow = separate_ringing(table, RIG)[0]
    row, keep_alive = forward_run(table.row(0))
    row["lead"], row["rod_stiffness"], row["lagged"] = slow.lead, slow.rod_stiffness, slow.body_release
    row["steps"], row["step"] = 4, INTERVAL / 4
    angle, rate, _ = integrate(parameter_vector(table.row(0).law(RIG))[None], row, SAMPLES)
    del keep_alive
    return slow.ringing.added(angle[0], rate[0], INTERVAL)[0]


@pytest.mark.parametrize("speed", [0.0, 25.0])
@pytest.mark.parametrize("share", [0.05, slow(0.3), 0.8])
@pytest.mark.parametrize("compliance", [1e-4, slow(1e-3), 5e-3])
def test_a_linear_rig_is_separated_exactly(compliance, share, speed):
    settings = run(compliance, share, speed)
    exact = followed(settings)
    assert np.max(np.abs(separated(settings) - exact)) < 5e-7
    rigid = replace(settings, rod_twist=None, release_angle=spring_end_angle(settings))
    assert np.max(np.abs(followed(rigid) - exact)) > 1e-3  # the rod does matter


@pytest.mark.parametrize(
    ("terms", "tolerance"),
    [
        ({"gravity_stiffness": 2.0}, 2e-5),
        ({"moment_cubic": 2.0}, 2e-4),
        ({"aero_lag": 1.0}, 2e-4),
        ({"friction_moment": 0.02}, 2e-4),
        ({"stiffness_cubic": -0.1}, 4e-4),
    ],
)
def test_nonlinear_terms_err_far_less_than_the_rod_does(terms, tolerance):
    settings = run(**terms)
    exact = followed(settings)
    error = np.max(np.abs(separated(settings) - exact))
    rigid = replace(settings, rod_twist=None, release_angle=spring_end_angle(settings))
    assert error < tolerance < 0.02 * np.max(np.abs(followed(rigid) - exact))


@pytest.mark.parametrize("on_body", [True, False])
@pytest.mark.parametrize(("terms", "tolerance"), [({}, 2e-6), ({"stiffness_cubic": -0.1}, 4e-4)])
def test_the_input_of_a_driven_run_excites_both_oscillations(terms, tolerance, on_body):
    time = INTERVAL * np.arange(SAMPLES)
    values = np.repeat(np.random.default_rng(3).standard_normal(SAMPLES // 25 + 1), 25)[:SAMPLES]
    drive = InputMoment(time, values, kind=MOMENT if on_body else ROOT, held=True)
    settings = replace(run(speed=0.0, **terms), drive=drive)
    exact = followed(settings)
    error = np.max(np.abs(separated(settings) - exact))
    rigid = replace(settings, rod_twist=None, release_angle=spring_end_angle(settings))
    assert error < tolerance < 0.02 * np.max(np.abs(followed(rigid) - exact))


def test_a_rod_almost_rigid_has_a_smooth_first_order_effect():
    """Fits take differences of predictions at tiny compliances."""
    rigid = separated(run(1e-14, speed=25.0))
    first, second = (
        (separated(run(c, speed=25.0)) - rigid)[50:] for c in (5e-9, 1e-8)
    )  # the ringing is over
    np.testing.assert_allclose(second, 2.0 * first, rtol=1e-5, atol=5e-11)
    assert np.max(np.abs(second)) > 1e-8


def test_a_rod_that_swings_almost_like_the_body_is_not_separated():
    assert not separate_ringing(released_at_the_end(run(0.05, 0.5)), RIG)
    assert not separate_ringing(released_at_the_end(replace(run(), rod_twist=None)), RIG)


def test_runs_are_separated_together_as_alone() -> None:
    settings = [run(0.05, 0.5), run(1e-3), replace(run(), rod_twist=None), run(5e-3, 0.8, spring=16.0)]
    table = SettingsTable.of(settings)
    table["release_angle"][:] = [spring_end_angle(one) for one in settings]
    together = separate_ringing(table, RIG)
    assert sorted(together) == [1, 3]
    for place in together:
        alone = released_at_the_end(settings[place])
        slow = separate_ringing(alone, RIG)[0]
        assert alone.numbers[0].tolist() == table.numbers[place].tolist()
        assert (slow.lead, slow.ringing.amplitude) == (
            together[place].lead,
            together[place].ringing.amplitude,
        )


@pytest.mark.parametrize(
    "terms",
    [
        {},
        {"stiffness_cubic": -0.2},
        {"quadratic_damping": 0.02},
        {"aero_lag": 1.0},
        {"shedding_amplitude": 0.01, "strouhal_number": 0.2},
    ],
)
def test_a_step_over_several_blocks_moves_as_short_steps_do(terms):
    settings = replace(run(spring=15.0, **terms), rod_twist=None)
    stride = stride_of(settings)
    assert stride == 2
    given = parameter_vector(settings.law(RIG))[None]
    law, (step,) = compensated(given, np.array([settings.wind_speed]), np.array([stride * INTERVAL]))
    row, keep_alive = forward_run(settings)
    row["stride"], row["step"] = stride, step / stride
    for samples in (SAMPLES, SAMPLES - 1):  # the last step may cover more than is asked for
        angle, rate, status = integrate(law, row, samples)
        assert status == 0
        assert np.max(np.abs(angle[0] - followed(settings)[:samples])) < 5e-6
        slope = np.gradient(angle[0], INTERVAL, edge_order=2)
        assert np.max(np.abs(rate[0] - slope)) < 0.02
    del keep_alive


def stride_of(settings):
    return int(fit_stride(RIG, SettingsTable.of([settings]), np.array([INTERVAL]))[0])


def test_a_wind_that_stiffens_shortens_the_steps():
    settings = replace(run(spring=15.0, speed=40.0), rod_twist=None)
    stiff = replace(settings, derivatives=AeroDerivatives(-2.0, -0.11))
    assert stride_of(settings) == 2
    assert stride_of(stiff) == 1


@pytest.mark.parametrize(
    "rough", [{"friction_moment": 0.01}, {"free_play": 0.01}, {"gravity_stiffness": 1.0}]
)
def test_kinks_and_curved_springs_keep_short_steps(rough):
    assert stride_of(replace(run(spring=15.0, **rough), rod_twist=None)) == 1


@pytest.mark.parametrize("size", [0.0, 1e-10, 3e-7, 0.02])
def test_the_ringing_is_added_until_it_is_below_a_nanoradian(size):
    """Re(c e^{st}) and its derivative, which is at most |s| times as large."""
    root, time = -8.0 + 300.0j, 1e-3 * np.arange(2000)
    angle, rate = np.cos(10.0 * time), -10.0 * np.sin(10.0 * time)
    ringing = Ringing(size * np.exp(0.7j), root)
    found = ringing.added(angle, rate, 1e-3)
    whole = ringing.amplitude * np.exp(root * time)
    assert np.abs(found[0] - angle - whole.real).max() <= 1e-9
    assert np.abs(found[1] - rate - (root * whole).real).max() <= 1e-9 * abs(root)
    assert angle[0] == 1.0  # what was given is not changed


def test_a_ringing_that_grows_without_bound_gives_no_finite_angle_and_no_warning():
    still = np.zeros(2000)
    angle, rate = Ringing(1e-3 + 0j, 2000.0 + 300.0j).added(still, still, 1e-3)
    assert not np.isfinite(angle[-1])
    assert not np.isfinite(rate[-1])
    assert np.isfinite(angle[0])
