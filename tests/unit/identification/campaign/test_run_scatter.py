"""Scatter between runs in the coefficients: closed forms, what the user states, and what is said."""

from dataclasses import fields, replace
from math import inf

import numpy as np
import pytest
from scipy.stats import chi2

from identification import identify
from identification.campaign.random_effects import UsualWidths
from identification.campaign.run_scatter import ratio_limit
from identification.estimate import Estimate
from identification.policy import DIFFERENCE_RATE
from identification.printing import repeatability_lines
from identification.statistics import student_factor
from tests.reference.free_decays import Setting, Truth, campaign
from tests.reference.scattering import THREE_SPRINGS, USUAL, scattering
from tunnel_sim.effects import BetweenRuns, known_effects
from tunnel_sim.vocabulary.between_runs import SCATTERED, Repeatability

pytestmark = pytest.mark.usefixtures("unexamined")

SHAPE = {"noise": 5e-4, "duration": 6.0, "rate": 100.0}
COEFFICIENTS = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")


@pytest.fixture(scope="module")
def scattered():
    return scattering(THREE_SPRINGS, np.random.default_rng(21), **SHAPE)


@pytest.fixture(scope="module")
def steady():
    return campaign(THREE_SPRINGS, rng=np.random.default_rng(22), **SHAPE)


def test_the_usual_widths_are_those_of_the_vocabulary():
    scales = {
        kind.scatters: kind.parameters()[0].scale for kind in known_effects() if issubclass(kind, BetweenRuns)
    }
    assert {name: getattr(UsualWidths(), name) for name in SCATTERED} == scales
    assert tuple(one.name for one in fields(Repeatability)) == SCATTERED


@pytest.mark.parametrize("widths", [1, 2, 3])
def test_the_ratio_is_exceeded_at_its_rate_by_the_mixture_at_the_end_of_the_range(widths):
    limit = ratio_limit(widths)
    fewer = chi2.sf(limit, widths - 1) if widths > 1 else 0.0
    assert 0.5 * (fewer + chi2.sf(limit, widths)) == pytest.approx(DIFFERENCE_RATE, rel=1e-4)
    if widths == 1:  # half of the runs that repeat show a width of zero
        assert limit == pytest.approx(chi2.isf(2.0 * DIFFERENCE_RATE, 1), rel=1e-4)


def test_students_factor_has_the_degrees_of_freedom_of_the_variance():
    # a variance of n squares has the relative variance 2/n; 12.706 and 2.228 are of the tables
    factor = student_factor(np.array([0.0, 2.0 / 10.0, 2.0, inf]))
    np.testing.assert_allclose(factor, np.array([1.95996, 2.22814, 12.7062, 12.7062]) / 1.95996, rtol=1e-4)


def test_an_inertia_of_runs_that_scatter_is_not_said_to_be_known_to_their_noise(scattered, steady):
    loud, quiet = identify(scattered), identify(steady)
    assert quiet.repeatability is None
    assert loud.repeatability is not None
    for name in COEFFICIENTS:
        given = getattr(loud, name)
        assert given.std > 5.0 * getattr(quiet, name).std
        assert abs(given.value - getattr(Truth(), name)) < 3.5 * given.std
    assert loud.status.name == "OK"  # the scatter is no misfit of the model


def test_the_widths_come_out_and_the_runs_own_deviations_are_their_frequency_and_damping(scattered):
    found = identify(scattered, "matrix_pencil").repeatability
    for name, true in zip(SCATTERED, USUAL, strict=True):
        low, high = getattr(found, name).interval
        assert low < true < high
    # springs of 0.05 % move the frequency of still runs by half of it; the wind adds to that of the others
    assert 0.5e-4 < found.frequency < 1e-3
    assert 1e-3 < found.damping < 0.03


@pytest.mark.parametrize("estimator", ["output_error", "matrix_pencil", "conventional", "bayesian"])
def test_a_stated_repeatability_is_used_as_it_is(steady, estimator):
    stated = replace(steady, repeatability=Repeatability(spring_stiffness=0.002))
    found, plain = identify(stated, estimator), identify(steady, estimator)
    assert found.repeatability.stated == ("spring_stiffness",)
    assert found.repeatability.spring_stiffness.value == 0.002
    assert found.repeatability.wind_speed is None  # neither stated nor seen
    # Truth: twelve springs of 0.2 % each, and an inertia that is at best their mean.
    assert found.yaw_inertia.std / found.yaw_inertia.value > 0.002 / np.sqrt(12)
    assert found.yaw_inertia.std > 10.0 * plain.yaw_inertia.std
    assert abs(found.yaw_inertia.value / plain.yaw_inertia.value - 1.0) < 0.002


def test_a_scatter_within_what_is_stated_adds_nothing_to_it(scattered):
    plain = identify(scattered, "matrix_pencil")
    stated = identify(replace(scattered, repeatability=Repeatability(*USUAL)), "matrix_pencil")
    assert stated.repeatability.stated == SCATTERED
    for name in COEFFICIENTS:  # widths that are known need no wider distribution than the normal
        assert 0.3 < getattr(stated, name).std / getattr(plain, name).std < 1.5


def test_the_wind_off_line_has_the_scatter_too(scattered, steady):
    loud, quiet = (identify(data, "matrix_pencil").wind_off_inertia for data in (scattered, steady))
    assert loud.std > 5.0 * quiet.std


def test_the_repeatability_is_printed_and_goes_through_json(scattered):
    estimate = identify(scattered, "matrix_pencil")
    document = estimate.to_json_dict()
    (line,) = repeatability_lines(document)
    assert line.startswith("Between runs: frequency differs by 0.0")
    assert "attributed to chance, wind speed by" in line
    assert line.endswith("The intervals include it; tunnel diagnose distinguishes chance from a cause.")
    assert line in " ".join(str(estimate).split())
    again = Estimate.from_json_dict(document)
    assert again.repeatability == estimate.repeatability


def test_runs_that_cannot_show_a_scatter_say_so_once(steady):
    for count, words in ((1, "one run"), (2, "runs without a repeat")):
        few = replace(steady, runs=steady.runs[:count])
        (line,) = repeatability_lines(identify(few, "matrix_pencil").to_json_dict())
        assert words in line
        assert "[repeatability]" in line
    assert repeatability_lines(identify(steady, "matrix_pencil").to_json_dict()) == []


def test_what_all_runs_share_is_no_scatter():
    """A speed that is 2 % off in all runs, and a spring that is: constants that the coefficients take."""
    data = campaign(THREE_SPRINGS, rng=np.random.default_rng(23), **SHAPE)
    runs = tuple(replace(run, wind_speed=1.02 * run.wind_speed) for run in data.runs)
    assert identify(replace(data, runs=runs), "matrix_pencil").repeatability is None


def test_runs_without_a_spring_that_is_stated_have_no_coefficients_to_widen():
    data = scattering((Setting(16.12, 0.0),) * 4, np.random.default_rng(24), **SHAPE)
    bare = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs))
    assert identify(bare, "matrix_pencil").repeatability is None
