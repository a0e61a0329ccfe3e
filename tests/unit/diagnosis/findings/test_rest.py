"""What remains: whether it is beyond chance, how far it moves the coefficients, and what is said of it.

Truth: refits of halves of the data, which the moves stand in for; estimates written by hand.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.linear_theory import (
    coefficient_move,
    wind_on_runs,
)
from diagnosis.findings.averaged_coefficients import Answers, Possible, coefficients
from diagnosis.findings.candidates import UNDETERMINED_FROM, meant_coefficient, meant_parameter
from diagnosis.findings.remainder import remainder
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.parameters import Point
from diagnosis.model.rig import PerInertia
from identification.estimate import Quantity
from tests.support.diagnosis_document import findings_of
from tests.support.gap_campaigns import CN_BETA, CONDITIONS, INERTIA, answer, campaign, nominal, studied
from tests.support.rendered import rest_words
from tunnel_sim.effects import effect_class
from tunnel_sim.files.writing import as_json

CAUSE = "quadratic_damping"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cn_beta", "cn_r"])
def test_noise_moves_no_coefficient_by_much_more_than_its_deviation(name):
    moves = []
    for seed in range(12):
        found = nominal(campaign(seed=seed))
        moves.append(coefficient_move(found, name) / found.std(name))
    assert np.median(moves) < 0.5
    assert max(moves) < 4.0


def halves(base, select):
    """The same runs, half of them as chosen."""
    runs = base.problem.data.runs
    chosen = [i for i, run in enumerate(runs) if select(run)]
    part = Problem(base.problem.data.with_runs(tuple(runs[i] for i in chosen)))
    return fit(part, Point(base.point.common, base.point.per_run[chosen]))


def test_the_move_is_half_the_difference_between_halves_of_the_data(base):
    """The aerodynamic damping of the two springs, which quadratic damping makes differ."""
    soft, stiff = (halves(base, lambda run, k=k: (run.spring_stiffness > 30.0) == k) for k in (False, True))
    half = 0.5 * abs(soft.value("cn_r") - stiff.value("cn_r"))
    assert half > 20.0 * base.std("cn_r")
    assert 0.3 * half < coefficient_move(base, "cn_r") < 3.0 * half


def test_in_normalised_form_the_frequency_and_the_damping_ratio_move(data):
    runs = tuple(replace(run, spring_stiffness=None) for run in data.runs[:1])
    base = nominal(replace(data, runs=runs))
    omega, zeta = (coefficient_move(base, name) for name in ("omega_n", "zeta"))
    assert 0.0 < omega < 0.1
    early, late = (cut(base, half) for half in (slice(None, 1250), slice(1250, None)))
    ratio = [f.value("mechanical_damping") / (2.0 * f.value("stiffness") ** 0.5) for f in (early, late)]
    half = 0.5 * abs(ratio[0] - ratio[1])
    assert 0.3 * half < zeta < 3.0 * half


def cut(base, part):
    """The nominal fit of a part of the only run."""
    (run,) = base.problem.data.runs
    reading = run.reading[part]
    shorter = replace(run, reading=reading, duration=reading.size * run.interval)
    release = np.array([[reading[0] - base.value("zero"), np.gradient(reading, run.interval)[0]]])
    return fit(Problem(base.problem.data.with_runs((shorter,))), Point(base.point.common, release))


def judged(study, moved, std, excess=0.4):
    stated = {"cn_beta": Quantity(0.5, std, "1/rad")}
    found = remainder(study, stated, {"cn_beta": moved}, excess)
    document = {
        "causes": list(study.causes),
        "gap": {"misfit": {"noise": 4e-4, "swing": 0.1, "unit": "rad"}},
        "rest": as_json(found),
        "coefficients": {"after": as_json(stated)},
    }
    return replace(found, words=rest_words(findings_of(document)))


def unknown(data, base):
    study = studied(data, base, ("free_play",))
    return with_p_value(replace(study, answers=(answer(("unknown",), 0.2, 1.0),)), 1e-9)


def with_p_value(study, value):
    return replace(study, gap=replace(study.gap, test=replace(study.gap.test, p_value=value)))


@pytest.mark.parametrize(
    ("moved", "std", "material"),
    [(0.004, 0.002, True), (0.006, 0.1, True), (0.0001, 0.0002, False), (0.006, None, False)],
)
def test_what_moves_a_coefficient_by_its_deviation_or_by_a_hundredth_is_material(
    data, base, moved, std, material
):
    found = judged(unknown(data, base), moved, std)
    assert found.significant
    assert found.material is material
    assert ("Do not trust the coefficients" in found.words) is material
    if std is not None and not material:
        assert "Cnβ by less than 0.04 %" in found.words
    if material:
        assert f"could change Cnβ by {100 * moved / 0.5:.2g} %" in found.words


def test_what_chance_explains_is_never_material(data, base):
    best = fit(Problem(base.problem.data, (effect_class(CAUSE),)), with_effect(base))
    found = judged(studied(data, base, (CAUSE,), best), 0.1, 0.001, excess=0.0004)
    assert not found.significant
    assert not found.material
    assert found.words == "The residual is within the noise."
    assert found.moves["cn_beta"].relative == pytest.approx(0.2)


def with_effect(base):
    return Point(np.append(base.point.common, 0.003), base.point.per_run)


def test_a_small_rest_of_a_named_cause_is_said_to_be_small(data, base):
    study = studied(data, base, (CAUSE,), base)
    found = judged(with_p_value(study, 0.0), 0.0, 0.0001)
    assert found.words == "The residual (0.0145° root mean square) changes Cnβ by less than 0.02 %."
    assert judged(study, 0.0, None).words.startswith(
        "The residual (0.0145° root mean square) changes no coefficient"
    )


def test_no_gap_leaves_nothing(data, base):
    study = studied(data, base)
    assert judged(with_p_value(study, 0.7), 0.0, 0.001).words.startswith("No gap")


@pytest.mark.parametrize(("std", "determined"), [(0.05, True), (1.0, True), (1000.0, False), (0.0, False)])
def test_a_parameter_without_an_order_of_magnitude_is_not_determined(std, determined):
    (info,) = effect_class("cubic_stiffness").parameters()[:1]
    given = Quantity(0.2, std, "1/rad2")
    found = meant_parameter(given, replace(info, scale=0.5), 0.3, UNDETERMINED_FROM)
    assert (found.std == std, found.determined) == (determined, determined)


def test_a_range_no_wider_than_chance_determines_nothing():
    info = effect_class("coulomb_friction").parameters()[0]
    bounded = replace(info, fit_lower=1.0, fit_upper=3.0, scale=100.0)
    assert meant_parameter(Quantity(2.0, 0.5, "1"), bounded, 0.3, UNDETERMINED_FROM).determined
    assert not meant_parameter(Quantity(2.0, 0.6, "1"), bounded, 0.3, UNDETERMINED_FROM).determined


@pytest.mark.parametrize(
    ("name", "value", "std", "determined"),
    [("omega_n", 0.8, 2.3, False), ("omega_n", 10.9, 0.1, True), ("zeta", 0.0, 1.4e9, False),
     ("zeta", -0.001, 0.002, True), ("cn_beta", 0.0, 840000.0, False), ("cn_beta", 0.4, 0.5, True),
     ("cn_r", -0.1, 1e4, False), ("cn_r", -0.1, 0.3, True)],
)  # fmt: skip
def test_a_coefficient_that_could_be_anything_is_not_determined(base, name, value, std, determined):
    found = meant_coefficient(Quantity(value, std, "1"), base, name)
    assert (found.determined, found.std) == (determined, std if determined else None)
    assert found.to_json_dict().get("determined", True) is determined


AREA, LENGTH, DENSITY = 0.036, 0.625, 1.2
WINDY = tuple((spring, speed) for spring, speed in CONDITIONS if speed > 0.0)


def loads(speed):
    """½ρV²Al in N m and ½ρVAl² in N m s."""
    return 0.5 * DENSITY * speed**2 * AREA * LENGTH, 0.5 * DENSITY * speed * AREA * LENGTH**2


@pytest.mark.parametrize("name", ["cn_beta", "cn_r"])
def test_the_limit_is_the_stiffness_or_the_critical_damping_in_the_fastest_wind(base, name):
    """2 √(I K) over ½ρVAl² and K over ½ρV²Al, with the moment of the air in K; 1 %: the campaign has a gap."""
    greatest = []
    for spring, speed in WINDY:
        stiffness = spring - loads(speed)[0] * CN_BETA
        moments = {"cn_beta": stiffness, "cn_r": 2.0 * np.sqrt(INERTIA * stiffness)}
        greatest.append(moments[name] / loads(speed)[name == "cn_r"])
    for share, determined in ((0.99, True), (1.01, False)):
        given = Quantity(0.1, share * min(greatest), "1/rad")
        assert meant_coefficient(given, base, name).determined is determined


def test_causes_are_told_of_the_wind_on_runs_in_si(base):
    """1 %: the campaign has a gap, which moves the inertia a little."""
    found = wind_on_runs(base)
    for run, (spring, speed) in zip(found, WINDY, strict=True):
        moment, rate = loads(speed)
        assert (run.per_cn_beta, run.per_cn_r) == pytest.approx((moment, rate))
        assert run.spring_stiffness == pytest.approx(spring)
        assert run.still_omega == pytest.approx(np.sqrt(spring / INERTIA), rel=0.01)
        assert run.omega == pytest.approx(np.sqrt((spring - moment * CN_BETA) / INERTIA), rel=0.01)


def test_the_zero_of_a_run_does_not_move_a_coefficient(base):
    """Pieces are ordered by their amplitude about the run's own zero."""

    def move(zeros):
        runs = base.problem.data.runs
        shifted = tuple(replace(run, reading=run.reading + z) for run, z in zip(runs, zeros, strict=True))
        data = replace(
            base.problem.data, runs=shifted, model=replace(base.problem.data.model, own_zeros=True)
        )
        return coefficient_move(fit(Problem(data), nominal_start(data)), "cn_r")

    assert move((0.0, 0.3, -0.2, 0.1, -0.4, 0.2)) == pytest.approx(move((0.0,) * 6), rel=1e-3)


