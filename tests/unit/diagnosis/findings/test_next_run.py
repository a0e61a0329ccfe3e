"""The run that would distinguish two models."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.findings.next_run import FurtherRuns, NextRun, planned_run, separation
from diagnosis.likelihood.least_squares import fit_at
from diagnosis.likelihood.normal_equations import normal_equations
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.parameters import Point
from diagnosis.search.investigate import nominal_study
from diagnosis.search.scatter import chance, with_deviations
from identification.show.quantity import Quantity
from tests.support.driven_runs import driven
from tests.support.gap_campaigns import added, campaign, nominal
from tunnel_sim.effects import effect_class, effect_from


@pytest.fixture(scope="module")
def rivals():
    data = campaign(effect_from("coulomb_friction", {"friction_moment": 0.003}))
    alike = replace(data, runs=tuple(run for run in data.runs if run.spring_stiffness == 16.12))
    base = nominal(alike)
    return added(base, "coulomb_friction"), added(base, "quadratic_damping")


def apart(first, second, run, angle):
    """What the second model's release cannot take up of the first one's prediction, in noise deviations."""
    predictions, slopes = [], []
    for one in (first, second):
        problem = Problem(one.problem.data.with_runs((run,)), one.problem.effects)
        point = Point(one.point.common, np.array([[angle, 0.0]]))
        predictions.append(problem.predict([point])[0][0] / run.noise.scale)
        slopes.append(sensitivities(problem, point)[0][1])
    change = predictions[1] - predictions[0]
    return np.sqrt(normal_equations([(change[:, None], slopes[0])], [change])[0][0, 0])


def test_the_run_separates_as_predicted_and_better_than_a_plain_one(rivals):
    found = NextRun.between(*rivals)
    assert found is not None
    template = rivals[0].problem.data.runs[0]

    def design(spring, speed, duration):
        count = round(duration / template.interval)
        return replace(template, reading=np.zeros(count), spring_stiffness=spring, wind_speed=speed,
                       air_density=1.2 if speed else 0.0, duration=duration)  # fmt: skip

    best = design(found.spring_stiffness, found.wind_speed, found.duration)
    assert apart(*rivals, best, found.release_angle) == pytest.approx(found.separation, rel=0.01)
    assert apart(*rivals, design(16.12, 15.0, 10.0), 0.35) < found.separation
    assert found.separation > 10.0


@pytest.fixture(scope="module")
def shedding():
    """A fit with vortices, whose phase every run has of its own, and the same with the phases elsewhere."""
    base = nominal(campaign())
    problem = Problem(base.problem.data, (effect_class("vortex_shedding"),))
    values = {"vortex_shedding.amplitude": 0.01, "vortex_shedding.strouhal_number": 0.03}
    common = np.append(base.point.common, [values[name] for name in problem.effect_names])

    def at(phase):
        release = np.column_stack([base.point.per_run, np.full(len(base.problem.data.runs), phase)])
        return replace(base, problem=problem, point=Point(common, release))

    return base, at


@pytest.mark.parametrize("phase", [0.0, 2.0])
def test_phases_that_every_run_has_of_its_own_separate_nothing(shedding, phase):
    """The fitted phases belong to the runs made: the same model with others is the same model."""
    base, at = shedding
    run = planned_run(base, spring_stiffness=16.12, wind_speed=20.0, air_density=1.2, duration=10.0)
    assert separation(at(0.0), at(phase), run, 0.35) == pytest.approx(0.0, abs=1e-3)
    assert separation(at(phase), base, run, 0.35) == pytest.approx(separation(at(0.0), base, run, 0.35))
    assert separation(base, at(phase), run, 0.35) > 5.0


def test_a_rival_s_phase_is_refitted(shedding):
    """Two sizes of the same vortices differ by the difference, never by the sum, whatever the phases."""
    base, at = shedding
    run = planned_run(base, spring_stiffness=16.12, wind_speed=20.0, air_density=1.2, duration=10.0)
    weak, strong = at(0.0), at(0.0)
    column = weak.problem.names.index("vortex_shedding.amplitude")
    common = strong.point.common.copy()
    common[column] *= 1.5
    strong = replace(strong, point=Point(common, strong.point.per_run))
    alone = separation(base, weak, run, 0.35)
    assert separation(weak, strong, run, 0.35) == pytest.approx(0.5 * alone, rel=0.05)


def test_the_separation_is_the_least_over_the_rival_s_phases(shedding):
    """Vortices of another Strouhal number drift apart by a radian: a search over phases finds as much."""
    base, at = shedding
    run = planned_run(base, spring_stiffness=16.12, wind_speed=20.0, air_density=1.2, duration=10.0)
    first, second = at(0.0), at(0.0)
    common = second.point.common.copy()
    common[second.problem.names.index("vortex_shedding.strouhal_number")] += (
        0.5 * 0.225 / (20.0 * np.pi * 10.0)
    )
    second = replace(second, point=Point(common, second.point.per_run))

    def reading(one, phase, angle=0.35, rate=0.0):
        problem = Problem(one.problem.data.with_runs((run,)), one.problem.effects)
        point = Point(one.point.common, np.array([[angle, rate, phase]]))
        return problem.predict([point])[0][0] / run.noise.scale

    release = [reading(second, 0.0, 0.3501), reading(second, 0.0, rate=1e-3)]
    slopes = np.stack([moved - reading(second, 0.0) for moved in release], axis=1)
    misses = []
    for phase in np.arange(-1.5, 1.5, 0.05):
        change = reading(first, 0.0) - reading(second, phase)
        misses.append(np.linalg.norm(change - slopes @ np.linalg.lstsq(slopes, change)[0]))
    assert misses[30] > 1.3 * min(misses)  # at the phases of the runs made
    assert separation(first, second, run, 0.35) == pytest.approx(min(misses), rel=0.1)


def test_a_run_that_is_made_is_not_proposed_again(rivals):
    """The fits explain it already; a much shorter one does not count."""
    first, second = rivals
    found = NextRun.between(first, second)
    runs, own = first.problem.data.runs, first.point.per_run
    made = replace(runs[0], wind_speed=found.wind_speed, air_density=1.2, duration=found.duration)

    def beside(run):
        data = first.problem.data.with_runs((*runs, run))
        release = np.vstack([own, [found.release_angle, *own[0, 1:]]])
        point = Point(first.point.common, release)
        return replace(first, problem=replace(first.problem, data=data), point=point)

    other = NextRun.between(beside(made), second)
    assert (other.wind_speed, other.release_angle) != (found.wind_speed, found.release_angle)
    assert other.separation <= found.separation
    again = NextRun.between(beside(replace(made, duration=0.1 * found.duration)), second)
    assert (again.wind_speed, again.release_angle) == (found.wind_speed, found.release_angle)


def test_a_difference_that_a_deviation_of_the_run_absorbs_separates_little():
    """One per cent of the inertia is one of stiffness and one of damping: both are one standard deviation."""
    base = nominal(campaign())
    run = planned_run(base, spring_stiffness=16.12, wind_speed=0.0, air_density=0.0, duration=10.0)
    width = 0.01
    layer = [chance(base, effect_class(f"{name}_scatter"), width) for name in ("stiffness", "damping")]
    differing = fit_at(*with_deviations(base.problem, base.point, tuple(layer)))

    def heavier(one):
        common = one.point.common.copy()
        common[one.problem.names.index("yaw_inertia")] *= 1.0 + width
        return replace(one, point=Point(common, one.point.per_run))

    assert separation(base, heavier(base), run, 0.35) > 20.0
    assert separation(differing, heavier(differing), run, 0.35) == pytest.approx(2.0**0.5, rel=0.05)
    assert separation(base, heavier(differing), run, 0.35) == pytest.approx(2.0**0.5, rel=0.05)


def test_a_misfit_of_both_models_counts_as_noise(rivals):
    first, second = rivals
    run = planned_run(first, spring_stiffness=16.12, wind_speed=15.0, air_density=1.2, duration=10.0)
    least = min(one.total / one.count for one in rivals)
    wider = [replace(one, chi2=4.0 / least * one.chi2) for one in rivals]
    whole = separation(first, second, run, 0.35) * max(1.0, least) ** 0.5
    assert separation(*wider, run, 0.35) == pytest.approx(0.5 * whole)


def test_runs_without_stiffness_propose_none():
    data = campaign()
    runs = tuple(replace(run, spring_stiffness=None) for run in data.runs[:1])
    base = nominal(replace(data, runs=runs))
    assert NextRun.between(base, base) is None


def test_the_run_is_one_that_the_rig_can_make(rivals):
    """Its only spring, its wind speeds, and angles within its swing."""
    data = rivals[0].problem.data
    found = NextRun.between(*rivals)
    assert found.spring_stiffness == 16.12
    assert found.wind_speed in (0.0, 15.0, 25.0)
    assert 0.0 < found.release_angle <= data.swing


def test_a_free_decay_is_not_proposed_where_it_does_not_show_the_question(rivals):
    data = driven("moment")
    base = nominal_study(data, ()).nominal
    assert NextRun.between(base, base) is None
    late = replace(rivals[1].problem, effects=(effect_class("input_delay"),))
    assert NextRun.between(rivals[0], replace(rivals[1], problem=late)) is None


def test_further_runs_narrow_a_coefficient_as_predicted():
    """Truth: the fit of the campaign with these runs, simulated with noise."""
    short = {"duration": 3.0, "conditions": ((16.12, 0.0), (44.84, 0.0), (44.84, 15.0))}
    base = nominal(campaign(**short))
    std = {name: base.std(name) for name in ("cn_beta", "cn_r")}
    after = {name: Quantity(base.value(name), std[name], "1/rad", shares={"noise": 1.0}) for name in std}
    wide = after | {"cn_r": replace(after["cn_r"], value=5.0 * std["cn_r"])}
    runs = FurtherRuns.narrowing(base, wide)
    assert runs is not None
    assert runs.wind_speed == 15.0
    assert (
        FurtherRuns.narrowing(
            base, {name: replace(one, value=100.0 * one.std) for name, one in after.items()}
        )
        is None
    )
    more = ((runs.spring_stiffness, runs.wind_speed),) * runs.count
    together = nominal(campaign(**short | {"conditions": short["conditions"] + more}))
    for name, before in std.items():
        assert runs.left[name] == pytest.approx(together.std(name) / before, rel=0.25)
    assert runs.left["cn_r"] < 0.8
