"""A spoiled campaign is refused or noted with the run to look at; a good one goes through as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from identification import identify
from identification.estimate import Estimate, Status
from identification.examination.examine import examine
from identification.status import Outcome, Remark
from tests.marks import slow
from tests.support.decays import campaign, grid, reading, run, stated
from tunnel_sim.vocabulary.record import Record


def refused(data) -> Remark:
    """The one remark, which refuses the campaign."""
    (remark,) = examine(data).remarks
    assert remark.outcome is Outcome.REFUSED
    return remark


def test_a_good_campaign_goes_through_as_it_is():
    data = grid()
    assert examine(data).campaign is data
    assert examine(data).remarks == ()


@pytest.mark.parametrize("springs", [slow((16.0, 35.0, 68.0)), (16.0, 35.0)])
def test_springs_exchanged_between_two_runs(springs):
    data = stated(grid(springs), "k16-v0", spring_stiffness=35.0)
    data = stated(data, "k35-v25", spring_stiffness=16.0)
    remark = refused(data)
    assert set(remark.runs) == {"k16-v0", "k35-v25"}
    assert "spring_stiffness" in remark.what


def test_two_springs_exchanged_in_all_runs():
    data = grid((16.0, 35.0), (0.0, 20.0))
    for one in data.runs:
        data = stated(data, one.id, spring_stiffness=51.0 - one.spring_stiffness)
    assert set(refused(data).runs) == {one.id for one in data.runs}


def test_speeds_of_one_setting_are_not_exchanged():
    """Their readings differ by a per cent or two, and by chance an exchange may cancel these errors."""
    actual = {"k16-v15": 15.15, "k35-v15": 14.85}
    data = campaign([run(r.id, r.spring_stiffness, actual.get(r.id, r.wind_speed)) for r in grid().runs])
    data = stated(stated(data, "k16-v15", wind_speed=14.85), "k35-v15", wind_speed=15.15)
    assert all(remark.outcome is not Outcome.REFUSED for remark in examine(data).remarks)


@pytest.mark.parametrize("exchanged", [slow((0.0, 20.0)), (20.0, 25.0)])
def test_two_speeds_exchanged_in_all_runs(exchanged):
    data = grid((16.0, 35.0), (0.0, 20.0, 25.0))
    swapped = dict(zip(exchanged, exchanged[::-1], strict=True))
    for one in data.runs:
        speed = swapped.get(one.wind_speed, one.wind_speed)
        data = stated(data, one.id, wind_speed=speed, air_density=1.2)
    remark = refused(data)
    assert "wind_speed" in remark.what
    assert set(remark.runs) == {one.id for one in data.runs if one.wind_speed in exchanged}


def test_exchanges_that_cannot_be_distinguished_are_all_named():
    data = stated(grid((16.0, 35.0), (0.0, 20.0)), "k16-v0", wind_speed=20.0, air_density=1.2)
    data = stated(data, "k16-v20", wind_speed=0.0)
    remark = refused(data)
    assert set(remark.runs) == {one.id for one in data.runs}
    assert "wind_speed of k16-v0 and k16-v20 exchanged" in remark.what
    assert "or with wind_speed of k35-v0 and k35-v20 exchanged" in remark.what


@pytest.mark.parametrize(("spring", "said"), [(16.0, "16"), slow(35.0, "35"), (68.0, "68")])
def test_one_spring_of_three_off_is_named_and_goes_through(spring, said):
    data = campaign(
        [run(f"k{k:g}-v{v:g}", k, v, actual=1.1 * k if k == spring else k)
         for k in (16.0, 35.0, 68.0) for v in (0.0, 20.0)]
    )  # fmt: skip
    examined = examine(data)
    (remark,) = examined.remarks
    assert remark.outcome is Outcome.NOTED
    assert remark.runs == (f"k{said}-v0",)
    assert "10 % stiffer" in remark.what
    assert examined.accepted().campaign is data
    assert identify(data).remarks == (remark,)


def test_of_two_springs_none_is_blamed():
    data = campaign([run("a", 16.0, 0.0, actual=17.6), run("b", 35.0, 0.0)])
    (remark,) = examine(data).remarks
    assert remark.runs == ("a", "b")
    assert "cannot be determined" in remark.what


@pytest.mark.parametrize(
    ("spring", "time", "said"),
    [
        (1e3, 1.0, "times the stated yaw_inertia of 0.1 kg m2: it looks like spring_stiffness in N mm/rad"),
        (np.pi / 180.0, 1.0, "spring_stiffness in N m/deg"),
        (1.0, 1.0 / 60.0, "time_s in minutes"),
        (1.0, 1e3, "time_s in milliseconds"),
        (30.0, 1.0, "times the stated yaw_inertia of 0.1 kg m2; correct"),
        (1.45, 1.0, None),
        (1.0 / 1.45, 1.0, None),
    ],
)
def test_a_stated_inertia_is_compared_with_the_springs(spring, time, said):
    data = grid((16.0, 35.0), (0.0, 20.0))
    rig = replace(data.rig, yaw_inertia=0.1)
    runs = tuple(
        replace(
            r,
            spring_stiffness=spring * r.spring_stiffness,
            record=Record(time * r.record.time_s, r.record.yaw_rad),
        )
        for r in data.runs
    )
    data = replace(data, rig=rig, runs=runs)
    remarks = examine(data).remarks
    assert [said in str(remark) for remark in remarks] == ([] if said is None else [True])
    assert examine(replace(data, sensor=replace(data.sensor, plausible=False))).remarks == ()


def test_the_diagnosis_says_that_the_inertia_is_off():
    data = grid((16.0,), (0.0, 20.0))
    answer = diagnose(
        replace(data, rig=replace(data.rig, yaw_inertia=1e-4)), kinds=vocabulary(["sensor_drift"])
    )
    assert answer.causes == ()
    assert "looks like spring_stiffness in N mm/rad" in str(answer)


def test_motion_may_grow_in_the_wind():
    one = run("r", 16.0, 20.0)
    assert examine(campaign([reading(one, one.record.yaw_rad[::-1])])).remarks == ()


def test_the_same_run_under_two_ids_is_counted_once():
    data = grid((16.0, 35.0), (0.0, 20.0))
    twice = replace(data, runs=(*data.runs[:1], replace(data.runs[0], id="again"), *data.runs[1:]))
    found, once = identify(twice), identify(data)
    assert found.cn_beta == once.cn_beta
    assert [one.id for one in found.runs] == [one.id for one in twice.runs]
    assert found.runs[1].statuses == (Status.REPEATED_RUN,)
    (remark,) = found.remarks
    assert remark.runs == ("again",)
    assert "same samples as run k16-v0" in remark.what
    assert Estimate.from_json_dict(found.to_json_dict()) == found


def test_all_runs_the_same_file():
    one = run("a", 16.0, 0.0)
    found = identify(campaign([replace(one, id=name) for name in "abcd"]))
    assert found.yaw_inertia is not None
    assert [remark.runs for remark in found.remarks] == [("b",), ("c",), ("d",)]


def test_old_estimates_without_remarks_still_read():
    document = identify(grid((16.0,), (0.0,))).to_json_dict()
    del document["remarks"]
    assert Estimate.from_json_dict(document).remarks == ()


def test_both_commands_go_on_from_the_same_release():
    free = run("r", 16.0, 0.0)
    held = np.concatenate([np.full(1500, free.record.yaw_rad[0]), free.record.yaw_rad])
    data = campaign([reading(free, held)])
    estimate, answer = identify(data), diagnose(data, kinds=vocabulary(["cubic_stiffness", "sensor_drift"]))
    assert estimate.remarks == answer.remarks
    assert "release found at 3.00" in estimate.remarks[0].what
    assert estimate.runs[0].zeta.value == pytest.approx(
        identify(campaign([free])).runs[0].zeta.value, rel=1e-2
    )
    assert answer.causes == ()
