"""Runs of a shaken base: the truth is the motion in the room, integrated by SciPy and seen from the base."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import kinds_for
from diagnosis.model.choose import nominal_model
from identification import identify
from tests.marks import slow
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import CampaignPlan, EffectSetting
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, INERTIA, DAMPING, NOISE = 500.0, 0.1014, 0.018, 3e-4
SPRINGS = (16.12, 44.84)
TIME = np.arange(6000) / RATE  # 500 Hz: at 200 Hz an input that is linear between samples is 0.2 % too small
MASS, ARM = 4.0, 0.05  # kg and m
TURNS, ALONG = "base_acceleration_rad_s2", "base_acceleration_m_s2"
KINDS = vocabulary(("coulomb_friction", "quadratic_damping", "cubic_stiffness", "input_delay"))


class Base:
    """A base on a multisine about a spring's resonance: its position and its derivatives, in closed form."""

    def __init__(self, seed: int, spring: float, peak: float) -> None:
        own = np.sqrt(spring / INERTIA) / (2.0 * np.pi)
        self.rates = 2.0 * np.pi * np.arange(0.5 * own, 1.6 * own, 4.0 / TIME[-1])
        self.phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, self.rates.size)
        self.sizes = peak / np.sqrt(self.rates.size) / self.rates**2

    def moved(self, time: Array | float, derivative: int = 0) -> Array:
        """Position, velocity or acceleration: rad or m, per s and s²; shape of the times."""
        turn = self.phases + 0.5 * np.pi * derivative
        waves = np.cos(np.multiply.outer(time, self.rates) + turn)
        return np.asarray(waves @ (self.sizes * self.rates**derivative))


