"""The weights are those of the formula in decision 0007, written out here with its numbers."""

import pytest

from diagnosis.attribution.decide import weigh

TEXTBOOK, EXACT = ("quadratic_damping",), ("spring_miscalibration",)
PAIR = ("free_play", "quadratic_damping")


def weight(share, misfit, excess, chance, effects=1, forms=0):
    delta = misfit * min(1.0, 300.0 / excess) + 2.0 * chance
    beyond = ((0.2 + delta) / (max(share, 0.2) + delta)) ** 6
    return delta**2 * (share + delta) ** -3 * beyond * 0.44 ** (3 * (effects - 1)) * 0.8 ** (3 * forms)


@pytest.mark.parametrize("excess", [5.0, 4000.0])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
def test_the_probabilities_are_those_of_the_decision(share, excess):
    chance = 0.002
    found = weigh([(TEXTBOOK, share), (EXACT, 0.3), (PAIR, 0.05)], chance, excess, numbers={PAIR: 2})
    weights = {
        TEXTBOOK: weight(share, 0.005, excess, chance),
        EXACT: weight(0.3, 0.001, excess, chance),
        PAIR: weight(0.05, 0.005, excess, chance, effects=2, forms=2),
    }
    of_unknown = [weight(0.2 * 0.7 ** (n - 1), 0.005, excess, chance, effects=n) for n in (1, 1, 2)]
    odds = sum(value / other for value, other in zip(weights.values(), of_unknown, strict=True))
    share_known = odds / (1.0 + odds) / sum(weights.values())
    expected = {names: 0.97 * share_known * value + 0.03 / 4 for names, value in weights.items()}
    expected[("unknown",)] = 0.97 / (1.0 + odds) + 0.03 / 4
    assert {answer.effects: answer.probability for answer in found} == pytest.approx(expected)
