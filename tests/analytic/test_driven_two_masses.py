"""Driven runs whose rod twists, against the equations of two masses integrated by SciPy from kink to kink."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis.likelihood.problem import Problem
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.model.rig import SpringModel
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import WhiteNoise
from tunnel_sim.effects import effect_class
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.vocabulary.input_kinds import INPUTS
from tunnel_sim.vocabulary.plan import AeroDerivatives, aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.record import Array

BY_MOMENT, ROOT = INPUTS["moment_nm"], INPUTS["base_rad"]

RATE, RIG, DENSITY = 100.0, load_rig(), 1.2
SPRING, INERTIA, DAMPING = 16.0, 0.1, 0.05
NOISE = WhiteNoise(1e-8)
COMPLIANCE, SHARE = 0.005, 0.2
TIME = np.arange(150) / RATE
MOMENT = np.convolve(np.random.default_rng(4).standard_normal(TIME.size), np.ones(6) / 6.0, "same")


def two_masses(hold: str, wind_speed: float, *, on_body: bool, start: tuple[float, float]) -> Array:
    """Angle of the upper end, which carries the spring; air and body below; the moment on either."""
    flow = RIG.body.flow(DENSITY, wind_speed)
    air, air_damping = aerodynamic_stiffness(0.5, **flow), aerodynamic_damping(-0.11, **flow)
    upper, lower = SHARE * INERTIA, (1.0 - SHARE) * INERTIA
    loss = 2.0 * 0.01 * np.sqrt(INERTIA * SHARE * (1.0 - SHARE) / COMPLIANCE)  # a hundredth of critical
    end = start[0] / (1.0 + SPRING * COMPLIANCE)
    state, found = np.array([end, start[1], start[0], start[1]]), [end]
    for k in range(TIME.size - 1):
        before, after = MOMENT[k], MOMENT[k] if hold == "zero" else MOMENT[k + 1]

        def slope(t: float, y: Array, before: float = before, after: float = after) -> list[float]:
            moment = before + (after - before) * t * RATE
            rod = (y[2] - y[0]) / COMPLIANCE + loss * (y[3] - y[1])
            top = rod - SPRING * y[0] - DAMPING * y[1] + (0.0 if on_body else moment)
            body = air * y[2] + air_damping * y[3] - rod + (moment if on_body else 0.0)
            return [y[1], top / upper, y[3], body / lower]

        state = solve_ivp(slope, (0.0, 1.0 / RATE), state, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        found.append(state[0])
    return np.array(found)


def run(
    hold: str, wind_speed: float, steps: int, *, on_body: bool, start: tuple[float, float]
) -> RunSettings:
    return RunSettings(
        SPRING,
        AeroDerivatives(0.5, -0.11),
        INERTIA,
        DAMPING,
        wind_speed,
        DENSITY,
        *start,
        duration=TIME.size / RATE,
        timestep=1.0 / (RATE * steps),
        rod_twist=RodTwist(COMPLIANCE, SHARE),
        drive=InputMoment(TIME, MOMENT, held=hold == "zero", kind=BY_MOMENT if on_body else ROOT),
    )


@pytest.mark.parametrize("wind_speed", [0.0, 20.0])
@pytest.mark.parametrize("hold", ["linear", "zero"])
@pytest.mark.parametrize("on_body", [True, False])
def test_engine_and_integrator_solve_the_equations_of_two_masses(
    hold: str, wind_speed: float, on_body: bool
) -> None:
    start = 0.1, 0.3
    expected = two_masses(hold, wind_speed, on_body=on_body, start=start)
    given = [run(hold, wind_speed, steps, on_body=on_body, start=start) for steps in (10, 20)]
    coarse, fine = (np.max(np.abs(forward_motion(RIG, one, RATE).angle - expected)) for one in given)
    assert coarse / fine == pytest.approx(16.0, rel=0.25)  # fourth order
    model = simulate_motion(build_model(RIG, given[1], drawn=False), RATE).angle
    assert np.max(np.abs(model - expected)) < 1.5 * fine < 1e-5


@pytest.mark.parametrize("hold", ["linear", "zero"])
@pytest.mark.parametrize("on_body", [True, False])
@pytest.mark.parametrize(("followed", "tolerance"), [(True, 2e-5), (False, 2e-7)])
def test_the_fits_predict_two_masses(hold: str, followed: bool, on_body: bool, tolerance: float) -> None:
    start = 0.1, 0.3
    # the fits' release is that of the sensor's end
    expected = two_masses(
        hold, 20.0, on_body=on_body, start=(start[0] * (1.0 + SPRING * COMPLIANCE), start[1])
    )
    # the spring's root moves by the angle whose moment it is
    unit = 1.0 if on_body else SPRING
    drive = InputMoment(
        TIME, MOMENT / unit, scale=unit, held=hold == "zero", kind=BY_MOMENT if on_body else ROOT
    )
    data = RunData(
        "r", np.zeros(TIME.size - 1), 1, 1.0 / RATE, NOISE, SPRING, 20.0, DENSITY, TIME[-1], drive=drive
    )
    body = RIG.body
    problem = Problem(
        Data((data,), body.frontal_area, body.length, body.width, SpringModel().among((data,))),
        (effect_class("rod_flexibility"),),
        resolve_rod_mode=followed,
    )
    common = np.array([INERTIA, DAMPING, 0.5, -0.11, 0.0, COMPLIANCE, SHARE])
    found = problem.predict([Point(common, np.array([start]))])[0][0]
    assert np.max(np.abs(found - expected[:-1])) < tolerance


def test_a_rod_too_stiff_to_ring_acts_by_its_first_order() -> None:
    """Steps of a fit would not follow its ringing; the rigid rod of the same first order moves alike."""
    kind, drive = effect_class("rod_flexibility"), InputMoment(TIME, MOMENT)
    data = RunData(
        "r", np.zeros(TIME.size - 1), 1, 1.0 / RATE, NOISE, SPRING, 0.0, 0.0, TIME[-1], drive=drive
    )
    problem = Problem(Data((data,), 1.0, 1.0, 1.0, SpringModel()), (kind,))
    release = np.array([[0.1, 0.3]])

    def moved(compliance: float) -> Array:
        common = np.array([INERTIA, DAMPING, 0.0, compliance, 0.02])
        return problem.predict([Point(common, release)])[0][0]

    rigid, soft = moved(0.0), moved(2.1e-5)
    assert np.all(np.isfinite(moved(1e-9)))
    assert np.max(np.abs(moved(2e-5) - soft)) < 0.1 * np.max(np.abs(soft - rigid))
