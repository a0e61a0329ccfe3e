"""Runs that are integrated side by side have the bits of those that are integrated alone."""

import numpy as np
import pytest

from tests.unit.tunnel_sim.physics.test_slopes import DRIVES, JUMPING, KINKED, SMOOTH, driven, runs
from tunnel_sim.physics.expression import parse
from tunnel_sim.physics.forward import integrate
from tunnel_sim.physics.slopes import slopes, term_places

FORMS = {
    "linear": {},
    "friction": {"friction_moment": 0.01},
    "friction with a peak": {"friction_moment": 0.01, "friction_peak": 0.6, "friction_peak_rate": 0.5},
    "friction with a load": {"friction_load": 0.05, "gravity_stiffness": 0.4, "gravity_angle": 0.1},
    "friction that gives way": {"friction_moment": 0.01, "presliding": 0.01},
    "other powers": {"moment_cubic": -2.0, "moment_cubic_exponent": 2.5, "damping_quadratic": 3.0},
    "gravity": {"gravity_stiffness": 0.4, "gravity_angle": 0.1},
}


#: Those with an elementary function, which lanes and the library round differently.
ROUNDED = (
    "friction with a peak",
    "friction with a load",
    "friction that gives way",
    "other powers",
    "gravity",
)


def kept_apart(run):
    """Keep runs from each other by a forcing of zero, which changes nothing else."""
    nothing = np.zeros(1)
    run["forcing"], run["forcing_count"], run["forcing_interval"] = nothing.ctypes.data, 1, 1.0
    return nothing


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize(("steps", "stride"), [(2, 1), (1, 3)])
def test_a_sampled_wind_has_the_same_bits_side_by_side(name, steps, stride):
    law, run = runs(FORMS[name], steps, stride, count=11)
    wind = 15.0 + np.random.default_rng(1).normal(size=(11, 20)).cumsum(axis=1)
    wind[4] = 0.0
    run["wind"] = wind.ctypes.data + wind.strides[0] * np.arange(11)
    run["wind_count"], run["wind_interval"] = 20, 0.1
    run["angle"] += 0.01 * np.arange(11)
    together, keep_alive = integrate(law, run, 400), kept_apart(run)
    alone = integrate(law, run, 400)
    del keep_alive
    error = 1e-12 if name in ROUNDED else 0.0
    for one, other in zip(together[:2], alone[:2], strict=True):
        np.testing.assert_allclose(one, other, rtol=error, atol=error)


INPUTS = {"b": "angle", "r": "rate", "t": "time", "v": "speed"}
#: Moments by expression, of every operation.
STATED = (
    "-k*b^3 - 0.01*r^2*sign(r)",
    "-0.01*exp(-(r/k)^2)*sign(r) - 0.02*tanh(r/0.2)",
    "0.02*sin(3*t)*cos(k*b) - 0.001*v*b/15",
    "-0.05*abs(b)^1.5*sign(b) - 0.1*(b + 2)^k + 0.1*2^k",
    "-0.01*max(b, 0.02*k) + 0.01*min(r, -0.1)",
    "-0.02*atan(r/k) - 0.01*tan(b) - 0.01*b*sqrt(1 + r^2)",
    "-0.01*b*log(k + b^2) - (-b)",
    "0.03*(b - 0.1)^3 - 0.01*(b - 0.05)^k",
)


def stated(run, texts, size=1.0):
    """Give runs moments by expression, whose number differs from run to run."""
    expressions = [parse(text, frozenset({*INPUTS, "k"})) for text in texts]
    codes = [
        np.array(expressions[i % len(texts)].program({"k": 0.4 + 0.1 * i * size}, INPUTS))
        for i in range(len(run))
    ]
    run["program"], run["program_count"] = [c.ctypes.data for c in codes], [c.size for c in codes]
    return codes


