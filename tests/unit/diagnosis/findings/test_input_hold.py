"""An input that is held between samples where it is taken as linear: one cause with two readings.

The truth is the exact response of a linear oscillator to an input that keeps its value between samples.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from diagnosis import diagnose, vocabulary
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.verdict import headline
from identification import identify
from tests.unit.diagnosis.test_input_delay import DELAY, campaign
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.writing import import_records
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Hold, Input
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, INERTIA, DAMPING, SPRING, NOISE = 200.0, 0.1, 0.05, 16.0, 3e-4
HALF = 0.5 / RATE
FEW = vocabulary([DELAY.name, "quadratic_damping", "cubic_stiffness"])


def held(hold: Hold | None) -> Campaign:
    """Two runs over the resonance at 2 Hz with commands that a controller holds; ``hold`` is what is stated."""
    law = np.array([[0.0, 1.0], [-SPRING / INERTIA, -DAMPING / INERTIA]])
    system = cont2discrete((law, np.array([[0.0], [1.0 / INERTIA]]), np.eye(2), np.zeros((2, 1))), 1.0 / RATE)
    time = np.arange(2400) / RATE

    def run(seed: int) -> Run:
        rng = np.random.default_rng(seed)
        omega = 2.0 * np.pi * np.arange(1.0, 3.0, 1.0 / time[-1])
        command = 0.1 * np.cos(np.outer(time, omega) + rng.uniform(0.0, 2.0 * np.pi, omega.size)).sum(axis=1)
        _, reading, _ = dlsim(system, command, x0=[0.02, 0.0])
        yaw = reading[:, 0] + NOISE * rng.standard_normal(time.size)
        drive = Input("moment_nm", command, hold)
        return Run(f"r{seed}", Record(time, yaw), 0.0, spring_stiffness=SPRING, drive=drive)

    return Campaign("held", RigProperties(), SensorProperties(sample_rate=RATE), (run(0), run(1)))


def test_a_guessed_hold_is_said_as_the_second_reading_of_the_delay() -> None:
    answer = diagnose(held(None), kinds=FEW, rivals=())
    assert answer.causes == (DELAY.name,)
    assert answer.candidates[0].parameters["delay"].value == pytest.approx(HALF, rel=0.05)
    assert headline(answer)[0] == "input delay or wrong hold"
    assert "or it keeps its value between samples, as a controller's command does" in answer.verdict
    assert "since drive_hold is not stated" in answer.verdict
    assert any('state drive_hold = "zero" for the runs' in step for step in next_steps(answer))


def test_a_hold_that_is_stated_wrongly_is_said_too() -> None:
    said = diagnose(held("linear"), kinds=FEW, rivals=()).verdict
    assert "One cause has two interpretations" in said
    assert "as the campaign states" in said


def test_the_right_hold_has_no_delay() -> None:
    assert diagnose(held("zero"), kinds=FEW, rivals=()).causes == ()


def test_a_smooth_input_that_is_stated_as_held_seems_early() -> None:
    smooth = campaign()
    runs = tuple(replace(run, drive=replace(run.drive, hold="zero")) for run in smooth.runs)
    answer = diagnose(replace(smooth, runs=runs), kinds=FEW, rivals=())
    assert answer.causes == (DELAY.name,)
    assert "acts 1 ms earlier than recorded, about half a sample (1 ms); or it is linear" in answer.verdict
    assert any('state drive_hold = "linear" for the runs' in step for step in next_steps(answer))


def test_identify_says_that_linear_is_assumed() -> None:
    (remark,) = identify(held(None)).remarks
    assert "drive_hold is not stated" in remark.what
    assert f"half a sample ({1e3 * HALF:.3g} ms)" in remark.what
    assert identify(held("zero")).remarks == ()


def test_a_guess_of_the_import_stays_a_guess(tmp_path: Path) -> None:
    run = held(None).runs[0]
    table = np.column_stack([run.record.time_s, run.record.yaw_rad, run.drive.values])
    np.savetxt(
        tmp_path / "log.csv", table, delimiter=",", header="time [s],angle [rad],torque [Nm]", comments=""
    )
    found = import_records([tmp_path / "log.csv"], tmp_path / "c")
    assert any("drive_hold: not stated, linear is assumed" in line for line in found.remarks())
    text = (tmp_path / "c" / "campaign.toml").read_text()
    assert "# drive_hold =   # 'zero' if a controller holds each command" in text
    assert read_campaign(tmp_path / "c").runs[0].drive.hold is None
    stated = import_records([tmp_path / "log.csv"], tmp_path / "d", ImportChoices(input_hold="zero"))
    assert stated.campaign.runs[0].drive.hold == "zero"
    assert 'drive_hold = "zero"' in (tmp_path / "d" / "campaign.toml").read_text()


@pytest.mark.parametrize("hold", [None, "zero", "linear"])
def test_a_hold_reads_back_as_it_was_stated(tmp_path: Path, hold: Hold | None) -> None:
    given = held(hold)
    given = replace(given, runs=given.runs[:1])
    found = read_campaign(write_campaign(given, tmp_path / "c"))
    assert found.runs[0].drive.hold == hold
