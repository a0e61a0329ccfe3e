"""The derivatives in phase with a lag, against the eigenvalues of the linear system with the lag's own state."""

import numpy as np
import pytest

from tunnel_reference.draw import CampaignDraw, EffectDraw, draw_conditions
from tunnel_reference.forms import forms_of
from tunnel_reference.in_phase import in_phase
from tunnel_reference.true_conditions import FRONTAL_AREA, REFERENCE_LENGTH

FORMS = {form.name: form for form in forms_of("unsteady_aero_lag")}


def drawn(name, size, extra, rng):
    conditions = draw_conditions(rng)
    one = next(i for i in np.flatnonzero(conditions.wind_on))
    alone = {
        key: value[[one]] for key, value in vars(conditions).items() if np.shape(value) == (conditions.runs,)
    }
    effect = EffectDraw(FORMS[name], extra, 1, 1.0, size)
    return CampaignDraw("single", type(conditions)(**{**vars(conditions), **alone}), (effect,), 1)


def states(name, size, extra, c):
    """The matrix of angle, rate and the states of the lag."""
    speed = float(c.wind_speed[0])
    tau = size * REFERENCE_LENGTH / speed
    moment = 0.5 * float(c.air_density) * speed**2 * FRONTAL_AREA * REFERENCE_LENGTH
    air, spring = moment * c.cn_beta, float(c.spring_stiffness[0])
    rate = c.mechanical_damping - moment * REFERENCE_LENGTH / speed * c.cn_r
    if name == "cascade":
        rows = [
            [-spring, -rate, 0.0, air],
            [2.0 / tau, 0.0, -2.0 / tau, 0.0],
            [0.0, 0.0, 2.0 / tau, -2.0 / tau],
        ]
    elif name == "two_times":
        w, other = extra["w1"], tau * extra["ratio"]
        rows = [
            [-spring, -rate, air * w, air * (1.0 - w)],
            [1.0 / tau, 0.0, -1.0 / tau, 0.0],
            [1.0 / other, 0.0, 0.0, -1.0 / other],
        ]
    else:
        sign = 1.0 if name == "lag" else -1.0
        rows = [[-spring + air * (1.0 - sign), -rate, sign * air], [1.0 / tau, 0.0, -1.0 / tau]]
    matrix = np.zeros((len(rows) + 1,) * 2)
    matrix[0, 1] = 1.0
    matrix[1:] = rows
    matrix[1] /= c.yaw_inertia
    return matrix, moment


@pytest.mark.parametrize(
    ("name", "extra"),
    [("lag", {}), ("lead", {}), ("cascade", {}), ("two_times", {"w1": 0.5, "ratio": 4.0})],
)
def test_the_derivatives_in_phase_give_the_decay_of_the_system_with_its_lag(name, extra):
    draw = drawn(name, 0.4, extra, np.random.default_rng(3))
    c = draw.conditions
    matrix, moment = states(name, 0.4, extra, c)
    pole = max(np.linalg.eigvals(matrix), key=lambda one: one.imag)
    found, speed = in_phase(draw), float(c.wind_speed[0])
    stiffness = float(c.spring_stiffness[0]) - moment * found["cn_beta"]
    damping = c.mechanical_damping - moment * REFERENCE_LENGTH / speed * found["cn_r"]
    assert abs(pole) ** 2 * c.yaw_inertia == pytest.approx(stiffness, rel=5e-4)
    assert -2.0 * pole.real * c.yaw_inertia == pytest.approx(damping, rel=1e-2)
    # the lag itself is two orders of magnitude larger
    plain = c.mechanical_damping - moment * REFERENCE_LENGTH / speed * c.cn_r
    assert abs(damping / plain - 1.0) > 0.1


def test_without_a_lag_nothing_is_added():
    draw = drawn("lag", 0.4, {}, np.random.default_rng(3))
    assert in_phase(CampaignDraw("none", draw.conditions, (), 1)) is None
