"""Causes and answers that readings outside their fit do not confirm.

Truth: the causes planted in a campaign, and a body whose law changes within the record.
"""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.held_out import Step, Waterfall, one_more, predict_held_out, share_ahead
from diagnosis.findings import closing as module
from diagnosis.findings.closing import (
    INTEGRATOR_TOLERANCE,
    Comparison,
    compare,
    confirm,
    confirmed,
    report_fits,
)
from diagnosis.findings.judgements import cautions
from diagnosis.likelihood.least_squares import Fit, fit_at
from diagnosis.likelihood.partial import refit_releases
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.data import Data
from diagnosis.model.fact import Fact
from diagnosis.model.parameters import Point
from diagnosis.model.rig import SpringModel
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import WhiteNoise
from diagnosis.noise.sensor_noise import campaign_noise
from diagnosis.search.investigate import nominal_study
from diagnosis.settings import Settings
from tests.support.driven_runs import NOTHING, Planted, driven
from tests.support.gap_campaigns import (
    CN_BETA,
    CN_R,
    DAMPING,
    INERTIA,
    NOISE,
    added,
    answer,
    campaign,
    nominal,
    studied,
)
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

CAUSE, IDLE = "quadratic_damping", "cubic_stiffness"


@pytest.fixture(scope="module")
def both(data, base):
    """A study whose answer has an idle effect beside the cause; the cause alone was weighed too."""
    found = studied(data, base, (CAUSE, IDLE), added(base, CAUSE, IDLE))
    names = (*found.answers[0].effects,)
    sets = (
        answer(names, 0.0, 0.6, found.chosen),
        answer((CAUSE,), 0.0, 0.25, added(base, CAUSE)),
        answer((CAUSE, IDLE, "sensor_drift"), 0.0, 0.1),
        answer(("unknown",), 1.0, 0.05),
    )
    return replace(found, answers=sets)


def held_out(monkeypatch, idle):
    """Let the held-out excess of both effects be 0.1, and of the cause alone ``idle``."""

    def waterfall(study, base):
        del base
        if study.fitted == ("unknown",):
            return Waterfall((Step(None, 30.0),))
        if study.fitted != (IDLE, CAUSE):
            return Waterfall((Step(None, 30.0), Step(CAUSE, idle)), {CAUSE: 30.0})
        steps = Step(None, 30.0), Step(CAUSE, idle), Step(IDLE, 0.1)
        return Waterfall(steps, {CAUSE: 25.0, IDLE: idle})

    monkeypatch.setattr("diagnosis.findings.closing.waterfall", waterfall)


def test_a_cause_that_does_not_reduce_the_held_out_residual_is_not_part_of_the_answer(both, monkeypatch):
    held_out(monkeypatch, 0.09)
    study, found = confirmed(both)
    assert study.causes == (CAUSE,)
    assert study.needless == (IDLE,)
    assert [one.effects for one in study.answers] == [(CAUSE,), ("unknown",)]
    assert study.answers[0].probability == pytest.approx(0.25 / 0.3)
    assert found.gap.excess_after == 0.09


def test_of_two_parts_that_predict_alike_the_likelier_is_the_answer(both, monkeypatch):
    """Beside scatter every part may leave nothing, and its held-out residuals then differ by chance."""
    left = {CAUSE: 0.09, IDLE: 0.09 - 1.0 / both.chosen.count}

    def waterfall(study, base):
        del base
        if study.fitted == (IDLE, CAUSE):
            steps = Step(None, 30.0), Step(CAUSE, left[CAUSE]), Step(IDLE, 0.1)
            return Waterfall(steps, {CAUSE: left[IDLE], IDLE: left[CAUSE]})
        return Waterfall((Step(None, 30.0), *(Step(name, left[name]) for name in study.fitted)), {})

    monkeypatch.setattr("diagnosis.findings.closing.waterfall", waterfall)
    other = answer((IDLE,), 0.0, 0.02)
    assert confirmed(replace(both, answers=(*both.answers, other)))[0].causes == (CAUSE,)
    left[IDLE] = 0.09 - 100.0 / both.chosen.count  # beyond chance
    fitted = answer((IDLE,), 0.0, 0.02, added(both.nominal, IDLE))
    assert confirmed(replace(both, answers=(*both.answers, fitted)))[0].fitted == (IDLE,)


def test_a_cause_that_reduces_it_stays(both, monkeypatch):
    held_out(monkeypatch, 0.11)
    study, found = confirmed(both)
    assert study is both
    assert found.gap.excess_after == 0.1


