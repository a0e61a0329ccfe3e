"""The standard deviations that Campaign-v0 shows are honest: errors over many seeds against χ²."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from identification.estimate import PARAMETERS
from tunnel_lab.envs.campaign import CampaignEnv

SEEDS = 80
FALSE_ALARM = 1e-3
RUNS = ([0, 0, 2, 1], [0, 3, 2, 1], [1, 0, 2, 1], [1, 2, 2, 1])


def squares(claimed):
    """Squared errors of Cnβ and Cnr over their variances, shape (seeds, 2); runs are fixed beforehand."""
    env, found = CampaignEnv(expose_truth=True), []
    for seed in range(SEEDS):
        _, info = env.reset(seed=seed)
        for action in RUNS:
            env.step(np.array(action))
        truth = np.array([info["truth"][name] for name in PARAMETERS])
        error = env.known.belief.values - truth
        found.append((error**2 / np.diag(env.known.belief.covariance) / claimed**2)[:2])
    return np.array(found)


@pytest.mark.slow
def test_errors_are_as_large_as_claimed():
    low, high = chi2.ppf([FALSE_ALARM / 4.0, 1.0 - FALSE_ALARM / 4.0], SEEDS)
    total = squares(1.0).sum(axis=0)
    assert np.all((low < total) & (total < high)), total
    half = total * 4.0  # standard deviations half as large must be caught
    assert np.all(half > high)
