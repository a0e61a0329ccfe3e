"""A second mode of driven runs: its response to the input in closed form, and its name."""

from __future__ import annotations

from dataclasses import replace
from math import exp, sqrt

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

from diagnosis.search.investigate import nominal_study
from tunnel_sim.effects import EffectChain, effect_class, effect_from
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

OMEGA, ZETA = 40.0, 0.02
RINGING = OMEGA * sqrt(1.0 - ZETA**2)
RATE, INERTIA, DAMPING = 100.0, 0.1, 0.05
TIME = np.arange(1200) / RATE


def free(time: Array, start: float, rate: float) -> Array:
    """q̈ + 2ζω q̇ + ω² q = 0 from these values at time 0; nothing before."""
    since = np.maximum(time, 0.0)
    sine = (rate + ZETA * OMEGA * start) / RINGING * np.sin(RINGING * since)
    return np.where(time > 0.0, np.exp(-ZETA * OMEGA * since) * (start * np.cos(RINGING * since) + sine), 0.0)


def test_the_answer_to_a_step_is_that_of_the_closed_form() -> None:
    drive = InputMoment(
        np.array([0.0, 0.13, 0.5]), np.array([0.0, 2.0, 0.0]), scale=3.0, delay=0.01, held=True
    )
    time = np.linspace(0.0, 1.0, 401)
    found = drive.oscillation(OMEGA, ZETA, time)
    on, off = time - 0.14, time - 0.51
    expected = 6.0 * ((on > 0.0) + free(on, -1.0, 0.0) - (off > 0.0) - free(off, -1.0, 0.0))
    assert np.max(np.abs(found - expected)) < 1e-12 * 6.0


def test_the_answer_to_a_ramp_and_its_derivatives_are_those_of_the_closed_form() -> None:
    drive = InputMoment(np.array([0.0, 0.13, 0.63]), np.array([0.0, 0.0, 5.0]))
    time = np.linspace(0.0, 0.6, 301)
    on, lag = time - 0.13, 2.0 * ZETA / OMEGA
    ramp = np.where(on > 0.0, 10.0 * (on - lag), 0.0)
    expected = ramp + 10.0 * free(on, lag, -1.0)
    assert np.max(np.abs(drive.oscillation(OMEGA, ZETA, time) - expected)) < 1e-12
    given = np.interp(time, drive.time_s, drive.values)
    first, second = (drive.oscillation(OMEGA, ZETA, time, order) for order in (1, 2))
    assert np.max(np.abs(second + 2.0 * ZETA * OMEGA * first + OMEGA**2 * (expected - given))) < 1e-9
    slope = np.gradient(expected, time, edge_order=2)
    assert np.max(np.abs(first - slope)) < 2.0 * OMEGA**2 * 10.0 * (time[1] - time[0]) ** 2


def test_samples_in_between_change_nothing_and_what_was_before_the_start_does_not_count() -> None:
    coarse = InputMoment(np.arange(20) / 20.0, np.random.default_rng(1).standard_normal(20))
    times = np.sort(np.r_[coarse.time_s, np.random.default_rng(2).uniform(0.0, 0.95, 300)])
    fine = InputMoment(times, np.interp(times, coarse.time_s, coarse.values))
    at = np.linspace(0.0, 1.2, 100)
    here = coarse.oscillation(OMEGA, ZETA, at)
    assert np.max(np.abs(here - fine.oscillation(OMEGA, ZETA, at))) < 1e-12
    early = replace(coarse, time_s=np.r_[-0.3, coarse.time_s], values=np.r_[0.0, coarse.values])
    assert np.max(np.abs(here - early.oscillation(OMEGA, ZETA, at))) < 1e-12