@pytest.mark.parametrize("name", ["linear", "friction", "gravity"])
@pytest.mark.parametrize("text", STATED)
def test_moments_by_expression_act_side_by_side_as_alone(text, name):
    law, run = runs(FORMS[name], count=11)
    without = integrate(law, run, 400)
    run["angle"] += 0.01 * np.arange(11)
    power = text.endswith("^k")  # of a negative number: only whole powers have values
    keep_alive = [stated(run, [text]) if not power else stated(run, [text.replace("^k", "^5")])]
    together = integrate(law, run, 400)
    keep_alive.append(kept_apart(run))
    alone = integrate(law, run, 400)
    assert together[2] == alone[2] == 0
    for one, other in zip(together[:2], alone[:2], strict=True):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12)
    assert np.max(np.abs(together[0][0] - without[0][0])) > 1e-5


def test_runs_with_other_expressions_and_with_none_move_beside_each_other():
    law, run = runs({}, count=11)
    keep_alive = [stated(run, STATED[:3])]
    run["program_count"][[4, 9]] = 0
    wind = 15.0 + np.random.default_rng(1).normal(size=(11, 20)).cumsum(axis=1)
    run["wind"] = wind.ctypes.data + wind.strides[0] * np.arange(11)
    run["wind_count"], run["wind_interval"] = 20, 0.1
    together = integrate(law, run, 400)
    keep_alive.append(kept_apart(run))
    alone = integrate(law, run, 400)
    np.testing.assert_allclose(together[0], alone[0], rtol=0.0, atol=1e-12)


def test_an_expression_without_a_value_has_none_beside_others_either():
    law, run = runs({}, count=3)
    keep_alive = [stated(run, ["0.01*(b - 0.5)^k"])]
    assert integrate(law, run, 400)[2] == 1
    keep_alive = [stated(run, ["0.01*log(b - 0.5)"])]
    assert integrate(law, run, 400)[2] == 1
    keep_alive = [stated(run, ["0.01*exp(1000*k/abs(b))"])]  # greater than any number
    assert integrate(law, run, 400)[2] == 1
    keep_alive.append(kept_apart(run))
    assert integrate(law, run, 400)[2] == 1


@pytest.mark.parametrize("drive", [None, *DRIVES])
@pytest.mark.parametrize("name", FORMS)
def test_rods_twist_side_by_side_as_alone(name, drive):
    law, run = runs(FORMS[name], 4, 1, count=11)
    keep_alive = [stated(run, STATED[:1])] if name == "linear" else []
    if drive is not None:
        law, run = driven(law, run, drive)
    rigid = integrate(law, run, 400)
    run["angle"] += 0.01 * np.arange(11)
    run["twist_stiffness"], run["twist_damping"], run["inertia_share"] = 800.0, 0.03, 0.3
    run["twist"], run["twist_rate"] = 0.01, 0.1
    together = integrate(law, run, 400)
    keep_alive.append(kept_apart(run))
    alone = integrate(law, run, 400)
    assert together[2] == alone[2] == 0
    error = 1e-12 if name in ROUNDED else 0.0
    if drive is not None:
        error = 1e-10
    for one, other in zip(together[:2], alone[:2], strict=True):
        np.testing.assert_allclose(one, other, rtol=error, atol=error)
    assert np.max(np.abs(together[0] - rigid[0])) > 1e-3


def test_a_sampled_wind_of_one_value_is_a_constant_one():
    law, run = runs({}, count=3)
    constant, _, _ = integrate(law, run, 400)
    wind = np.full(4, 15.0)
    run["wind"], run["wind_count"], run["wind_interval"] = wind.ctypes.data, 4, 0.5
    assert np.array_equal(integrate(law, run, 400)[0], constant)


@pytest.mark.parametrize("drive", DRIVES)
def test_driven_runs_move_side_by_side_as_alone(drive):
    """Inputs without slopes keep runs from the others."""
    for name, (values, _) in {**SMOOTH, **KINKED, **JUMPING}.items():
        law, run = driven(*runs(values, count=11), drive)
        run["angle"] += 0.01 * np.arange(11)
        together = integrate(law, run, 400)
        run["moment_slope"] = 0
        alone = integrate(law, run, 400)
        assert together[2] == alone[2] == 0
        np.testing.assert_allclose(together[0], alone[0], rtol=0.0, atol=1e-10, err_msg=name)


