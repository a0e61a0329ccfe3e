"""Filter error on driven runs that a random moment moves too. The truth adds kicks of the rate, ten a sample."""

import numpy as np
import pytest
from scipy.linalg import expm

from identification import identify
from identification.signal.forcing import driven_rows
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("unexamined")

RATE, INERTIA, DAMPING, SPRING, NOISE, GAIN = 100.0, 0.1, 0.1, 16.0, 5e-4, 2.5
TIME = np.arange(1500) / RATE
KICKS = 10  # a sample


def random_motion(intensity: float, rng: np.random.Generator) -> Array:
    """The angle of a body at rest that white noise of this intensity (rad²/s³) moves."""
    step = 1.0 / (RATE * KICKS)
    transition = expm(np.array([[0.0, 1.0], [-SPRING / INERTIA, -DAMPING / INERTIA]]) * step)
    kicks = np.sqrt(intensity * step) * rng.standard_normal((TIME.size, KICKS))
    state, angles = np.zeros(2), np.empty(TIME.size)
    for i, row in enumerate(kicks):
        angles[i] = state[0]
        for kick in row:
            state = transition @ state
            state[1] += kick
    return angles


def campaign(column: InputColumn, intensity: float, seed: int) -> Campaign:
    runs = []
    for place in range(2):
        rng = np.random.default_rng([seed, place])
        values = np.convolve(rng.standard_normal(TIME.size), np.ones(6) / 6.0, "same")
        values *= 0.1 if column == "base_rad" else 1.0
        factor = {"moment_nm": 1.0, "drive": GAIN, "base_rad": SPRING}[column] / INERTIA
        reading = factor * driven_rows(TIME, values, 0.5 * DAMPING / INERTIA, SPRING / INERTIA, held=False)[0]
        reading = reading + random_motion(intensity, rng) + NOISE * rng.standard_normal(TIME.size)
        drive = Input(column, values)
        runs.append(Run(f"r{place}", Record(TIME, reading), 0.0, SPRING, drive=drive))
    return Campaign("shaken", RigProperties(), SensorProperties(RATE, None, NOISE), tuple(runs))


@pytest.mark.slow
@pytest.mark.parametrize("column", ["moment_nm", "drive", "base_rad"])
def test_its_standard_deviations_are_those_of_the_scatter(column: InputColumn) -> None:
    scores = []
    for seed in range(8):
        found = identify(campaign(column, 0.5, seed), "filter_error")
        assert found.yaw_inertia is not None
        assert found.mechanical_damping is not None
        assert all(run.process_noise is not None for run in found.runs)
        scores.append((found.yaw_inertia.value - INERTIA) / found.yaw_inertia.std)
        scores.append((found.mechanical_damping.value - DAMPING) / found.mechanical_damping.std)
        assert any("N m per unit" in str(remark) for remark in found.remarks) == (column == "drive")
    # χ² of 16 values: outside this range once in ten thousand
    assert 2.5 < float(np.sum(np.square(scores))) < 47.8


def test_the_random_moment_is_found_beside_the_input() -> None:
    found = identify(campaign("moment_nm", 0.5, 3), "filter_error")
    for run in found.runs:
        assert run.process_noise is not None
        assert abs(run.process_noise.value - 0.5) < 4.0 * run.process_noise.std


@pytest.mark.parametrize("column", ["moment_nm", "drive", "base_rad"])
def test_without_a_random_moment_it_agrees_with_output_error(column: InputColumn) -> None:
    given = campaign(column, 0.0, 5)
    one, other = identify(given, "filter_error"), identify(given, "output_error")
    for name in ("yaw_inertia", "mechanical_damping"):
        a, b = getattr(one, name), getattr(other, name)
        assert abs(a.value - b.value) < 0.3 * b.std
        assert a.std == pytest.approx(b.std, rel=0.05)
    assert all(run.process_noise is None for run in one.runs)
