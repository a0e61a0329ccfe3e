"""Diagnosis of driven joints without a spring.

The truth is the equation of motion, by the classical Runge–Kutta method with steps divided where the rate turns.
"""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.similar import similar_campaign
from diagnosis.model.similarity import REFERENCE_INERTIA
from diagnosis.result import Diagnosis
from diagnosis.search.views.by_moment import by_moment
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, STEPS, INERTIA, DAMPING, OFFSET, FRICTION, NOISE = 100.0, 5, 2.0, 3.0, 0.4, 1.0, 3e-3
TIME = np.arange(2000) / RATE
FEW = vocabulary(["coulomb_friction", "quadratic_damping", "cubic_stiffness", "sensor_drift"])


def moment(seed: int) -> np.ndarray:
    """A multisine from 0.1 to 2 Hz, N m."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 39)
    lines = np.linspace(0.1, 2.0, 39)
    return np.asarray(1.1 * np.sin(2.0 * np.pi * np.outer(TIME, lines) + phases).sum(axis=1))


def turned(
    friction: float, angle: float, rate: float, at: float, until: float, values: np.ndarray, load: float = 0.0
) -> list[float]:
    """Angle and rate at the end of a step in which the moment is linear; at rest while friction holds the body.

    Friction grows by ``load`` times the moment.
    """
    whole = until - at
    while until - at > 1e-9 * whole:
        first, last = (float(np.interp(t, TIME, values)) + OFFSET for t in (at, until))
        if rate == 0.0 and abs(first) <= friction + load * abs(first):
            break
        m, h = np.array([first, 0.5 * (first + last), last]), until - at
        m = m - (friction + load * np.abs(m)) * np.sign(rate or first)
        k1 = (m[0] - DAMPING * rate) / INERTIA
        k2 = (m[1] - DAMPING * (rate + 0.5 * h * k1)) / INERTIA
        k3 = (m[1] - DAMPING * (rate + 0.5 * h * k2)) / INERTIA
        k4 = (m[2] - DAMPING * (rate + h * k3)) / INERTIA
        later = rate + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
        if (friction or load) and rate * later < 0.0:  # up to where it turns, with the rate linear
            part = h * rate / (rate - later)
            angle, rate, at = angle + 0.5 * part * rate, 0.0, at + part
        else:
            angle, rate, at = angle + h * rate + h * h * (k1 + k2 + k3) / 6.0, later, until
    return [angle, rate]


def joint(friction: float, seed: int, unknown: float = 0.0, load: float = 0.0) -> Run:
    """A run; ``unknown`` is the standard deviation of a moment that the input does not have, N m."""
    values, state, angles = moment(seed), [0.3, 0.0], []
    acting = values + unknown * np.random.default_rng([seed, 2]).standard_normal(TIME.size)
    for start in TIME:
        angles.append(state[0])
        for k in range(STEPS):
            ends = start + k / (STEPS * RATE), start + (k + 1) / (STEPS * RATE)
            state = turned(friction, state[0], state[1], *ends, acting, load)
    reading = np.array(angles) + NOISE * np.random.default_rng([seed, 1]).standard_normal(TIME.size)
    return Run(f"r{seed}", Record(TIME, reading), 0.0, 0.0, drive=Input("moment_nm", values))


def campaign(*runs: Run, inertia: float | None = None) -> Campaign:
    return Campaign("joint", RigProperties(inertia), SensorProperties(RATE), runs)


def within(found: Diagnosis, stds: float) -> bool:
    """Whether the coefficients are as near to the truth as they say."""
    truth = {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING, "moment_offset": OFFSET}
    after = found.coefficients.after
    assert after.keys() == truth.keys()
    return all(
        abs(after[name].value - true) < stds * (after[name].std or 0.0) for name, true in truth.items()
    )


def test_dry_friction_is_named_and_what_vanishes_without_a_spring_is_said() -> None:
    found = diagnose(campaign(joint(FRICTION, 2)), kinds=FEW, rivals=())
    assert found.causes == ("coulomb_friction",)
    friction = found.candidates[0].parameters["friction_moment"]
    assert friction.std is not None
    assert abs(friction.value - FRICTION) < 3.0 * friction.std < 0.02
    assert within(found, 3.0)
    assert found.gap.closed > 0.99
    assert any("no moment" in said and "cubic_stiffness" in said for said in found.cautions)
    assert any("zero is not determined" in said and "sensor_drift" in said for said in found.cautions)
    assert not any("omega_n" in name for name in found.coefficients.after)


@pytest.mark.slow
def test_friction_that_grows_with_the_moment_of_the_drive_is_named_with_its_share() -> None:
    found = diagnose(campaign(joint(0.5, 2, load=0.15), joint(0.5, 3, load=0.15)))
    assert found.causes == ("coulomb_friction",)
    share = found.candidates[0].parameters["load"]
    assert share.std is not None
    assert abs(share.value - 0.15) < 4.0 * share.std < 0.08


@pytest.mark.slow
def test_a_moment_that_no_effect_explains_counts_as_noise_beside_the_friction() -> None:
    found = diagnose(campaign(joint(FRICTION, 7, unknown=0.5)))
    assert found.causes == ("coulomb_friction",)
    assert any("The fits treat it as random noise" in said for said in found.cautions)
    friction = found.candidates[0].parameters["friction_moment"]
    assert friction.std is not None
    assert abs(friction.value - FRICTION) < 3.0 * friction.std < 0.2 * FRICTION
    assert within(found, 3.0)


@pytest.mark.parametrize("stated", [None, 2.0 * INERTIA])
def test_the_similar_rig_has_the_reference_inertia(stated: float | None) -> None:
    similar, change = similar_campaign(campaign(joint(0.0, 3), inertia=stated))
    data = prepare(similar, {run.id: NOISE**2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    assert found.value("yaw_inertia") == pytest.approx(
        REFERENCE_INERTIA / (1.0 if stated is None else 2.0), rel=0.05
    )
    assert change.own(found.value("yaw_inertia"), "kg m2") == pytest.approx(INERTIA, rel=1e-2)
    assert abs(found.excess) < 0.15


def test_a_random_moment_is_found_as_the_noise_that_it_is() -> None:
    similar, change = similar_campaign(campaign(joint(0.0, 5)))
    data = prepare(similar, {run.id: NOISE**2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    (before,) = data.runs
    loss = np.exp(-found.value("mechanical_damping") * before.interval / found.value("yaw_inertia"))
    pushed = np.random.default_rng(6).standard_normal(before.reading.size)
    rate, angle = 0.0, [0.0]
    for push in pushed[1:]:
        rate = loss * rate + push
        angle.append(angle[-1] + rate)
    walked = replace(found, residuals=[found.residuals[0] + np.array(angle)])
    (run,) = by_moment(walked).runs
    white = run.scaled(before.unscaled(walked.residuals[0]))[10:]
    assert abs(np.mean(white**2) - 1.0) < 5.0 * np.sqrt(2.0 / white.size)
    assert abs(np.mean(white[1:] * white[:-1])) < 5.0 / np.sqrt(white.size)
