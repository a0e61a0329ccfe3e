"""From what sets leave in each channel to probabilities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.likelihood.residuals import CHANNELS, ChannelMisfit
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.weigh import weigh
from diagnosis.search.weights import FittedSet, log_weight, misfit_scale
from diagnosis.settings import Settings

NAMES = ("a", "b", "c", "d", "e")
COUNT = np.array([200.0, 200.0, 24.0, 24.0, 210.0, 29_000.0])
LEFT = st.tuples(*[st.floats(-50.0, 1e6)] * len(CHANNELS)).map(np.array)
SETS = st.dictionaries(
    st.sets(st.sampled_from(NAMES), min_size=1, max_size=3).map(lambda s: tuple(sorted(s))), LEFT, max_size=8
)
GAP = st.tuples(*[st.floats(1.0, 1e7)] * len(CHANNELS)).map(np.array)


def nominal(excess, motion=1e8):
    """What a nominal model leaves: χ² beyond noise by channel."""
    return ChannelMisfit(COUNT + excess, COUNT, motion)


def fitted(left, gap, numbers=0):
    """Sets by name from what they leave by channel."""
    return [FittedSet(key, float(x.sum() / gap.sum()), x, numbers) for key, x in left.items()]


def probabilities(left, gap, **kwargs):
    return {
        w.effects: w.probability
        for w in weigh(fitted(left, gap), nominal(gap, **kwargs), Settings().weighing)
    }


def channels(**values):
    """χ² by channel, the rest 0."""
    return np.array([values.get(name.replace(" ", "_"), 0.0) for name in CHANNELS])


@given(SETS, GAP)
def test_probabilities_are_probabilities_and_in_order(left, gap):
    found = weigh(fitted(left, gap), nominal(gap), Settings().weighing)
    assert sum(w.probability for w in found) == pytest.approx(1.0)
    assert all(0.0 < w.probability <= 1.0 for w in found)
    first, *others = found
    assert [w.probability for w in others] == sorted((w.probability for w in others), reverse=True)
    unknown = next(w for w in found if w.effects == UNKNOWN)
    named = [w.probability for w in found if w.effects != UNKNOWN]
    assert first is unknown if unknown.probability >= 0.5 else first.probability == max(named)
    assert {w.effects for w in found} == {*left, UNKNOWN}
    assert all(w.share >= 0.0 for w in found)


@given(SETS.filter(bool), GAP, st.data())
def test_leaving_less_in_a_channel_never_makes_a_set_less_likely_than_another(left, gap, data):
    name = data.draw(st.sampled_from(sorted(left)))
    share = data.draw(st.tuples(*[st.floats(0.0, 1.0)] * len(CHANNELS)).map(np.array))
    left = {key: np.maximum(x, 0.0) for key, x in left.items()}
    even = Settings().weighing.even_share / (len(left) + 1)  # spread over all answers, whatever they leave
    before = {key: p - even for key, p in probabilities(left, gap).items()}
    after = {key: p - even for key, p in probabilities({**left, name: left[name] * share}, gap).items()}
    for other in left:
        assert after[name] * before[other] >= before[name] * after[other] * (1.0 - 1e-9) - 1e-15


def test_an_error_of_the_frequency_does_not_hide_a_cause_in_the_damping():
    """Quadratic damping takes a quarter of the little that gravity leaves, but all that is in the damping."""
    gap = channels(damping=5e4, frequency=1.6e6)
    left = {
        ("gravity",): channels(damping=1e4, frequency=2e4, harmonics=1e4),
        ("gravity", "quadratic"): channels(damping=1e2, frequency=2e4, harmonics=1e4),
    }
    alike = {**left, ("gravity", "quadratic"): 0.75 * left[("gravity",)]}
    odds = [
        found[("gravity", "quadratic")] / found[("gravity",)]
        for found in (probabilities(left, gap), probabilities(alike, gap))
    ]
    assert odds[0] > 3.0 * odds[1]


@pytest.mark.parametrize(("channel", "named"), [("frequency", ("a",)), ("harmonics", ("a", "b"))])
def test_an_error_of_form_is_allowed_for_in_the_channel_of_the_gap(channel, named):
    """A cause may leave 1 % of the gap in its own channel, where its form differs, but not in another."""
    gap = channels(frequency=1e5)
    left = {("a",): channels(**{channel: 1e3}), ("a", "b"): channels()}
    found = probabilities(left, gap, motion=1e12)
    assert max(found, key=found.__getitem__) == named


@pytest.mark.parametrize("channel", ["zero", "harmonics"])
def test_a_misfit_of_the_zero_or_the_harmonics_does_not_hide_a_cause_in_the_damping(channel):
    """A quadratic damping closes all of its channel beside lost encoder counts that no set explains."""
    scale = misfit_scale(nominal(channels(damping=3e4, **{channel: 3e6})), Settings().weighing)
    dry = log_weight(channels(damping=3e3, **{channel: 3e6}), scale, 1, 0, Settings().weighing)
    both = log_weight(channels(**{channel: 3e6}), scale, 2, 0, Settings().weighing)
    assert both > dry


@pytest.mark.parametrize("margin", [0.9, 1.1])
def test_a_further_effect_must_close_its_price(margin):
    """In the two channels that exchange nothing, alike."""
    gap, single = np.full(6, 1e6), 1e4
    scale = misfit_scale(nominal(gap), Settings().weighing)[0]
    pair = (single + scale) * np.exp(
        -margin * Settings().weighing.set_price / Settings().weighing.steepness / 2.0
    ) - scale
    left = {key: channels(zero=x, harmonics=x) for key, x in ((("a",), single), (("a", "b"), pair))}
    found = probabilities(left, gap)
    assert (found[("a", "b")] > found[("a",)]) == (margin > 1.0)


@given(st.floats(0.0, 0.1))
def test_what_a_thousandth_of_the_motion_leaves_needs_no_cause(part):
    motion, gap = 1e12, channels(damping=1e10, zero=1e9)
    small = part * Settings().weighing.model_error ** 2 * motion
    left = {("a",): channels(zero=small), ("a", "b"): channels()}
    found = probabilities(left, gap, motion=motion)
    assert found[("a",)] > found[("a", "b")]


def test_a_small_cause_is_named_where_it_leaves_noise():
    """A gap of 0.4 thousandths of the motion, of which another effect leaves a quarter of the amplitude."""
    motion = 1e11
    gap = channels(frequency=1.6e4)
    left = {("a",): channels(), ("b",): channels(frequency=1e3), ("a", "b"): channels()}
    found = probabilities(left, gap, motion=motion)
    assert found[("a",)] > 0.75


def test_what_all_sets_leave_needs_no_cause():
    """No set closes the harmonics, so that a second effect that closes as little elsewhere is needless."""
    gap = channels(frequency=3e4, harmonics=3e3)
    left = {("a",): channels(zero=1e3, harmonics=3e3), ("a", "b"): channels(harmonics=3e3)}
    found = probabilities(left, gap, motion=1e11)
    assert found[("a",)] > found[("a", "b")]


def test_what_chance_adds_is_common_to_all_sets():
    """Chance left less than nothing; only the differences between the sets count."""
    gap = channels(damping=1e4)
    left = {("a",): channels(damping=5.0), ("b",): channels(damping=900.0)}
    lower = {key: x - channels(damping=100.0) for key, x in left.items()}
    one, other = probabilities(left, gap), probabilities(lower, gap)
    assert one[("b",)] < Settings().answer.rivals_from
    assert other[("b",)] < Settings().answer.rivals_from


def test_a_set_that_leaves_a_significant_channel_untouched_loses_to_unknown():
    gap = channels(damping=1e5, zero=1e5)
    half = probabilities({("a",): channels(damping=0.0, zero=1e5)}, gap, motion=1e7)
    whole = probabilities({("a",): channels(damping=100.0, zero=100.0)}, gap, motion=1e7)
    assert half[UNKNOWN] > 0.5
    assert whole[("a",)] > 0.9


def test_a_gross_gap_may_leave_more_than_a_small_one():
    """Real rigs of large motion leave much that is significant, though their causes are known."""
    left = channels(damping=1e4, frequency=1e4, harmonics=1e4)
    gap = channels(damping=1e6, frequency=1e7, zero=1e4, harmonics=1e5)
    small = probabilities({("a",): left}, gap, motion=1e7)
    large = probabilities({("a",): left}, 1e4 * gap, motion=1e7)
    assert large[("a",)] > small[("a",)]


def test_without_sets_the_answer_is_unknown():
    assert [w.effects for w in weigh([], nominal(channels(damping=1e4)), Settings().weighing)] == [UNKNOWN]


def test_of_two_fits_of_the_same_effects_the_better_one_counts():
    gap = channels(damping=1e4)
    worse, better = FittedSet(("a", "b"), 0.5, channels(damping=5e3)), FittedSet(("b", "a"), 0.0, channels())
    found = weigh([worse, better], nominal(gap), Settings().weighing)
    assert {w.effects: w.share for w in found if w.effects != UNKNOWN} == {("a", "b"): 0.0}
