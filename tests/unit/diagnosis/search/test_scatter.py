"""Runs that do not repeat: scatter is named, hides no cause, is no gap where it is stated, and is no drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose, vocabulary
from diagnosis.confirmed import Confirmed
from diagnosis.findings.next_run import separation
from diagnosis.findings.next_steps import next_steps
from diagnosis.search.clock import StepClock
from diagnosis.search.investigate import investigate, nominal_study
from diagnosis.search.one_more import sets_with_one_more
from diagnosis.search.patterns import has_a_cause, with_drifts
from diagnosis.search.scatter import scattered
from diagnosis.search.sets import Sets
from diagnosis.search.study import Study
from diagnosis.search.views.whole_runs import WholeRuns
from tests.marks import slow
from tests.reference.free_decays import damped_cosine
from tests.support.scattered_runs import SCATTERED
from tunnel_reference.draw import Mixture
from tunnel_reference.make import as_campaign, draw_set, simulate_set
from tunnel_sim.effects import ALL_EFFECTS, Effect, effect_class
from tunnel_sim.vocabulary.campaign import (
    Campaign,
    Repeatability,
    RigProperties,
    Run,
    SensorProperties,
)
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout", "with_odd_runs")

INERTIA, DAMPING, NOISE, RATE = 0.1, 0.03, 3e-4, 100.0
SPRINGS = (16.0, 16.0, 16.0, 30.0, 30.0, 44.0, 44.0, 44.0)
FEW = vocabulary(
    ["cubic_stiffness", "coulomb_friction", "spring_miscalibration", "stiffness_scatter", "damping_scatter"]
)
"""What could be taken for scatter, where the whole vocabulary adds nothing but time."""
FEWER = vocabulary(["cubic_stiffness", "stiffness_scatter", "damping_scatter"])
PATTERNS = vocabulary(["reynolds_dependence", "spring_miscalibration", *SCATTERED])
"""What could be taken for scatter with the speed and the spring."""
SPRING, DAMPER = 5e-4, 1e-2  # one standard deviation between runs, relative
STIFFNESS, DAMPED = "stiffness_scatter", "damping_scatter"


@cache
def campaign(
    *,
    scatter: float = 1.0,
    drift: float = 0.0,
    by_spring: float = 0.0,
    cubic: float = 0.0,
    repeatability: Repeatability | None = None,
    duration: float = 5.0,
) -> Campaign:
    """Decays in closed form or by SciPy's integrator, whose springs and dampers differ from run to run.

    Args:
        scatter: factor on the standard deviations.
        drift: relative change of the damping from the first to the last run.
        by_spring: relative change of the damping from the softer half of the springs to the stiffer.
        cubic: κ of a hardening spring, 1/rad².
        duration: of a run, s.
    """
    rng, time = np.random.default_rng(56), np.arange(0.0, duration, 1.0 / RATE)
    differences = rng.standard_normal((len(SPRINGS), 2))
    order = np.linspace(-0.5, 0.5, len(SPRINGS))
    springs = np.array(SPRINGS) * (1.0 + scatter * SPRING * differences[:, 0])
    dampers = DAMPING * (1.0 + scatter * DAMPER * differences[:, 1] + drift * order)
    dampers = dampers * (1.0 + by_spring * (np.array(SPRINGS) > 20.0))

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        angle, rate = y.reshape(2, len(SPRINGS))
        return np.concatenate([rate, -(springs * (angle + cubic * angle**3) + dampers * rate) / INERTIA])

    if cubic:
        start = np.repeat([0.3, 0.0], len(SPRINGS))
        swings = solve_ivp(rates, (0.0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-12).y
    else:
        swings = [
            damped_cosine(time, damper / INERTIA, spring / INERTIA, 0.3, 0.0)
            for spring, damper in zip(springs, dampers, strict=True)
        ]
    runs = [
        Run(
            f"r{number}",
            Record(time, swing + rng.normal(0.0, NOISE, time.size)),
            0.0,
            spring_stiffness=stiffness,
        )
        for number, (stiffness, swing) in enumerate(zip(SPRINGS, swings[: len(SPRINGS)], strict=True))
    ]
    return Campaign(
        "again", RigProperties(), SensorProperties(RATE), tuple(runs), repeatability=repeatability
    )


@cache
def studied(*, scatter: float = 1.0, cubic: float = 0.0, kinds: Sequence[type[Effect]] = FEW) -> Study:
    return investigate(campaign(scatter=scatter, cubic=cubic), kinds)


@pytest.mark.parametrize("kinds", [FEW, slow(ALL_EFFECTS)])
def test_scatter_alone_is_named_with_its_size_and_nothing_else(kinds: Sequence[type[Effect]]) -> None:
    found = Confirmed.of(studied(kinds=kinds))
    assert set(found.study.causes) == {STIFFNESS, DAMPED}
    assert found.repeats is not None
    for spread in found.repeats.spreads:
        width = {STIFFNESS: SPRING, DAMPED: DAMPER}[spread.effect]
        assert spread.interval[0] < width < spread.interval[1]
        assert 1.0 / 2.5 < spread.width / width < 2.5  # eight runs tell a standard deviation to a quarter


def test_scatter_hides_no_cause() -> None:
    found = studied(cubic=0.1)
    assert "cubic_stiffness" in found.causes
    assert {*found.causes} <= {"cubic_stiffness", STIFFNESS, DAMPED}
    name = "cubic_stiffness.coefficient"
    assert abs(found.chosen.value(name) - 0.1) < 4.0 * found.chosen.std(name)


@pytest.mark.slow
def test_wide_differences_do_not_hide_a_lag_beside_a_form_that_is_not_exact() -> None:
    """A quintic spring and a lead, of the reference simulator: runs that repeat fit worse than wide differences."""
    shares = {"single": 0.3, "pair": 0.17, "three": 0.14, "four": 0.11, "none": 0.14, "outside": 0.14}
    (made,) = simulate_set([draw_set(40, 71, shares, Mixture(edition=3))[3]])
    kinds = vocabulary(["cubic_stiffness", "unsteady_aero_lag", *SCATTERED])
    assert diagnose(as_campaign(made, "lead"), kinds=kinds).causes == ("cubic_stiffness", "unsteady_aero_lag")


@pytest.mark.slow
def test_a_form_is_tried_though_its_error_looks_like_wide_scatter() -> None:
    """A spring of two stiffnesses, of the reference simulator, beside a wrong spring and stated scatter."""
    shares = {"single": 0.4, "pair": 0.4, "none": 0.2}
    (made,) = simulate_set([draw_set(24, 8801, shares, Mixture(scatter=1.0))[14]])
    others = ["flow_misalignment", "sensor_clipping", "sensor_drift", "spring_miscalibration"]
    found = diagnose(
        as_campaign(made, "bilinear"), kinds=vocabulary(["asymmetric_stiffness", *others, *SCATTERED])
    )
    assert found.causes == ("asymmetric_stiffness", "sensor_clipping", "spring_miscalibration")


def test_an_effect_that_does_what_the_scatter_does_is_left_out() -> None:
    """In runs that repeat a wrong spring explains some of the differences; beside them it explains nothing."""
    cubic, spring = effect_class("cubic_stiffness"), effect_class("spring_miscalibration")
    view = WholeRuns.after(nominal_study(campaign(cubic=0.1), FEW).prepared, None, StepClock())
    assert view is not None
    (alone,) = sets_with_one_more([view.smallest], [cubic])
    (both,) = sets_with_one_more([alone], [spring])
    beside = view.beside(both)
    assert beside is not None
    assert beside.effects == ("cubic_stiffness", "spring_miscalibration")
    assert view.likeliest_part([beside]).effects == ("cubic_stiffness",)


@pytest.mark.slow
def test_two_patterns_in_one_number_are_not_chance() -> None:
    """Beside what a dependence on the speed leaves, a wrong spring looks like chance, and the reverse."""
    rng, time, runs = np.random.default_rng(8), np.arange(0.0, 6.0, 1.0 / RATE), []
    speeds, springs = (0.0, 12.0, 17.0, 25.0), (16.0, 30.0, 44.0)
    mean, air = float(np.mean(speeds[1:])), 0.5 * 1.2 * 0.036 * 0.625
    for spring, speed in product(springs, speeds):
        cn_beta = 0.5 * (1.0 + 0.02 * np.log(max(speed, 1.0) / mean))
        stiffness = spring * (1.0 - 0.001 * (spring == 30.0)) - air * speed**2 * cn_beta
        swing = damped_cosine(
            time, (DAMPING + air * 0.625 * speed * 0.15) / INERTIA, stiffness / INERTIA, 0.3, 0.0
        )
        record = Record(time, swing + rng.normal(0.0, NOISE, time.size))
        runs.append(Run(f"s{spring:g}-v{speed:g}", record, speed, spring, 1.2))
    rig = RigProperties(INERTIA, 0.036, 0.625, 0.225)
    found = diagnose(
        Campaign("patterns", rig, SensorProperties(RATE), tuple(runs)), kinds=PATTERNS, rivals=()
    )
    assert found.causes == ("reynolds_dependence", "spring_miscalibration")
    assert found.decision.decided
    assert (
        abs(found.coefficients.after["cn_beta"].value - 0.5)
        < 4.0 * found.coefficients.after["cn_beta"].known_std
    )


def test_runs_that_repeat_show_none() -> None:
    found = Confirmed.of(studied(scatter=0.0))
    assert found.study.causes == ()
    assert found.repeats is not None
    assert found.repeats.spreads == ()


@pytest.mark.slow
def test_stated_scatter_is_no_gap_but_more_than_that_is() -> None:
    stated = Repeatability(spring_stiffness=SPRING, mechanical_damping=DAMPER)
    within = investigate(campaign(repeatability=stated), FEW)
    assert not within.gap.test.detected
    assert within.causes == ()
    beyond = investigate(campaign(scatter=8.0, repeatability=stated), FEW)
    assert beyond.gap.test.detected
    assert set(beyond.causes) <= {STIFFNESS, DAMPED}
    assert beyond.causes


def test_two_runs_have_the_stated_scatter_that_they_cannot_show() -> None:
    """The inertia has the deviation of a spring over the root of two, at least; noise alone gives half of that."""
    stds = []
    known = Repeatability(spring_stiffness=SPRING, mechanical_damping=DAMPER)
    for scatter, stated in ((1.0, known), (0.0, None)):
        several = campaign(scatter=scatter, cubic=0.1, repeatability=stated, duration=8.0)
        study = investigate(replace(several, runs=several.runs[:2]), FEW)
        assert study.fitted == ("cubic_stiffness",)
        stds.append(study.similarity.own(study.chosen.std("yaw_inertia"), "kg m2"))
    assert stds[0] > 0.7 * INERTIA * SPRING / np.sqrt(2.0) > 2.0 * stds[1]


def test_intervals_hold_the_scatter() -> None:
    """The inertia's standard deviation is that of a spring over the root of the number of runs, at least."""
    study, repeats = (studied(scatter=size) for size in (1.0, 0.0))
    own = study.similarity.own(1.0, "kg m2")
    value, std = (own * one for one in (study.chosen.value("yaw_inertia"), study.chosen.std("yaw_inertia")))
    assert std > 0.7 * INERTIA * SPRING / np.sqrt(len(SPRINGS))
    assert abs(value - INERTIA) < 4.0 * std
    assert repeats.similarity.own(repeats.chosen.std("yaw_inertia"), "kg m2") < 0.1 * std


