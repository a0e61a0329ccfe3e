"""Runs are left out as asked. Truth: the same campaign without their files, and a record that is no decay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose
from identification import identify
from identification.status import Outcome
from tests.reference.free_decays import Setting, campaign
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")


@pytest.fixture(scope="module")
def spoilt() -> tuple[Campaign, Campaign]:
    """Two springs, wind off and on, without the last run, and with it: noise of half a radian."""
    settings = [Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 15.0)]
    settings.append(Setting(16.12, 15.0))
    rng = np.random.default_rng(8)
    whole = campaign(settings, duration=5.0, rate=500.0, noise=5e-4, rng=rng)
    last = whole.runs[-1]
    noisy = last.record.yaw_rad + 0.5 * rng.standard_normal(last.record.yaw_rad.size)
    bad = replace(last, record=Record(last.record.time_s, noisy))
    return replace(whole, runs=whole.runs[:-1]), replace(whole, runs=(*whole.runs[:-1], bad))


def test_the_others_remain_in_their_order(spoilt: tuple[Campaign, Campaign]) -> None:
    whole = spoilt[1]
    ids = [run.id for run in whole.runs]
    assert [run.id for run in whole.without((ids[2], ids[0])).runs] == [ids[1], *ids[3:]]
    assert whole.without(()) is whole


@pytest.mark.parametrize("function", [identify, diagnose])
def test_a_run_that_is_not_there_and_all_runs_are_refused_in_a_line(
    spoilt: tuple[Campaign, Campaign], function
) -> None:
    whole = spoilt[1]
    last = whole.runs[-1].id
    with pytest.raises(TunnelError, match=f"no run '{last}0' to leave out; did you mean '{last}'"):
        function(whole, leave_out=(f"{last}0",))
    with pytest.raises(TunnelError, match="every run is left out; leave out fewer"):
        function(whole, leave_out=[run.id for run in whole.runs])


def test_an_estimate_is_that_of_the_other_runs_and_says_so(spoilt: tuple[Campaign, Campaign]) -> None:
    good, whole = spoilt
    last = whole.runs[-1].id
    found, expected = identify(whole, leave_out=(last,)), identify(good)
    assert found.to_json_dict()["cn_beta"] == expected.to_json_dict()["cn_beta"]
    assert identify(whole).cn_beta != expected.cn_beta
    first, *others = found.remarks
    assert (first.outcome, first.runs, first.what) == (Outcome.LEFT_OUT, (last,), "left out on request")
    assert tuple(others) == expected.remarks


def test_a_diagnosis_is_that_of_the_other_runs_and_says_so(spoilt: tuple[Campaign, Campaign]) -> None:
    good, whole = spoilt
    last, kinds = whole.runs[-1].id, (effect_class("coulomb_friction"),)
    answer = diagnose(whole, leave_out=(last,), kinds=kinds)
    found = answer.to_json_dict()
    expected = diagnose(good, kinds=kinds).to_json_dict()
    assert found["provenance"].pop("left_out") == [last]
    assert expected["provenance"].pop("left_out") == []
    first, *others = found["remarks"]
    assert (first["outcome"], first["runs"], first["what"]) == ("left out", [last], "left out on request")
    for document in (found, expected):
        document.pop("seconds")
    assert found | {"remarks": others} == expected
    shown = str(answer)
    assert f"run {last}: left out on request" in shown