def test_a_late_input_excites_the_mode_later_and_one_that_ends_leaves_what_a_release_leaves() -> None:
    """The moment that holds a body at 0.35 rad is that of the amplitude, at which the mode then rings."""
    mode = effect_from(
        "second_mode", {"amplitude": 0.01, "frequency": OMEGA, "damping_ratio": ZETA, "by_input": 1.0}
    )
    late = effect_from("input_delay", {"delay": 0.05})
    spring = 16.0
    held = InputMoment(np.array([0.0, 8.0]), np.array([0.35 * spring, 0.0]), held=True)
    run = RunSettings(spring, AeroDerivatives(0.0, 0.0), INERTIA, DAMPING, duration=9.0, drive=held)
    chain = EffectChain(run, (mode, late), (0.3, None))
    time = np.array([8.04, 8.0501, 8.1, 8.2])
    seen = chain.angle(np.zeros(4), time)
    since = time - 8.05
    rung = np.where(since < 0.0, 0.01, 0.01 * free(since, 1.0, 0.0))
    assert np.max(np.abs(seen - rung)) < 1.1 * 0.01 * exp(-ZETA * OMEGA * 8.0) + 1e-15


def two_oscillators(values: Array, spring: float, mode: tuple[float, float, float]) -> Array:
    """What the sensor sees of a body and a mode, both driven from rest by a moment linear between its samples.

    One matrix exponential of both states, the moment and its slope per sample.
    """
    size, omega, zeta = mode
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = a[4, 5] = 1.0
    a[1, [0, 1, 4]] = -spring / INERTIA, -DAMPING / INERTIA, 1.0 / INERTIA
    a[3, [2, 3, 4]] = -(omega**2), -2.0 * zeta * omega, omega**2 * size / (0.35 * spring)
    step = expm(a / RATE)
    state, seen = np.zeros(6), []
    for now, then in zip(values, np.append(values[1:], 0.0), strict=True):
        state[4:] = now, (then - now) * RATE
        seen.append(state[0] + state[2])
        state = step @ state
    return np.array(seen)


def coloured(size: float, seed: int) -> Array:
    """Noise of this standard deviation: half its power white, half below a corner at 3 Hz."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-2.0 * np.pi * 3.0 / RATE)
    slow = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(2 * TIME.size))
    return np.asarray(size * np.sqrt(0.5) * (slow[TIME.size :] + rng.standard_normal(TIME.size)))


@pytest.mark.parametrize("amplitude", [0.0, 2.5e-3])
def test_a_slow_mode_that_the_input_excites_does_not_count_as_colour_of_the_noise(amplitude: float) -> None:
    """The mode is below the motion, where the spectrum of coloured noise rises."""
    runs = []
    for number in range(8):
        spring, rng = (16.0, 30.0)[number % 2], np.random.default_rng(number)
        lines = np.arange(0.5, 8.0, 3.0 / TIME[-1])
        phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
        values = 0.15 * np.cos(2.0 * np.pi * np.outer(TIME, lines) + phases).sum(axis=1)
        seen = two_oscillators(values, spring, (amplitude, 5.5, 0.004)) + coloured(1e-3, 100 + number)
        runs.append(
            Run(
                f"r{number}",
                Record(TIME, seen),
                0.0,
                spring_stiffness=spring,
                drive=Input("moment_nm", values),
            )
        )
    campaign = Campaign("driven", RigProperties(), SensorProperties(sample_rate=RATE), tuple(runs))
    study = nominal_study(campaign, KINDS)
    assert study.gap.test.detected == (amplitude > 0.0)


KINDS = [
    effect_class(name)
    for name in ("second_mode", "cubic_stiffness", "rod_flexibility", "input_delay", "dropped_samples")
]


@pytest.mark.parametrize("value", [0.5, -1.5])
def test_what_is_none_of_the_cases_is_refused(value: float) -> None:
    with pytest.raises(TunnelError, match="by_input"):
        effect_from(
            "second_mode", {"amplitude": 0.01, "frequency": 60.0, "damping_ratio": 0.01, "by_input": value}
        )