def test_a_further_run_is_predicted_without_a_deviation() -> None:
    fitted = studied(cubic=0.1).chosen
    assert fitted.problem.scatter
    run = fitted.problem.data.runs[0]
    assert separation(fitted, fitted, run, 0.3) == pytest.approx(0.0, abs=1e-6)


def test_what_follows_the_order_of_the_runs_is_no_scatter() -> None:
    found = diagnose(campaign(scatter=0.0, drift=0.2), kinds=FEW, rivals=())
    assert found.causes == ("unknown",)
    assert found.repeatability is not None
    (trend,) = found.repeatability.trends
    assert trend.effect == DAMPED
    assert trend.change == pytest.approx(0.2, abs=0.01)
    assert trend.only
    assert "by chance" not in found.verdict
    first = (
        "Look for what makes the mechanical damping differ from the first run to the last: the runs differ by"
    )
    assert next_steps(found)[0].startswith(first)


def test_a_difference_with_a_condition_beside_a_cause_leaves_the_answer_undecided() -> None:
    found = diagnose(campaign(scatter=0.0, cubic=0.1, by_spring=0.2), kinds=FEWER, rivals=())
    assert found.causes == ("cubic_stiffness", DAMPED)
    assert not found.decided
    assert [doubt.kind for doubt in found.decision.doubts] == ["pattern"]
    assert "The runs differ but do not scatter: the mechanical damping is" in found.verdict
    assert next_steps(found)[0].startswith(
        "Look for what makes the mechanical damping differ with the stiffness"
    )


