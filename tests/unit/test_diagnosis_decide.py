"""From shares of the gap to probabilities."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.attribution.decide import UNKNOWN, form_floor, weigh
from diagnosis.policy import (
    EVEN_SHARE,
    FORM_MISFIT,
    FORM_MISFIT_UP_TO,
    NEEDLESS_CHI2,
    PAIR_SHARE,
    PLACE_WRONG,
    RIVAL_PROBABILITY,
    UNKNOWN_FURTHER,
    UNKNOWN_SHARE,
)

NAMES = ("a", "b", "c", "d", "e")
SHARES = st.floats(0.0, 1.5)
ANSWERS = st.dictionaries(
    st.sets(st.sampled_from(NAMES), min_size=1, max_size=2).map(lambda s: tuple(sorted(s))),
    SHARES,
    max_size=8,
)
CHANCE = st.floats(0.0, 0.5)
EXCESS = st.floats(1e-3, 1e6)


@given(ANSWERS, CHANCE, EXCESS)
def test_probabilities_are_probabilities_and_in_order(answers, chance, excess):
    found = weigh(list(answers.items()), chance, excess)
    assert sum(w.probability for w in found) == pytest.approx(1.0)
    assert all(0.0 < w.probability <= 1.0 for w in found)
    assert [w.probability for w in found] == sorted((w.probability for w in found), reverse=True)
    assert {w.effects for w in found} == {*answers, ("unknown",)}


@given(ANSWERS.filter(bool), CHANCE, EXCESS, st.data())
def test_closing_more_never_makes_an_answer_less_likely(answers, chance, excess, data):
    name = data.draw(st.sampled_from(sorted(answers)))
    better = {**answers, name: answers[name] * data.draw(st.floats(0.0, 1.0))}

    def probability(given_answers):
        found = weigh(list(given_answers.items()), chance, excess)
        return next(w.probability for w in found if w.effects == name)

    assert probability(better) >= probability(answers) * (1.0 - 1e-12)


@given(st.floats(0.0, UNKNOWN_SHARE), st.floats(0.0, UNKNOWN_SHARE), CHANCE, EXCESS)
def test_two_names_must_leave_less_than_the_stated_part_of_what_one_leaves(single, pair, chance, excess):
    floor = form_floor(excess) + NEEDLESS_CHI2 * chance**2 * excess / 2.0
    found = {w.effects: w.probability for w in weigh([(("a",), single), (("a", "b"), pair)], chance, excess)}
    margin = (pair + floor) / (PAIR_SHARE * (single + floor))
    if abs(margin - 1.0) > 1e-9:
        assert (found[("a", "b")] > found[("a",)]) == (margin < 1.0)


@given(SHARES, CHANCE, EXCESS)
def test_a_cause_that_leaves_more_than_its_share_loses_to_unknown(share, chance, excess):
    found = {w.effects: w.probability for w in weigh([(("a",), share)], chance, excess)}
    if abs(share - UNKNOWN_SHARE) > 1e-9:
        assert (found[("a",)] > found[("unknown",)]) == (share < UNKNOWN_SHARE)


@given(st.integers(1, 5), SHARES, CHANCE, EXCESS)
def test_unknown_may_leave_less_where_more_effects_are_tried(count, share, chance, excess):
    names = NAMES[:count]
    found = {w.effects: w.probability for w in weigh([(names, share)], chance, excess)}
    limit = UNKNOWN_SHARE * UNKNOWN_FURTHER ** (count - 1)
    if abs(share - limit) > 1e-9:
        assert (found[names] > found[("unknown",)]) == (share < limit)


def test_an_outsider_that_closes_more_weighs_as_one_effect():
    sets = [(NAMES[:4], 0.03)]
    assert weigh(sets, 1e-4, 20.0)[0].effects == NAMES[:4]
    assert weigh(sets, 1e-4, 20.0, outside=0.03)[0].effects == ("unknown",)


def test_nothing_weighed_leaves_unknown():
    (only,) = weigh([], 0.01, 5.0)
    assert (only.effects, only.probability) == (("unknown",), 1.0)


def test_of_two_fits_of_the_same_effects_the_better_counts():
    one = weigh([(("b", "a"), 0.2), (("a", "b"), 0.05)], 0.0, 5.0)
    other = weigh([(("a", "b"), 0.05)], 0.0, 5.0)
    assert {w.effects: w.share for w in one} == {w.effects: w.share for w in other}
    assert one[0].probability == pytest.approx(other[0].probability)


def test_shares_below_zero_count_as_nothing_left():
    one, other = (weigh([(("a",), share)], 0.0, 5.0)[0] for share in (-0.2, 0.0))
    assert (one.share, one.probability) == (0.0, pytest.approx(other.probability))


def test_what_chance_adds_to_the_shares_is_common_to_all_sets():
    shares = {("a",): 0.02, ("a", "b"): -0.005, ("c",): 0.4}
    high, low = (
        weigh([(names, share - by) for names, share in shares.items()], 0.004, 5.0) for by in (0.0, 0.01)
    )
    assert high[0].effects == low[0].effects == ("a", "b")
    odds = [found[0].probability / found[1].probability for found in (high, low)]
    assert odds[0] == pytest.approx(odds[1], rel=0.01)


def test_a_difference_within_the_chance_of_a_share_counts():
    """A second effect may lower χ² by 280, though it lowers the share by 1.4 standard deviations only."""
    excess, count = 1.0, 20_000
    chance = (2.0 / count) ** 0.5 / excess
    single, pair = 0.7 * chance, -0.7 * chance
    assert (single - pair) * excess * count == pytest.approx(280.0)
    assert weigh([(("a",), single), (("a", "b"), pair)], chance, excess)[0].effects == ("a", "b")


def test_rivals_that_close_alike_are_as_likely():
    found = weigh([(("a",), 0.02), (("b",), 0.02), (("c",), 0.9)], 0.0, 5.0)
    assert found[0].probability == pytest.approx(found[1].probability)
    assert found[1].probability > RIVAL_PROBABILITY > found[-1].probability


def test_chance_draws_answers_together():
    """Where a share is known only roughly, being ahead says less."""
    shares = [(("a",), 0.01), (("b",), 0.05)]
    sure, unsure = (weigh(shares, chance, 5.0)[0].probability for chance in (0.001, 0.2))
    assert sure > unsure > 1.0 / 3.0


def test_the_share_forgiven_stops_growing_with_the_gap():
    assert form_floor(1.0) == form_floor(FORM_MISFIT_UP_TO) == FORM_MISFIT
    assert 10.0 * FORM_MISFIT_UP_TO * form_floor(10.0 * FORM_MISFIT_UP_TO) == pytest.approx(
        FORM_MISFIT * FORM_MISFIT_UP_TO
    )


def test_many_that_close_little_do_not_outweigh_unknown():
    found = weigh([((f"effect {i}",), 0.95) for i in range(23)], 0.001, 20.0)
    assert found[0].effects == ("unknown",)
    assert found[0].probability > 0.95


def test_names_that_act_elsewhere_than_the_residuals_show_lose_weight():
    shares = [(("coulomb_friction",), 0.01), (("cubic_stiffness",), 0.01)]
    even, damping = (
        {w.effects: w.probability for w in weigh(shares, 0.0, 5.0, place=place)}
        for place in (None, "damping")
    )
    assert even[("coulomb_friction",)] == pytest.approx(even[("cubic_stiffness",)])
    odds = (damping[("coulomb_friction",)] - EVEN_SHARE / 3) / (
        damping[("cubic_stiffness",)] - EVEN_SHARE / 3
    )
    assert odds == pytest.approx((1.0 - PLACE_WRONG) / PLACE_WRONG)
    alone = [
        {w.effects: w.probability for w in weigh(shares[1:], 0.0, 5.0, place=p)}[UNKNOWN]
        for p in (None, "damping")
    ]
    assert alone[1] > 5.0 * (alone[0] - EVEN_SHARE / 2)


def test_a_small_effect_beside_the_main_one_does_not_make_it_agree():
    shares = [(("coulomb_friction",), 0.02), (("asymmetric_stiffness", "coulomb_friction"), 0.015)]
    odds = []
    for place in (None, "stiffness"):
        found = {w.effects: w.probability for w in weigh(shares, 0.0, 5.0, place=place)}
        odds.append((found[shares[0][0]] - EVEN_SHARE / 3) / (found[shares[1][0]] - EVEN_SHARE / 3))
    assert odds[0] == pytest.approx(odds[1])
