"""Lines of a driven run that are the drive's own are no place of a gap. Truth: the motion that was simulated."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import kinds_for
from diagnosis.model.joint import Joint
from tests.support.rendered import where_words
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Actuator, JointLaw, Term

RATE, STEP, SECONDS = 100.0, 5e-4, 30.0
INERTIA, DAMPING, STIFFNESS, FRICTION = 0.12, 0.05, 3.0, 0.2
DRIVEN_HZ, HUM_HZ = 0.44, 7.3


def response(amplitude: float, hum: float = 0.0) -> tuple[Array, Array, Array]:
    """Times, angles and moments of a body with dry friction that a sinusoid drives, by small steps."""
    steps = round(SECONDS / STEP)
    clock = np.arange(steps) * STEP
    moment = amplitude * np.sin(2.0 * np.pi * DRIVEN_HZ * clock)
    other = hum * np.sin(2.0 * np.pi * HUM_HZ * clock)
    angle, rate, found = 0.0, 0.0, np.empty(steps)
    for i in range(steps):
        found[i] = angle
        rate += STEP / INERTIA * (moment[i] + other[i] - STIFFNESS * angle - DAMPING * rate)
        rate = np.sign(rate) * max(abs(rate) - STEP * FRICTION / INERTIA, 0.0)
        angle += STEP * rate
    every = round(1.0 / (RATE * STEP))
    return clock[::every], found[::every], moment[::every]


def campaign(hum: float = 0.0) -> Campaign:
    runs = []
    for number, amplitude in enumerate((2.0, 1.6, 1.2), 1):
        time, angle, moment = response(amplitude, hum)
        angle = angle + 2e-4 * np.random.default_rng(number).standard_normal(time.size)
        drive = Input("moment_nm", moment)
        runs.append(Run(f"r{number}", Record(time, angle), 0.0, STIFFNESS, drive=drive))
    return Campaign("driven", RigProperties(), SensorProperties(RATE), tuple(runs))


@pytest.mark.slow
def test_the_drive_is_not_called_a_force_on_the_rig() -> None:
    found = diagnose(campaign(), kinds=vocabulary(include=["coulomb_friction"]))
    assert found.where is not None
    assert found.where.channel != "forcing"
    assert "spectral line" not in where_words(found)


@pytest.mark.slow
def test_a_line_beside_the_drive_is_still_found() -> None:
    found = diagnose(campaign(hum=2.0), kinds=vocabulary(include=["coulomb_friction"]))
    assert found.where is not None
    lines = [line["frequency_hz"] for line in found.to_json_dict()["maps"]["lines"]]
    assert any(line == pytest.approx(HUM_HZ, abs=0.1) for line in lines)
    assert not any(line == pytest.approx(DRIVEN_HZ, abs=0.1) for line in lines)


@pytest.mark.parametrize("hangs", [True, False])
def test_play_of_a_joint_that_gravity_holds_is_said_not_to_be_tried(hangs: bool) -> None:
    terms = (Term("sin(b)-b", STIFFNESS, "N m"),) if hangs else ()
    law = JointLaw(INERTIA, STIFFNESS, terms=terms, actuator=Actuator("motor", 0, 1.0))
    kept, said = kinds_for(campaign(), vocabulary(), Joint(law=law))
    assert ("free_play" in {kind.name for kind in kept}) is not hangs
    assert (
        any("a model of two bodies, so these effects are not tried: free_play" in line for line in said)
        is hangs
    )
