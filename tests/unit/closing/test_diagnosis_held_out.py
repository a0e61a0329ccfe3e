"""Closing on runs that were left out, and the coefficients' intervals that come of it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.answer.coefficients import coefficients, rival_fits
from diagnosis.answer.held_out import HeldOut, folds, predict_held_out
from diagnosis.answer.native_closure import native_closure
from diagnosis.attribution.decide import Weighed
from diagnosis.attribution.hypothesis import Hypothesis
from diagnosis.fitting.least_squares import fit
from diagnosis.fitting.run_data import Data, RunData
from diagnosis.fitting.starting_points import starting_points
from diagnosis.policy import EVEN_SHARE
from tests.unit.gap_campaigns import nominal
from tunnel_sim.effects import effect_class
from tunnel_sim.engine.joint_patch import Start
from tunnel_sim.physics.motion import Motion
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

CAUSE = "quadratic_damping"


def one_run(name, spring, speed):
    return RunData(name, np.zeros(4), 1, 4e-3, 1e-7, spring, speed, 1.2, 1.0)


RUNS = st.lists(st.tuples(st.sampled_from([16.0, 21.0, 45.0]), st.sampled_from([0.0, 15.0, 25.0])), min_size=1,
                max_size=14)  # fmt: skip


@given(RUNS, st.integers(2, 5))
@settings(max_examples=300)
def test_what_is_kept_has_every_spring_and_both_winds(conditions, count):
    runs = tuple(one_run(f"r{i}", *condition) for i, condition in enumerate(conditions))
    groups = folds(Data(runs, 1.0, 1.0, 0.0, False, None), count)
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
    groups = folds(Data(runs, 1.0, 1.0, 0.0, False, None))
    assert sorted(name for group in groups for name in group) == sorted(run.id for run in runs)
    assert [len(group) for group in groups] == [4, 4, 4]


def test_one_run_of_each_spring_leaves_nothing_to_hold_out():
    runs = (one_run("a", 16.0, 0.0), one_run("b", 21.0, 15.0))
    assert folds(Data(runs, 1.0, 1.0, 0.0, False, None)) == []


@pytest.fixture(scope="module")
def best(base):
    lead = starting_points(base, effect_class(CAUSE))[0]
    return fit(lead.problem, lead.point, base=base)


def test_the_right_effect_predicts_runs_it_has_not_seen(base, best):
    before, after = predict_held_out(base), predict_held_out(best)
    assert set(before.excess) == set(after.excess) == {run.id for run in base.problem.data.runs}
    assert min(before.excess.values()) > 1.0
    assert max(np.abs(list(after.excess.values()))) < 6.0 * np.sqrt(2.0 / 2500)
    assert after.common.shape == (3, len(best.problem.names))


def test_a_wrong_effect_predicts_worse_than_it_fits(base):
    """What mops up the seen runs does not carry over in full."""
    lead = starting_points(base, effect_class("coulomb_friction"))[0]
    wrong = fit(lead.problem, lead.point, base=base)
    assert np.mean(list(predict_held_out(wrong).excess.values())) > wrong.excess


@pytest.mark.parametrize("keep", [(0, 3, 1), (0, 3, 3, 0, 1, 2), (0, 0, 0, 0, 1, 1), (1, 2, 4, 5)])
def test_designs_with_few_winds_can_be_held_out(data, keep):
    runs = tuple(replace(data.runs[i], id=f"x{j}") for j, i in enumerate(keep))
    found = predict_held_out(nominal(replace(data, runs=runs)))
    assert all(np.isfinite(value) for value in found.excess.values())


def test_white_residuals_give_the_formal_interval(data, best):
    out = predict_held_out(best)
    found = coefficients(best, out, data)
    assert found["cn_beta"].value == best.value("cn_beta")
    density = 0.05 / np.sqrt(3.0) / 1.2  # 1.2 is stated to one digit
    inflated = best.std("cn_r") * np.sqrt(1.0 + max(best.excess, 0.0))
    assert found["cn_r"].std == pytest.approx(np.hypot(inflated, density * abs(best.value("cn_r"))))
    assert (found["cn_r"].unit, set(found)) == ("1/rad", {"cn_beta", "cn_r"})


def test_the_digits_of_the_density_count(data, best):
    out = predict_held_out(best)
    for density, relative in ((1.2041, 0.5e-4 / np.sqrt(3.0)), (np.float64(1.204), 0.5e-3 / np.sqrt(3.0))):
        runs = tuple(replace(run, air_density=density) for run in data.runs)
        found = coefficients(best, out, replace(data, runs=runs))["cn_beta"]
        formal = best.std("cn_beta") * np.sqrt(1.0 + max(best.excess, 0.0))
        assert found.std == pytest.approx(np.hypot(formal, relative / 1.204 * found.value), rel=1e-3)


def test_coloured_residuals_give_the_jackknife_s_interval(data, base):
    """Delete-a-group: (g − 1)/g times the summed squares of what each group moves."""
    column = base.problem.names.index("cn_r")
    common = np.tile(base.point.common, (3, 1))
    common[:, column] += [0.1, -0.2, 0.1]
    out = HeldOut({}, {}, common, base.problem.names)
    assert base.excess > 0.03
    precise = replace(data, runs=tuple(replace(run, air_density=1.20000001) for run in data.runs))
    found = coefficients(base, out, precise)["cn_r"]
    assert found.std == pytest.approx(np.sqrt(2.0 / 3.0 * 0.06), rel=1e-3)


def test_a_rival_s_value_widens_the_interval(data, base, best):
    out = predict_held_out(best)
    alone = coefficients(best, out, data)["cn_r"]
    doubtful = coefficients(best, out, data, [(base, 0.3)])["cn_r"]
    apart = base.value("cn_r") - best.value("cn_r")
    assert doubtful.value == alone.value
    assert doubtful.std == pytest.approx(np.sqrt(alone.std**2 + 0.3 * apart**2))


def test_rivals_are_the_fits_that_were_not_chosen(base, best):
    weighed = [
        Weighed((CAUSE,), 0.0, 0.8),
        Weighed(("free_play",), 0.3, 0.15),
        Weighed(("unknown",), 0.33, 0.05),
    ]
    hypotheses = [Hypothesis((CAUSE,), best), Hypothesis(("free_play",), base)]
    ((fit, probability),) = rival_fits(weighed, hypotheses, best)
    assert fit is base
    assert probability == pytest.approx(0.15 - EVEN_SHARE / 3)  # without its part of the even share


def test_normalised_runs_have_frequency_and_damping_ratio(data):
    still = tuple(replace(run, spring_stiffness=None) for run in data.runs[:1])
    normalised = replace(data, runs=(still[0], replace(still[0], id="again")))
    base = nominal(normalised)
    found = coefficients(base, predict_held_out(base), normalised)
    assert found["omega_n"].value == pytest.approx(np.sqrt(16.12 / 0.11), rel=2e-3)
    assert {name: value.unit for name, value in found.items()} == {"omega_n": "rad/s", "zeta": "1"}
    assert all(value.std > 0.0 for value in found.values())


def test_truths_lie_inside_the_intervals_before_and_after(data, base, best):
    before = coefficients(base, predict_held_out(base), data, [(best, 1.0)])
    after = coefficients(best, predict_held_out(best), data)
    for found in (before, after):
        assert abs(found["cn_beta"].value - 0.45) < 3.0 * found["cn_beta"].std
        assert abs(found["cn_r"].value + 0.25) < 3.0 * found["cn_r"].std


def test_a_patched_model_that_is_right_closes_the_gap_of_swings_of_a_milliradian():
    """The start is fitted again with steps in proportion to the swing, whose frequency depends on its size here."""

    def swing(_common, _own, start, duration):
        time = np.arange(0.0, duration, 2e-3)
        size = np.hypot(start.angle, start.rate / 12.0)
        omega = 12.0 * (1.0 + 0.02 * (size / 1e-3) ** 2)
        state = size * np.exp((1j * omega - 0.1) * time + 1j * np.arctan2(-start.rate / 12.0, start.angle))
        return Motion(time, state.real, ((1j * omega - 0.1) * state).real)

    noise, truth = 1e-7, Start("a", 0.0, 1e-3, 1e-3)
    motion = swing(None, None, truth, 5.0)
    reading = motion.angle + noise * np.random.default_rng(1).standard_normal(motion.angle.size)
    run = Run("a", Record(motion.time_s, reading), 0.0, 16.0)
    fitted = nominal(Campaign("small", RigProperties(), SensorProperties(500.0, None, noise), (run,)))
    common = np.where([name == "zero" for name in fitted.problem.names], 0.0, fitted.point.common)
    point = (common, np.array([1.03e-3, 0.9e-3]))
    out = HeldOut({"a": fitted.residuals[0]}, {"a": point}, common[None], fitted.problem.names)
    closure = native_closure(fitted, fitted, out, out, swing)
    assert closure.native == pytest.approx(1.0, abs=0.2)
