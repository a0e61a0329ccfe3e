"""A pendulum, whose spring is gravity: what acts on it, its frequency, and where it comes to rest."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.likelihood.least_squares import fit_at
from diagnosis.likelihood.paths import COMMON, SINGLE, paths, ranges
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import resonance
from diagnosis.likelihood.starting_points import misses_motion, starting_points
from diagnosis.model.blocks import prepare, without_long_rest, without_rest, without_start
from diagnosis.model.parameters import Point
from diagnosis.search.grow import grow
from diagnosis.search.hypothesis import Hypothesis, is_plausible
from diagnosis.search.investigate import investigate
from diagnosis.search.prepared import fit_nominal
from diagnosis.search.views.stretches import InStretches
from diagnosis.settings import Settings
from identification import identify
from tests.support.gap_campaigns import campaign, nominal, whole_runs
from tunnel_reference import moments
from tunnel_reference.integrator import BoundLaw, Phase, integrate
from tunnel_reference.true_conditions import TrueConditions
from tunnel_sim.effects import ALL_EFFECTS, effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

GRAVITY, DRY, QUADRATIC, VISCOUS, SLIDE = 30.9, 0.2, 0.02, 0.02, 0.012  # per unit inertia; slide: rad
ONE = np.ones(1)
FRICTION = {
    "sign": BoundLaw(moments.coulomb_level, Phase.FRICTION, {"moment": DRY * ONE}),
    "dahl": BoundLaw(
        moments.dahl_friction, Phase.MOMENT, {"moment": DRY * ONE, "slide": SLIDE * ONE}, np.zeros((1, 1))
    ),
}  # fmt: skip


TOGETHER = (0.3, 0.5, 2.5)
"""Amplitudes of most tests, rad: the integrator takes hardly longer for three runs than for one."""
LONGEST = 25.0
"""Their duration, s; a shorter record is the beginning of a longer one."""


def conditions(amplitude, duration, noise=0.0):
    return TrueConditions(
        1e-9 * ONE, 0.0 * ONE, amplitude * ONE, amplitude * ONE, 1.2, duration, 1.0, VISCOUS, 0.0, 0.0, noise,
        sample_rate=100.0,
    )  # fmt: skip


@cache
def motions(amplitudes, duration, friction, quadratic):
    """Angles of heavy pendulums with dry and quadratic damping, integrated by the reference simulator."""
    terms = [
        BoundLaw(
            moments.gravity,
            Phase.MOMENT,
            {"stiffness": GRAVITY * ONE, "angle": 0.0 * ONE, "second": 0.0 * ONE},
        ),
        BoundLaw(moments.quadratic_damping, Phase.MOMENT, {"coefficient": quadratic * ONE}),
        FRICTION[friction],
    ]  # fmt: skip
    substeps = 10 if friction == "dahl" else 2  # presliding is stiff
    given = [conditions(amplitude, duration) for amplitude in amplitudes]
    found = integrate(given, [terms] * len(given), substeps=substeps)
    return {amplitude: motion.angle[:, 0] for amplitude, motion in zip(amplitudes, found, strict=True)}


@cache
def pendulum(amplitude=2.5, duration=40.0, noise=1e-3, friction="sign", quadratic=QUADRATIC):
    """A record of one pendulum."""
    many = amplitude in TOGETHER and duration <= LONGEST
    amplitudes, longest = (TOGETHER, LONGEST) if many else ((amplitude,), duration)
    swing = conditions(amplitude, duration, noise)
    clean = motions(amplitudes, longest, friction, quadratic)[amplitude][: swing.samples]
    reading = clean + np.random.default_rng(6).normal(0.0, noise, swing.samples)
    run = Run("swing", Record(swing.time, reading), 0.0, None, None)
    return Campaign("pendulum", RigProperties(), SensorProperties(100.0, None, noise), (run,))


def prepared(campaign, noise=1e-3):
    return prepare(campaign, {run.id: noise**2 for run in campaign.runs})


@pytest.fixture(scope="module")
def without_spring():
    """The model of gravity alone, at the truth."""
    problem = Problem(prepared(pendulum(0.3, 6.0)), (effect_class("gravity_stiffness"),))
    value = {"mechanical_damping": VISCOUS, "gravity_stiffness.stiffness": GRAVITY}
    common = np.array([value.get(name, 0.0) for name in problem.names])
    return fit_at(problem, Point(common, np.array([[0.3, 0.0]])))


def test_gravity_counts_in_the_frequency(without_spring):
    assert 2.0 * np.pi * resonance(without_spring, 0) == pytest.approx(np.sqrt(GRAVITY), rel=1e-9)


@pytest.mark.parametrize(("share", "further"), [(0.0, -2), (0.04, -2), (0.06, 0)])
def test_gravity_that_needs_no_spring_counts_as_two_numbers_less(without_spring, share, further):
    common = without_spring.point.common.copy()
    common[without_spring.problem.names.index("stiffness")] = share / (1.0 - share) * GRAVITY
    found = fit_at(without_spring.problem, Point(common, without_spring.point.per_run))
    assert Hypothesis(("gravity_stiffness",), found).further_numbers == further


def test_a_stated_spring_is_needed():
    base = nominal(campaign())
    assert Hypothesis((), base).further_numbers == 0


def test_a_steady_moment_moves_a_pendulum_by_what_gravity_allows(without_spring):
    """The response swings about the moment over the stiffness."""
    (path,) = paths(without_spring)
    rows = path.response(np.ones((path.time.size, 1)))[:, 0]
    moved = rows * path.run.noise_std / np.sqrt(path.group)
    assert np.mean(moved) == pytest.approx(1.0 / GRAVITY, rel=0.05)


@pytest.mark.parametrize("kind", sorted({*COMMON, *SINGLE} - {"wind"}))
def test_laws_of_a_rig_without_a_spring_are_finite(without_spring, kind):
    found = paths(without_spring)
    assert np.isfinite({**COMMON, **SINGLE}[kind](found[0], ranges(found))).all()


def test_the_end_of_a_run_at_rest_is_left_out():
    """The angle at which dry friction stops the body is off its equilibrium; the swing before stays."""
    data = prepared(pendulum(0.5, LONGEST))
    (whole,), (cut,) = data.runs, without_rest(data).runs
    gone = whole.reading[cut.reading.size :]
    np.testing.assert_array_equal(cut.reading, whole.reading[: cut.reading.size])
    assert np.ptp(gone) < 0.04 * np.max(np.abs(whole.reading))
    assert np.ptp(cut.reading[-60:]) > 0.02 * np.max(np.abs(whole.reading))  # half a cycle is 57 samples
    assert 5.0 < cut.reading.size * cut.interval < 20.0


def test_a_run_that_still_swings_loses_half_a_cycle_at_most():
    data = prepared(pendulum(2.5, 10.0))
    (whole,), (cut,) = data.runs, without_rest(data).runs
    assert (
        0 <= whole.reading.size - cut.reading.size <= 70
    )  # a cycle at this swing is longer than 113 samples


@pytest.mark.slow
def test_presliding_friction_is_fitted_in_stretches():
    """With the textbook form alone, its misfit hides whatever else acts."""
    data = without_rest(without_start(prepared(pendulum(1.0, 20.0, friction="dahl", quadratic=0.0))))
    kinds = [effect_class(name) for name in ("coulomb_friction", "gravity_stiffness")]
    found = grow(InStretches.of(whole_runs(fit_nominal(data), kinds).prepared))
    both = next(h for h in found if len(h.effects) == 2)
    assert both.forms > 0
    assert abs(both.fit.excess) < 6.0 * np.sqrt(2.0 / both.fit.count)


def test_each_set_is_followed_by_its_best_child():
    ranked = [Hypothesis(names, None) for names in (("a", "c"), ("a", "d"), ("b", "c"), ("a", "b"))]
    parents = [Hypothesis(("a",), None), Hypothesis(("b",), None)]
    fitted = SimpleNamespace(settings=Settings().changed({"search.grown_from": 4}))
    view = InStretches(None, fitted, None, None, None)
    followed = view.to_grow(parents, ranked)
    assert [h.effects for h in followed] == [("a", "c"), ("b", "c"), ("a", "d"), ("a", "b")]
    assert view.to_grow([*parents, Hypothesis(("x",), None)], ranked)[:2] == [ranked[0], ranked[2]]
    assert view.to_grow(parents, []) == []


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "friction"), [(2.5, "sign"), (1.8, "dahl")])
def test_what_acts_on_a_pendulum_of_large_amplitude_is_found(amplitude, friction):
    kinds = [kind for kind in ALL_EFFECTS if kind.fitted and kind.condition == "always"]
    study = investigate(pendulum(amplitude, friction=friction), kinds)
    assert study.causes == ("coulomb_friction", "gravity_stiffness", "quadratic_damping")
    assert abs(study.chosen.excess) < 6.0 * np.sqrt(2.0 / study.chosen.count)
    truth = {
        "gravity_stiffness.stiffness": (GRAVITY, "1/s2"),
        "coulomb_friction.friction_moment": (DRY, "1/s2"),
        "quadratic_damping.coefficient": (QUADRATIC, "1"),
    }
    for name, (value, unit) in truth.items():
        found = study.similarity.own(study.chosen.value(name), unit)
        assert found == pytest.approx(value, rel=0.03)


def test_gravity_is_found_where_the_nominal_model_does_not_miss_the_motion():
    """Linear theory sees gravity's curvature only if it takes the place of the spring."""
    found = fit_nominal(without_start(prepared(pendulum(0.5, 10.0))))
    assert not misses_motion(found)
    (gravity,) = starting_points(found, effect_class("gravity_stiffness"))
    (cubic,) = starting_points(found, effect_class("cubic_stiffness"))
    assert gravity.predicted_drop == pytest.approx(cubic.predicted_drop, rel=0.1)
    stiffness = found.point.common[found.problem.names.index("stiffness")]
    assert sum(
        gravity.point.common[gravity.problem.names.index(name)]
        for name in ("stiffness", "gravity_stiffness.stiffness")
    ) == pytest.approx(stiffness, rel=1e-9)


