"""Driven runs of the reference simulator against an adaptive solver that ends at every kink of the input."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.marks import slow
from tests.reference.rigs import rig
from tunnel_reference import make
from tunnel_reference import moments as m
from tunnel_reference.draw import CampaignDraw, EffectDraw, Mixture, draw_campaign
from tunnel_reference.driven_inputs import linear_response
from tunnel_reference.forms import FAMILIES, FORMS, families
from tunnel_reference.forms_actuators import ACTUATORS
from tunnel_reference.integrator import BoundLaw, Phase, integrate
from tunnel_reference.nominal_fit import fit_driven
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_reference.true_conditions import DrivenInput

PLAIN = replace(rig(duration=0.5, sample_rate=100.0), start_rate=np.array([0.4, -0.2]))


def driven(column, held, *, gain=1.0, delay=0.0):
    """Random values at every sample, of a size that moves the rig by about 0.1 rad."""
    values = np.random.default_rng(4).standard_normal((PLAIN.samples, 2))
    values *= {
        "moment_nm": 1.0,
        "drive": 1.0 / gain,
        "base_rad": 0.05,
        "base_acceleration_rad_s2": 10.0,
    }[column]
    return replace(
        PLAIN,
        drive=DrivenInput(column, values, np.full(2, held), np.full(2, 0.1), gain, True, np.full(2, delay)),
    )


def solved(c, run, cubic):
    """The equation of motion between the kinks of the input, one interval at a time."""
    given = c.drive
    values, delay = given.values[:, run] * given.gain, float(given.delay[run])

    def value(t):
        place = np.clip((t - delay) * c.sample_rate, 0.0, c.samples - 1)
        return (
            values[int(place + 1e-9)] if given.held[run] else np.interp(place, np.arange(c.samples), values)
        )

    def slope(t, y, at):
        u = value(at) if given.held[run] else value(t)
        spring = y[0] - (0.0 if given.on_body else u)
        moment = (u if given.on_body else 0.0) - c.true_stiffness[run] * (spring + cubic * spring**3)
        moment += c.air_stiffness[run] * y[0] + (c.air_damping[run] - c.mechanical_damping) * y[1]
        return [y[1], moment / c.yaw_inertia]

    kinks = np.arange(-1, c.samples + 1) / c.sample_rate + delay
    ends = np.unique(np.round(np.concatenate([c.time, kinks[(kinks > 0.0) & (kinks < c.time[-1])]]), 12))
    state, out = [c.start_angle[run], float(c.start_rate[run])], {0.0: c.start_angle[run]}
    for start, end in pairwise(ends):
        found = solve_ivp(
            slope, (start, end), state, method="DOP853", args=(0.5 * (start + end),), rtol=1e-11, atol=1e-13
        )
        state = found.y[:, -1]
        out[float(end)] = state[0]
    return np.array([out[float(round(t, 12))] for t in c.time])


@pytest.mark.parametrize("column", ["moment_nm", "drive", "base_rad"])
@pytest.mark.parametrize("held", [False, True], ids=["linear", "zero"])
@pytest.mark.parametrize("delay", [slow(0.0), 0.013])
def test_an_input_acts_as_its_equation_says(column, held, delay):
    c = driven(column, held, gain=2.5 if column == "drive" else 1.0, delay=delay)
    cubic = 3.0
    law = BoundLaw(
        m.polynomial_spring,
        Phase.MOMENT,
        {"k2": np.zeros(2), "k3": np.full(2, cubic), "k4": np.zeros(2), "k5": np.zeros(2)},
    )
    (motion,) = integrate([c], [[law]], substeps=10)
    for run in range(2):
        assert np.max(np.abs(motion.angle[:, run] - solved(c, run, cubic))) < 1e-6
    (plain,) = integrate([replace(c, drive=None)], [[law]], substeps=10)
    assert np.max(np.abs(motion.angle - plain.angle)) > 1e-2


@pytest.mark.parametrize("column", ["moment_nm", "base_rad"])
@pytest.mark.parametrize("held", [False, True], ids=["linear", "zero"])
def test_the_closed_form_is_the_integrated_linear_response(column, held):
    c = replace(driven(column, held), start_angle=np.zeros(2), start_rate=np.zeros(2))
    parameters = np.array([c.yaw_inertia, c.mechanical_damping, c.cn_beta, c.cn_r])
    (motion,) = integrate([c], [[]], substeps=20)
    assert np.max(np.abs(linear_response(c, parameters).T - motion.angle)) < 1e-8


def test_the_nominal_fit_finds_rig_and_gain_again():
    c = rig(
        (21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35,) * 4, duration=2.0, sample_rate=250.0
    )
    values = np.random.default_rng(1).standard_normal((c.samples, 4)) * 4.0
    unknown = DrivenInput("drive", values, np.full(4, False), np.full(4, 0.1), 0.5)
    c = replace(c, drive=unknown, zero=0.002, start_rate=np.full(4, 0.5))
    (motion,) = simulate_motions([CampaignDraw("none", c, (), 0)])
    other = replace(c, yaw_inertia=0.102, cn_beta=0.4, drive=replace(unknown, gain=0.48))
    fit = fit_driven(other, motion.angle + c.zero)
    assert fit.parameters == pytest.approx([0.1, 0.012, 0.45, -0.12], rel=1e-4)
    assert fit.zero == pytest.approx(0.002, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_driven_draws_drive_some_run_and_keep_the_others(seed):
    drawn = draw_campaign(np.random.default_rng(seed), kind="single", mixture=Mixture(driven=True))
    c = drawn.conditions
    assert c.drive is not None
    assert c.drive.driven.any()
    free = ~c.drive.driven
    assert np.all(c.drive.values[:, free] == 0.0)
    assert np.all(c.start_rate[free] == 0.0)
    assert drawn.effects[0].form.family in families(driven=True)


def test_driven_families_are_those_that_a_driven_run_can_show():
    assert set(families(driven=True)) == set(FAMILIES) | {"input_delay"} | ACTUATORS


@pytest.mark.parametrize("column", ["moment_nm", "drive", "base_rad", "base_acceleration_rad_s2"])
def test_a_driven_campaign_is_written_in_its_scales(column):
    c = replace(
        driven(column, held=True, gain=2.0 if column == "drive" else 1.0), moment_scale=0.02, time_scale=0.1
    )
    c = replace(c, drive=replace(c.drive, peak=np.array([0.1, 0.0])))
    draw = CampaignDraw("none", c, (), 1)
    written = make.as_campaign(read_and_fit(draw, simulate_motions([draw], fine=False)[0]), "c")
    first, free = written.runs
    assert free.drive is None
    assert free.release_angle == pytest.approx(0.3)
    assert first.release_angle is None
    assert (first.drive.column, first.drive.hold) == (column, "zero")
    if column == "base_acceleration_rad_s2":
        assert first.drive.values == pytest.approx(c.drive.values[:, 0] * 0.1**-2)
        return
    scale = first.spring_stiffness if column == "base_rad" else first.input_gain
    true = c.spring_stiffness[0] if column == "base_rad" else c.drive.gain
    assert first.drive.values * scale == pytest.approx(c.drive.values[:, 0] * true * 0.02)


def driven_draw(family: str, form: str, column: str = "moment_nm", *, held: bool = False, **extra: float):
    """A campaign of two driven runs with one effect of a size given, as it is written."""
    c = replace(driven(column, held=held), resolution=1e-12, noise_std=1e-15, zero=0.0)
    kind = next(f for f in FORMS if (f.family, f.name) == (family, form))
    drawn = kind.draw(np.random.default_rng(5), c) | extra
    value = extra.get("value", kind.start)
    effect = EffectDraw(kind, {k: float(v) for k, v in drawn.items()}, 1, 1.0, value)
    return CampaignDraw("single", c, (effect,), 1)


@pytest.mark.parametrize("lost", [0.0, 1.0])
def test_a_logger_that_loses_rows_loses_those_of_the_input_too(lost):
    draw = driven_draw("dropped_samples", "one_instant", value=0.05, input_lost=lost)
    (motion,) = simulate_motions([draw])
    written = read_and_fit(draw, motion)
    true, gone, samples = draw.conditions.drive.values, 5, draw.conditions.samples
    for run in range(2):
        moved = motion.angle[:, run]
        first = next(k for k in range(samples) if abs(written.readings[k, run] - moved[k]) > 1e-9)
        assert written.readings[first:, run] == pytest.approx(moved[first + gone : samples + gone], abs=1e-9)
        kept = written.draw.conditions.drive.values[:, run]
        expected = np.delete(true[:, run], slice(first, first + gone)) if lost else true[:, run]
        assert kept[: expected.size] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("column", "held"), [("moment_nm", False), ("base_rad", True)])
def test_the_input_excites_a_second_mode_as_its_equation_says(column, held):
    frequency, damping_ratio = 40.0, 0.02
    draw = driven_draw(
        "second_mode",
        "released",
        column,
        held=held,
        value=0.01,
        frequency=frequency,
        damping_ratio=damping_ratio,
    )
    (motion,) = simulate_motions([draw])
    c, added = draw.conditions, read_and_fit(draw, motion).readings - motion.angle
    per = c.drive.gain / (1.0 if column == "base_rad" else c.spring_stiffness)
    square = frequency**2 * (1.0 + damping_ratio**2)
    for run in range(2):
        value, state = c.drive.values[:, run] * np.broadcast_to(per, 2)[run], np.zeros(2)
        for k in range(c.samples - 1):
            assert added[k, run] == pytest.approx(0.01 / c.reach * state[0], abs=1e-9)
            after = value[k] if held else value[k + 1]

            def slope(t, y, now=value[k], then=after):
                given = now + (then - now) * t * c.sample_rate
                return [y[1], square * (given - y[0]) - 2.0 * damping_ratio * frequency * y[1]]

            state = solve_ivp(
                slope, (0.0, 1.0 / c.sample_rate), state, method="DOP853", rtol=1e-10, atol=1e-13
            ).y[:, -1]
