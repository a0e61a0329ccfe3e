"""Springs that scatter from run to run, driven and free."""

import numpy as np
import pytest

from identification import identify
from identification.signal.forcing import driven_rows
from tests.reference.free_decays import damped_cosine
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record

TIME = np.arange(1000) / 100.0
INERTIA, DAMPING, NOISE = 0.1, 0.1, 5e-4
VALUES = np.convolve(np.random.default_rng(1).standard_normal(TIME.size), np.ones(6) / 6.0, "same")


def motion(spring: float, column: InputColumn | None) -> Array:
    rate, stiffness = 0.5 * DAMPING / INERTIA, spring / INERTIA
    if column is None:
        return damped_cosine(TIME, 2.0 * rate, stiffness, 0.2, 0.0)
    return np.asarray(driven_rows(TIME, VALUES, rate, stiffness, held=True)[0] / INERTIA)


@pytest.mark.parametrize("estimator", ["output_error", "matrix_pencil"])
def test_driven_runs_carry_the_scatter_of_their_springs(estimator: str) -> None:
    """Springs clamped anew, 0.4 % each, in runs of two springs, driven by a moment or released."""
    rng, sensor = np.random.default_rng(6), SensorProperties(100.0, None, NOISE)
    column: InputColumn | None = "moment_nm" if estimator == "output_error" else None
    runs = []
    for place, spring in enumerate((16.0, 36.0) * 4):
        own = motion(spring * (1.0 + 0.004 * rng.standard_normal()), column)
        record = Record(TIME, own + NOISE * rng.standard_normal(TIME.size))
        drive = None if column is None else Input(column, VALUES, "zero")
        release = 0.2 if column is None else None
        runs.append(Run(f"r{place}", record, 0.0, spring, release_angle=release, drive=drive))
    estimate = identify(Campaign("scattering", RigProperties(), sensor, tuple(runs)), estimator)
    assert estimate.repeatability is not None
    assert estimate.repeatability.spring_stiffness is not None
    low, high = estimate.repeatability.spring_stiffness.interval or (0.0, 0.0)
    assert low < 0.004 < high
    assert estimate.yaw_inertia is not None
    assert abs(estimate.yaw_inertia.value - INERTIA) < 3.5 * estimate.yaw_inertia.std < 3.5 * 0.004 * INERTIA