def test_a_cause_of_no_size_is_not_part_of_the_answer(both, monkeypatch):
    """Though the set explains more: by the form of the other cause, which was freed beside it."""
    held_out(monkeypatch, 0.11)
    whole = both.chosen
    none = np.where(np.array(whole.problem.names) == f"{IDLE}.coefficient", 0.0, whole.point.common)
    absent = answer(both.fitted, 0.0, 0.6, fit_at(whole.problem, Point(none, whole.point.per_run)))
    study, _ = confirmed(replace(both, answers=(absent, *both.answers[1:])))
    assert study.causes == (CAUSE,)
    assert study.needless == (IDLE,)


def test_without_the_refused_set_an_unknown_cause_may_be_likelier_than_all_others(both, monkeypatch):
    held_out(monkeypatch, 0.09)
    weak = replace(both.answers[1], probability=0.01)
    study, found = confirmed(replace(both, answers=(both.answers[0], weak, *both.answers[2:])))
    assert study.causes == ("unknown",)
    assert study.needless == (IDLE,)
    assert found.gap.closed == 0.0


def test_where_the_part_was_not_weighed_the_cause_is_unknown(both, monkeypatch):
    held_out(monkeypatch, 0.09)
    study, _ = confirmed(replace(both, answers=both.answers[:1]))
    assert study.causes == ("unknown",)
    assert study.answers[0].probability == 0.0  # undecided


def test_real_readings_confirm_the_cause(both):
    assert CAUSE in confirmed(both)[0].causes


FRICTION = effect_class("coulomb_friction")
RUBS = Planted(friction=0.03)


def from_half(first, second):
    """One driven run whose later half is read from another campaign."""
    (run,), (other,) = first.runs, second.runs
    time = run.record.time_s
    late = time > time[time.size // 2]
    reading = np.where(late, other.record.yaw_rad, run.record.yaw_rad)
    return replace(first, runs=(replace(run, record=Record(time, reading)),))


@pytest.mark.parametrize("always", [True, False])
def test_a_law_of_one_half_does_not_predict_the_other(always):
    rubs = driven("one run", RUBS)
    data = rubs if always else from_half(driven("one run"), rubs)
    found = nominal_study(data, [FRICTION])
    best = one_more(found.nominal, FRICTION)
    assert best.excess < found.nominal.excess
    study = replace(found, answers=(answer((FRICTION.name,), 0.0, 1.0, best),))
    assert not predict_held_out(best).residuals
    share = share_ahead(study, ())
    assert share > 0.9 if always else share < 0.1
    assert share_ahead(study, [run.id for run in data.runs]) is None


def test_a_later_half_without_a_gap_judges_nothing():
    found = nominal_study(driven("one run", NOTHING), [FRICTION])
    best = one_more(found.nominal, FRICTION)
    assert share_ahead(replace(found, answers=(answer((FRICTION.name,), 0.0, 1.0, best),)), ()) is None


def test_free_decays_are_not_predicted_ahead(both):
    assert share_ahead(both, ()) is None


RELEASE = np.array([[0.35, 0.0], [-0.2, 0.4]])
NOMINAL = (INERTIA, DAMPING, CN_BETA, CN_R, 0.001)


def problem(*names, block=4, duration=4.0, **held):
    """Two runs of four samples to a block, of the nominal model with effects."""
    count = round(duration / 4e-3)
    runs = tuple(
        RunData(
            f"r{i}", np.zeros(count), block, 4e-3, WhiteNoise(NOISE**2 / block), spring, speed, 1.2, duration
        )
        for i, (spring, speed) in enumerate(((16.12, 0.0), (21.02, 20.0)), 1)
    )
    kinds = tuple(effect_class(name) for name in names)
    return Problem(Data(runs, 0.036, 0.625, 0.225, SpringModel().among(runs)), kinds, tuple(held.items()))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("", []),
        ("coulomb_friction", [0.01]),
        ("cubic_stiffness", [1.0]),
        ("wind_speed_drift", [0.1]),
        ("unsteady_aero_lag", [1.5]),
        ("sensor_nonlinearity", [0.2]),
        ("sensor_drift", [0.01]),
        ("rod_flexibility", [1e-3, 0.3]),
        ("rod_flexibility", [1e-5, 0.3]),
    ],
)
def test_the_two_models_predict_the_same_readings(name, values):
    made = problem(*([name] if name else []))
    found = compare(made, np.array([*NOMINAL, *values]), RELEASE)
    assert [d.shape for d in found.differences] == [(1000,), (1000,)]
    assert max(np.max(np.abs(d)) for d in found.differences) < 3e-5
    verdict = confirm([found], INTEGRATOR_TOLERANCE)
    assert verdict.agrees
    assert verdict.rms_difference < verdict.tolerance == pytest.approx(INTEGRATOR_TOLERANCE * NOISE / 2.0)


