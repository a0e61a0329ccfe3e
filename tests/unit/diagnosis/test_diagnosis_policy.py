"""The weights are those of the formula in decision 0007, written out here."""

from math import exp, log

import numpy as np
import pytest

from diagnosis import policy
from diagnosis.likelihood.residuals import ChannelMisfit
from diagnosis.search.weigh import FittedSet, weigh

COUNT = np.array([100.0, 100.0, 10.0, 10.0, 110.0, 10_000.0])
GAP = np.array([3e5, 1e3, 2e3, 50.0, 4e4, 1e4])
SETS = {
    ("a",): (np.array([2e3, 100.0, 40.0, -5.0, 4e4, 200.0]), 0),
    ("a", "b"): (np.array([1e3, 80.0, 30.0, -6.0, 300.0, -80.0]), 0),
    ("b", "c"): (np.array([500.0, 80.0, 30.0, 4.0, 100.0, 100.0]), 2),
}


def misfit(left, scales, leaking=6):
    """Sum of logarithms over the channels, with the leak between the first few of them."""
    above = [max(x, 0.0) for x in left]
    leaked = [sum(above[:leaking]) - x for x in above[:leaking]] + [0.0] * (6 - leaking)
    return sum(log(1.0 + (x + policy.LEAK * y) / s) for x, y, s in zip(above, leaked, scales, strict=True))


@pytest.mark.parametrize("motion", [4e7, 4e10])
def test_the_probabilities_are_those_of_the_decision(motion):
    least = [min(0.0, *(left[c] for left, _ in SETS.values())) for c in range(6)]
    common = max(min(left[c] for left, _ in SETS.values()) for c in range(6))
    error = min(max(policy.FORM_ERROR**2 * sum(GAP), common), policy.MODEL_ERROR**2 * motion)
    scale = [policy.NEEDLESS_CHI2 + error] * 6
    weights = {
        key: exp(
            -policy.STEEPNESS * misfit(left - least, scale, leaking=4)  # damping and frequency, and of runs
            - policy.SET_PRICE * len(key)
            - policy.FORM_PRICE * numbers
        )
        for key, (left, numbers) in SETS.items()
    }
    by_chance = [policy.CHANCE_STDS * (2.0 * n) ** 0.5 + error for n in COUNT]
    gap = misfit(GAP, by_chance)
    odds = {}
    for key, (left, _) in SETS.items():
        remains = misfit(left, by_chance)
        closed = log(max(1.0 - remains / gap, 0.0) + 0.02)
        odds[key] = exp(
            policy.UNKNOWN_AT + policy.UNKNOWN_GAP * gap - policy.UNKNOWN_LEFT * (log(1.0 + remains) - closed)
        )
    total = sum(weights.values())
    against = sum(weights[key] * odds[key] for key in SETS) / total
    even, own = policy.EVEN_SHARE / 4, 1.0 - policy.EVEN_SHARE
    expected = {
        key: own * against / (1.0 + against) * weight / total + even for key, weight in weights.items()
    }
    expected[("unknown",)] = own / (1.0 + against) + even
    sets = [FittedSet(key, 0.1, left, numbers) for key, (left, numbers) in SETS.items()]
    found = weigh(sets, ChannelMisfit(COUNT + GAP, COUNT, motion))
    assert {answer.effects: answer.probability for answer in found} == pytest.approx(expected)
