"""The least squares behind a diagnosis: derivatives, elimination, borrowed sensitivities, recovery."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

from diagnosis.likelihood.least_squares import FitError, clip, fit, scaled_residuals
from diagnosis.likelihood.motions import condensed
from diagnosis.likelihood.normal_equations import bounded_step, normal_equations, project_release
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.parameters import Point
from tests.marks import slow
from tests.reference import free_decays
from tests.reference.free_decays import SIX, Setting, Truth
from tests.support.gap_campaigns import campaign, nominal
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from

NOISE = 4e-4


def prepared(seed=1, *, noise=NOISE, settings=SIX, **options):
    """Six runs of the nominal model in closed form, 5 s at 500 Hz."""
    rng = np.random.default_rng(seed)
    data = free_decays.campaign(settings, noise=noise, rate=500.0, duration=5.0, rng=rng, **options)
    return prepare(data, {run.id: NOISE**2 for run in data.runs})


def test_the_truth_is_recovered_from_closed_form_records():
    truth = Truth()
    data = prepared()
    found = fit(Problem(data), nominal_start(data))
    assert found.converged
    names = ("yaw_inertia", "mechanical_damping", "cn_beta", "cn_r")
    for name in (*names, "zero"):
        expected = 0.004 if name == "zero" else getattr(truth, name)
        assert abs(found.value(name) - expected) < 4.0 * found.std(name)
    assert abs(found.excess) < 5.0 * np.sqrt(2.0 / found.count)
    np.testing.assert_allclose(found.point.per_run[:, 0], 0.35, atol=5 * NOISE)


def test_without_noise_the_truth_is_exact():
    data = prepared(noise=0.0)
    found = fit(Problem(data), nominal_start(data), tolerance=1e-9)
    assert found.value("cn_r") == pytest.approx(-0.11, abs=1e-4)
    assert found.total < 0.1  # of 7500 residuals in noise standard deviations


@pytest.mark.slow
def test_intervals_are_as_wide_as_the_scatter():
    pulls = []
    for seed in range(30):
        data = prepared(seed, settings=SIX[:3])
        found = fit(Problem(data), nominal_start(data))
        truth = {"yaw_inertia": 0.1014, "mechanical_damping": 0.012, "cn_beta": 0.49, "cn_r": -0.11}
        pulls.append([(found.value(n) - v) / found.std(n) for n, v in truth.items()])
    square = np.mean(np.square(pulls), axis=0)
    # χ² of 30 lies within 0.30 and 2.3 times 30 but for one in 10 000 on either side
    assert np.all((square > 0.30) & (square < 2.3))


def test_normalised_runs_give_frequency_and_damping():
    data = prepared(settings=(Setting(None, 0.0), Setting(None, 0.0, 0.2)))
    found = fit(Problem(data), nominal_start(data))
    assert found.problem.names == ("stiffness", "mechanical_damping", "zero")
    truth = Truth()
    assert abs(found.value("stiffness") - 16.12 / truth.yaw_inertia) < 4.0 * found.std("stiffness")
    damping = truth.mechanical_damping / truth.yaw_inertia
    assert abs(found.value("mechanical_damping") - damping) < 4.0 * found.std("mechanical_damping")


SMOOTH = {
    "quadratic_damping": {"coefficient": 0.005},
    "cubic_stiffness": {"coefficient": 0.3},
    "gravity_stiffness": {"stiffness": 0.1, "rest_angle": 0.1},
    "unsteady_aero_lag": {"lag": 0.5},
    "rod_flexibility": {"compliance": 1e-3, "inertia_share": 0.3},
    "wind_speed_drift": {"drift": 0.02},
    "vortex_shedding": {"amplitude": 0.02, "strouhal_number": 0.12},
    "sensor_nonlinearity": {"coefficient": 0.05},
    "wind_speed_offset": {"offset": 0.4},
    "reynolds_dependence": {"per_e_fold": 0.1},
}


@pytest.mark.parametrize("name", SMOOTH)
def test_sensitivities_agree_with_central_differences(name):
    problem = Problem(prepared(settings=SIX[:2]), (effect_class(name),))
    common = np.array([0.1014, 0.012, 0.49, -0.11, 0.004, *SMOOTH[name].values()])
    own = [
        [0.35, 0.1, *[0.7] * problem.parameters.of_effects],
        [0.3, -0.2, *[0.4] * problem.parameters.of_effects],
    ]
    point = Point(common, np.array(own))
    for r, (by_common, by_own) in enumerate(sensitivities(problem, point)):
        for columns, which in ((by_common, "common"), (by_own, "per_run")):
            for j in range(columns.shape[1]):
                h = 1e-5 * max(abs(getattr(point, which)[..., j].max()), 1e-2)
                ends = []
                for side in (-1.0, 1.0):
                    moved = getattr(point, which).copy()
                    moved[..., j] += side * h
                    ends.append(replace(point, **{which: moved}))
                low, high = (scaled_residuals(problem, end)[r] for end in ends)
                central = (low - high) / (2.0 * h)
                scale = np.linalg.norm(central)
                assert np.linalg.norm(columns[:, j] - central) <= 3e-5 * scale + 1e-5


def random_system(rng, runs=5, common=4, own=3, count=40):
    jacobian = [(rng.normal(size=(count, common)), rng.normal(size=(count, own))) for _ in range(runs)]
    return jacobian, [rng.normal(size=count) for _ in range(runs)]


def dense_solution(jacobian, residuals):
    """All parameters in one least-squares problem: common, then every run's own."""
    runs, own = len(jacobian), jacobian[0][1].shape[1]
    rows = []
    for r, (common, release) in enumerate(jacobian):
        blocks = [np.zeros((len(common), own)) for _ in range(runs)]
        blocks[r] = release
        rows.append(np.column_stack([common, *blocks]))
    matrix = np.concatenate(rows)
    return np.linalg.lstsq(matrix, np.concatenate(residuals), rcond=None)[0], matrix


