"""The weights are those of the formula in decision 0007, written out here with its numbers."""

import pytest

from diagnosis.attribution.decide import weigh

TEXTBOOK, EXACT = ("quadratic_damping",), ("spring_miscalibration",)
PAIR = ("free_play", "quadratic_damping")


def weight(share, misfit, excess, chance, effects=1, forms=0):
    """Of a set, ``chance`` being what chance makes of its share."""
    delta = misfit * min(1.0, 300.0 / excess) + chance
    beyond = ((0.2 + delta) / (max(share, 0.2) + delta)) ** 6
    return delta**2 * (share + delta) ** -3 * beyond * 0.44 ** (3 * (effects - 1)) * 0.8 ** (3 * forms)


@pytest.mark.parametrize("excess", [5.0, 4000.0])
@pytest.mark.parametrize("share", [-0.01, 0.0, 0.1, 0.5])
def test_the_probabilities_are_those_of_the_decision(share, excess):
    count = 20_000
    chance, needless = (2.0 / count) ** 0.5 / excess, 20.0 / (count * excess)
    sets = {TEXTBOOK: (share, 0.005, 1, 0), EXACT: (0.3, 0.001, 1, 0), PAIR: (0.05, 0.005, 2, 2)}
    found = weigh([(names, left) for names, (left, *_) in sets.items()], chance, excess, numbers={PAIR: 2})
    weights = {
        names: weight(left - min(share, 0.0), misfit, excess, needless, *numbers)
        for names, (left, misfit, *numbers) in sets.items()
    }
    odds = sum(
        weight(max(left, 0.0), misfit, excess, 2.0 * chance, effects, forms)
        / weight(0.2 * 0.7 ** (effects - 1), 0.005, excess, 2.0 * chance, effects)
        for left, misfit, effects, forms in sets.values()
    )
    share_known = odds / (1.0 + odds) / sum(weights.values())
    expected = {names: 0.97 * share_known * value + 0.03 / 4 for names, value in weights.items()}
    expected[("unknown",)] = 0.97 / (1.0 + odds) + 0.03 / 4
    assert {answer.effects: answer.probability for answer in found} == pytest.approx(expected)