def test_every_run_may_have_parameters_of_its_own():
    made = problem()
    common = np.array([NOMINAL, NOMINAL])
    common[1, 0] *= 1.01
    mixed = compare(made, common, RELEASE)
    for i, row in enumerate(common):
        alone = compare(made, row, RELEASE)
        np.testing.assert_array_equal(mixed.residuals[i], alone.residuals[i])
        np.testing.assert_array_equal(mixed.differences[i], alone.differences[i])
    assert np.max(np.abs(mixed.differences[1])) < 3e-5


@pytest.mark.parametrize("inertia", [0.1013999944767101, 0.11, 1.0])
@pytest.mark.parametrize(
    "sizes", [(0.036, 0.625, 0.225), (1.0, 1.0, 0.0), (0.036, 0.625, 0.0), (1.0, 3.0, 0.0)]
)
def test_campaigns_that_do_not_state_their_sizes_are_predicted_too(sizes, inertia):
    made = problem()
    made = dataclasses.replace(
        made,
        data=dataclasses.replace(made.data, frontal_area=sizes[0], reference_length=sizes[1], width=sizes[2]),
    )
    common = np.array([inertia, DAMPING, 0.02, -0.01, 0.001])
    assert confirm([compare(made, common, RELEASE)], INTEGRATOR_TOLERANCE).agrees


def test_what_the_sensor_does_to_samples_is_not_done_to_their_means():
    """A clipped reading bends inside a block; the mean of a block cannot show that by being clipped."""
    found = compare(problem("sensor_clipping"), np.array([*NOMINAL, 0.25]), RELEASE)
    verdict = confirm([found], INTEGRATOR_TOLERANCE)
    assert not verdict.agrees
    assert verdict.run == "r1"  # the one that swings beyond the limit
    exact = compare(problem("sensor_clipping", block=1), np.array([*NOMINAL, 0.25]), RELEASE)
    assert confirm([exact], INTEGRATOR_TOLERANCE).rms_difference < 0.2 * verdict.rms_difference


def test_the_largest_difference_and_the_run_closest_to_its_tolerance_are_said():
    small, large = np.full(100, 1e-6), np.zeros(100)
    large[3] = 5e-6
    found = Comparison(("quiet", "loud"), [small, large], [small, large], (1e-5, 1e-3))
    verdict = confirm([found], INTEGRATOR_TOLERANCE)
    assert (verdict.agrees, verdict.run) == (True, "quiet")
    assert verdict.largest_difference == pytest.approx(5e-6)
    assert (verdict.rms_difference, verdict.tolerance) == (pytest.approx(1e-6), pytest.approx(1e-6))
    worse = dataclasses.replace(found, differences=[1.01 * small, large])
    assert not confirm([found, worse], INTEGRATOR_TOLERANCE).agrees


def test_a_motion_that_mujoco_cannot_follow_is_said(monkeypatch):
    def refuse(*_args):
        raise TunnelError("the motion grows without bound")

    monkeypatch.setattr(module, "mujoco_blocks", refuse)
    found = compare(problem(), np.array(NOMINAL), RELEASE)
    assert not np.any(found.differences)
    verdict = confirm([found], INTEGRATOR_TOLERANCE)
    assert not verdict.agrees
    assert verdict.failure == "the motion grows without bound"
    data = campaign()
    noise = campaign_noise(data, Settings().noise)
    said = cautions(data, noise, (), verdict, named=False)
    assert Fact("not followed", {"failure": verdict.failure}) in said


