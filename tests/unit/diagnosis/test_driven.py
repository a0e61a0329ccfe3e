"""Driven runs in the diagnosis. The truth is the equation of motion, integrated by SciPy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.parameters import Point
from diagnosis.model.similar import similar_campaign
from diagnosis.noise.sensor_noise import LEAST_SAMPLES, driven_variance
from identification.signal.driven import driven_rows
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone")

RATE, INERTIA, DAMPING, SPRING, GAIN, NOISE = 100.0, 0.1, 0.05, 16.0, 0.5, 3e-4
TIME = np.arange(1200) / RATE


def driven_run(name: str, seed: int, cubic: float, *, stated: float | None = SPRING) -> Run:
    """A run driven by a multisine from 1 to 3 Hz, which is linear between its samples."""
    rng = np.random.default_rng(seed)
    lines = np.arange(1.0, 3.0, 1.0 / TIME[-1])
    phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    values = 0.2 * np.cos(2.0 * np.pi * np.outer(TIME, lines) + phases).sum(axis=1)

    def slope(t: float, y: np.ndarray) -> list[float]:
        moment = GAIN * np.interp(t, TIME, values) - SPRING * (y[0] + cubic * y[0] ** 3) - DAMPING * y[1]
        return [y[1], moment / INERTIA]

    angle = solve_ivp(
        slope, (0.0, TIME[-1]), [0.02, 0.0], "RK45", TIME, rtol=1e-7, atol=1e-9, max_step=0.02
    ).y[0]
    reading = angle + NOISE * rng.standard_normal(TIME.size)
    return Run(name, Record(TIME, reading), 0.0, spring_stiffness=stated, drive=Drive("drive", values))


def campaign(cubic: float, *, stated: float | None = SPRING) -> Campaign:
    runs = tuple(driven_run(f"r{i}", i, cubic, stated=stated) for i in range(2))
    return Campaign("driven", RigProperties(), SensorProperties(sample_rate=RATE), runs)


@pytest.mark.parametrize("stated", [SPRING, None])
def test_the_nominal_model_of_linear_runs_is_found(stated: float | None) -> None:
    similar, change = similar_campaign(campaign(0.0, stated=stated))
    data = prepare(similar, {run.id: NOISE**2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    gain = change.own(found.value("drive_gain"), "N m")
    expected = GAIN if stated is not None else GAIN / INERTIA
    assert abs(gain / expected - 1.0) < 5e-3
    assert abs(found.excess) < 0.15


def test_a_part_of_a_run_keeps_its_input() -> None:
    similar, change = similar_campaign(campaign(0.0))
    data = prepare(similar, {run.id: NOISE**2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    later = data.with_runs(tuple(run.part(300) for run in data.runs))
    start = Point(found.point.common, np.zeros_like(found.point.release))
    again = fit(Problem(later), start)
    assert abs(again.excess) < 0.15


def test_cubic_stiffness_is_named() -> None:
    kinds = [effect_class(name) for name in ("cubic_stiffness", "coulomb_friction", "sensor_nonlinearity")]
    found = diagnose(campaign(2.0, stated=None), kinds=kinds)
    assert found.causes == ("cubic_stiffness",)
    assert found.gap.closed > 0.95
    assert found.where.words is not None
    assert "along the decay" not in found.where.words


def test_the_cubic_stiffness_of_a_spring_whose_root_moves_is_named() -> None:
    """The spring pulls by its deflection; SciPy's solution has the cube of it."""
    runs, held = [], [0.03, 0.05]
    for seed, size in enumerate(held):
        run = driven_run(f"r{seed}", seed, 0.0)
        assert run.drive is not None
        root = size / float(np.max(np.abs(run.drive.values))) * run.drive.values

        def slope(t: float, y: np.ndarray, root: np.ndarray = root) -> list[float]:
            bent = y[0] - np.interp(t, TIME, root)
            return [y[1], (-SPRING * (bent + 2.0 * bent**3) - DAMPING * y[1]) / INERTIA]

        angle = solve_ivp(
            slope, (0.0, TIME[-1]), [0.0, 0.1], "RK45", TIME, rtol=1e-7, atol=1e-9, max_step=0.02
        ).y[0]
        noise = NOISE * np.random.default_rng(seed).standard_normal(TIME.size)
        runs.append(replace(run, record=Record(TIME, angle + noise), drive=Drive("base_rad", root)))
    kinds = [
        effect_class(n) for n in ("cubic_stiffness", "structural_damping", "coulomb_friction", "input_delay")
    ]
    found = diagnose(replace(campaign(0.0), runs=tuple(runs)), kinds=kinds)
    assert found.causes == ("cubic_stiffness",)
    size = found.candidates[0].parameters["coefficient"]
    assert abs(size.value - 2.0) < 4.0 * size.std
    assert any("its loss depends on that motion" in said for said in found.cautions)


def test_a_moving_root_without_a_spring_is_refused_in_one_line() -> None:
    given = campaign(0.0)
    run = given.runs[0]
    assert run.drive is not None
    moving = replace(run, drive=Drive("base_rad", run.drive.values), spring_stiffness=0.0)
    with pytest.raises(TunnelError, match="spring_stiffness = 0 states none"):
        diagnose(replace(given, runs=(moving,)))


def test_too_few_samples_to_tell_noise_from_response_are_refused() -> None:
    given = campaign(0.0)
    run, size = given.runs[0], LEAST_SAMPLES - 1
    assert run.drive is not None
    short = Record(run.record.time_s[:size], run.record.yaw_rad[:size])
    cut = replace(run, record=short, drive=replace(run.drive, values=run.drive.values[:size]))
    with pytest.raises(TunnelError, match=f"driven and has {size} samples") as caught:
        diagnose(replace(given, runs=(cut,)))
    assert f"{LEAST_SAMPLES} samples or more" in str(caught.value)


def test_the_noise_of_the_shortest_record_is_that_which_was_added() -> None:
    omega, step, found = 2.0 * np.pi * 1.6, 0.01, []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time, given = step * np.arange(LEAST_SAMPLES), rng.normal(size=LEAST_SAMPLES)
        response = driven_rows(time, given, 0.025 * omega, omega**2, held=False)[0]
        level = 1e-3 * response.std()
        variance, relative = driven_variance(response + level * rng.normal(size=time.size), given, 0.6)
        found.append((variance / level**2 - 1.0) / relative)
    # the mean of 40 values of unit variance: beyond this once in ten thousand
    assert abs(np.mean(found)) < 3.9 / np.sqrt(40.0)


def test_known_moments_and_free_decays_are_fitted_together() -> None:
    given = campaign(0.0)
    first = given.runs[0]
    assert first.drive is not None
    known = replace(first, drive=Drive("moment_nm", GAIN * first.drive.values))
    omega, rate = np.sqrt(SPRING / INERTIA - (0.5 * DAMPING / INERTIA) ** 2), 0.5 * DAMPING / INERTIA
    decay = 0.2 * np.exp(-rate * TIME) * np.cos(omega * TIME)
    free = Run("free", Record(TIME, decay), 0.0, spring_stiffness=SPRING)
    similar, change = similar_campaign(replace(given, runs=(known, free)))
    data = prepare(similar, {run.id: NOISE**2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    assert "drive_gain" not in found.problem.names
    assert abs(change.own(found.value("yaw_inertia"), "kg m2") / INERTIA - 1.0) < 1e-3
    assert found.excess < 0.15
