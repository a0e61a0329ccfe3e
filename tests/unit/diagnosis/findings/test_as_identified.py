"""Without a cause, or with scatter alone, a diagnosis states the numbers of `identify`, to the last digit."""

from dataclasses import replace

import pytest

from diagnosis import diagnose
from identification import identify
from tests.support.gap_campaigns import campaign
from tests.support.scattered_runs import SCATTERED, scattered
from tunnel_sim.effects import effect_class

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

KINDS = [effect_class(name) for name in SCATTERED]


@pytest.mark.parametrize("scatters", [False, True])
def test_one_number_has_one_value(scatters):
    data = scattered() if scatters else campaign(duration=6.0)
    data = replace(data, runs=data.runs[:9])
    found, estimate = diagnose(data, kinds=KINDS, rivals=()), identify(data)
    assert set(found.causes) <= set(SCATTERED)
    assert bool(found.causes) == scatters
    for name in ("cn_beta", "cn_r"):
        ours, theirs = found.coefficients.after[name], getattr(estimate, name)
        assert ours.value == pytest.approx(theirs.value, rel=1e-12)
        assert ours.std == pytest.approx(theirs.std, rel=1e-12)
        assert sum(ours.shares.values()) == pytest.approx(1.0)
        assert (ours.shares["scatter"] > 0.5) == scatters