@pytest.mark.parametrize(("scatter", "only"), [(0.0, True), (1.0, False)])
def test_a_drift_beside_scatter_costs_less_than_scatter_as_wide(scatter: float, only: bool) -> None:
    fitted = nominal_study(campaign(scatter=scatter, drift=0.2), FEW).nominal
    layered = scattered(fitted, FEW)
    assert layered is not None
    beside, between = with_drifts(layered), layered.between
    assert has_a_cause(layered) == only
    assert beside is not None
    assert between is not None
    precision = layered.columns.products.own
    assert beside.cost(precision) + 6.0 < between.cost(precision)
    alone = scattered(nominal_study(campaign(scatter=1.0), FEW).nominal, FEW)
    assert alone is not None
    assert with_drifts(alone) is None


@pytest.mark.parametrize("scatter", [0.0, 1.0])
def test_a_drift_has_one_price_with_an_effect_and_without(scatter: float) -> None:
    """Otherwise an effect is bought by scatter as wide as the drift."""
    view = WholeRuns.of(nominal_study(campaign(scatter=scatter, drift=0.2), FEW).prepared)._differing(None)
    none = view.smallest
    (cubic,) = sets_with_one_more([none], vocabulary(["cubic_stiffness"]))
    sets = Sets(view, (none, cubic))
    alone, beside = sets._fitted_set(none), sets._fitted_set(cubic)
    precision = view.gap.deviation_precision
    assert alone.scatter_cost < none.fit.scatter_cost(precision) - 6.0
    assert beside.scatter_cost < cubic.fit.scatter_cost(precision) - 6.0
    assert beside.scatter_cost == pytest.approx(alone.scatter_cost, abs=6.0)
    assert alone.outside == (scatter == 0.0)
    assert not beside.outside
    assert sets.weighed[0].effects != ("cubic_stiffness",)