NAMES = (
    "stiffness",
    "mechanical_damping",
    "zero",
    "gravity_stiffness.stiffness",
    "cubic_stiffness.coefficient",
)


@pytest.mark.parametrize("name", ["omega_n", "zeta", "zero"])
def test_small_swings_have_the_stiffness_of_spring_and_gravity(name):
    common = np.array([30.0, 0.5, 0.01, 91.0, 7.0])
    value = PerInertia().coefficient(NAMES, common, name)
    assert value == pytest.approx({"omega_n": 11.0, "zeta": 0.5 / 22.0, "zero": 0.01}[name])
    gradient = PerInertia().gradient(NAMES, common, name)
    for i, step in enumerate(1e-6 * np.eye(5)):
        up, down = (PerInertia().coefficient(NAMES, common + s, name) for s in (step, -step))
        assert gradient[i] == pytest.approx((up - down) / 2e-6, abs=1e-8)


def only(fitted, data):
    return coefficients(Answers((Possible(1.0, fitted),), 0.0, fitted), data)


def test_a_spring_at_its_bound_does_not_matter_where_gravity_holds_the_body(data):
    runs = tuple(replace(run, spring_stiffness=None) for run in data.runs[:1])
    base = nominal(replace(data, runs=runs))
    least = Point(np.array([0.0, 0.0, *base.point.common[2:]]), base.point.per_run)
    alone = only(replace(base, point=least), data)
    assert alone["omega_n"].bound == "lower"
    assert "zeta" not in alone  # nothing swings
    problem = Problem(base.problem.data, (effect_class("gravity_stiffness"),))
    values = dict(zip(base.problem.names, least.common, strict=True))
    values["gravity_stiffness.stiffness"] = base.value("stiffness")
    common = np.array([values.get(name, 0.0) for name in problem.names])
    held = fit(problem, Point(common, base.point.per_run), max_iterations=1)
    found = only(held, data)["omega_n"]
    assert found.bound is None
    assert found.value == pytest.approx(np.sqrt(base.value("stiffness")), rel=0.01)
