"""How much of an effect's evidence the scatter between the runs leaves."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import fit, fit_at
from diagnosis.likelihood.normal_equations import normal_equations
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import project_out, starting_points
from diagnosis.model.parameters import Point
from diagnosis.search.evident import overdispersion
from diagnosis.search.random_moments import follows_the_motion, is_inflated
from tests.support.drawn_moment import moment
from tests.support.gap_campaigns import CONDITIONS, campaign, nominal
from tunnel_sim.effects import effect_class, effect_from

KIND = effect_class("quadratic_damping")


@pytest.fixture(scope="module")
def fitted():
    """Twelve runs with quadratic damping, and the effect fitted."""
    effect = effect_from("quadratic_damping", {"coefficient": 0.003})
    base = nominal(campaign(effect, conditions=2 * CONDITIONS))
    start = starting_points(base, KIND)[0]
    assert isinstance(start.problem, Problem)
    return fit(start.problem, start.point)


def drawn(fitted, rng, share):
    """A fit's residuals in white noise, and with a coefficient that scatters between the runs.

    Args:
        share: standard deviation of a run's own coefficient over that which the noise gives it in one run.
    """
    place = fitted.problem.names.index("quadratic_damping.coefficient")
    residuals = []
    for common, release in fitted.jacobian:
        column = common[:, place]
        alone = column - release @ np.linalg.lstsq(release, column, rcond=None)[0]
        own = share * rng.normal() / np.sqrt(alone @ alone)
        residuals.append(rng.normal(size=column.size) + own * column)
    return replace(fitted, residuals=project_out(fitted, residuals))


@pytest.mark.parametrize("share", [0.0, 5.0])
def test_the_scatter_between_runs_is_told_from_that_of_the_noise(fitted, share):
    """Truth: the variance is 1 + share² times that of the noise where one coefficient is free.

    Twelve runs estimate the mean of many campaigns within a factor of two either way.
    """
    rng = np.random.default_rng(11)
    found = [overdispersion(drawn(fitted, rng, share), KIND) for _ in range(200)]
    assert 0.5 < np.mean(found) / (1.0 + share**2) < 2.0
    assert min(found) >= 1.0


def test_an_effect_that_one_run_alone_shows_has_the_disagreement_of_the_others(fitted):
    """Truth: the first run, a thousand times as precise as the others, has a coefficient that they contradict.

    The fit follows this run, so no residual of its own shows the disagreement.
    """
    place, away, precise = fitted.problem.names.index("quadratic_damping.coefficient"), 1e-3, 1e3
    jacobian = [(c * precise, r * precise) if i == 0 else (c, r) for i, (c, r) in enumerate(fitted.jacobian)]
    residuals = [c[:, place] * (away if i == 0 else 0.0) for i, (c, _) in enumerate(jacobian)]
    odd = replace(fitted, jacobian=jacobian)
    matrix, _, _ = normal_equations(jacobian, residuals)
    variance = float(np.linalg.inv(matrix)[place, place])
    found = overdispersion(replace(odd, residuals=project_out(odd, residuals)), KIND)
    assert found * variance == pytest.approx(away**2, rel=0.2)


@pytest.mark.parametrize(("share", "contradicts"), [(1e-2, True), (1e-4, False)])
def test_runs_that_hardly_show_an_effect_do_not_contradict_the_one_that_does(fitted, share, contradicts):
    """Truth: columns without correlation, a share of the first run's sensitivity in the others, ten along them.

    Of few runs, the others then determine the effect by rounding alone.
    """
    rng = np.random.default_rng(13)
    place, runs = fitted.problem.names.index("quadratic_damping.coefficient"), fitted.problem.data.runs[:4]
    jacobian, residuals = [], []
    for index, (common, release) in enumerate(fitted.jacobian[: len(runs)]):
        columns = rng.normal(size=common.shape)
        residuals.append((10.0 if index else 0.0) * columns[:, place] / np.linalg.norm(columns[:, place]))
        columns[:, place] *= share if index else 1.0
        jacobian.append((columns, rng.normal(size=release.shape)))
    problem = replace(fitted.problem, data=fitted.problem.data.with_runs(runs))
    few = replace(fitted, problem=problem, jacobian=jacobian)
    found = overdispersion(replace(few, residuals=project_out(few, residuals)), KIND)
    assert (found > 100.0) == contradicts


@pytest.mark.parametrize(("excess", "inflated"), [(2.0, False), (8.0, True)])
def test_a_noise_that_permits_a_large_error_of_the_model_is_no_moment(fitted, excess, inflated):
    """Truth: a point whose χ² exceeds the least by a multiple of the number of readings."""
    place, common = fitted.problem.names.index("quadratic_damping.coefficient"), fitted.point.common
    away = np.eye(common.size)[place] * 0.1 * common[place]
    near = fit_at(fitted.problem, Point(common + away, fitted.point.per_run))
    far = away * np.sqrt(excess * fitted.count / (near.total - fitted.total))
    beside = fit_at(fitted.problem, Point(common + far, fitted.point.per_run))
    assert (beside.total - fitted.total) / fitted.count == pytest.approx(excess, rel=0.2)
    assert is_inflated(moment(1.0), beside, fitted) == inflated


@pytest.mark.parametrize(
    ("along", "rate", "follows"), [(3.0, 3.0, False), (100.0, 1.0, True), (1.0, 100.0, True)]
)
def test_a_random_moment_adds_as_much_along_the_motion_as_along_the_rate(fitted, along, rate, follows):
    """Truth: slow random changes of the amplitude and of the phase, in noise standard deviations of a sample.

    The false-alarm rate is one in a thousand: of 40 campaigns none may be refused, but most are where the motion or
    its rate is followed a hundred times as much as the other.
    """
    rng = np.random.default_rng(12)
    found = []
    for _ in range(40):
        residuals, runs = [], []
        for run, left in zip(fitted.problem.data.runs, fitted.residuals, strict=True):
            motion = run.scaled(run.reading) - left
            slow = 1.0 + np.arange(left.size) / left.size
            added = rng.normal(size=left.size)
            for size, part in ((along, motion), (rate, np.gradient(motion))):
                added += size * rng.normal() * slow * part / np.std(part)
            residuals.append(added)
            runs.append(replace(run, reading=run.reading + run.unscaled(added - left)))
        problem = replace(fitted.problem, data=fitted.problem.data.with_runs(tuple(runs)))
        acts = [run.id for run in runs if run.wind_on]
        found.append(follows_the_motion(replace(fitted, problem=problem, residuals=residuals), acts))
    assert np.mean(found) >= 0.5 if follows else not any(found)
