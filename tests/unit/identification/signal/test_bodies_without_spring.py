"""Driven bodies without a spring. The truth is the closed form of the motion under a held moment."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identification import Estimate, identify
from identification.estimate import Status
from identification.signal.forcing import driven_rows, driven_start
from tests.reference.free_decays import damped_cosine
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")

RATE, INERTIA, DAMPING, NOISE, OFFSET = 200.0, 0.1, 0.15, 5e-4, 0.3
TIME = np.arange(3000) / RATE
DECAY = DAMPING / INERTIA


def moment(seed: int) -> np.ndarray:
    """Steps of 0.4 s and a little noise, of mean about zero."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.standard_normal(TIME.size // 80 + 1), 80)[: TIME.size]
    return np.asarray(steps + 0.05 * rng.standard_normal(TIME.size))


def motion(values: np.ndarray) -> np.ndarray:
    """Izz β̈ + C β̇ = u held from sample to sample, from β = 0.4 rad and β̇ = 0.2 rad/s, step by step."""
    step = 1.0 / RATE
    left = np.exp(-DECAY * step)
    angle, rate, found = 0.4, 0.2, np.empty(values.size)
    for i, value in enumerate(values):
        found[i] = angle
        final = value / DAMPING
        angle += final * step + (rate - final) * (1.0 - left) / DECAY
        rate = final + (rate - final) * left
    return found


def loose(seed: int, column: InputColumn = "moment_nm", gain: float | None = None) -> Run:
    values, factor = moment(seed), 2.5 if column == "drive" else 1.0
    reading = motion(factor * (values + OFFSET))
    reading = reading + NOISE * np.random.default_rng([seed, 1]).standard_normal(TIME.size)
    drive = Input(column, values, "zero", gain)
    return Run(f"loose-{seed}", Record(TIME, reading), 0.0, 0.0, drive=drive)


def campaign(*runs: Run) -> Campaign:
    return Campaign("loose", RigProperties(), SensorProperties(RATE, None, NOISE), runs)


def scores(found: Estimate) -> list[float]:
    assert found.yaw_inertia is not None
    assert found.mechanical_damping is not None
    pairs = ((found.yaw_inertia, INERTIA), (found.mechanical_damping, DAMPING))
    return [(quantity.value - truth) / quantity.std for quantity, truth in pairs]


@pytest.mark.parametrize(("column", "gain"), [("moment_nm", None), ("drive", 2.5)])
def test_a_known_moment_gives_inertia_damping_and_its_offset(column: InputColumn, gain: float | None) -> None:
    found = identify(campaign(loose(1, column, gain)))
    assert max(map(abs, scores(found))) < 4.5
    assert found.yaw_inertia is not None
    assert found.yaw_inertia.std < 1e-2 * INERTIA
    run = found.runs[0]
    assert (run.omega_n, run.zeta, run.sensor_zero) == (None, None, None)
    assert run.initial_angle is not None
    assert abs(run.initial_angle.value - 0.4) < 4.5 * run.initial_angle.std
    said = next(remark for remark in found.remarks if "without a spring" in str(remark))
    assert said.figures["offset_in_units_of_the_input"] == pytest.approx(OFFSET, abs=5e-3)
    assert "are not determined" in str(said)
    assert "the inertia," not in str(said)
    json.dumps(found.to_json_dict(), allow_nan=False)


def test_an_unknown_gain_leaves_the_ratios() -> None:
    found = identify(campaign(loose(2, "drive")))
    assert found.yaw_inertia is None
    assert found.mechanical_damping is None
    said = next(remark for remark in found.remarks if "the inertia, omega_n" in str(remark))
    assert said.remedy == "state drive_gain for the inertia"
    assert said.figures["gain_per_inertia"] == pytest.approx(2.5 / INERTIA, rel=1e-2)
    assert said.figures["damping_over_inertia_per_s"] == pytest.approx(DECAY, rel=1e-2)


def test_standard_deviations_are_those_of_the_scatter() -> None:
    all_scores, offsets = [], []
    for seed in range(20):
        found = identify(campaign(loose(seed + 10)))
        all_scores += scores(found)
        text = next(str(remark) for remark in found.remarks if "without a spring" in str(remark))
        said = text.split("beside the input ")[1].split(" N m")[0]
        value, std = map(float, said.split(" ± "))
        offsets.append((value - OFFSET) / std)
    # χ² of 40 and of 20 values: outside these ranges once in ten thousand
    assert 14.1 < float(np.sum(np.square(all_scores))) < 84.6
    assert 4.0 < float(np.sum(np.square(offsets))) < 54.5


def test_it_joins_runs_with_a_spring() -> None:
    free = damped_cosine(TIME, DECAY, 160.0, 0.2, 0.0) + 0.01
    sprung = Run(
        "free", Record(TIME, free + NOISE * np.random.default_rng(5).standard_normal(TIME.size)), 0.0, 16.0
    )
    alone, both = identify(campaign(sprung)), identify(campaign(loose(1), sprung))
    assert max(map(abs, scores(both))) < 4.5
    assert both.yaw_inertia is not None
    assert alone.yaw_inertia is not None
    assert both.yaw_inertia.std < alone.yaw_inertia.std
    # of unknown gain it says nothing on the inertia, and its gain is found by the spring of the other
    gained = identify(campaign(loose(1, "drive"), sprung))
    assert max(map(abs, scores(gained))) < 4.5
    assert any("N m per unit" in str(remark) for remark in gained.remarks)


def test_the_start_without_a_stiffness_is_near_the_truth() -> None:
    values = moment(4)
    start = driven_start(
        TIME, 10.0 * driven_rows(TIME, values, 0.75, 0.0, held=True)[0], values, sprung=False
    )
    assert start is not None
    assert start[0] == pytest.approx(0.75, rel=0.05)
    assert start[1] == 0.0
    assert start[2] == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize("size", [3, 5, 6, 12, 19])
def test_too_few_samples_are_no_estimate(size: int) -> None:
    run = loose(1)
    assert run.drive is not None
    short = Record(run.record.time_s[:size], run.record.yaw_rad[:size])
    cut = replace(run, record=short, drive=replace(run.drive, values=run.drive.values[:size]))
    found = identify(campaign(cut), throw=False)
    assert found.status.failed
    assert found.runs[0].status is Status.NOT_DETERMINED


@pytest.mark.parametrize("what", ["noise", "step", "growth"])
def test_a_record_that_the_input_does_not_explain_is_a_status(what: str) -> None:
    reading = {
        "noise": NOISE * np.random.default_rng(3).standard_normal(TIME.size),
        "step": np.where(TIME > 7.0, 0.5, 0.0),
        "growth": 1e-6 * np.exp(np.minimum(TIME, 14.0)),
    }[what]
    found = identify(campaign(replace(loose(3), record=Record(TIME, reading))), throw=False)
    json.dumps(found.to_json_dict(), allow_nan=False)
    assert found.status.failed or found.status is Status.MODEL_DEPARTS
