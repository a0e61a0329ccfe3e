"""Derivatives of motions from the compiled integrator, against differences of motions that it integrates."""

from collections.abc import Callable

import numpy as np
import pytest

from tunnel_sim.physics.forward import integrate
from tunnel_sim.physics.moment_law import parameter_names, run_dtype
from tunnel_sim.physics.slopes import slopes, term_places, terms

NOMINAL = {
    "air_density": 1.2, "frontal_area": 0.036, "reference_length": 0.625, "width": 0.2, "cn_beta": 0.35,
    "cn_r": -0.7, "spring_stiffness": 8.0, "mechanical_damping": 0.01, "yaw_inertia": 0.05,
}  # fmt: skip
WIND = np.array([15.0])  # m/s
SAMPLES = 300
#: Winds of samples, m/s: a drift, and one that rises from nothing and falls again.
WINDS = {"drift": np.array([15.0, 17.0]), "gust": np.array([0.0, 9.0, 16.0, 4.0])}

#: Laws, and the parameters by which they are differentiated.
SMOOTH = {
    "linear": ({}, (*NOMINAL, "angle", "rate", "lead", "rod_stiffness")),
    "structural damping": ({"loss_factor": 0.01}, ("loss_factor", "spring_stiffness", "yaw_inertia")),
    "cubic": ({"stiffness_cubic": 0.5}, ("stiffness_cubic", "spring_stiffness", "angle")),
    "cubic, other power": (
        {"stiffness_cubic": 0.5, "stiffness_cubic_exponent": 2.6},
        ("stiffness_cubic", "stiffness_cubic_exponent", "rate"),
    ),
    "cubic of nothing, other power": ({"stiffness_cubic_exponent": 2.6}, ("stiffness_cubic", "cn_r")),
    "quadratic": (
        {"stiffness_quadratic": 0.3, "stiffness_quadratic_exponent": 2.5},
        ("stiffness_quadratic", "stiffness_quadratic_exponent"),
    ),
    "moment": (
        {"moment_cubic": -2.0, "moment_cubic_exponent": 2.5},
        ("moment_cubic", "moment_cubic_exponent", "cn_beta"),
    ),
    "damping by angle": (
        {"damping_quadratic": 3.0, "damping_quadratic_exponent": 1.7},
        ("damping_quadratic", "damping_quadratic_exponent", "cn_r"),
    ),
    "damping by rate": (
        {"quadratic_damping": 0.004, "quadratic_damping_exponent": 1.6},
        ("quadratic_damping", "quadratic_damping_exponent"),
    ),
    "gravity": ({"gravity_stiffness": 0.4, "gravity_angle": 0.1}, ("gravity_stiffness", "gravity_angle")),
    "oblique flow": ({"flow_angle": 0.05, "moment_cubic": -1.0}, ("flow_angle", "cn_beta", "air_density")),
    "lag": ({"aero_lag": 2.0}, ("aero_lag", "cn_beta", "reference_length", "lagged", "lead")),
    "short lag": ({"aero_lag": 0.05}, ("aero_lag", "lagged")),
    "lead": ({"aero_lag": -1.5, "moment_cubic": -1.0}, ("aero_lag", "moment_cubic", "angle", "rate")),
    "vortices": (
        {"shedding_amplitude": 0.02, "strouhal_number": 0.05, "shedding_phase": 0.4},
        ("shedding_amplitude", "strouhal_number", "shedding_phase"),
    ),
}
#: Laws with a kink in the moment, which the steps of the difference may not reach from a stage.
KINKED = {"free play": ({"free_play": 0.02}, ("free_play", "spring_stiffness", "angle"))}
#: Laws whose moment jumps at a reversal.
JUMPING = {
    "friction": ({"friction_moment": 0.01}, ("friction_moment", "spring_stiffness", "yaw_inertia", "rate")),
    "friction that sticks": ({"friction_moment": 0.3}, ("friction_moment", "spring_stiffness", "angle")),
    "friction and lag": ({"friction_moment": 0.01, "aero_lag": 1.0}, ("friction_moment", "aero_lag", "angle")),
    "friction by rate": (
        {"friction_moment": 0.02, "friction_exponent": 2.0},
        ("friction_moment", "friction_exponent"),
    ),
    "viscous friction": (
        {"friction_moment": 0.02, "friction_saturation": 0.3},
        ("friction_moment", "friction_saturation"),
    ),
    "friction with a peak": (
        {"friction_moment": 0.01, "friction_peak": 0.6, "friction_peak_rate": 0.5},
        ("friction_moment", "friction_peak", "friction_peak_rate"),
    ),
}  # fmt: skip