def test_eliminated_releases_give_the_dense_solution():
    jacobian, residuals = random_system(np.random.default_rng(2))
    expected, matrix = dense_solution(jacobian, residuals)
    normal, gradient, solutions = normal_equations(jacobian, residuals)
    step = np.linalg.solve(normal, gradient)
    np.testing.assert_allclose(step, expected[:4], rtol=1e-8)
    own = [s[:, -1] - s[:, :-1] @ step for s in solutions]
    np.testing.assert_allclose(np.concatenate(own), expected[4:], rtol=1e-8)
    covariance = np.linalg.inv(matrix.T @ matrix)[:4, :4]
    np.testing.assert_allclose(np.linalg.inv(normal), covariance, rtol=1e-8)


def test_a_parameter_without_any_say_does_no_harm():
    """The phase of shed vortices means nothing in a run without wind."""
    jacobian, residuals = random_system(np.random.default_rng(3))
    expected, _ = dense_solution(jacobian, residuals)
    padded = [(common, np.column_stack([release, np.zeros(40)])) for common, release in jacobian]
    normal, gradient, solutions = normal_equations(padded, residuals)
    step = np.linalg.solve(normal, gradient)
    np.testing.assert_allclose(step, expected[:4], rtol=1e-8)
    assert all((s[:, -1] - s[:, :-1] @ step)[-1] == 0.0 for s in solutions)


@pytest.mark.parametrize("name", ["quadratic_damping", "coulomb_friction", "unsteady_aero_lag"])
def test_borrowed_sensitivities_lead_to_the_same_optimum(name):
    values = {"coulomb_friction": {"friction_moment": 0.002}, "quadratic_damping": {"coefficient": 0.003},
              "unsteady_aero_lag": {"lag": 1.0}}[name]  # fmt: skip
    base = nominal(campaign(effect_from(name, values)))
    problem = Problem(base.problem.data, (effect_class(name),))
    start = Point(np.append(base.point.common, 0.5 * next(iter(values.values()))), base.point.per_run)
    full = fit(problem, start, tolerance=1e-6)
    borrowed = fit(problem, start, base=base, tolerance=1e-6)
    assert borrowed.total == pytest.approx(full.total, abs=1.0)
    key = problem.effect_names[0]
    assert abs(borrowed.value(key) - full.value(key)) < 0.1 * full.std(key)
    assert abs(full.value(key) - next(iter(values.values()))) < 4.0 * full.std(key)


