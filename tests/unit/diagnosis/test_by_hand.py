"""Causes chosen by hand. Truth: the effect that a simulated campaign has, and the diagnosis of the same set."""

from __future__ import annotations

import pytest

from diagnosis.by_hand import ByHand
from tests.support.gap_campaigns import campaign
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.errors import TunnelError

MOMENT = 0.01


@pytest.fixture(scope="module")
def hand() -> ByHand:
    return ByHand(campaign(effect_class("coulomb_friction")(friction_moment=MOMENT)))


def test_the_true_cause_closes_the_gap_on_runs_held_out(hand: ByHand) -> None:
    found = hand.closure(["coulomb_friction"])
    given = found.parameters["friction_moment"]
    assert found.before > 1.0
    assert found.closed > 0.99
    assert given.unit == "N m"
    assert given.std is not None
    assert given.value == pytest.approx(MOMENT, abs=5.0 * given.std)
    assert found.held_out == "on held-out runs"


def test_no_cause_or_another_closes_less(hand: ByHand) -> None:
    nothing, other = hand.closure([]), hand.closure(["cubic_stiffness"])
    assert nothing.before == nothing.after == other.before
    assert nothing.closed == 0.0
    assert other.closed < 0.5


def test_switching_on_and_off_in_any_order_gives_the_same(hand: ByHand) -> None:
    both = hand.closure(["quadratic_damping", "coulomb_friction"])
    assert both.effects == ("coulomb_friction", "quadratic_damping")
    assert set(both.parameters) >= {"coulomb_friction.friction_moment", "quadratic_damping.coefficient"}
    fresh = ByHand(campaign(effect_class("coulomb_friction")(friction_moment=MOMENT)))
    fresh.closure(["quadratic_damping", "coulomb_friction"])
    assert fresh.closure(["coulomb_friction"]).after == pytest.approx(
        hand.closure(["coulomb_friction"]).after, abs=0.01
    )


def test_the_run_that_would_distinguish_two_causes(hand: ByHand) -> None:
    found = hand.next_run(["coulomb_friction"], ["quadratic_damping"])
    assert found is not None
    assert found.separation > 10.0
    assert found.duration > 1.0


def test_a_cause_that_the_runs_cannot_show_is_refused() -> None:
    from dataclasses import replace

    data = campaign()
    still = replace(data, runs=tuple(run for run in data.runs if run.wind_speed == 0.0))
    with pytest.raises(TunnelError, match="wind speed offset cannot be fitted"):
        ByHand(still).closure(["wind_speed_offset"])