def test_a_disagreement_is_a_caution_and_agreement_is_none():
    data = campaign()
    noise, tolerance = campaign_noise(data, Settings().noise), INTEGRATOR_TOLERANCE
    good, bad = (
        confirm([Comparison(("r1",), [np.zeros(9)], [np.full(9, far)], (1e-4,))], tolerance)
        for far in (1e-6, 2e-5)
    )
    assert cautions(data, noise, (), good, named=False) == ()
    alone = replace(data, runs=data.runs[:1])
    assert [one.kind for one in cautions(alone, noise, (), good, named=False)] == ["few runs"]
    assert cautions(alone, noise, (), good, named=False, decays=False) == ()
    (said,) = cautions(data, noise, (), bad, named=False)
    assert (said.kind, said.figures["run"]) == ("not confirmed", "r1")
    assert (said.figures["rms_rad"], said.figures["tolerance_rad"]) == pytest.approx((2e-5, 1e-5))


def test_nothing_speaks_of_wind_speeds_where_no_run_had_wind():
    data = campaign()
    alone = dataclasses.replace(data, runs=data.runs[:1])
    good = confirm(
        [Comparison(("r1",), [np.zeros(9)], [np.full(9, 1e-6)], (1e-4,))],
        INTEGRATOR_TOLERANCE,
    )
    found = {}
    for speed in (0.0, 10.0):
        run = dataclasses.replace(alone.runs[0], wind_speed=speed, air_density=1.2)
        (said,) = cautions(
            dataclasses.replace(alone, runs=(run,)),
            campaign_noise(alone, Settings().noise),
            (),
            good,
            named=False,
        )
        runs = tuple(dataclasses.replace(r, wind_speed=speed) for r in problem().data.runs)
        model = SpringModel().among(runs)
        spots = model.blind_spots(dataclasses.replace(problem().data, runs=runs, model=model))
        found[speed] = (said, " ".join(spots))
    assert found[0.0][0].figures == {"runs": 1, "driven": False, "windy": False}
    assert found[10.0][0].figures == {"runs": 1, "driven": False, "windy": True}
    assert "Cnβ" not in found[0.0][1]
    assert "a scale error of wind speed" in found[10.0][1]


@pytest.fixture(scope="module")
def fits():
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    base = nominal(data)
    return base, added(base, "quadratic_damping")


def test_what_is_reported_is_mujoco_s_at_the_parameters_found(fits):
    base, best = fits
    out, best_out = predict_held_out(base), predict_held_out(best)
    shown = report_fits(base, best, out, best_out)
    assert shown.confirmation.agrees
    assert 0.0 < shown.confirmation.largest_difference < 3e-5
    assert shown.held_out == set(shown.before) == set(shown.after)
    for i, run in enumerate(base.problem.data.runs):
        # close to the fits' own residuals, and not the same
        for mine, theirs in (
            (shown.before[run.id], base.residuals[i]),
            (shown.after[run.id], best_out.residuals[run.id]),
        ):
            assert 0.0 < np.max(np.abs(mine - theirs)) < 3e-5 / NOISE


def test_a_wrong_forward_integrator_would_be_found_out(fits, monkeypatch):
    """Half a per mille of stiffness lost in the fits' integrator: the excess reported is not fooled."""
    base, _ = fits
    honest = Problem.predict

    def off(self, points):
        moved = [Point(np.concatenate([[p.common[0] * 1.0005], p.common[1:]]), p.per_run) for p in points]
        return honest(self, moved)

    monkeypatch.setattr(Problem, "predict", off)
    out = predict_held_out(base)
    shown = report_fits(base, base, out, out)
    assert not shown.confirmation.agrees
    assert shown.confirmation.largest_difference > 1e-4


def test_releases_are_refitted_run_by_run(fits):
    base, _ = fits
    point = Point(base.point.common, base.point.per_run + np.array([[2e-3, 0.0]]))
    slopes = [release for _, release in sensitivities(base.problem, base.point)]
    found, residuals = refit_releases(base.problem, point, slopes)
    assert isinstance(base, Fit)
    chi2 = [float(r @ r) for r in residuals]
    np.testing.assert_allclose(chi2, base.chi2, rtol=1e-4)
    np.testing.assert_allclose(found.per_run, base.point.per_run, atol=2e-5)


def test_a_run_that_grows_without_bound_keeps_its_release(fits):
    """Negative damping that overflows in every run: there is nothing to refit, and nothing fails."""
    base, _ = fits
    common = base.point.common.copy()
    common[base.problem.names.index("mechanical_damping")] = -50.0
    slopes = [release for _, release in base.jacobian]
    found, residuals = refit_releases(base.problem, Point(common, base.point.per_run), slopes)
    assert not any(np.all(np.isfinite(r)) for r in residuals)
    assert np.array_equal(found.per_run, base.point.per_run)
