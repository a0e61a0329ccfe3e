"""Every estimator on campaigns that no rig would give: a status or one line of refusal, and finite numbers only."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
import pytest

from identification import identify
from identification.estimators import ALL_ESTIMATORS, make_estimator
from identification.status import Status
from tests.support.degenerate_campaigns import degenerate_campaign, same_runs
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

INERTIA = 0.11
_RATE = 0.08
# Seeds that raised something else, or gave NaN, when the generator was written.
SEEDS = (5, 11, 16, 25, 47, 62, 66)


def _swing(stiffness: float, seed: int, *, clip: float = np.inf, amplitude: float = 0.3) -> Record:
    time = np.arange(2000) / 100.0
    omega = np.sqrt(stiffness / INERTIA - _RATE**2)
    angle = amplitude * np.exp(-_RATE * time) * np.cos(omega * time)
    noise = 5e-4 * np.random.default_rng(seed).standard_normal(time.size)
    return Record(time, np.clip(angle, -clip, clip) + noise)


def _campaign(*runs: Run) -> Campaign:
    return Campaign("springs", RigProperties(None, 0.036, 0.625), SensorProperties(), runs)


def _stds(data: object) -> Iterator[float]:
    if isinstance(data, dict):
        if "std" in data and "value" in data:
            yield data["std"]
        for value in data.values():
            yield from _stds(value)
    elif isinstance(data, list):
        for value in data:
            yield from _stds(value)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("estimator", [name for name in ALL_ESTIMATORS if name != "bayesian"])
def test_a_degenerate_campaign_gives_finite_numbers_or_a_refusal(seed, estimator):
    try:
        found = identify(degenerate_campaign(seed), estimator, throw=False).to_json_dict()
    except TunnelError:
        return
    json.dumps(found, allow_nan=False)
    assert min(_stds(found), default=1.0) > 0.0


@pytest.mark.parametrize("estimator", ALL_ESTIMATORS)
def test_runs_that_are_one_file_are_no_traceback(estimator):
    springs = (16.12, 44.84, 16.12)
    runs = tuple(Run(f"r{k}", _swing(16.12, 0), 0.0, spring) for k, spring in enumerate(springs))
    with pytest.raises(TunnelError, match="the same samples with different springs"):
        identify(_campaign(*runs), estimator, throw=False)
    found = make_estimator(estimator).estimate(_campaign(*runs))
    json.dumps(found.to_json_dict(), allow_nan=False)
    same = same_runs(_campaign(*runs), 3)
    assert identify(same, estimator, throw=False).yaw_inertia is not None


@pytest.mark.parametrize("estimator", ["output_error", "conventional", "matrix_pencil"])
@pytest.mark.parametrize("apart", [1e-9, 1e-6, 1e-4])
def test_springs_hardly_apart_are_one(estimator, apart):
    runs = [Run(f"r{k}", _swing(16.12, k), 0.0, 16.12 * (1.0 + apart * k)) for k in range(2)]
    found = identify(_campaign(*runs), estimator, throw=False)
    assert found.wind_off_intercept is None
    assert found.wind_off_inertia is not None
    assert abs(found.wind_off_inertia.value - INERTIA) < 5.0 * found.wind_off_inertia.std


@pytest.mark.parametrize("estimator", ["output_error", "conventional", "matrix_pencil"])
def test_an_inertia_is_never_negative(estimator):
    runs = [Run("soft", _swing(44.84, 0), 0.0, 16.12), Run("stiff", _swing(16.12, 1), 0.0, 44.84)]
    swapped = _campaign(*runs, Run("on", _swing(40.0, 2), 20.0, 16.12, 1.2))
    with pytest.raises(TunnelError, match="contradict the frequencies"):
        identify(swapped, estimator, throw=False)
    found = make_estimator(estimator).estimate(swapped)
    for inertia in (found.yaw_inertia, found.wind_off_inertia):
        assert inertia is None or inertia.value > 0.0


@pytest.mark.parametrize("estimator", [name for name in ALL_ESTIMATORS if name != "filter_error"])
def test_a_clipped_record_departs_for_every_estimator(estimator):
    clipped = Run("clipped", _swing(16.12, 0, clip=0.29), 0.0, 16.12)
    found = identify(_campaign(clipped, Run("whole", _swing(16.12, 1), 0.0, 16.12)), estimator, throw=False)
    assert Status.MODEL_DEPARTS in found.statuses
    assert Status.MODEL_DEPARTS in found.runs[0].statuses
    assert Status.MODEL_DEPARTS not in found.runs[1].statuses
