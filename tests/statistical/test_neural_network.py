"""The networks' intervals and coverage, the paper's claim on two kinds of rig, and planted faults."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom, chi2

from docs.studies.reference_campaigns import reference_campaigns, verdict
from identification import identify
from tests.reference.free_decays import damped_cosine
from tunnel_lab.paper.networks import CONVENTIONAL, NETWORK, closeness
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

TRIALS, NOISE, OMEGA = 300, 5e-4, 12.5
FALSE_ALARM = 1e-3
# What the propagation leaves out (second order, the noise's own estimate) may cost this share of a deviation.
TOLERANCE = 1.1
pytestmark = pytest.mark.slow


@cache
def trials(zeta):
    """Errors of ζ over the deviation claimed: of the run and of its first window, shape (TRIALS, 2)."""
    rng = np.random.default_rng(21)
    time = np.arange(6000) / 1000.0
    clean = damped_cosine(time, 2.0 * zeta * OMEGA, OMEGA**2, 0.35, 0.0)
    found = []
    for _ in range(TRIALS):
        yaw = clean + NOISE * rng.standard_normal(time.size)
        run = Run("r", Record(time, yaw), 0.0)
        sensor = SensorProperties(1000.0, None, NOISE)
        (one,) = identify(Campaign("c", RigProperties(), sensor, (run,)), NETWORK).runs
        found.append([(q.value - zeta) / q.std for q in (one.zeta, one.windows[0].zeta)])
    return np.array(found)


def objections(scores):
    """What is wrong with scores that should be standard normal; nothing, if nothing is."""
    low, high = chi2.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], scores.size) / scores.size
    power = float(np.mean(scores**2))
    found = []
    if not low / TOLERANCE**2 <= power <= high * TOLERANCE**2:
        found.append(f"mean square {power:.2f}")
    share = int(np.sum(np.abs(scores) <= 1.959964))
    if share < binom.ppf(FALSE_ALARM, scores.size, 0.95 - 0.03):
        found.append(f"95 % intervals cover {share} of {scores.size}")
    return found


@pytest.mark.parametrize("zeta", [0.005, 0.03, 0.2])
def test_intervals_hold_for_runs_and_for_windows(zeta):
    scores = trials(zeta)
    assert objections(scores[:, 0]) == []
    assert objections(scores[:, 1]) == []


@pytest.mark.parametrize("factor", [1.4, 0.7])
def test_planted_overconfidence_and_timidity_are_caught(factor):
    assert objections(factor * trials(0.03)[:, 0])


def test_closer_than_the_conventional_method_on_softening_rigs_and_not_on_linear_ones():
    # Data of the reference integrator. A coin would reach 18 of 24 once in 88.
    linear = [closeness(*pair) for pair in reference_campaigns(8, 32, softening=False)]
    softening = [closeness(*pair) for pair in reference_campaigns(24, 33, softening=True)]
    for quantity in ("cn_beta", "cn_r", "response"):
        on_linear, soft = verdict(linear, quantity), verdict(softening, quantity)
        assert on_linear.total == 8
        assert on_linear.closer <= 1
        assert on_linear.rms[NETWORK] > on_linear.rms[CONVENTIONAL]
        assert soft.total == 24
        assert soft.closer >= 18
        assert soft.rms[NETWORK] < soft.rms[CONVENTIONAL]