def test_a_driven_run_has_free_ones_beside_it():
    law, run = driven(*runs({}, count=3), "linear moment")
    expected = integrate(law[:1], run[:1], 400)[0][0]
    run["moment_count"][1:] = 0
    found = integrate(law, run, 400)[0]
    np.testing.assert_array_equal(found[0], expected)
    np.testing.assert_array_equal(found[1], integrate(*runs({}), 400)[0][0])


LENGTHS = np.array([400, 7, 399, 131, 1, 250, 400, 2, 90, 398, 64])


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize(("steps", "stride"), [(2, 1), (1, 3)])
def test_runs_of_any_length_move_as_alone_and_nothing_is_written_beyond_their_ends(name, steps, stride):
    law, run = runs(FORMS[name], steps, stride, count=LENGTHS.size)
    run["angle"] += 0.01 * np.arange(LENGTHS.size)
    angle, rate, status = integrate(law, run, LENGTHS)
    assert status == 0
    for i, length in enumerate(LENGTHS):
        alone = integrate(law[i : i + 1], run[i : i + 1], int(length))
        np.testing.assert_array_equal(angle[i, :length], alone[0][0])
        np.testing.assert_array_equal(rate[i, :length], alone[1][0])
        assert not angle[i, length:].any()
        assert not rate[i, length:].any()


def test_a_motion_that_diverges_after_its_record_is_no_failure():
    law, run = runs({}, count=2)
    law[1] = law[0]
    run["rate"][1] = 3e7  # rad/s
    assert integrate(law, run, np.array([400, 2]))[2] == 0
    assert integrate(law, run, np.array([400, 400]))[2] == 2


@pytest.mark.parametrize("weighed", [False, True])
@pytest.mark.parametrize(("steps", "stride"), [(2, 1), (1, 3)])
def test_derivatives_of_runs_of_any_length_are_those_of_a_run_alone(steps, stride, weighed):
    law, run = runs(FORMS["friction"], steps, stride, count=LENGTHS.size)
    run["angle"] += 0.01 * np.arange(LENGTHS.size)
    columns = [term_places()[name] for name in ("angle", "rate", "start_angle")]
    weights = np.random.default_rng(1).normal(size=(LENGTHS.size, 4, 1)) if weighed else None
    found = slopes(law, run, LENGTHS, columns, weights)
    assert found.status == 0
    for i, length in enumerate(LENGTHS):
        own = slice(i, i + 1)
        given = None if weights is None else weights[own]
        alone = slopes(law[own], run[own], int(length), columns, given)
        np.testing.assert_array_equal(found.angle[i, :length], alone.angle[0])
        last = alone.by_angle.shape[2]
        np.testing.assert_array_equal(found.by_angle[i, :, :last], alone.by_angle[0])
        assert not found.by_angle[i, :, last:].any()
        if alone.by_rate is not None:
            np.testing.assert_array_equal(found.by_rate[i, :, :last], alone.by_rate[0])


def test_a_run_has_the_same_bits_in_any_company():
    """Also one whose exponent is that of the textbook, beside one with another exponent."""
    forms = [
        {},
        {"moment_cubic": -2.0, "moment_cubic_exponent": 2.0},
        {"moment_cubic": -2.0, "moment_cubic_exponent": 2.5},
        {"stiffness_cubic": 0.3, "stiffness_cubic_exponent": 3.0},
        {"stiffness_cubic": 0.3, "stiffness_cubic_exponent": 3.4},
        FORMS["gravity"],
        FORMS["friction with a peak"],
        {"friction_moment": 0.01, "friction_saturation": 0.2},
        {"friction_moment": 0.01, "friction_exponent": 0.7},
    ]
    law = np.concatenate([runs(form)[0] for form in forms])
    run = runs({}, count=len(forms))[1]
    run["angle"] += 0.01 * np.arange(len(forms))
    together = integrate(law, run, 400)
    for i in range(len(forms)):
        alone = integrate(law[i : i + 1], run[i : i + 1], 400)
        np.testing.assert_array_equal(together[0][i], alone[0][0], err_msg=str(forms[i]))
        np.testing.assert_array_equal(together[1][i], alone[1][0], err_msg=str(forms[i]))