def runs(values, steps=2, stride=1, count=1):
    """So many equal runs, and their laws."""
    law, run = np.zeros((1, len(parameter_names()))), np.zeros(1, run_dtype())
    for name, value in {**NOMINAL, **values}.items():
        law[0, parameter_names().index(name)] = value
    given = {
        "wind": WIND.ctypes.data, "wind_count": 1, "angle": 0.3, "rate": 0.4, "lagged": 0.31, "lead": 0.02,
        "rod_stiffness": 0.1, "step": 0.004, "steps": steps, "stride": stride,
    }  # fmt: skip
    for name, value in given.items():
        run[name] = value
    return np.repeat(law, count, axis=0), np.repeat(run, count)


def blown(law, run, wind):
    """The same runs in a wind of samples, over a little less than the motion."""
    run = run.copy()
    run["wind"], run["wind_count"], run["wind_interval"] = wind.ctypes.data, wind.size, 2.2 / (wind.size - 1)
    return law, run


#: Inputs, sampled at every second step of the runs from two samples before their start on.
INPUT = 0.1 * np.concatenate([[3.0, -2.0], np.sin(np.arange(250) ** 1.3), np.zeros(90)])
INPUT_TIME = 0.008 * (np.arange(INPUT.size) - 2.0)  # s
INPUT_SLOPE = {"held": np.zeros(INPUT.size), "linear": np.append(np.diff(INPUT) / 0.008, 0.0)}
#: How an input acts: on the body, or on the root of the spring, linear or constant between its samples.
DRIVES = {
    "linear moment": {"moment_scale": 8.0, "moment_offset": 0.05},
    "held moment": {"moment_scale": 8.0, "moment_offset": 0.05, "moment_held": 1},
    "root": {"moment_scale": NOMINAL["spring_stiffness"], "moment_on_end": 1},
}


def driven(law, run, drive, values=INPUT, slopes=None):
    """The same runs with an input; its slopes follow from its form where they are not given."""
    run = run.copy()
    slopes = INPUT_SLOPE["held" if "moment_held" in DRIVES[drive] else "linear"] if slopes is None else slopes
    given = {
        "moment": values.ctypes.data, "moment_slope": slopes.ctypes.data, "moment_time": INPUT_TIME.ctypes.data,
        "moment_count": INPUT.size, "moment_interval": 0.008,
    }  # fmt: skip
    for name, value in {**given, **DRIVES[drive]}.items():
        run[name] = value
    return law, run


def moved(law, run, name, by):
    law, run = law.copy(), run.copy()
    if name in parameter_names():
        law[:, parameter_names().index(name)] += by
    else:
        run[name] += by
    return law, run