def test_a_fit_stays_inside_its_bounds():
    base = nominal(campaign())
    problem = Problem(base.problem.data, (effect_class("coulomb_friction"),))
    low = clip(problem, Point(np.append(base.point.common, -1.0), base.point.per_run))
    assert low.common[-1] == 0.0
    found = fit(problem, Point(np.append(base.point.common, 1e-4), base.point.per_run), base=base)
    assert 0.0 <= found.value("coulomb_friction.friction_moment") < 1e-4


def test_a_model_that_grows_without_bound_is_refused():
    data = prepared(settings=SIX[:2])
    start = nominal_start(data)
    wild = start.common.copy()
    wild[3] = 5e4  # Cnr; the mechanical damping is not negative in a fit
    with pytest.raises(FitError):
        fit(Problem(data), Point(wild, start.per_run))


@pytest.mark.parametrize("greatest", [1e160, 1e308])
def test_a_motion_whose_square_overflows_costs_without_bound(monkeypatch, greatest):
    """It has no warning: a step that leads there is taken back."""
    base = nominal(campaign())
    far = [np.full_like(values, greatest) for values in base.problem.predict([base.point])[0]]
    monkeypatch.setattr(Problem, "predict", lambda _, points: [far for _ in points])
    with pytest.raises(FitError):
        fit(base.problem, base.point)


def test_a_parameter_that_is_not_finite_predicts_what_grows_without_bound():
    base = nominal(campaign())
    release = base.point.per_run.copy()
    release[2, 0] = np.nan
    common = np.where(np.arange(base.point.common.size) == 0, np.nan, base.point.common)
    spoilt = [Point(base.point.common, release), Point(common, base.point.per_run), base.point]
    one, all_of_them, none = base.problem.predict(spoilt)
    assert [bool(np.all(np.isposinf(values))) for values in one] == [r == 2 for r in range(len(one))]
    assert all(np.all(np.isposinf(values)) for values in all_of_them)
    assert all(np.array_equal(a, b) for a, b in zip(none, base.problem.predict([base.point])[0], strict=True))


def test_what_a_release_cannot_absorb_is_orthogonal_to_it():
    rng = np.random.default_rng(5)
    slopes, change = rng.normal(size=(50, 2)), rng.normal(size=50)
    left = project_release(change, slopes)
    np.testing.assert_allclose(slopes.T @ left, 0.0, atol=1e-10)
    np.testing.assert_allclose(project_release(slopes @ [2.0, -3.0], slopes), 0.0, atol=1e-10)


def random_bounded(rng, size, bounded):
    """A least-squares problem in scaled parameters, of which the first ``bounded`` have bounds about zero."""
    design = rng.normal(size=(3 * size, size)) @ rng.normal(size=(size, size))
    design /= np.linalg.norm(design, axis=0)
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    lower[:bounded], upper[:bounded] = -rng.exponential(size=bounded), rng.exponential(size=bounded)
    lower[:bounded][rng.random(bounded) < 0.2] = 0.0
    return design, rng.normal(size=3 * size), lower, upper


@pytest.mark.parametrize("size", [1, 2, 5, 9])
def test_a_step_with_one_bounded_parameter_is_scipys(size):
    rng = np.random.default_rng(size)
    for _ in range(50):
        design, target, lower, upper = random_bounded(rng, size, 1)
        step = bounded_step(design.T @ design, design.T @ target, lower, upper)
        expected = lsq_linear(design, target, (lower, upper), method="bvls", tol=1e-14).x
        np.testing.assert_allclose(design @ step, design @ expected, atol=1e-8 * np.linalg.norm(target))


@pytest.mark.parametrize("size", [2, 5, 9])
def test_a_step_with_many_bounded_parameters_solves_for_those_inside(size):
    """A parameter once held at its bound is not released again, so SciPy's step is often better."""
    rng = np.random.default_rng(size)
    for _ in range(100):
        design, target, lower, upper = random_bounded(rng, size, size)
        step = bounded_step(design.T @ design, design.T @ target, lower, upper)
        assert np.all((step >= lower) & (step <= upper))
        inside = (step > lower) & (step < upper)
        np.testing.assert_allclose((design.T @ (design @ step - target))[inside], 0.0, atol=1e-8)
        best = lsq_linear(design, target, (lower, upper), method="bvls", tol=1e-14).x
        assert np.sum((design @ best - target) ** 2) <= np.sum((design @ step - target) ** 2) * (1.0 + 1e-9)


