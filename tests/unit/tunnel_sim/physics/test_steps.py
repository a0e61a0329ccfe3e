"""The one place that decides how long a step is: what is left alone, what is shortened, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tunnel_sim.engine.model import build_model
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RodTwist, RunSettings, Series, SettingsTable
from tunnel_sim.physics.steps import (
    BODY_TURN,
    LEAST_STEP,
    body_rate,
    check_stable,
    fit_substeps,
    follow_fastest,
    for_contact,
    for_rod,
    report_substeps,
    whole_steps,
)
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import AeroDerivatives

RIG = load_rig()
PLAIN = RunSettings(
    67.98, AeroDerivatives(0.35, -0.7), 0.1014, 0.05, wind_speed=30.0, air_density=1.204, release_angle=0.3
)


@pytest.mark.parametrize("spring", [2.38, 16.12, 67.98])
@pytest.mark.parametrize("speed", [0.0, 5.0, 40.0])
@pytest.mark.parametrize("law", [{}, {"stiffness_cubic": 1.0, "gravity_stiffness": 0.5, "moment_cubic": 1.0}])
def test_ordinary_rigs_keep_their_steps(spring: float, speed: float, law: dict[str, float]) -> None:
    run = replace(PLAIN, spring_stiffness=spring, wind_speed=speed, parameters=law)
    assert follow_fastest(RIG, run) is run


def substeps(run: RunSettings, interval: float) -> int:
    return int(fit_substeps(SettingsTable.of([run]), np.array([interval]))[0])


@given(
    spring=st.floats(0.1, 3e7),
    inertia=st.floats(1e-3, 10.0),
    damping=st.floats(0.0, 100.0),
    cn_beta=st.floats(-3.0, 3.0),
    rate=st.sampled_from([50.0, 200.0, 333.0, 1000.0, 2000.0]),
)
def test_the_step_divides_the_sample_and_follows_the_fastest(
    spring: float, inertia: float, damping: float, cn_beta: float, rate: float
) -> None:
    air = AeroDerivatives(cn_beta, -0.7)
    run = replace(
        PLAIN, spring_stiffness=spring, yaw_inertia=inertia, mechanical_damping=damping, derivatives=air,
        timestep=whole_steps(rate),
    )  # fmt: skip
    fastest = body_rate(RIG, run)
    needed = fastest * run.timestep / BODY_TURN
    if needed > 1.0 and run.timestep / np.ceil(needed) < LEAST_STEP:
        with pytest.raises(TunnelError, match="too fast for steps"):
            follow_fastest(RIG, run)
        return
    followed = follow_fastest(RIG, run)
    number = run.timestep / followed.timestep
    assert number == pytest.approx(round(number), rel=1e-12)
    assert max(1.0, needed) <= round(number) < needed + 1.0 + 1e-9
    assert fastest * followed.timestep <= BODY_TURN * (1.0 + 1e-12)
    assert follow_fastest(RIG, followed) == followed
    assert fastest >= np.sqrt(spring / inertia) * (1.0 - 1e-12)


@pytest.mark.parametrize(
    "changes",
    [
        {"derivatives": AeroDerivatives(-3e3, -0.7)},
        {"derivatives": AeroDerivatives(0.35, -3e3)},
        {"series": {"wind_speed": Series((10.0, 2e3), 1.0)}, "derivatives": AeroDerivatives(-1.0, 0.0)},
        {"parameters": {"stiffness_cubic": 1e4}},
        {"parameters": {"stiffness_cubic": 1e4, "stiffness_cubic_exponent": 2.0}},
        {"parameters": {"gravity_stiffness": 1e4}},
        {"parameters": {"moment_cubic": -1e5}},
        {"parameters": {"loss_factor": 20.0}},
        {"mechanical_damping": 20.0},
        {"rod_twist": RodTwist(1e-7, 0.3)},
    ],
    ids=str,
)
def test_whatever_makes_the_motion_faster_shortens_the_steps(changes: dict[str, object]) -> None:
    run = replace(PLAIN, **changes)  # type: ignore[arg-type]
    assert follow_fastest(RIG, run).timestep < run.timestep


def test_steps_in_which_the_integration_diverges_are_refused_by_the_model_too() -> None:
    # a model may be built with coarse steps on purpose, but not with such
    build_model(RIG, replace(PLAIN, timestep=8e-3))
    with pytest.raises(TunnelError, match=r"body's motion on its spring at .* too fast for steps of 0.2 s"):
        build_model(RIG, replace(PLAIN, timestep=0.2))
    with pytest.raises(TunnelError, match="larger compliance"):
        check_stable(RIG, replace(PLAIN, rod_twist=RodTwist(1e-9, 0.001)))


def test_a_term_beyond_all_numbers_is_refused_and_no_traceback() -> None:
    law = {"stiffness_cubic": 1e300, "stiffness_cubic_exponent": 1e6}
    with pytest.raises(TunnelError, match="too fast for steps"):
        follow_fastest(RIG, replace(PLAIN, parameters=law, release_angle=3.0))


def test_rod_and_contact_shorten_what_they_find() -> None:
    rod = for_rod(replace(PLAIN, rod_twist=RodTwist(1e-5, 0.3)))
    contact = for_contact(replace(PLAIN, parameters={"friction_moment": 0.02, "presliding": 1e-5}))
    for run in (rod, contact):
        number = PLAIN.timestep / run.timestep
        assert number > 1.0
        assert number == pytest.approx(round(number), rel=1e-12)
    assert for_rod(PLAIN) is PLAIN
    assert for_contact(PLAIN) is PLAIN


@given(st.floats(1e-5, 1e-1), st.floats(0.02, 0.98), st.sampled_from([4e-3, 5e-3, 1e-2]))
def test_what_is_reported_takes_half_the_steps_of_a_fit_of_an_ordinary_body(
    compliance: float, share: float, interval: float
) -> None:
    slow = replace(PLAIN, spring_stiffness=16.12)
    for run in (slow, replace(slow, rod_twist=RodTwist(compliance, share))):
        coarse, fine = substeps(run, interval), report_substeps(run, interval, 1)
        assert fine >= 2 * coarse - 1
        assert interval / fine <= 2e-3 * (1.0 + 1e-6)


def test_fits_take_shorter_steps_for_a_faster_body() -> None:
    found = [substeps(replace(PLAIN, spring_stiffness=spring), 4e-3) for spring in (16.12, 67.98, 600.0)]
    assert found == [1, 1, 3]


@pytest.mark.parametrize("interval", [4e-3, 2e-2, 1.0])
def test_a_fit_does_not_follow_a_body_too_fast_for_any_record(interval: float) -> None:
    """A trial inertia near zero once took 24,000 steps per block mean, a diagnosis minutes instead of seconds."""
    inertia = PLAIN.spring_stiffness / (np.pi / interval) ** 2  # half a turn per block mean: still followed
    slow, fast, least = (
        substeps(replace(PLAIN, yaw_inertia=inertia / factor), interval) for factor in (1.0, 100.0, 1e9)
    )
    assert interval / slow * np.pi / interval <= 0.11 * (1.0 + 1e-12)
    assert fast == least <= 2 * slow


@pytest.mark.parametrize(("compliance", "steps"), [(1e-2, 1), (1e-3, 2), (1e-4, 6), (1e-6, 20)])
def test_a_fit_follows_the_rod_down_to_a_fifth_of_a_millisecond(compliance: float, steps: int) -> None:
    run = replace(PLAIN, spring_stiffness=16.12, rod_twist=RodTwist(compliance, 0.3))
    rod = np.sqrt(1.0 / (compliance * 0.1014 * 0.3 * 0.7))
    assert np.ceil(4e-3 / max(0.5 / rod, 2e-4)) == steps
    assert substeps(run, 4e-3) == steps


@given(st.floats(1e-6, 1e-1), st.floats(0.02, 0.98), st.floats(1.0, 100.0))
def test_the_rods_frequency_is_bounded_by_both_modes_together(
    compliance: float, share: float, spring: float
) -> None:
    """Two inertias joined by the rod, one of them on the spring: the squares of both modes add up to the trace."""
    k = 1.0 / compliance
    one, other = 0.1 * share, 0.1 * (1.0 - share)
    squares = np.linalg.eigvals([[(k + spring) / one, -k / one], [-k / other, k / other]]).real
    assert RodTwist(compliance, share).frequency(0.1, spring) ** 2 == pytest.approx(squares.sum(), rel=1e-6)


def test_the_rod_s_free_frequency_is_below_that_on_a_spring() -> None:
    twist = RodTwist(1e-3, 0.2)
    assert twist.free_frequency(0.1) == pytest.approx(np.sqrt(1.0 / (1e-3 * 0.1 * 0.2 * 0.8)), rel=1e-12)
    assert twist.free_frequency(0.1) < twist.frequency(0.1, 40.0)