def difference(of: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """The derivative at 0, by central differences of fourth order."""
    near, far = of(step) - of(-step), of(2.0 * step) - of(-2.0 * step)
    return (8.0 * near - far) / (12.0 * step)


def errors(values, names, relative, wind=WIND, drive=None, **steps):
    """How far the derivatives are from those of differences, relative to their norm, by parameter."""
    law, run = runs(values, **steps)
    if drive is not None:
        law, run = driven(law, run, drive)
    if wind.size > 1:
        law, run = blown(law, run, wind)
    for name in names:
        value = law[0, parameter_names().index(name)] if name in parameter_names() else run[name][0]
        step = relative * (abs(value) or 1.0)

        def motion(by, name=name):
            angle, rate, status = integrate(*moved(law, run, name, by), SAMPLES)
            assert status == 0
            return np.concatenate([angle[0], rate[0]])

        by_term = difference(
            lambda by, name=name: terms(*moved(law, run, name, by))[0], 1e-4 * (abs(value) or 1.0)
        )
        columns = np.flatnonzero(by_term)
        found = slopes(law, run, SAMPLES, columns.tolist())
        assert found.status == 0
        exact = np.concatenate([by_term[columns] @ found.by_angle[0], by_term[columns] @ found.by_rate[0]])
        expected = difference(motion, step)
        yield name, np.linalg.norm(exact - expected) / max(np.linalg.norm(expected), 1e-12)


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("steps", [{"steps": 2}, {"steps": 1, "stride": 3}], ids=["steps", "stride"])
def test_derivatives_of_a_smooth_law_are_those_of_the_motion(name, steps):
    values, names = SMOOTH[name]
    for parameter, error in errors(values, names, 1e-4, **steps):
        if parameter != "width" or "strouhal_number" in values:  # else it changes nothing
            assert error < 1e-8, parameter


@pytest.mark.parametrize("drive", DRIVES)
def test_derivatives_of_a_driven_run_are_those_of_the_motion(drive):
    own = ("moment_scale", "moment_offset", "spring_stiffness") if drive != "root" else ()
    laws = {**SMOOTH, **JUMPING}
    for name in ("linear", "cubic, other power", "quadratic", "lag", "gravity", "friction"):
        values, names = laws[name]
        names = [one for one in (*own, *names) if one != "width" and (own or one != "spring_stiffness")]
        for parameter, error in errors(values, names, 1e-4 if name in SMOOTH else 1e-5, drive=drive):
            assert error < (1e-8 if name in SMOOTH else 1e-5), (name, parameter)


@pytest.mark.parametrize("wind", WINDS)
@pytest.mark.parametrize(
    "name", [name for name in SMOOTH if not any(word in name for word in ("lag", "lead", "vort"))]
)
def test_derivatives_in_a_wind_of_samples_are_those_of_the_motion(name, wind):
    for parameter, error in errors(*SMOOTH[name], 1e-4, WINDS[wind]):
        if parameter != "width":  # it changes nothing
            assert error < 1e-8, parameter


@pytest.mark.parametrize("values", [{}, {"moment_cubic": -2.0, "damping_quadratic": 3.0, "flow_angle": 0.1}])
@pytest.mark.parametrize(
    ("friction", "steps"),
    [(0.0, {"steps": 2}), (0.0, {"steps": 1, "stride": 3}), (0.01, {"steps": 2})],
    ids=["steps", "stride", "friction"],
)
def test_derivatives_along_changes_of_the_wind_are_those_of_the_motion(values, friction, steps):
    """Beside a run in a constant wind, which has none; the wind does not fall below zero."""
    wind = WINDS["gust"] + 1.0
    changes = np.random.default_rng(3).normal(size=(2, wind.size))
    law, run = runs(values | {"friction_moment": friction}, **steps, count=2)
    run[1:] = blown(law, run[1:], wind)[1]
    column = [term_places()["angle"]]
    found = slopes(law, run, SAMPLES, column, changes=[np.zeros((2, 1)), changes])
    assert np.isnan(found.by_angle[0, 1:]).all()
    for change, exact in zip(changes, found.by_angle[1, 1:], strict=True):

        def motion(by, change=change):
            there = wind + by * change
            return integrate(law[1:], blown(law, run[1:], there)[1], SAMPLES)[0][0]

        step, tolerance = (1e-6, 1e-6) if friction else (1e-4, 1e-8)
        expected = difference(motion, step)
        assert np.linalg.norm(exact - expected) < tolerance * np.linalg.norm(expected)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(
    "name", ["linear", "cubic, other power", "quadratic", "lag", "free play", "friction"]
)
def test_derivatives_along_changes_of_a_drive_are_those_of_the_motion(drive, name):
    """Beside a free run, which has none."""
    law, run = runs({**SMOOTH, **KINKED, **JUMPING}[name][0], count=2)
    rng = np.random.default_rng(5)
    values, slopes_ = INPUT + 0.1, rng.normal(size=INPUT.size)
    changes = np.concatenate([rng.normal(size=(2, INPUT.size)), rng.normal(size=(2, INPUT.size))], axis=1)
    run[1:] = driven(law, run[1:], drive, values, slopes_)[1]
    found = slopes(law, run, SAMPLES, [term_places()["angle"]], changes=[np.zeros((2, 1)), changes])
    assert found.status == 0
    assert np.isnan(found.by_angle[0, 1:]).all()
    for change, exact in zip(changes, found.by_angle[1, 1:], strict=True):

        def motion(by, change=change):
            moved = values + by * change[: INPUT.size], slopes_ + by * change[INPUT.size :]
            return integrate(law[1:], driven(law, run[1:], drive, *moved)[1], SAMPLES)[0][0]

        smooth = name in SMOOTH
        expected = difference(motion, 1e-4 if smooth else 1e-6)
        assert np.linalg.norm(exact - expected) < (1e-8 if smooth else 1e-5) * np.linalg.norm(expected)


@pytest.mark.parametrize("name", KINKED)
def test_derivatives_with_a_kink_are_those_of_the_motion(name):
    for parameter, error in errors(*KINKED[name], 1e-6):
        assert error < 1e-8, parameter


@pytest.mark.parametrize("name", JUMPING)
def test_derivatives_across_reversals_are_those_of_the_exact_motion(name):
    """The integrated motion's own error, and with it that of its difference, is of the order of 1e-7."""
    for parameter, error in errors(*JUMPING[name], 1e-6):
        assert error < 1e-6, parameter


@pytest.mark.parametrize("name", [*SMOOTH, *KINKED, *JUMPING])
def test_the_motion_is_bit_identical_beside_its_derivatives(name):
    values = (SMOOTH | KINKED | JUMPING)[name][0]
    for steps in ({"steps": 2}, {"stride": 3, "steps": 1}):
        law, run = runs(values, **steps, count=11)
        run["angle"] += 0.01 * np.arange(11)
        if "aero_lag" not in values and "shedding_amplitude" not in values:
            run[5:] = blown(law, run[5:], WINDS["drift"])[1]
        angle, rate, _ = integrate(law, run, SAMPLES)
        found = slopes(law, run, SAMPLES, [term_places()["angle"], term_places()["start_rate"]])
        assert np.array_equal(found.angle, angle)
        assert np.array_equal(found.rate, rate)


@pytest.mark.parametrize("stride", [1, 3])
def test_a_longer_step_shows_the_motion_later(stride):
    law, run = runs({"aero_lag": 1.0}, 1, stride)
    found = slopes(law, run, SAMPLES, [term_places()["pace"]])

    def motion(by):
        longer = run.copy()
        longer["step"] *= np.exp(by)
        return np.concatenate([one[0] for one in integrate(law, longer, SAMPLES)[:2]])

    exact, expected = np.concatenate([found.by_angle[0, 0], found.by_rate[0, 0]]), difference(motion, 1e-4)
    # beside the time, a longer step changes the error of the integration
    assert np.linalg.norm(exact - expected) < 1e-4 * np.linalg.norm(expected)


@pytest.mark.parametrize("blocks", [1, SAMPLES - 1])
@pytest.mark.parametrize("stride", [1, 3])
def test_weighted_sums_are_those_of_the_derivatives(blocks, stride):
    law, run = runs({"stiffness_cubic": 0.5}, 1, stride, 3)
    run["angle"] += 0.1 * np.arange(3)
    weights = np.random.default_rng(1).normal(size=(3, 4, blocks))
    columns = [term_places()[name] for name in ("angle", "cube", "start_angle", "pace")]
    summed, whole = slopes(law, run, SAMPLES, columns, weights), slopes(law, run, SAMPLES, columns)
    w, y, r = np.moveaxis(weights, 1, 0)[:, :, None], whole.by_angle, whole.by_rate
    expected = w[0] * y[..., :-1] + w[1] * y[..., 1:] + w[2] * r[..., :-1] + w[3] * r[..., 1:]
    np.testing.assert_allclose(summed.by_angle, expected, rtol=1e-12, atol=1e-12)
    assert np.array_equal(summed.angle, whole.angle)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({}, "friction"),
        ({"friction_moment": 0.01}, "friction_exponent"),
        ({"friction_moment": 0.01}, "friction_saturation"),
        ({"friction_moment": 0.01}, "friction_peak"),
        ({"friction_moment": 0.01}, "friction_peak_rate"),
        ({}, "lag"),
        ({}, "seen"),
        ({}, "air_rate"),
        ({}, "turn"),
        ({}, "shedding_sine"),
    ],
)
def test_a_derivative_that_does_not_exist_is_not_a_number(values, name):
    """The motion has a jump, or none, only on one side of such a value."""
    found = slopes(*runs(values), SAMPLES, [term_places()[name], term_places()["start_angle"]])
    assert np.isnan(found.by_angle[0, 0]).all()
    assert np.isnan(found.by_rate[0, 0]).all()
    assert np.isfinite(found.by_angle[0, 1]).all()


def test_motions_without_derivatives_are_refused():
    for form in ({"presliding": 0.001}, {"friction_exponent": 0.5}):
        assert slopes(*runs({"friction_moment": 0.01, **form}), SAMPLES, [0]).status == -1
    law, run = runs({})
    run["twist_stiffness"] = 50.0
    assert slopes(law, run, SAMPLES, [0]).status == -1


def test_a_motion_that_grows_without_bound_is_named():
    law, run = runs({}, count=3)
    law[1, parameter_names().index("mechanical_damping")] = -0.9
    assert slopes(law, run, 3000, [0]).status == integrate(law, run, 3000)[2] == 2
