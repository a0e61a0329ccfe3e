"""The motion of a driven run against closed forms, and what output error finds in driven and mixed campaigns."""

from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from identification.estimators import ALL_ESTIMATORS, estimators_of_driven_runs
from identification.signal.driven import driven_rows, driven_start
from tests.reference.free_decays import damped_cosine
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import DriveMoment, RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.drive import Drive, Hold
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Record

RATE, INERTIA, DAMPING, NOISE = 100.0, 0.1, 0.02, 5e-4
TIME = np.arange(1500) / RATE
A, K = 0.5 * DAMPING / INERTIA, 16.0 / INERTIA


def ramp_response(time: np.ndarray) -> np.ndarray:
    """From rest to u = t, in closed form: β = (t − 2a/k)/k + a free motion."""
    return (time - 2.0 * A / K) / K + damped_cosine(time, 2.0 * A, K, 2.0 * A / K**2, -1.0 / K)


def step_response(time: np.ndarray) -> np.ndarray:
    """From rest to u = 1 from time 0 on."""
    return np.where(
        time > 0.0, 1.0 / K + damped_cosine(np.maximum(time, 0.0), 2.0 * A, K, -1.0 / K, 0.0), 0.0
    )


def test_a_linear_hold_is_the_sum_of_ramps() -> None:
    values = np.zeros(TIME.size)
    values[100:] = TIME[100:] - TIME[100]
    values[400:] = values[400]
    closed = ramp_response(np.maximum(TIME - TIME[100], 0.0)) * (TIME[100] < TIME)
    closed -= ramp_response(np.maximum(TIME - TIME[400], 0.0)) * (TIME[400] < TIME)
    found = driven_rows(TIME, values, A, K, held=False)[0]
    assert np.max(np.abs(found - closed)) < 1e-13


def test_a_zero_hold_is_the_sum_of_steps() -> None:
    values = np.where((np.arange(TIME.size) >= 50) & (np.arange(TIME.size) < 300), 2.0, 0.0)
    closed = 2.0 * (step_response(TIME - TIME[50]) - step_response(TIME - TIME[300]))
    assert np.max(np.abs(driven_rows(TIME, values, A, K, held=True)[0] - closed)) < 1e-13