def test_a_run_far_beyond_the_others_is_an_outlier() -> None:
    runs = campaign()
    faulty = campaign(scatter=25.0).runs[4]
    changed = tuple(faulty if run.id == faulty.id else run for run in runs.runs)
    found = diagnose(replace(runs, runs=changed), kinds=FEWER, rivals=())
    assert found.repeatability is not None
    assert found.repeatability.outlier == faulty.id
    others = found.repeatability.without_outlier
    assert others is not None
    assert set(others.causes) <= {STIFFNESS, DAMPED}
    assert f"Run {faulty.id} deviates far beyond the others" in found.verdict
    assert "Without it " in found.verdict


def test_scatter_that_one_run_shows_is_an_odd_run() -> None:
    runs = campaign(scatter=0.0, cubic=0.1)
    faulty = campaign(scatter=15.0, cubic=0.1).runs[4]
    changed = tuple(faulty if run.id == faulty.id else run for run in runs.runs)
    found = diagnose(replace(runs, runs=changed), kinds=FEWER, rivals=())
    assert found.causes == ("cubic_stiffness",)
    (odd,) = found.disturbed
    assert (odd.run, odd.left_out) == (faulty.id, True)
    of_spring, of_damper = 15.0 * np.random.default_rng(56).standard_normal((len(SPRINGS), 2))[4]
    frequency = np.sqrt(1.0 + SPRING * of_spring)
    for own, true in (
        (odd.frequency, frequency - 1.0),
        (odd.damping, (1.0 + DAMPER * of_damper) / frequency - 1.0),
    ):
        assert own is not None
        assert own.value == pytest.approx(true, abs=4.0 * own.std)
        assert own.std < 0.1 * abs(true)
    assert odd.as_they
    assert f"Run {faulty.id} differs from the others: its frequency is " in found.verdict
    assert any("its spring, its clock and what was mounted in it" in step for step in next_steps(found))
