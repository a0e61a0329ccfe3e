"""The frequency response of driven runs. The truth is the reference simulator's own integrator."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification import identify
from identification.estimators import (
    ALL_ESTIMATORS,
    DRIVEN_ONLY,
    Estimator,
    estimators_of_driven_runs,
)
from identification.estimators.bayesian import Bayesian, InputResponse
from identification.estimators.frequency_response import FrequencyResponse
from identification.signal.forcing import driven_rows
from identification.signal.free_decay import Decay
from tests.marks import slow
from tests.reference.rigs import rig
from tunnel_reference import make
from tunnel_reference.draw import CampaignDraw
from tunnel_reference.integrator import integrate
from tunnel_reference.severity import Simulated
from tunnel_reference.true_conditions import DrivenInput
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")

RIG = replace(
    rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 25.0), (0.1,) * 4, duration=8.0, sample_rate=250.0),
    start_rate=np.full(4, 0.3),
    zero=0.004,
)
TIME = np.arange(RIG.samples) / RIG.sample_rate
TRUTH = {"yaw_inertia": 0.1, "mechanical_damping": 0.012, "cn_beta": 0.45, "cn_r": -0.12}


def band(rng: np.random.Generator) -> np.ndarray:
    """Lines at all multiples of 1/8 Hz from 1 to 6 Hz: periodic in the record."""
    lines = np.arange(8, 49) / 8.0
    return np.cos(2.0 * np.pi * np.outer(TIME, lines) + rng.uniform(0.0, 6.3, lines.size)).sum(axis=1)


WAVES = {
    "multisine": band,
    "chirp": lambda _rng: np.sin(2.0 * np.pi * (1.0 + 0.5 * 5.0 / TIME[-1] * TIME) * TIME),
    "square": lambda _rng: np.sign(np.sin(2.0 * np.pi * 1.3 * TIME + 0.1)),
    "random": lambda rng: np.convolve(rng.standard_normal(TIME.size), np.ones(25) / 25.0, "same"),
}


@cache
def driven(kind: str, column: str = "moment_nm", *, held: bool = False) -> Campaign:
    """Four runs without noise, their input scaled to move the rig by about 0.1 rad."""
    rng = np.random.default_rng(2)
    values = np.stack([WAVES[kind](rng) for _ in range(4)], axis=1)
    values *= {"moment_nm": 0.3, "base_rad": 0.01}[column] / values.std()
    given = DrivenInput(column, values, np.full(4, held), np.full(4, 0.1))
    c = replace(RIG, drive=given)
    (motion,) = integrate([c], [[]], substeps=4)
    draw = CampaignDraw("none", c, (), 0)
    return make.as_campaign(Simulated(draw, motion.angle + c.zero, 0.0, np.zeros(4), np.zeros((0, 0))), kind)


@pytest.mark.parametrize(
    ("kind", "held"),
    [
        ("multisine", False),
        slow("multisine", True),
        *(slow(kind, held) for kind in ("chirp", "square", "random") for held in (False, True)),
    ],
)
def test_coefficients_of_a_linear_rig_are_found(kind: str, held: bool) -> None:
    found = identify(driven(kind, held=held), "frequency_response")
    for name, true in TRUTH.items():
        assert getattr(found, name).value == pytest.approx(true, rel=1e-4), name


@pytest.mark.parametrize(
    "estimator", [e if e == "frequency_response" else slow(e) for e in estimators_of_driven_runs()]
)
def test_a_moving_root_does_not_act_through_the_air(estimator: str) -> None:
    found = identify(driven("multisine", "base_rad"), estimator)
    for name, true in TRUTH.items():
        assert getattr(found, name).value == pytest.approx(true, rel=1e-4), name
    stiffness = RIG.true_stiffness - RIG.air_stiffness
    for run, true in zip(found.runs, stiffness, strict=True):
        assert run.omega_n.value == pytest.approx(np.sqrt(true / 0.1), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("estimator", [FrequencyResponse(), slow(Bayesian())], ids=lambda e: e.name)
@pytest.mark.parametrize("kind", [slow("multisine"), "random"])
def test_stated_deviations_are_those_of_the_estimates(kind: str, estimator: Estimator) -> None:
    clean, noise, deviations = driven(kind), 1e-3, []
    omega = np.sqrt(RIG.spring_stiffness / 0.1)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        runs = tuple(
            replace(r, record=Record(TIME, r.record.yaw_rad + noise * rng.standard_normal(TIME.size)))
            for r in clean.runs[:2]
        )
        found = estimator.estimate(replace(clean, runs=runs))
        for run, true, damping in zip(found.runs, omega, 0.012 / (0.2 * omega), strict=False):
            deviations += [(run.omega_n.value - true) / run.omega_n.std]
            deviations += [(run.zeta.value - damping) / run.zeta.std]
    # χ² of 40 values: outside this range once in ten thousand
    assert 14.6 < np.sum(np.square(deviations)) < 84.0


def test_lines_that_something_else_shakes_are_left_out() -> None:
    clean = driven("multisine")
    shaken = tuple(
        replace(r, record=Record(TIME, r.record.yaw_rad + 0.02 * np.sin(2.0 * np.pi * 5.0 * TIME + 1.0)))
        for r in clean.runs
    )
    kept, all_lines = (
        FrequencyResponse(least_coherence=least).estimate(replace(clean, runs=shaken)).runs[1].zeta.value
        for least in (0.5, -1e9)
    )
    true = 0.012 / (0.2 * np.sqrt(67.98 / 0.1))
    assert abs(kept - true) < 0.2 * abs(all_lines - true)


def test_it_is_not_among_the_estimators_of_free_decays() -> None:
    assert DRIVEN_ONLY == ("frequency_response",)
    assert not set(DRIVEN_ONLY) & set(ALL_ESTIMATORS)


def test_the_response_over_the_grid_of_a_posterior_is_that_of_its_points() -> None:
    """Seven standard deviations to either side, of a record of noise 1e-3."""
    run = driven("multisine").runs[0]
    assert run.drive is not None
    centre, scale, axis = np.array([0.06, 210.0]), np.diag([4e-3, 0.12]), np.linspace(-7.0, 7.0, 15)

    def rows(decay: Decay) -> np.ndarray:
        return driven_rows(TIME, run.drive.values, decay.rate, decay.stiffness, held=False)

    found = InputResponse(rows, known=None).over(centre, scale, axis).reshape(15, 15, 3, -1)
    for i, j in ((0, 0), (3, 11), (7, 7), (14, 2)):
        exact = rows(Decay(*(centre + scale @ axis[[i, j]])))
        assert np.max(np.abs(found[i, j] - exact) / np.max(np.abs(exact), axis=1, keepdims=True)) < 1e-3