def solved(slope: object, start: list[float]) -> Array:
    found = solve_ivp(slope, (0.0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12)
    return np.asarray(found.y[0])


def turned(base: Base, spring: float) -> Array:
    """The angle between body and base, from the body's angle in the room; at rest against the base at time 0."""

    def slope(t: float, y: Array) -> list[float]:
        away, faster = y[0] - base.moved(t), y[1] - base.moved(t, 1)
        return [y[1], (-spring * away - DAMPING * faster) / INERTIA]

    return solved(slope, [float(base.moved(0.0)), float(base.moved(0.0, 1))]) - base.moved(TIME)


def pushed(base: Base, spring: float) -> Array:
    """The angle of a body whose centre of mass lies at an arm across the motion of the base.

    With the base at x, T = ½ I θ̇² + m r cos θ θ̇ ẋ + ½ m ẋ²: Lagrange's equation is I θ̈ + C θ̇ + K θ = −m r cos θ ẍ.
    """

    def slope(t: float, y: Array) -> list[float]:
        moment = -MASS * ARM * np.cos(y[0]) * base.moved(t, 2) - spring * y[0] - DAMPING * y[1]
        return [y[1], float(moment) / INERTIA]

    return solved(slope, [0.0, 0.0])


def shaken(column: InputColumn, seed: int, spring: float, *, noise: float = NOISE) -> Run:
    base = Base(seed, spring, 0.6 if column == TURNS else 0.3)
    motion = (turned if column == TURNS else pushed)(base, spring)
    reading = motion + noise * np.random.default_rng(seed).standard_normal(TIME.size)
    drive = Input(column, base.moved(TIME, 2), "linear")
    return Run(f"r{seed}", Record(TIME, reading), 0.0, spring, drive=drive)


def campaign(column: InputColumn) -> Campaign:
    runs = tuple(shaken(column, seed, spring) for seed, spring in enumerate(SPRINGS * 2))
    return Campaign("shaken", RigProperties(), SensorProperties(sample_rate=RATE), runs)


@pytest.fixture(scope="module")
def turning() -> Campaign:
    return campaign("base_acceleration_rad_s2")


@pytest.fixture(scope="module")
def moving() -> Campaign:
    return campaign("base_acceleration_m_s2")


def plan(folder: Path, *drive: str) -> CampaignPlan:
    lines = [
        'name = "shaken"', "seed = 3", "springs = [5, 8]", "wind_speeds = [0.0]", "duration = 12.0",
        "truth = { cn_beta = 0.495, cn_r = -0.114 }", f"sensor = {{ sample_rate = {RATE:g} }}",
        "[drive]", 'kind = "multisine"', "from_hz = 1.0", "to_hz = 5.0", *drive,
    ]  # fmt: skip
    path = folder / "plan.toml"
    path.write_text("\n".join(lines))
    return load_plan(path)


BY_TURNS, BY_PUSHES = ("amplitudes_rad_s2 = [0.5, 1.5]",), ("amplitudes_m_s2 = [0.3, 0.8]", "gain = 0.2")


@pytest.mark.parametrize("column", [TURNS, ALONG])
def test_the_virtual_rig_moves_as_the_body_in_the_room_does(column: InputColumn, tmp_path: Path) -> None:
    truth = shaken(column, 1, SPRINGS[0], noise=0.0)
    assert truth.drive is not None
    given = plan(tmp_path, *(BY_TURNS if column == TURNS else BY_PUSHES))
    one = replace(given.conditions[0], drive=truth.drive, gain=MASS * ARM)
    quiet = replace(given.sensor, noise_std=0.0, resolution=0.0)
    run = simulate_campaign(replace(given, conditions=(one,), sensor=quiet)).runs[0]
    error = np.max(np.abs(run.record.yaw_rad - truth.record.yaw_rad))
    swing = np.max(np.abs(truth.record.yaw_rad))
    # The input is linear between its samples, which makes it smaller by (ωh)²/12, h the sample interval; an arm
    # across the motion at rest turns with the body, by 1 − cos θ.
    fast = Base(1, SPRINGS[0], 1.0).rates.max() / RATE
    assert error < (0.1 * fast**2 + (0.5 * swing**2 if column == ALONG else 0.0)) * swing


def test_of_the_translation_mass_times_arm_is_found(moving: Campaign) -> None:
    found = identify(moving)
    assert found.yaw_inertia is not None
    (gain,) = (remark.what for remark in found.remarks if "gain" in remark.what)
    value = float(gain.split(", ")[-1].split()[0])
    assert abs(value / (MASS * ARM) - 1.0) < 2e-3
    stated = tuple(replace(r, drive=replace(r.drive, gain=MASS * ARM)) for r in moving.runs if r.drive)
    known = identify(replace(moving, runs=stated))
    assert known.yaw_inertia is not None
    assert abs(known.yaw_inertia.value / INERTIA - 1.0) < 2e-3


@pytest.mark.usefixtures("models_in_this_process")
def test_without_a_cause_none_is_named(moving: Campaign) -> None:
    answer = diagnose(moving, kinds=KINDS)
    assert answer.causes == ()
    (said,) = (one for one in answer.cautions if one.startswith("The gain of the input"))
    assert abs(float(said.split()[6]) / (MASS * ARM) - 1.0) < 2e-3


@pytest.mark.usefixtures("models_in_this_process")
@pytest.mark.parametrize("drive", [slow(BY_TURNS), slow(BY_PUSHES)])
def test_friction_that_is_planted_is_named_with_its_size(drive: tuple[str, ...], tmp_path: Path) -> None:
    planted = EffectSetting("coulomb_friction", {"friction_moment": 0.004})
    data = simulate_campaign(replace(plan(tmp_path, *drive), effects=(planted,)))
    write_campaign(data, tmp_path / "dry")
    answer = diagnose(read_campaign(tmp_path / "dry"), kinds=KINDS)
    assert answer.causes == ("coulomb_friction",)
    size = answer.candidates[0].parameters["friction_moment"]
    assert size.std is not None
    assert abs(size.value - 0.004) < 4.0 * size.std + 1e-5
    assert diagnose(simulate_campaign(plan(tmp_path, *drive)), kinds=KINDS).causes == ()


def test_effects_that_the_acceleration_of_the_base_does_not_determine_are_not_tried(
    turning: Campaign,
) -> None:
    given = vocabulary(("gravity_stiffness", "rod_flexibility", "actuator_lag", "coulomb_friction"))
    kept, said = kinds_for(turning, given, nominal_model(turning))
    assert [kind.name for kind in kept] == ["coulomb_friction"]
    assert any("gravity_stiffness, rod_flexibility" in one for one in said)


def test_an_effect_of_an_actuator_leaves_a_shaken_base_as_it_is(tmp_path: Path) -> None:
    given = plan(tmp_path, *BY_TURNS)
    pushed_too = plan(tmp_path, "amplitudes_nm = [0.1]").conditions[0]
    mixed = replace(given, conditions=(given.conditions[0], replace(pushed_too, id="pushed")))
    bare = simulate_campaign(mixed)
    slow = simulate_campaign(replace(mixed, effects=(EffectSetting("actuator_lag", {"lag": 0.05}),)))
    same = [
        np.array_equal(one.record.yaw_rad, other.record.yaw_rad)
        for one, other in zip(bare.runs, slow.runs, strict=True)
    ]
    assert same == [True, False]


@pytest.mark.parametrize(
    ("drive", "what"),
    [
        (BY_PUSHES[:1], "needs a gain"),
        ((*BY_TURNS, "gain = 0.2"), "does not take a gain"),
        ((*BY_TURNS, *BY_PUSHES), "both amplitudes_rad_s2 and amplitudes_m_s2"),
    ],
)
def test_a_plan_of_a_shaken_base_that_cannot_be_simulated_is_refused(
    drive: tuple[str, ...], what: str, tmp_path: Path
) -> None:
    with pytest.raises(TunnelError, match=what):
        plan(tmp_path, *drive)


def test_a_rod_that_twists_and_a_wind_are_not_simulated_on_a_base_that_turns(tmp_path: Path) -> None:
    given = plan(tmp_path, *BY_TURNS)
    rod = EffectSetting("rod_flexibility", {"compliance": 1e-3})
    windy = tuple(replace(one, wind_speed=10.0) for one in given.conditions)
    for wrong, what in (
        (replace(given, effects=(rod,)), "base turns"),
        (replace(given, conditions=windy), "wind"),
    ):
        with pytest.raises(TunnelError, match=what):
            simulate_campaign(wrong)


@pytest.mark.parametrize(
    ("heading", "column", "factor"),
    [
        ("Table acceleration [deg/s2]", TURNS, 180.0 / np.pi),
        ("base_acceleration_rad_s2", TURNS, 1.0),
        ("base_acceleration_m_s2", ALONG, 1.0),
        ("Floor acc (mg)", ALONG, 1e3 / 9.80665),
        ("Base acceleration (m/s^2)", ALONG, 1.0),
        ("Base acceleration", ALONG, 1.0),
    ],
)
def test_an_import_reads_the_acceleration_of_a_base_by_name_and_unit(
    heading: str, column: str, factor: float, turning: Campaign, tmp_path: Path
) -> None:
    run = turning.runs[0]
    assert run.drive is not None
    rows = np.column_stack((run.record.time_s, run.record.yaw_rad, factor * run.drive.values))[::4]
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=f"time_s,yaw_rad,{heading}", comments="")
    drive = read_records([tmp_path / "log.csv"]).campaign.runs[0].drive
    assert drive is not None
    assert drive.column == column
    assert np.allclose(drive.values, run.drive.values[::4], rtol=1e-9)