def test_a_strongly_damped_bounded_step_is_exact():
    """The diagonal then outweighs the rest, and every parameter is clipped for itself."""
    rng = np.random.default_rng(4)
    design, target, lower, upper = random_bounded(rng, 9, 9)
    damped = design.T @ design + 1e6 * np.eye(9)
    step = bounded_step(damped, 1e6 * design.T @ target, lower, upper)
    np.testing.assert_allclose(step, np.clip(design.T @ target, lower, upper), rtol=1e-4, atol=1e-4)


def two_inertias(run, compliance, share, time):
    """The rod's end of the two-inertia model, by SciPy; the body is held, so the rod starts twisted."""
    truth = Truth()
    top, body = share * truth.yaw_inertia, (1.0 - share) * truth.yaw_inertia
    rod = 1.0 / compliance
    twist_damping = 2.0 * 0.01 * np.sqrt(truth.yaw_inertia * share * (1.0 - share) * rod)
    per = 0.5 * run.air_density * 0.036 * 0.625 * run.wind_speed

    def slope(_t, s):
        theta, omega, beta, rate = s
        between = rod * (beta - theta) + twist_damping * (rate - omega)
        air = per * (run.wind_speed * truth.cn_beta * beta + 0.625 * truth.cn_r * rate)
        spring = run.spring_stiffness * theta + truth.mechanical_damping * omega
        return [omega, (between - spring) / top, rate, (air - between) / body]

    start = [0.35, 0.0, 0.35 * (1.0 + run.spring_stiffness * compliance), 0.0]
    found = solve_ivp(slope, (0.0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-12, max_step=5e-4)
    return found.y[0]


@pytest.mark.parametrize(("share", "speed"), [(0.1, 25.0), (0.5, 0.0), slow(0.1, 0.0), slow(0.5, 25.0)])
def test_a_stiff_rod_condensed_moves_as_the_two_inertias_do(speed, share):
    """What is dropped is of the square of c Kr = 9e-4, and the ringing after the release."""
    compliance = 2e-5
    data = prepared(settings=(Setting(44.84, speed),))
    data = replace(
        data,
        runs=tuple(replace(run, reading=run.reading[:500]) for run in data.runs),
        model=replace(data.model, windy=True),
    )
    problem = Problem(data, (effect_class("rod_flexibility"),))
    truth = Truth()
    common = [truth.yaw_inertia, truth.mechanical_damping, truth.cn_beta, truth.cn_r, 0.0, compliance, share]
    point = Point(np.array(common), np.array([[0.35, 0.0]]))
    physics = problem.chain(point.common, point.per_run[0], data.runs[0]).physics()
    assert condensed(physics, data).rod_twist is None
    moved = problem.predict([point])[0][0]
    time = np.arange(1000) / 500.0
    expected = two_inertias(data.runs[0], compliance, share, time).reshape(500, 2).mean(axis=1)
    rigid = Problem(data).predict([Point(point.common[:5], point.per_run)])[0][0]
    effect = np.max(np.abs(rigid - expected))
    assert effect > 2.0 * NOISE
    assert np.max(np.abs(moved - expected)) < min(0.1 * effect, 0.25 * NOISE)


@pytest.mark.parametrize("kind", [k for k in ALL_EFFECTS if k.name not in ("sensor_clipping", "buffeting")])
def test_an_effect_at_its_null_predicts_as_without(kind):
    data = prepared(settings=SIX[:2])
    infos = [info for info in kind.parameters() if not (info.form or info.of_input)]
    values = [0.0 if i == 0 else info.default for i, info in enumerate(infos)]
    common = np.array([0.1014, 0.012, 0.49, -0.11, 0.004])
    release = np.array([[0.35, 0.0], [0.35, 0.0]])
    problem = Problem(data, (kind,))
    own = np.column_stack([release, *[np.zeros(2)] * problem.parameters.of_effects])
    with_effect = problem.predict([Point(np.append(common, values), own)])[0]
    without = Problem(data).predict([Point(common, release)])[0]
    for one, other in zip(with_effect, without, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