def test_the_nominal_fit_is_the_one_that_identify_finds():
    """The frequency rises by a third as the swing dies away; by the peak of the spectrum the fit ends 15 % off."""
    data = pendulum(2.5, LONGEST)
    found, run = fit_nominal(prepared(data)), identify(data).runs[0]
    omega = float(np.sqrt(found.value("stiffness")))
    assert misses_motion(found)
    assert abs(omega - run.omega_n.value) < run.omega_n.std
    assert abs(found.value("mechanical_damping") / (2.0 * omega) - run.zeta.value) < run.zeta.std


def test_a_long_rest_is_left_out():
    data = prepared(pendulum(0.3, LONGEST))
    cut, rested = without_long_rest(data)
    (run,) = cut.runs
    assert rested == (run.id,)
    moving = np.flatnonzero(np.abs(run.reading) > 0.01)
    assert 0.9 * run.reading.size < moving[-1] < run.reading.size < 0.5 * data.runs[0].reading.size
    short = prepared(pendulum(0.3, 10.0))
    whole, none = without_long_rest(short)
    assert (whole.runs, none) == (short.runs, ())


@pytest.mark.slow
def test_gravity_keeps_its_sign():
    """Half a turn away gravity of the other sign swings a body alike; the fits of this record end there first."""
    data = pendulum(2.2, 19.0, quadratic=0.0)
    found = investigate(data, [effect_class(name) for name in ("gravity_stiffness", "coulomb_friction")])
    best = found.answers[0].hypothesis.fit
    assert found.causes == ("coulomb_friction", "gravity_stiffness")
    assert abs(best.excess) < 0.2
    similar = found.similarity.moment * GRAVITY
    assert best.value("gravity_stiffness.stiffness") == pytest.approx(similar, rel=1e-3)
    assert best.value("zero") + found.similarity.rest == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("spring", "gravity", "plausible"),
    [(0.0, GRAVITY, True), (2.0 * GRAVITY, -GRAVITY, True), (25.0 * GRAVITY, -24.0 * GRAVITY, False)],
)
def test_gravity_that_cancels_most_of_a_spring_is_not_called_gravity(spring, gravity, plausible):
    """All three rigs swing alike at small angles; what the last leaves is a hardening spring."""
    problem = Problem(prepared(pendulum(0.3, 6.0)), (effect_class("gravity_stiffness"),))
    value = {"stiffness": spring, "mechanical_damping": VISCOUS, "gravity_stiffness.stiffness": gravity}
    common = np.array([value.get(name, 0.0) for name in problem.names])
    assert is_plausible(fit_at(problem, Point(common, np.array([[0.3, 0.0]])))) is plausible


@cache
def stopped():
    """Dry friction stops two of the three runs long before their records end."""
    friction = effect_class("coulomb_friction")(friction_moment=0.02)
    return campaign(friction, duration=12.0, conditions=((16.12, 0.0), (16.12, 25.0), (44.84, 25.0)))


@pytest.mark.usefixtures("causes_alone")
def test_the_answer_says_which_runs_rest_for_long():
    found = diagnose(stopped(), kinds=[effect_class("coulomb_friction")], rivals=())
    assert found.causes == ("coulomb_friction",)
    assert any("at rest at the end of r2, r3" in caution for caution in found.cautions)


def test_rests_stay_where_the_rest_of_the_runs_cannot_be_fitted(monkeypatch):
    monkeypatch.setattr("diagnosis.search.views.whole_runs.try_fit", lambda *_: None)
    fitted = nominal(stopped())
    monkeypatch.setattr("diagnosis.search.prepared.fit_nominal", lambda _data: fitted)
    found = investigate(stopped(), [effect_class("coulomb_friction")], rivals=())
    assert found.prepared.rested == ()
    assert [run.fine.reading.size for run in found.nominal.problem.data.runs] == [3000] * 3
    assert found.causes == ("coulomb_friction",)
