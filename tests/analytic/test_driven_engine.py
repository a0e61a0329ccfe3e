"""Driven runs of the MuJoCo model against closed forms: amplitude and phase of a sine, order of the hold, rest."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification.signal.forcing import driven_rows
from tests.marks import slow
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.vocabulary.input_kinds import INPUTS
from tunnel_sim.vocabulary.plan import AeroDerivatives, aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.record import Array

MOMENT, ROOT = INPUTS["moment_nm"], INPUTS["base_rad"]

RATE, RIG = 100.0, load_rig()
SPRING, INERTIA, DAMPING = 16.0, 0.1, 0.3  # a transient falls by e⁻¹·⁵ in a second
TIME = np.arange(2000) / RATE
SMOOTH = np.convolve(np.random.default_rng(1).standard_normal(TIME.size), np.ones(6) / 6.0, "same")


def driven(values: Array, *, steps: int = 10, hold: str = "linear", on_body: bool = True) -> RunSettings:
    """A run of these samples with the wind off, without effects."""
    return RunSettings(
        SPRING,
        AeroDerivatives(0.5, -0.11),
        INERTIA,
        DAMPING,
        duration=values.size / RATE,
        timestep=1.0 / (RATE * steps),
        drive=InputMoment(TIME[: values.size], values, held=hold == "zero", kind=MOMENT if on_body else ROOT),
    )


def angle(run: RunSettings) -> Array:
    return simulate_motion(build_model(RIG, run, drawn=False), RATE).angle


@pytest.mark.parametrize("wind_speed", [0.0, 15.0])
@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_amplitude_and_phase_of_a_sine_are_those_of_the_closed_form(hold: str, wind_speed: float) -> None:
    frequency, amplitude = 4.0, 0.4
    run = driven(amplitude * np.sin(2.0 * pi * frequency * TIME), hold=hold)
    found = angle(replace(run, wind_speed=wind_speed, air_density=1.2))[-1000:]  # forty whole cycles
    response = 2.0 * np.mean(found * np.exp(-2j * pi * frequency * TIME[-1000:])) * 1j
    flow = RIG.body.flow(1.2, wind_speed)
    stiffness = SPRING - aerodynamic_stiffness(0.5, **flow)
    damping = DAMPING - aerodynamic_damping(-0.11, **flow)
    omega = 2.0 * pi * frequency
    # a hold passes a sine of its samples with sinc, a linear one with sinc² and without delay
    passed = np.sinc(frequency / RATE) * np.exp(-0.5j * omega / RATE)
    passed = passed if hold == "zero" else np.sinc(frequency / RATE) ** 2
    closed = amplitude * passed / (stiffness - INERTIA * omega**2 + 1j * omega * damping)
    # images of the sine at 96 Hz and above, which the samples fold back, are 1e-4 of it
    assert abs(response / closed - 1.0) < 1e-4
    assert abs(1.0 / passed - 1.0) > 5e-3  # so that a wrong hold is seen


@pytest.mark.parametrize("on_body", [True, False])
@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_the_model_is_of_fourth_order_for_an_input_with_kinks(hold: str, on_body: bool) -> None:
    exact = (
        driven_rows(TIME, SMOOTH, 0.5 * DAMPING / INERTIA, SPRING / INERTIA, held=hold == "zero")[0] / INERTIA
    )
    runs = [driven(SMOOTH, steps=steps, hold=hold, on_body=on_body) for steps in (4, 8)]
    coarse, fine = (np.max(np.abs(angle(run) - exact)) for run in runs)
    assert fine < 1e-8
    assert coarse / fine == pytest.approx(16.0, rel=0.1)


@pytest.mark.parametrize("hold", ["linear", "zero"])
@pytest.mark.parametrize("on_body", [True, False])
def test_model_and_compiled_integrator_agree_with_a_flexible_rod(hold: str, on_body: bool) -> None:
    twisted = replace(
        driven(SMOOTH[:500], steps=40, hold=hold, on_body=on_body), rod_twist=RodTwist(0.002, 0.1)
    )
    assert np.max(np.abs(angle(twisted) - forward_motion(RIG, twisted, RATE).angle)) < 1e-9


@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_a_spring_whose_root_moves_acts_by_its_deflection(hold: str) -> None:
    count, cubic, quadratic = 100, 3.0, 0.8
    root = 0.3 * SMOOTH[:count] / np.max(np.abs(SMOOTH[:count]))
    expected, state = np.zeros(count), np.zeros(2)
    for i in range(count - 1):  # SciPy, from kink to kink
        start, after = root[i], root[i] if hold == "zero" else root[i + 1]

        def slope(t: float, y: Array, start: float = start, after: float = after) -> list[float]:
            bent = y[0] - start - (after - start) * t * RATE
            spring = bent + cubic * bent**3 + quadratic * bent**2
            return [y[1], (-SPRING * spring - DAMPING * y[1]) / INERTIA]

        state = solve_ivp(slope, (0.0, 1.0 / RATE), state, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        expected[i + 1] = state[0]
    run = driven(SPRING * root, steps=20, hold=hold, on_body=False)
    run = replace(run, parameters={"stiffness_cubic": cubic, "stiffness_quadratic": quadratic})
    for found in (angle(run), forward_motion(RIG, run, RATE).angle):
        assert np.max(np.abs(found - expected)) < 1e-8
    fixed = replace(run, drive=replace(run.drive, kind=MOMENT))  # the same moment, without a moving root
    assert np.max(np.abs(angle(fixed) - expected)) > 1e-3


def test_friction_holds_a_body_at_rest_until_the_moment_exceeds_it() -> None:
    ramp = 0.02 * TIME  # N m; exceeds the friction after 5 s
    run = replace(driven(ramp), parameters={"friction_moment": 0.1})
    found = angle(run)
    # friction is that of a step's start: the moment's growth in a step h moves the body by Ṁh³/I at most
    creep = 0.02 * run.timestep**2 / INERTIA * TIME
    assert np.all(np.abs(found) <= creep, where=TIME < 4.99)
    assert np.max(np.abs(found[TIME > 6.0])) > 1e-3


def test_many_runs_of_different_holds_and_lengths_have_the_bits_of_single_ones() -> None:
    values = [SMOOTH[:150], SMOOTH[5:155], SMOOTH[:200]]
    runs = [
        driven(v, hold=hold, on_body=b) for v in values for hold in ("zero", "linear") for b in (True, False)
    ]
    runs.append(replace(runs[0], drive=None, release_angle=0.1))
    alone = [angle(run) for run in runs]
    for threads in (1, 2, 3):
        found = simulate_motions(RIG, runs, RATE, nthread=threads)
        assert all(np.array_equal(a, b.angle) for a, b in zip(alone, found, strict=True))


@pytest.mark.parametrize(
    ("hold", "delay"), [("linear", 0.0037), ("zero", -0.0237), slow("zero", 0.0037), slow("linear", -0.0237)]
)
def test_a_delayed_input_is_of_second_order(hold: str, delay: float) -> None:
    values = SMOOTH[:600]

    def error(steps: int) -> float:
        run = driven(values, steps=steps, hold=hold)
        assert run.drive is not None
        late = replace(run, drive=replace(run.drive, delay=delay))
        return float(np.max(np.abs(angle(late) - forward_motion(RIG, late, RATE).angle)))

    assert error(10) < 3e-5 * np.max(np.abs(angle(driven(values))))
    assert error(5) / error(40) > 40.0  # sixty-four, less what the place of a kink in its step does


@pytest.mark.parametrize(
    "drive",
    [
        InputMoment(TIME[1:], SMOOTH[1:]),
        InputMoment(TIME**1.01, SMOOTH),
        InputMoment(0.55 * TIME, SMOOTH),
        InputMoment(TIME[:1], SMOOTH[:1]),
    ],
)
@pytest.mark.parametrize("held", [False, True])
def test_samples_that_no_step_ends_at_act_by_their_means_over_the_steps(
    drive: InputMoment, held: bool
) -> None:
    run = replace(driven(SMOOTH), drive=replace(drive, held=held))
    found = forward_motion(RIG, run, RATE).angle
    assert np.max(np.abs(angle(run) - found)) < 3e-5 * np.max(np.abs(found))