def test_a_body_without_a_spring_or_a_damper_moves_by_the_integral() -> None:
    found = driven_rows(TIME, np.ones(TIME.size), 0.0, 0.0, held=False)[0]
    assert np.allclose(found, 0.5 * TIME**2, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("held", [False, True])
def test_sensitivities_are_the_derivatives(held: bool) -> None:
    values = excitation(3)
    rows = driven_rows(TIME, values, A, K, held=held)
    for row, (da, dk) in zip(rows[1:], ((1e-4, 0.0), (0.0, 1e-2)), strict=True):
        more, less = (driven_rows(TIME, values, A + s * da, K + s * dk, held=held)[0] for s in (1.0, -1.0))
        slope = (more - less) / (2.0 * (da + dk))
        assert np.max(np.abs(slope - row)) < 1e-5 * np.max(np.abs(row))


def test_uneven_times_give_the_motion_of_even_ones() -> None:
    values = np.interp(TIME, TIME[::10], excitation(5)[::10])  # linear between every tenth sample
    kept = np.sort(np.r_[np.arange(0, TIME.size, 10), np.arange(3, TIME.size - 10, 20)])
    even = driven_rows(TIME, values, A, K, held=False)[:, kept]
    uneven = driven_rows(TIME[kept], values[kept], A, K, held=False)
    assert np.max(np.abs(even[0] - uneven[0])) < 1e-12


def excitation(seed: int) -> np.ndarray:
    return np.convolve(np.random.default_rng(seed).standard_normal(TIME.size), np.ones(6) / 6.0, "same")


def integrated(steps: int, drive: DriveMoment) -> np.ndarray:
    run = RunSettings(
        16.0,
        AeroDerivatives(0.0, 0.0),
        INERTIA,
        DAMPING,
        duration=TIME.size / RATE,
        timestep=1.0 / (RATE * steps),
        drive=drive,
    )
    return forward_motion(load_rig(), run, RATE).angle


@pytest.mark.parametrize("held", [False, True])
def test_the_integrator_is_of_fourth_order_for_an_input_with_kinks(held: bool) -> None:
    drive = DriveMoment(TIME, excitation(1), held=held)
    exact = driven_rows(TIME, drive.values, A, K, held=held)[0] / INERTIA
    coarse, fine = (np.max(np.abs(integrated(steps, drive) - exact)) for steps in (4, 8))
    assert fine < 1e-8
    assert coarse / fine == pytest.approx(16.0, rel=0.1)


@pytest.mark.parametrize("held", [False, True])
def test_a_delay_that_is_not_a_whole_number_of_steps_loses_no_order(held: bool) -> None:
    values, delay = excitation(2), 0.0037
    values[:3] = 0.0
    fine = np.arange(10 * TIME.size) / (10.0 * RATE)
    drive = DriveMoment(TIME, values, delay=delay, held=held)
    later = TIME + delay
    finest = np.sort(np.r_[fine, later[later < fine[-1]]])
    at = np.searchsorted(later, finest + 1e-12) - 1
    held_values = np.where(at >= 0, values[np.maximum(at, 0)], 0.0)
    given = held_values if held else np.interp(finest, later, values)
    exact = driven_rows(finest, given, A, K, held=held)[0][np.searchsorted(finest, TIME - 1e-9)] / INERTIA
    coarse, finer = (np.max(np.abs(integrated(steps, drive) - exact)) for steps in (4, 8))
    assert finer < 2e-8
    assert coarse / finer > 12.0


def test_a_moment_by_the_root_and_on_the_body_are_one_with_a_rigid_rod() -> None:
    drive = DriveMoment(TIME, excitation(1))
    by_root = DriveMoment(TIME, excitation(1), on_body=False)
    assert np.max(np.abs(integrated(4, drive) - integrated(4, by_root))) < 1e-13


def test_the_start_is_near_the_truth() -> None:
    values = excitation(4)
    reading = 10.0 * driven_rows(TIME, values, A, K, held=False)[0] + 0.02
    reading += NOISE * np.random.default_rng(1).standard_normal(TIME.size)
    start = driven_start(TIME, reading, values)
    assert start is not None
    assert start[1] == pytest.approx(K, rel=0.01)
    assert start[2] == pytest.approx(10.0, rel=0.05)


def run(name: str, spring: float, column: str | None, seed: int, hold: Hold = "linear") -> Run:
    values = excitation(seed) * (0.1 if column == "base_rad" else 1.0)
    factor = {"moment_nm": 1.0, "drive": 2.5, "base_rad": spring, None: 0.0}[column] / INERTIA
    reading = damped_cosine(TIME, DAMPING / INERTIA, spring / INERTIA, 0.1, 0.2) + 0.01
    stiffness = spring / INERTIA
    reading = reading + factor * driven_rows(TIME, values, A, stiffness, held=hold == "zero")[0]
    reading = reading + NOISE * np.random.default_rng([seed, 1]).standard_normal(TIME.size)
    drive = None if column is None else Drive(column, values, hold)  # type: ignore[arg-type]
    return Run(name, Record(TIME, reading), 0.0, spring, drive=drive)


def campaign(columns: tuple[str | None, ...], hold: Hold = "linear", seed: int = 0) -> Campaign:
    springs = (16.0, 36.0)
    runs = tuple(
        run(f"r{i}", springs[i % 2], column, 100 * seed + i, hold) for i, column in enumerate(columns)
    )
    return Campaign("driven", RigProperties(), SensorProperties(RATE, None, NOISE), runs)


@pytest.mark.parametrize("hold", ["linear", "zero"])
@pytest.mark.parametrize(
    "columns",
    [
        ("moment_nm", "moment_nm"),
        ("drive", "drive"),
        ("base_rad", "base_rad"),
        ("moment_nm", None),
        (None, "drive"),
        ("moment_nm",),
    ],
)
def test_output_error_finds_inertia_and_damping(columns: tuple[str | None, ...], hold: Hold) -> None:
    found = identify(campaign(columns, hold))
    assert found.yaw_inertia is not None
    assert found.mechanical_damping is not None
    for quantity, truth in ((found.yaw_inertia, INERTIA), (found.mechanical_damping, DAMPING)):
        assert abs(quantity.value - truth) < 4.5 * quantity.std
        assert quantity.std < 2e-3 * truth
    gained = any("gain of the input" in str(remark) for remark in found.remarks)
    assert gained == ("drive" in columns)


@pytest.mark.slow
def test_its_standard_deviations_are_those_of_the_scatter() -> None:
    scores = []
    for seed in range(40):
        found = identify(campaign(("moment_nm", None), seed=seed + 1))
        assert found.yaw_inertia is not None
        assert found.mechanical_damping is not None
        scores.append((found.yaw_inertia.value - INERTIA) / found.yaw_inertia.std)
        scores.append((found.mechanical_damping.value - DAMPING) / found.mechanical_damping.std)
    # χ² of 80 values: outside this range once in ten thousand campaigns of campaigns
    assert 40.0 < float(np.sum(np.square(scores))) < 137.0


@pytest.mark.parametrize("seed", [4, 7, 12, 18, 19])
def test_a_resonance_above_half_the_sample_rate_is_no_estimate(seed: int) -> None:
    # a moment on the body, said to be the angle of the root: without a limit these fits end at 1e7 rad/s and more
    rng, time = np.random.default_rng(seed), np.arange(3000) / 100.0
    given = np.sin(2.0 * np.pi * 1.5 * time) + 0.3 * rng.normal(size=time.size)
    reading = 10.0 * driven_rows(time, given, 0.25, 100.0, held=True)[0] + 1e-4 * rng.normal(size=time.size)
    wrong = Run("r", Record(time, reading), 0.0, 10.0, drive=Drive("base_rad", given))
    with pytest.raises(TunnelError, match="no run could be identified"):
        identify(Campaign("wrong", RigProperties(), SensorProperties(), (wrong,)))


def test_a_run_without_a_spring_stated_gives_frequency_and_damping() -> None:
    free = campaign(("drive",))
    bare = replace(free, runs=(replace(free.runs[0], spring_stiffness=None),))
    estimate = identify(bare)
    said = next(str(remark) for remark in estimate.remarks if "gain of the input" in str(remark))
    gain, std = (float(word) for word in said.split("is ")[1].split(" rad")[0].split(" ± "))
    assert abs(gain - 2.5 / INERTIA) < 4.5 * std
    found = estimate.runs[0]
    assert found.omega_n is not None
    assert abs(found.omega_n.value - np.sqrt(K)) < 4.5 * found.omega_n.std


@pytest.mark.parametrize("name", [name for name in ALL_ESTIMATORS if name not in estimators_of_driven_runs()])
def test_other_estimators_refuse_driven_runs_in_one_line(name: str) -> None:
    with pytest.raises(
        TunnelError, match=f"run 'r0': the run is driven, and {name} takes free decays only"
    ) as caught:
        identify(campaign(("moment_nm", None)), name)
    assert "\n" not in str(caught.value)