def test_a_run_file_that_does_not_say_the_unit_is_refused(turning: Campaign, tmp_path: Path) -> None:
    write_campaign(turning, tmp_path / "shaken", run_format="csv")
    file = tmp_path / "shaken/runs/r0.csv"
    file.write_text(file.read_text().replace(TURNS, "base_acceleration", 1))
    with pytest.raises(TunnelError, match="name it base_acceleration_rad_s2 or base_acceleration_m_s2"):
        read_campaign(tmp_path / "shaken")


@pytest.mark.parametrize("seed", range(5))
def test_a_base_that_hardly_moves_the_body_is_not_taken_for_one_of_the_other_sign(seed: int) -> None:
    """The motion is a free decay, beside which noise decides what follows the base."""
    rng = np.random.default_rng(seed)
    decay = np.exp(-DAMPING / (2.0 * INERTIA) * TIME) * np.cos(np.sqrt(SPRINGS[0] / INERTIA) * TIME)
    reading = 0.2 * decay + NOISE * rng.standard_normal(TIME.size)
    quiet = Input(TURNS, 1e-4 * rng.standard_normal(TIME.size))
    run = Run("r", Record(TIME, reading), 0.0, SPRINGS[0], drive=quiet)
    identify(Campaign("quiet", RigProperties(), SensorProperties(sample_rate=RATE), (run,)))
