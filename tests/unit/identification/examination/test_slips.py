"""Every slip is named with its runs before any fit, and an honest campaign is not questioned."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose
from identification import identify
from identification.estimate import PARAMETERS
from identification.examination.examine import examine
from identification.examination.slips.spoilt_records import clock_jumps
from identification.status import Outcome, Status
from tests.marks import slow
from tests.support.slip_cases import FURTHER, PLAIN, SIX, TABLE, Case
from tests.support.slip_rig import INERTIA, SPEEDS, SPRINGS, Condition, high_passed, honest, reading, repeated
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

OF_ANOTHER_SIZE = {
    "two of twelve speeds in km/h", "one speed in mph", "one speed in knots", "one 20 stated as 10",
    "two speeds exchanged", "one density's decimal point", "a second day's density 15 % too high",
    "the first day's density 15 % too low", "idle wind of 6 m/s", "two springs one number down",
    "one speed 10 % high", "density falls along the campaign", "one clock 10 % slow",
    "one clock 4 % fast with the wind on", "one setting in km/h", "one 15 stated as 20", "one speed 10 % low",
    "one speed in ft/s", "one speed of the stiff spring in km/h",
}  # fmt: skip
"""Slips that another one has the kind of."""
CASES = [
    pytest.param(case, id=name, marks=[pytest.mark.slow] * (name in OF_ANOTHER_SIZE))
    for name, case in (TABLE | FURTHER).items()
]
GIVEN = {id(case.given): case.given for case in (TABLE | FURTHER).values() if case.given is not case.campaign}


@pytest.mark.parametrize("case", CASES)
def test_a_slip_is_named_with_its_runs(case: Case):
    found = [remark for remark in examine(case.campaign).remarks if case.says in str(remark)]
    assert found
    assert set(case.runs) <= {name for remark in found for name in remark.runs}
    assert any(remark.outcome is Outcome.REFUSED for remark in found) is case.refused


@pytest.mark.parametrize("given", [one if one is PLAIN else slow(one) for one in GIVEN.values()])
def test_without_its_slip_a_campaign_is_not_questioned(given: Campaign):
    assert not examine(given).remarks


REFUSED = [name for name, case in TABLE.items() if case.refused]


@pytest.mark.parametrize("name", [REFUSED[0], *map(slow, REFUSED[1:])])
def test_a_refusal_is_the_answer_of_both_commands(name: str):
    case = TABLE[name]
    for command in (identify, diagnose):
        with pytest.raises(TunnelError) as caught:
            command(case.campaign)
        assert case.says in str(caught.value)
        assert any(name in str(caught.value) for name in case.runs)
        assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in CASES if not case.values[0].refused])
def test_what_goes_on_is_not_named_as_an_effect(case: Case):
    answer = diagnose(case.campaign)
    assert answer.causes == ()
    assert case.says in " ".join(str(answer).split())


@pytest.mark.parametrize(
    "name", ["last third zeros", "wraps at pi", "resolution of 0.5 rad", "repeated times 1.001"]
)
def test_a_mended_campaign_gives_the_coefficients_of_the_honest_one(name: str):
    found, true = identify(TABLE[name].campaign), identify(honest())
    for key in ("cn_beta", "cn_r", "yaw_inertia"):
        one, other = getattr(found, key), getattr(true, key)
        assert abs(one.value - other.value) < 4.0 * np.hypot(one.std, other.std)
        assert 0.99 < one.std / other.std < 3.0


def test_a_repeated_record_does_not_shrink_the_deviations():
    assert identify(TABLE["repeated and rounded"].campaign).cn_beta == identify(honest()).cn_beta


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(honest(seed=5), id="four runs"),
        pytest.param(repeated(release=True), id="twelve runs"),
        pytest.param(
            honest([Condition(k, v, release) for k in SPRINGS for v in SPEEDS for release in (0.26, -0.26, 0.1)],
                   release=True),
            id="both sides",
        ),
        pytest.param(honest([Condition(k + 2.0 * (k > 20.0), v) for k in SPRINGS for v in SPEEDS]), id="5 %"
        ),
        pytest.param(
            honest([Condition(k, v * (1.0 + 0.01 * (-1) ** i)) for i, k in enumerate(SPRINGS * 3) for v in SPEEDS]),
            id="speeds scatter",
        ),
    ],
)  # fmt: skip
def test_an_honest_campaign_is_not_questioned(data: Campaign):
    assert examine(data).remarks == ()


def test_miscalibrated_springs_and_offset_speeds_are_left_to_the_diagnosis():
    """Effects of some per cent are not slips, whatever the labels near them."""
    actual = [
        (16.12, 0.0),
        (16.12, 16.5),
        (44.84 * 1.05, 0.0),
        (44.84 * 1.05, 16.5),
        (16.12, 21.5),
        (16.12, 11.5),
    ]
    stated = [(16.12, 0.0), (16.12, 15.0), (44.84, 0.0), (44.84, 15.0), (16.12, 20.0), (16.12, 10.0)]
    data = honest([Condition(*one) for one in actual])
    runs = tuple(
        replace(run, spring_stiffness=spring, wind_speed=speed)
        for run, (spring, speed) in zip(data.runs, stated, strict=True)
    )
    assert all(remark.outcome is Outcome.NOTED for remark in examine(replace(data, runs=runs)).remarks)


@pytest.mark.parametrize(("time_scale", "moment"), [(1.0 / 25.0, 30.0), (25.0, 0.02)])
def test_nothing_knows_how_fast_or_heavy_a_rig_is(time_scale: float, moment: float):
    """A dynamically similar campaign without sizes is not questioned, and its slips are."""
    for case in (None, "one speed in km/h", "one spring's label wrong", "one sign inverted", "AC-coupled"):
        data = honest() if case is None else TABLE[case].campaign
        runs = tuple(
            replace(
                run,
                record=Record(time_scale * run.record.time_s, run.record.yaw_rad),
                spring_stiffness=moment * run.spring_stiffness,
                wind_speed=run.wind_speed / time_scale,
            )
            for run in data.runs
        )
        rig = replace(data.rig, frontal_area=None, reference_length=None)
        sensor = replace(data.sensor, sample_rate=data.sensor.sample_rate / time_scale)
        remarks = examine(replace(data, runs=runs, rig=rig, sensor=sensor)).remarks
        assert [remark.outcome for remark in remarks] == ([] if case is None else [Outcome.REFUSED])


def test_a_drift_that_settles_is_no_coupled_sensor_where_a_few_runs_lead_by_chance():
    data, lead = honest(), high_passed(4.5, held=False)
    free = [run for run in data.runs if run.drive is None]
    led = {run.id for run in free[: (len(free) - 1) // 2]}

    def warmed(run, leading):
        record = run.record
        yaw = lead(record.yaw_rad) if leading else record.yaw_rad - 0.02 * np.exp(-record.time_s / 4.5)
        return replace(run, record=Record(record.time_s, yaw))

    def said(leading):
        runs = tuple(warmed(run, run.id in leading) for run in data.runs)
        return [one for one in examine(replace(data, runs=runs)).remarks if "AC-coupled" in one.what]

    assert not said(led)
    assert said({run.id for run in free})


def test_a_centre_that_one_run_has_within_its_first_cycle_is_no_sensor():
    """A hand that still holds at the start gives such a reading, and one run alone cannot tell the two apart."""
    period = 2.0 * np.pi * np.sqrt(INERTIA / honest().runs[0].spring_stiffness)
    brief, lasting = (reading(high_passed(share * period, held=False), "r3") for share in (0.19, 0.9))

    def said(data):
        return [one for one in examine(data).remarks if "AC-coupled" in one.what]

    assert said(lasting(honest()))
    assert not said(brief(honest()))


def test_what_looks_like_a_wrong_unit_is_kept_where_the_campaign_vouches_for_it():
    for name in ("springs in N mm/rad", "springs in N m/deg", "time in minutes", "area in cm2"):
        data = (TABLE | FURTHER)[name].campaign
        assert examine(replace(data, sensor=replace(data.sensor, plausible=False))).remarks == ()


def test_zeros_of_their_own_do_not_mirror_a_run():
    data = honest()
    zeros = (0.004, -0.004, 0.001, 0.006)
    runs = tuple(
        replace(run, record=Record(run.record.time_s, run.record.yaw_rad - 0.004 + zero))
        for run, zero in zip(data.runs, zeros, strict=True)
    )
    assert examine(replace(data, runs=runs)).remarks == ()


@pytest.mark.parametrize("name", ["springs in N mm/rad", "time in minutes", "springs in kgf m/rad"])
def test_coefficients_wrong_by_decades_are_withheld(name: str):
    data = (TABLE | FURTHER)[name].campaign
    found = identify(data)
    assert all(getattr(found, key) is None for key in (*PARAMETERS, "wind_off_inertia", "wind_off_intercept"))
    assert found.parameters == ()
    assert Status.COEFFICIENTS_WITHHELD in found.statuses
    assert all(run.omega_n is not None for run in found.runs)
    vouched = identify(replace(data, sensor=replace(data.sensor, plausible=False)))
    assert vouched.cn_beta is not None


@pytest.mark.slow
def test_a_diagnosis_withholds_them_too():
    answer = diagnose(TABLE["springs in N mm/rad"].campaign)
    assert answer.coefficients.after == {}
    assert "Use the coefficients" not in str(answer)
    assert "give them in SI units" in str(answer)


def test_two_readings_of_one_contradiction_are_both_said():
    (remark,) = examine(TABLE["a second day's density 18 % too low"].campaign).remarks
    assert "0.984 of r5, r6 as 1.2 kg/m3" in remark.what
    assert "1.2 of r2, r3 as 0.984 kg/m3" in remark.what
    assert set(remark.runs) == {"r2", "r3", "r5", "r6"}


def test_samples_that_are_missing_are_no_jump_of_the_clock():
    rng = np.random.default_rng(4)
    for run in honest().runs:
        time, yaw = run.record.time_s, run.record.yaw_rad
        for begin in rng.integers(200, 3000, 6).tolist():
            kept = np.r_[0:begin, begin + int(rng.integers(60, 1500)) : time.size]
            data = replace(PLAIN, runs=(replace(run, record=Record(time[kept], yaw[kept])),))
            assert clock_jumps(data)[1] == ()


def test_noise_that_grows_with_the_wind_is_not_odd():
    rng = np.random.default_rng(6)
    runs = tuple(
        replace(
            run,
            record=Record(
                run.record.time_s,
                run.record.yaw_rad
                + rng.normal(0.0, 1e-3 * (run.wind_speed / 15.0) ** 2, run.record.yaw_rad.size),
            ),
        )
        for run in SIX.runs
    )
    assert examine(replace(SIX, runs=runs)).remarks == ()


def test_the_examination_is_cheap():
    """Twelve runs of ten seconds at 1 kHz, in seconds of the processor, with room for a slower one."""
    data = repeated()
    runs = tuple(
        replace(
            run,
            record=Record(
                np.arange(10_000) / 1000.0,
                np.interp(np.arange(10_000) / 1000.0, run.record.time_s, run.record.yaw_rad)
                + np.random.default_rng(number).normal(0.0, 5e-4, 10_000),
            ),
        )
        for number, run in enumerate(data.runs)
    )
    begun = time.process_time()
    examine(replace(data, runs=runs))
    assert time.process_time() - begun < 1.0
