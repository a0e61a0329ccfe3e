"""Driven runs whose sensor reads rates. The truth is the equation of motion, integrated by SciPy."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose
from identification import identify
from identification.signal.driven import driven_rows, driven_start
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone")

RATE, INERTIA, DAMPING, SPRING, NOISE, ZERO = 200.0, 0.1, 0.05, 16.0, 2e-3, 0.01
TIME = np.arange(1500) / RATE
RIG = RigProperties(yaw_inertia=INERTIA)


def multisine(seed: int) -> np.ndarray:
    lines = np.arange(1.0, 3.0, 1.0 / TIME[-1])
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size)
    return 0.1 * np.cos(2.0 * np.pi * np.outer(TIME, lines) + phases).sum(axis=1)


def driven_run(seed: int, hold: str, friction: float) -> Run:
    """One run; a held input is integrated from sample to sample, and friction acts by the sign of the rate."""
    values = multisine(seed)
    knots = TIME if hold == "zero" else TIME[[0, -1]]
    states = [np.array([[0.02], [0.0]])]
    for first, last in pairwise(knots):
        inside = TIME[(first < TIME) & (last >= TIME)]

        def slope(t: float, y: np.ndarray, since: float = first) -> list[float]:
            moment = values[np.searchsorted(TIME, since)] if hold == "zero" else np.interp(t, TIME, values)
            moment -= SPRING * y[0] + DAMPING * y[1] + friction * np.tanh(y[1] / 1e-3)
            return [y[1], moment / INERTIA]

        start = states[-1][:, -1]
        states.append(solve_ivp(slope, (first, last), start, "LSODA", inside, rtol=1e-8, atol=1e-10).y)
    rate = np.concatenate(states, axis=1)[1]
    reading = ZERO + rate + NOISE * np.random.default_rng(100 + seed).standard_normal(TIME.size)
    drive = Drive("moment_nm", values, hold=hold)
    return Run(f"r{seed}", Record(TIME, reading), 0.0, spring_stiffness=SPRING, drive=drive)


@cache
def campaign(hold: str = "linear", friction: float = 0.0) -> Campaign:
    runs = tuple(driven_run(seed, hold, friction) for seed in range(2))
    return Campaign("rates", RIG, SensorProperties(RATE, quantity="rate"), runs)


@pytest.mark.parametrize("held", [True, False])
def test_the_rate_is_the_slope_of_the_angle(held: bool) -> None:
    fine = np.arange(10 * TIME.size) / (10.0 * RATE)
    values = np.repeat(multisine(0), 10) if held else np.interp(fine, TIME, multisine(0))
    rows = [driven_rows(fine, values, 0.25, 160.0, held=held, derivative=d) for d in (0, 1)]
    slopes = (rows[0][:, 2:] - rows[0][:, :-2]) / (fine[2:] - fine[:-2])
    for slope, rate in zip(slopes, rows[1][:, 1:-1], strict=True):
        assert np.max(np.abs(slope - rate)) < 2e-3 * np.max(np.abs(rate))


def test_the_spectra_give_decay_stiffness_and_gain_of_a_rate() -> None:
    values = multisine(3)
    reading = 10.0 * driven_rows(TIME, values, 0.25, 160.0, held=False, derivative=1)[0]
    found = driven_start(TIME, reading, values, derivative=1)
    assert found is not None
    assert found == pytest.approx((0.25, 160.0, 10.0), rel=0.02)


@pytest.mark.parametrize("estimator", ["output_error", "filter_error", "bayesian", "frequency_response"])
@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_the_rig_is_identified_from_rates(estimator: str, hold: str) -> None:
    estimate = identify(campaign(hold), estimator)
    for name, truth in (("yaw_inertia", INERTIA), ("mechanical_damping", DAMPING)):
        found = getattr(estimate, name)
        assert abs(found.value - truth) < 4.0 * found.std
        assert found.std < 0.02 * truth


@pytest.mark.slow
def test_dry_friction_is_named_on_rates() -> None:
    kinds = [
        effect_class(n) for n in ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "input_delay")
    ]
    found = diagnose(campaign(friction=0.01), kinds=kinds)
    assert found.causes == ("coulomb_friction",)
    size = found.candidates[0].parameters["friction_moment"]
    assert abs(size.value - 0.01) < 4.0 * size.std
    assert found.gap.closed > 0.9


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_a_linear_rig_has_no_gap_on_rates(hold: str) -> None:
    assert diagnose(campaign(hold)).causes == ()


@pytest.mark.parametrize(
    ("quantity", "spring", "match"),
    [("acceleration", SPRING, "reads accelerations"), ("rate", 0.0, "looks like a constant moment")],
)
@pytest.mark.parametrize("entry", [identify, diagnose])
def test_what_cannot_be_treated_is_refused_in_one_line(quantity, spring, match, entry) -> None:
    given = campaign()
    runs = tuple(replace(run, spring_stiffness=spring) for run in given.runs)
    with pytest.raises(TunnelError, match=match):
        entry(replace(given, runs=runs, sensor=SensorProperties(RATE, quantity=quantity)))
