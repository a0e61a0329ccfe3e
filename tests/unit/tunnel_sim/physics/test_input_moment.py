"""Inputs as one line for each step move a body as their samples do, between which the step ends early."""

from dataclasses import replace

import numpy as np
import pytest

from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.actuator import ActuatorLimits
from tunnel_sim.physics.forward import forward_motion, forward_run, integrate
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.moment_law import parameter_vector
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives

DURATION = 3.0  # s


def settings(drive, step):
    return RunSettings(
        spring_stiffness=16.0, derivatives=AeroDerivatives(0.1, -0.1), yaw_inertia=0.1, mechanical_damping=0.02,
        wind_speed=15.0, air_density=1.2, duration=DURATION, timestep=step, drive=drive,
        parameters={"stiffness_cubic": 3.0},
    )  # fmt: skip


def by_lines(drive, step):
    """Angles at the steps' ends, rad."""
    steps, physics, rig = round(DURATION / step), settings(drive, step), load_rig()
    run, kept = forward_run(physics)
    lines = drive.lines(step, steps + 1, sampled=False)
    for name, part in {
        "moment": lines.values,
        "moment_slope": lines.slopes,
        "moment_time": lines.time_s,
    }.items():
        run[name] = part.ctypes.data
    run["moment_count"], run["moment_interval"], run["moment_delay"] = steps + 1, lines.interval, lines.delay
    angle, _, status = integrate(parameter_vector(physics.law(rig))[None], run, steps + 1)
    assert status == 0
    del kept
    return angle[0, :-1]


def by_samples(drive, step):
    motion = forward_motion(load_rig(), settings(drive, step), 1.0 / step)
    return motion.angle


def jittered(rng, size=400):
    times = np.sort(np.arange(size) + rng.uniform(-0.4, 0.4, size)) * (DURATION / size)
    return times, np.sin(7.0 * times) + 0.3 * rng.normal(size=size)


@pytest.mark.parametrize("delay", [0.0, 0.0137])
@pytest.mark.parametrize("held", [False, True], ids=["linear", "held"])
def test_the_motion_is_that_of_the_samples(held, delay):
    """The difference falls faster than the square of the step."""
    drive = InputMoment(*jittered(np.random.default_rng(2)), delay=delay, held=held)
    errors = []
    for step in (0.01, 0.005):
        exact = by_samples(drive, step)
        errors.append(np.max(np.abs(by_lines(drive, step) - exact)) / np.max(np.abs(exact)))
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 4.0


def test_a_line_has_the_impulse_and_the_first_moment_of_the_input():
    drive = InputMoment(*jittered(np.random.default_rng(4)), delay=0.002)
    lines = drive.lines(0.02, 100, sampled=False)
    fine = np.linspace(0.0, 0.02, 20001)
    for start, value, slope in zip(lines.time_s, lines.values, lines.slopes, strict=True):
        given = np.interp(start + fine - drive.delay, drive.time_s, drive.values)
        line = value + slope * fine
        assert np.trapezoid(line, fine) == pytest.approx(np.trapezoid(given, fine), abs=1e-8)
        assert np.trapezoid(line * fine, fine) == pytest.approx(np.trapezoid(given * fine, fine), abs=1e-9)


def test_equal_samples_have_the_same_lines():
    times, values = jittered(np.random.default_rng(6))
    one = InputMoment(times, values)
    scaled = InputMoment(one.time_s, one.values, scale=3.0)
    assert one.lines(0.01, 300, sampled=False) is scaled.lines(0.01, 300, sampled=False)
    assert one.lines(0.01, 300, sampled=False) is not InputMoment(times, values).lines(
        0.01, 300, sampled=False
    )


def test_samples_at_the_starts_of_steps_are_lines_as_they_are():
    drive = InputMoment(np.arange(5) * 0.1, np.array([1.0, 3.0, 2.0, 2.0, 5.0]))
    lines = drive.lines(0.05, 10, sampled=True)
    assert lines.values is drive.values
    assert lines.slopes == pytest.approx([20.0, -10.0, 0.0, 30.0, 0.0])
    assert lines.interval == pytest.approx(0.1)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("lag", [0.0, 0.02])
@pytest.mark.parametrize("delay", [-0.013, 0.0, 0.0042])
def test_the_response_to_even_samples_is_that_to_the_same_input_in_uneven_ones(held, lag, delay):
    """A further sample on the input's line, or on its step, changes nothing but the order of the lengths."""
    time, values = 0.01 * np.arange(300), np.random.default_rng(1).normal(size=300).cumsum()
    among = 0.5 * (time[100] + time[101])
    there = values[100] if held else 0.5 * (values[100] + values[101])
    ends, root = np.arange(0.0, 2.9, 0.03), complex(-0.7, 40.0)
    even, uneven = (
        InputMoment(t, v, delay=delay, held=held, actuator=ActuatorLimits(lag=lag)).mode(root, ends)
        for t, v in ((time, values), (np.insert(time, 101, among), np.insert(values, 101, there)))
    )
    within = 1e-4 if lag else 1e-9  # a response with a lag is a line in each interval, however short
    assert np.max(np.abs(even - uneven)) < within * np.max(np.abs(even))


def test_the_samples_behind_an_actuator_are_computed_once_for_equal_inputs():
    drive = InputMoment(np.arange(50) * 0.1, np.sin(np.arange(50.0)), actuator=ActuatorLimits(lag=0.3))
    later = replace(drive, delay=0.05, offset=1.0)
    assert later.exerted.values is drive.exerted.values
    assert later.exerted.time_s is drive.exerted.time_s
