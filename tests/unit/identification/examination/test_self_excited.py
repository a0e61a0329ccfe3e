"""Self-excitation; the truth is the oscillator that is integrated here, β̈ − 2a(1 − (2β/A)²)β̇ + ω²β = 0."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose
from identification import identify
from identification.estimate import Status
from identification.examination.examine import examine
from identification.examination.self_excited import in_limit_cycle
from identification.status import Outcome, Remark
from tests.marks import slow
from tests.support.decays import RATE, campaign, reading, run
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

GROWTH, SETTLED, OMEGA = 0.4, 0.3, 20.0


@cache
def motion(start: float, duration: float, growth: float = GROWTH, settled: float = SETTLED) -> Array:
    def moment(_: float, state: Array) -> list[float]:
        angle, rate = state
        return [rate, 2.0 * growth * (1.0 - (2.0 * angle / settled) ** 2) * rate - OMEGA**2 * angle]

    time = np.arange(int(duration * RATE)) / RATE
    solved = solve_ivp(moment, (0.0, duration), (start, 0.0), "DOP853", time, rtol=1e-8, atol=1e-10)
    return np.asarray(solved.y[0])


def excited(start: float, duration: float = 30.0, growth: float = GROWTH, settled: float = SETTLED) -> Run:
    yaw = motion(start, duration, growth, settled)
    noise = np.random.default_rng(3).normal(0.0, 2e-4, yaw.size)
    return reading(run("excited", 40.0, 25.0), yaw + noise)


def test_growth_to_a_limit_cycle_is_recognised_with_its_figures() -> None:
    examined = examine(campaign([excited(0.01)]))
    (remark,) = examined.remarks
    assert remark.outcome is Outcome.CUT
    assert "self-excited: grows at 0.39" in remark.what or "self-excited: grows at 0.4" in remark.what
    assert remark.figures["settled_rad"] == pytest.approx(SETTLED, rel=0.02)
    # The mean of 1 − (amplitude/settled)² up to 0.3 of the limit cycle is at least 0.95.
    assert 0.95 * GROWTH < remark.figures["growth_rate_per_s"] < 1.01 * GROWTH
    assert len(remark.figures["growth_rate"]) == len(remark.figures["amplitude_rad"])
    assert Remark.from_json_dict(remark.to_json_dict()) == remark


def test_four_windows_of_linear_growth_are_enough() -> None:
    """Of three cycles each: from 0.002 rad to 0.3 of the limit cycle in 3.8 s."""
    (remark,) = examine(campaign([excited(0.002, 14.0, growth=1.0)])).remarks
    assert remark.outcome is Outcome.CUT
    assert remark.figures["growth_rate_per_s"] == pytest.approx(1.0, rel=0.02)
    assert sum(np.array(remark.figures["amplitude_rad"]) < 0.3 * SETTLED) == 4


@pytest.mark.parametrize("start", [slow(0.1), 0.2])
def test_a_record_that_begins_late_is_known_by_an_amplitude_that_stays(start: float) -> None:
    """Most of the record is the limit cycle, so that its last quarter is hardly larger than its first one."""
    (remark,) = examine(campaign([excited(start, 60.0)])).remarks
    assert remark.outcome is Outcome.LEFT_OUT
    assert in_limit_cycle(remark.figures)
    assert remark.figures["settled_rad"] == pytest.approx(SETTLED, rel=0.02)


def test_damping_is_that_of_the_linear_growth() -> None:
    estimate = identify(campaign([excited(0.01)]))
    found = estimate.runs[0].zeta
    assert found is not None
    assert found.value == pytest.approx(-GROWTH / OMEGA, rel=0.05)


def test_a_steady_limit_cycle_has_a_status_and_no_damping_ratio() -> None:
    estimate = identify(campaign([excited(SETTLED)]))
    assert estimate.runs[0].statuses == (Status.LIMIT_CYCLE,)
    assert estimate.runs[0].zeta is None
    assert estimate.status is Status.LIMIT_CYCLE
    assert "steady oscillation" in estimate.remarks[0].what


def test_other_runs_are_identified_without_the_limit_cycle() -> None:
    decay = run("k40-v0", 40.0, 0.0)
    estimate = identify(campaign([decay, excited(SETTLED)]))
    assert estimate.runs[0].zeta is not None
    assert estimate.runs[1].zeta is None
    assert Status.LIMIT_CYCLE in estimate.statuses


@pytest.mark.parametrize("start", [slow(0.01), SETTLED])
def test_diagnosis_of_limit_cycles_alone_is_unknown_and_says_so(start: float) -> None:
    answer = diagnose(campaign([excited(start)]))
    assert answer.causes == ("unknown",)
    assert answer.remarks[0].what in answer.verdict
    assert not answer.coefficients.after


@pytest.mark.slow
def test_diagnosis_leaves_the_limit_cycle_out() -> None:
    decays = [run("k40-v0", 40.0, 0.0), run("k60-v0", 60.0, 0.0)]
    answer = diagnose(campaign([*decays, excited(SETTLED)]))
    assert answer.causes == ()
    assert [one.id for one in answer.gap.runs] == ["k40-v0", "k60-v0"]
    assert answer.remarks[0].outcome is Outcome.LEFT_OUT


def test_a_linear_growth_keeps_its_run_and_is_noted() -> None:
    # 0.1 1/s for 30 s is a factor of 20, far below the limit cycle.
    (remark,) = examine(campaign([excited(0.005, growth=0.1, settled=30.0)])).remarks
    assert remark.outcome is Outcome.NOTED
    assert remark.figures["growth_rate_per_s"] == pytest.approx(
        0.1, abs=3 * remark.figures["growth_rate_std"]
    )
    assert not in_limit_cycle(remark.figures)


@pytest.mark.slow
def test_decays_and_buffeted_runs_are_not_called_self_excited() -> None:
    rng = np.random.default_rng(7)
    for seed in range(20):
        assert not examine(campaign([run("r", 40.0, 25.0, seed=seed)])).remarks
        force = rng.normal(0.0, 1.0, 15000)
        state, yaw = np.zeros(2), []
        step = np.array(
            [[1.0, 1.0 / RATE], [-(OMEGA**2) / RATE, 1.0 - 2.0 * 0.5 / RATE - OMEGA**2 / RATE**2]]
        )
        for push in force:
            state = step @ state + (0.0, 0.05 * push)
            yaw.append(state[0])
        buffeted = reading(run("b", 40.0, 25.0), np.array(yaw))
        assert not any(r.figures for r in examine(campaign([buffeted])).remarks)


def test_a_wind_off_growth_is_refused_as_before() -> None:
    still = replace(excited(0.005, growth=0.1, settled=30.0), wind_speed=0.0, air_density=None)
    assert examine(campaign([still])).remarks[0].outcome is Outcome.REFUSED
