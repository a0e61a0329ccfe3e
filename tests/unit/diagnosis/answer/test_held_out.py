"""Closing on runs that were left out, and the coefficients' intervals that come of it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.answer import held_out
from diagnosis.answer.held_out import HeldOut, Step, Waterfall, predict_held_out
from diagnosis.model.data import Data, folds
from diagnosis.model.rig import SpringModel
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import WhiteNoise
from diagnosis.patch.patched_model import native_closure
from tests.support.gap_campaigns import added, nominal
from tunnel_sim.engine.joint_patch import Start
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

CAUSE = "quadratic_damping"


def one_run(name, spring, speed):
    return RunData(name, np.zeros(4), 1, 4e-3, WhiteNoise(1e-7), spring, speed, 1.2, 1.0)


RUNS = st.lists(st.tuples(st.sampled_from([16.0, 21.0, 45.0]), st.sampled_from([0.0, 15.0, 25.0])), min_size=1,
                max_size=14)  # fmt: skip


@given(RUNS, st.integers(2, 5))
@settings(max_examples=300)
def test_what_is_kept_has_every_spring_and_both_winds(conditions, count):
    runs = tuple(one_run(f"r{i}", *condition) for i, condition in enumerate(conditions))
    groups = folds(Data(runs, 1.0, 1.0, 0.0, SpringModel()), count)
    left_out = [name for group in groups for name in group]
    assert len(left_out) == len(set(left_out))
    assert len(groups) <= count
    for group in groups:
        kept = [run for run in runs if run.id not in group]
        assert {run.spring_stiffness for run in kept} == {run.spring_stiffness for run in runs}
        assert {run.wind_on for run in kept} == {run.wind_on for run in runs}


def test_every_run_of_a_full_plan_is_left_out_once():
    conditions = [(spring, speed) for spring in (16.0, 21.0, 45.0) for speed in (0.0, 15.0, 25.0)] + [
        (16.0, 0.0), (16.0, 25.0), (21.0, 20.0)]  # fmt: skip
    runs = tuple(one_run(f"r{i}", *condition) for i, condition in enumerate(conditions))
    groups = folds(Data(runs, 1.0, 1.0, 0.0, SpringModel()))
    assert sorted(name for group in groups for name in group) == sorted(run.id for run in runs)
    assert [len(group) for group in groups] == [4, 4, 4]


def test_one_run_of_each_spring_leaves_nothing_to_hold_out():
    runs = (one_run("a", 16.0, 0.0), one_run("b", 21.0, 15.0))
    assert folds(Data(runs, 1.0, 1.0, 0.0, SpringModel())) == []


@pytest.fixture(scope="module")
def best(base):
    return added(base, CAUSE)


def excess(fitted):
    """Of the runs held out of a fit, by id: mean squared scaled residual minus one."""
    return {run: np.mean(left**2) - 1.0 for run, left in predict_held_out(fitted).residuals.items()}


def test_a_fit_predicts_held_out_runs_once(best, monkeypatch):
    known = predict_held_out(best)
    monkeypatch.setattr(held_out, "fit_seen", lambda *_: pytest.fail("fitted anew"))
    assert predict_held_out(best) is known


def test_the_right_effect_predicts_runs_it_has_not_seen(base, best):
    before, after = excess(base), excess(best)
    assert set(before) == set(after) == {run.id for run in base.problem.data.runs}
    assert min(before.values()) > 1.0
    assert max(np.abs(list(after.values()))) < 6.0 * np.sqrt(2.0 / 2500)


def test_a_wrong_effect_predicts_worse_than_it_fits(base):
    """What mops up the seen runs does not carry over in full."""
    wrong = added(base, "coulomb_friction")
    assert np.mean(list(excess(wrong).values())) > wrong.excess


@pytest.mark.parametrize("keep", [(0, 3, 1), (0, 3, 3, 0, 1, 2), (0, 0, 0, 0, 1, 1), (1, 2, 4, 5)])
def test_designs_with_few_winds_can_be_held_out(data, keep):
    runs = tuple(replace(data.runs[i], id=f"x{j}") for j, i in enumerate(keep))
    assert all(np.isfinite(value) for value in excess(nominal(replace(data, runs=runs))).values())


def test_a_patched_model_that_is_right_closes_the_gap_of_swings_of_a_milliradian():
    """The start is fitted again with steps in proportion to the swing, whose frequency depends on its size here."""

    def swing(_common, start, duration):
        time = np.arange(0.0, duration, 2e-3)
        size = np.hypot(start.angle, start.rate / 12.0)
        omega = 12.0 * (1.0 + 0.02 * (size / 1e-3) ** 2)
        state = size * np.exp((1j * omega - 0.1) * time + 1j * np.arctan2(-start.rate / 12.0, start.angle))
        return Motion(time, state.real, ((1j * omega - 0.1) * state).real)

    noise, truth = 1e-7, Start("a", 0.0, 1e-3, 1e-3)
    motion = swing(None, truth, 5.0)
    reading = motion.angle + noise * np.random.default_rng(1).standard_normal(motion.angle.size)
    run = Run("a", Record(motion.time_s, reading), 0.0, 16.0)
    fitted = nominal(Campaign("small", RigProperties(), SensorProperties(500.0, None, noise), (run,)))
    common = np.where([name == "zero" for name in fitted.problem.names], 0.0, fitted.point.common)
    point = (common, np.array([1.03e-3, 0.9e-3]))
    out = HeldOut({"a": fitted.residuals[0]}, {"a": point})
    closure, _ = native_closure(fitted, fitted, out, out, swing)
    assert closure.native == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(
    ("excesses", "ratio"),
    [
        ((4.0, 1.0, 900.0, 0.0), 15.0),  # the second of three causes makes the misfit fifteen times as large
        ((4.0, 4.0, 0.1), 1.0),
        ((4.0, -0.1, 0.0), 0.0),
        ((4.0, 100.0), 0.0),  # all causes, not a part of them
        ((), 0.0),
    ],
)
def test_the_misfit_with_a_part_of_the_causes_is_relative_to_the_gap(
    excesses: tuple[float, ...], ratio: float
) -> None:
    steps = tuple(Step(str(place), excess) for place, excess in enumerate(excesses))
    assert Waterfall(steps).of_a_part == pytest.approx(ratio)
