"""The neural posterior on campaigns of the virtual rig, another simulator than that of its training."""

import numpy as np
import pytest

from identification import Status, identify
from tunnel_lab.experiments.score_grid import Cell, draw_trial
from tunnel_lab.terminal.arguments import NO_EFFECT

pytestmark = pytest.mark.slow
TRIALS = 12
NAMES = ("cn_beta", "cn_r")


def trials(effect):
    cell = Cell(
        "campaign", 1.5e-3, 10.0, 0.35, 1000.0, 0.0, wind_speed=20.0, springs=(16.0, 35.0), effect=effect
    )
    return [draw_trial(cell, 2026, number) for number in range(TRIALS)]


def errors(given, estimator):
    """Errors of every trial and coefficient, 1/rad, and whether the intervals hold the truth."""
    away, held = [], []
    for trial in given:
        found = identify(trial.campaign, estimator, throw=False)
        assert found.status is not Status.UNLIKE_TRAINING
        for name in NAMES:
            value = getattr(found, name)
            low, high = value.interval or (value.value - 1.96 * value.std, value.value + 1.96 * value.std)
            away.append(value.value - trial.truth[name])
            held.append(low <= trial.truth[name] <= high)
    return np.abs(away).reshape(-1, len(NAMES)), np.mean(held)


def test_without_an_effect_it_is_near_the_bound():
    given = trials(NO_EFFECT)
    away, held = errors(given, "neural_posterior")
    bounds = np.array([[trial.bound[name] for name in NAMES] for trial in given])
    # 24 values know a root mean square to 14 %: at most 1.3 bounds, and three of these deviations.
    assert np.sqrt(np.mean((away / bounds) ** 2)) < 1.3 * 1.42
    assert held > 0.8


@pytest.mark.parametrize(
    "effect", ["cubic_stiffness:coefficient=-0.02", "coulomb_friction:friction_moment=0.001"]
)
def test_with_an_effect_its_median_error_is_at_most_half_of_output_errors(effect):
    given = trials(effect)
    plain, _ = errors(given, "output_error")
    neural, held = errors(given, "neural_posterior")
    place = 0 if effect.startswith("cubic") else 1
    assert np.median(neural[:, place]) < 0.5 * np.median(plain[:, place])
    assert held > 0.72  # nine tenths, less three deviations of 24 values
