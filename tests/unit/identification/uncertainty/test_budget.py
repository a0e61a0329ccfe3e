"""The budget's arithmetic against the estimators themselves and against closed forms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification import identify
from identification.uncertainty.budget import InputUncertainties, make_budget, with_budget
from tests.marks import slow
from tests.reference.free_decays import TWELVE, Setting, campaign, with_records
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")
EIGHT = (
    *(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0, 24.0)),
    Setting(16.12, 0.0, 0.2),
    Setting(44.84, 0.0, 0.2),
)
SHAPE = {"duration": 5.0, "rate": 200.0}


@cache
def by(name):
    """An estimator that estimates from the same campaign once."""
    kept = {}  # with the campaigns, so that no other object takes the place of one

    def estimated(data):
        if id(data) not in kept:
            kept[id(data)] = data, identify(data, name, throw=False)
        return kept[id(data)][1]

    return estimated


@pytest.fixture(scope="module")
def noisy():
    # A seed in which chance raises no flag of scatter; how often it does is tested below.
    return campaign(EIGHT, noise=5e-4, rng=np.random.default_rng(4), **SHAPE)


def budget_of(data, inputs, name="matrix_pencil", **options):
    return make_budget(data, by(name)(data), by(name), inputs, **options)


def component(budget, start):
    (found,) = [one for one in budget.components if one.name.startswith(start)]
    return found


def stated(data, name, factor):
    """The campaign with one input stated otherwise in all runs."""
    if name == "clock":
        runs = tuple(
            replace(run, record=Record(run.record.time_s * factor, run.record.yaw_rad)) for run in data.runs
        )
        return replace(data, runs=runs)
    if hasattr(data.rig, name):
        return replace(data, rig=replace(data.rig, **{name: (getattr(data.rig, name) or 0.1) * factor}))
    return replace(data, runs=tuple(replace(run, **{name: getattr(run, name) * factor}) for run in data.runs))


INPUTS = (
    "spring_stiffness", "wind_speed", "air_density", "frontal_area", "reference_length", "yaw_inertia", "clock"
)  # fmt: skip


@pytest.mark.parametrize("estimator", ["matrix_pencil", slow("conventional")])
@pytest.mark.parametrize("name", INPUTS)
def test_common_errors_move_the_estimators_as_the_closed_form_says(noisy, estimator, name):
    step = 1e-4
    budget = budget_of(noisy, InputUncertainties({name: step}), estimator)
    moves = np.sqrt(np.diag(component(budget, name).covariance))
    there, back = (by(estimator)(stated(noisy, name, 1.0 + s * step)) for s in (1, -1))
    for quantity, move in zip(budget.names, moves, strict=True):
        change = 0.5 * abs(getattr(there, quantity).value - getattr(back, quantity).value)
        scale = abs(getattr(there, quantity).value) * step
        assert move == pytest.approx(change, abs=0.02 * scale)


def test_one_wind_speed_for_all_runs_ties_the_coefficients_together(noisy):
    budget = budget_of(noisy, InputUncertainties({"wind_speed": 0.02}))
    block = component(budget, "wind_speed").covariance[:2, :2]
    # Cnβ > 0 falls and Cnr < 0 rises where the speed is larger: one error, correlation −1.
    assert block[0, 1] / np.sqrt(block[0, 0] * block[1, 1]) == pytest.approx(-1.0)
    widened = with_budget(by("matrix_pencil")(noisy), budget)
    assert widened.cn_beta.std == pytest.approx(budget.std("cn_beta"))
    assert widened.covariance_matrix[0, 1] == pytest.approx(budget.covariance[0, 1])


def test_independent_errors_of_runs_average_out_and_common_ones_do_not(noisy):
    common = budget_of(noisy, InputUncertainties({"wind_speed": 0.01}))
    own = budget_of(noisy, InputUncertainties({}, {"wind_speed": 0.01}))
    ratio = component(own, "wind_speed").covariance[0, 0] / component(common, "wind_speed").covariance[0, 0]
    assert 0.2 < ratio < 0.95  # four wind-on runs: 1/4 if they counted alike


def test_an_error_of_zero_has_no_component_and_leaves_the_others(noisy):
    alone = budget_of(noisy, InputUncertainties({"air_density": 0.01}, {"wind_speed": 0.01}))
    zeros = InputUncertainties(
        {"clock": 0.0, "air_density": 0.01}, {"spring_stiffness": 0.0, "wind_speed": 0.01}
    )
    both = budget_of(noisy, zeros)
    assert [one.name for one in both.components] == [one.name for one in alone.components]
    assert np.array_equal(both.covariance, alone.covariance)


def test_correlated_inputs_add_or_cancel(noisy):
    inputs = {"wind_speed": 0.01, "air_density": 0.02}
    for coefficient, percent in ((1.0, 4.0), (-1.0, 0.0), (0.0, np.sqrt(8.0))):
        given = InputUncertainties(inputs, {}, (("wind_speed", "air_density", coefficient),))
        budget = budget_of(noisy, given)
        # Cnβ ∝ 1/(ρV²): 2 % from each of them.
        extra = budget.covariance[0, 0] - budget.components[0].covariance[0, 0]
        assert np.sqrt(max(extra, 0.0)) / budget.values[0] == pytest.approx(0.01 * percent, abs=1e-6)


def test_scatter_is_none_where_noise_explains_it_and_found_where_it_does_not(noisy):
    quiet = budget_of(noisy, InputUncertainties())
    assert component(quiet, "scatter").known
    assert not component(quiet, "scatter").covariance.any()
    # Every run's speed is off by 3 % of its own, and nobody says so.
    rng = np.random.default_rng(8)
    runs = tuple(replace(run, wind_speed=run.wind_speed * rng.normal(1.0, 0.03)) for run in noisy.runs)
    loud = budget_of(replace(noisy, runs=runs), InputUncertainties())
    assert loud.share(component(loud, "scatter"), "cn_beta") > 0.9
    # Said, it is not counted twice.
    said = budget_of(replace(noisy, runs=runs), InputUncertainties({}, {"wind_speed": 0.03}))
    assert said.share(component(said, "scatter"), "cn_beta") < 0.6
    assert 0.3 < loud.std("cn_beta") / said.std("cn_beta") < 3.0


def test_the_choice_of_model_shows_where_the_model_is_wrong(noisy):
    calm = budget_of(noisy, InputUncertainties(), others={"conventional": by("conventional")})
    assert not component(calm, "choice").covariance.any()
    # A spring that stiffens with the angle: the first half of a decay is quicker than the whole.
    curved = with_records(noisy, lambda time, yaw: yaw + 0.02 * np.sin(0.4 * time) * yaw)
    budget = budget_of(curved, InputUncertainties())
    assert component(budget, "choice").covariance[1, 1] > 0.0
    assert "first half" in component(budget, "choice").note


def test_a_budget_adds_up_and_goes_to_json(noisy):
    budget = budget_of(noisy, InputUncertainties({"wind_speed": 0.01}, {"spring_stiffness": 0.002}))
    for name in budget.names:
        assert sum(budget.share(one, name) for one in budget.components) == pytest.approx(1.0)
    document = budget.to_json_dict()
    total = sum(one["variance"]["cn_r"] for one in document["components"])
    assert np.sqrt(total) == pytest.approx(document["combined_std"]["cn_r"])


def test_scatter_is_unknown_where_no_run_can_be_spared():
    data = campaign(TWELVE[:2], noise=5e-4, rng=np.random.default_rng(1), **SHAPE)
    budget = budget_of(data, InputUncertainties())
    assert not component(budget, "scatter").known


@pytest.mark.slow
def test_scatter_beyond_noise_is_flagged_as_rarely_as_stated():
    """One likelihood ratio at 1 %."""
    flagged = 0
    for seed in range(60):
        data = campaign(EIGHT, noise=5e-4, rng=np.random.default_rng(seed), duration=4.0, rate=100.0)
        flagged += by("matrix_pencil")(data).repeatability is not None
    assert flagged <= 4  # of 60 at 1 %: more with probability 3e-4


@pytest.mark.parametrize("windy", [False, True])
def test_what_common_errors_of_the_wind_need_is_said(windy):
    runs = [run for run in TWELVE if windy or run.speed == 0.0]
    data = campaign(runs, noise=5e-4, rng=np.random.default_rng(2), **SHAPE)
    found = component(budget_of(data, InputUncertainties(common={"wind_speed": 0.01})), "wind_speed, common")
    assert found.note == ("" if windy else "no wind-on run")
    assert found.covariance.any() == windy
