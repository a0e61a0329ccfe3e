"""The Cramér–Rao bound of driven runs against the scatter of estimates from simulated records."""

from dataclasses import replace

import numpy as np
import pytest

from identification import identify
from identification.signal.driven import driven_rows
from identification.uncertainty.cramer_rao import CampaignBound, campaign_bound
from tests.marks import slow
from tests.reference.free_decays import damped_cosine
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.inputs import InputColumn
from tunnel_sim.vocabulary.record import Array, Record

TIME = np.arange(1000) / 100.0
INERTIA, DAMPING, GAIN, NOISE, SEEDS = 0.1, 0.1, 2.5, 5e-4, 30
VALUES = np.convolve(np.random.default_rng(1).standard_normal(TIME.size), np.ones(6) / 6.0, "same")


def motion(spring: float, column: InputColumn | None) -> Array:
    rate, stiffness = 0.5 * DAMPING / INERTIA, spring / INERTIA
    if column is None:
        return damped_cosine(TIME, 2.0 * rate, stiffness, 0.2, 0.0)
    factor = {"moment_nm": 1.0, "drive": GAIN, "base_rad": spring}[column] / INERTIA
    return np.asarray(factor * driven_rows(TIME, VALUES, rate, stiffness, held=True)[0])


CAMPAIGNS: dict[str, tuple[tuple[float, InputColumn | None], ...]] = {
    "known moment": ((16.0, "moment_nm"),),
    "unknown gain": ((16.0, "drive"), (36.0, "drive")),
    "no spring": ((0.0, "moment_nm"),),
    "mixed": ((0.0, "drive"), (16.0, "base_rad"), (36.0, None)),
}


def campaign(kind: str) -> Campaign:
    runs = tuple(
        Run(
            f"r{i}",
            Record(TIME, motion(spring, column)),
            0.0,
            spring,
            release_angle=0.2 if column is None else None,
            drive=None if column is None else Drive(column, VALUES, "zero"),
        )
        for i, (spring, column) in enumerate(CAMPAIGNS[kind])
    )
    zero = "per_run" if kind == "mixed" else "common"
    return Campaign(kind, RigProperties(), SensorProperties(100.0, None, NOISE, zero=zero), runs)


def bound(given: Campaign) -> CampaignBound:
    truth = {"cn_beta": 0.0, "cn_r": 0.0, "yaw_inertia": INERTIA, "mechanical_damping": DAMPING}
    return campaign_bound(given, **truth, noise_std=NOISE, drive_gain=GAIN)


@pytest.mark.parametrize("kind", [slow("unknown gain"), "mixed", slow("known moment"), slow("no spring")])
def test_estimates_scatter_as_the_bound_says(kind: str) -> None:
    given = campaign(kind)
    least = bound(given)
    covariance = np.array(least.covariance)
    assert least.parameters == ("yaw_inertia", "mechanical_damping")
    distances = []
    for seed in range(SEEDS):
        rng = np.random.default_rng([seed, 7])
        runs = tuple(
            replace(run, record=Record(TIME, run.record.yaw_rad + NOISE * rng.standard_normal(TIME.size)))
            for run in given.runs
        )
        found = identify(replace(given, runs=runs))
        assert found.yaw_inertia is not None
        assert found.mechanical_damping is not None
        error = np.array([found.yaw_inertia.value - INERTIA, found.mechanical_damping.value - DAMPING])
        distances.append(error @ np.linalg.solve(covariance, error))
        assert np.diag(found.covariance_matrix) == pytest.approx(np.diag(covariance), rel=0.2)
    # χ² of 60 values: outside this range once in ten thousand
    assert 26.4 < float(np.sum(distances)) < 112.3


def test_a_gain_that_must_be_found_costs_information() -> None:
    given = campaign("unknown gain")
    stated = tuple(replace(run, drive=Drive("drive", VALUES, "zero", GAIN)) for run in given.runs)
    assert bound(replace(given, runs=stated)).std("yaw_inertia") < bound(given).std("yaw_inertia")


@pytest.mark.parametrize("estimator", ["output_error", "matrix_pencil"])
def test_driven_runs_carry_the_scatter_of_their_springs(estimator: str) -> None:
    """Springs clamped anew, 0.4 % each, in runs of two springs, driven by a moment or released."""
    rng = np.random.default_rng(6)
    column: InputColumn | None = "moment_nm" if estimator == "output_error" else None
    given = replace(campaign("unknown gain"), name="scattering")
    runs = []
    for place, spring in enumerate((16.0, 36.0) * 4):
        own = motion(spring * (1.0 + 0.004 * rng.standard_normal()), column)
        record = Record(TIME, own + NOISE * rng.standard_normal(TIME.size))
        drive = None if column is None else Drive(column, VALUES, "zero")
        release = 0.2 if column is None else None
        runs.append(Run(f"r{place}", record, 0.0, spring, release_angle=release, drive=drive))
    estimate = identify(replace(given, runs=tuple(runs)), estimator)
    assert estimate.repeatability is not None
    assert estimate.repeatability.spring_stiffness is not None
    low, high = estimate.repeatability.spring_stiffness.interval or (0.0, 0.0)
    assert low < 0.004 < high
    assert estimate.yaw_inertia is not None
    assert abs(estimate.yaw_inertia.value - INERTIA) < 3.5 * estimate.yaw_inertia.std < 3.5 * 0.004 * INERTIA
