"""Runs that one model fits: mixtures of springs, stated or not, are separated and reported."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import comparable_runs, gain_words, without_short
from diagnosis.model.fact import Fact
from diagnosis.model.similarity import frequency
from identification.status import Outcome
from tests.reference import free_decays
from tests.reference.free_decays import Setting, angle_of
from tests.support.driven_runs import GAIN, driven
from tests.support.gap_campaigns import nominal
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

NOISE = 4e-4
STIFFNESSES = (16.12, 21.02)


def decays(settings, *, bare=(), duration=5.0, seed=4):
    """Runs of the settings; those at the places of ``bare`` do not state their spring."""
    data = free_decays.campaign(
        settings, noise=NOISE, duration=duration, rate=500.0, rng=np.random.default_rng(seed)
    )
    runs = tuple(replace(run, spring_stiffness=None) if i in bare else run for i, run in enumerate(data.runs))
    return replace(data, runs=runs)


PAIR = [Setting(spring, speed) for spring in STIFFNESSES for speed in (0.0, 0.0, 20.0)]


def kept(data):
    found, said = comparable_runs(data)
    return [run.id for run in found.runs], said


def test_runs_that_all_state_their_spring_stay():
    data = decays(PAIR)
    found, said = comparable_runs(data)
    assert found.runs == data.runs
    assert said == ()


def test_the_more_numerous_of_a_mixture_stay():
    ids, (said,) = kept(decays(PAIR, bare=(5,)))
    assert ids == ["r01", "r02", "r03", "r04", "r05"]
    assert said == Fact("stiffness not stated", {"runs": ["r06"]})
    ids, said = kept(decays(PAIR, bare=(0, 1, 2, 4)))
    assert ids == ["r01", "r02"]
    assert said[0] == Fact("stiffness stated", {"runs": ["r04", "r06"]})
    assert said[1] == Fact("other springs", {"runs": ["r03", "r05"]})
    ids, (said, *_) = kept(decays(PAIR[:3], bare=(0, 1)))
    assert ids == ["r01", "r02"]
    assert said.kind == "stiffness stated"
    assert kept(decays(PAIR[:2], bare=(1,)))[0] == ["r01"]


def test_of_springs_that_are_not_stated_the_larger_group_stays():
    """A fifth apart in stiffness, as the closest of the paper's springs."""
    ids, (said,) = kept(decays([*PAIR, Setting(21.02, 20.0, 0.14)], bare=range(7)))
    assert ids == ["r04", "r05", "r06", "r07"]
    assert said == Fact("other springs", {"runs": ["r01", "r02", "r03"]})
    # only some winds have both: the largest group of one wind
    ids, _ = kept(decays([*PAIR[:3], PAIR[3], PAIR[4], PAIR[4]], bare=range(6)))
    assert ids == ["r04", "r05", "r06"]


@pytest.mark.parametrize("speeds", [(0.0, 0.0, 0.0), (0.0, 15.0, 25.0)])
def test_one_spring_that_is_not_stated_is_not_split_by_wind_or_release(speeds):
    settings = [Setting(16.12, speed, release) for speed in speeds for release in (0.35, 0.1)]
    ids, said = kept(decays(settings, bare=range(6)))
    assert len(ids) == 6
    assert said == ()


def test_the_frequency_of_few_cycles_is_found():
    for setting in (Setting(16.12, 0.0), Setting(44.84, 0.0)):
        data = free_decays.campaign((setting,), duration=2.0, noise=NOISE, rng=np.random.default_rng(1))
        expected = np.sqrt(setting.spring / free_decays.Truth().yaw_inertia) / (2.0 * np.pi)
        assert frequency(data.runs[0].record) == pytest.approx(expected, rel=0.03)
    assert angle_of(PAIR[0], free_decays.Truth(), np.zeros(1))[0] == 0.35


def friction(settings, *, bare):
    """Decays that dry friction shortens by the same angle every half swing (closed form, wind off)."""
    data = decays(settings, bare=bare, duration=8.0)
    inertia, spring, moment = 0.1014, 16.12, 0.02
    omega, step = np.sqrt(spring / inertia), moment / spring
    time = data.runs[0].record.time_s
    half = np.floor(omega * time / np.pi)
    swing = 0.3 - (2.0 * half + 1.0) * step
    reading = swing * np.cos(omega * time) + step * np.where(half % 2 == 0, 1.0, -1.0)
    reading = np.where(swing > 2.0 * step, reading, np.nan)
    assert np.all(np.isfinite(reading))
    rng = np.random.default_rng(6)
    runs = tuple(
        replace(run, record=type(run.record)(time, reading + rng.normal(0.0, NOISE, time.size)))
        for run in data.runs
    )
    return replace(data, runs=runs), moment / inertia


def test_without_a_spring_a_moment_is_per_unit_inertia():
    data, expected = friction([Setting(16.12, 0.0)] * 2, bare=(0, 1))
    answer = diagnose(data, kinds=vocabulary(["coulomb_friction", "quadratic_damping"]), rivals=())
    assert answer.causes == ("coulomb_friction",)
    found = answer.candidates[0].parameters["friction_moment"]
    assert found.unit == "rad/s2"
    assert found.value == pytest.approx(expected, rel=0.02)
    assert set(answer.coefficients.after) == {"omega_n", "zeta"}
    assert any("same spring, and moments are per unit inertia" in text for text in answer.cautions)


def test_runs_left_out_are_in_the_cautions_and_not_in_the_gap():
    answer = diagnose(decays(PAIR, bare=(5,)), kinds=vocabulary(["sensor_drift"]), rivals=())
    assert [run.id for run in answer.gap.runs] == ["r01", "r02", "r03", "r04", "r05"]
    assert any("r06" in text and "Left out" in text for text in answer.cautions)
    assert answer.causes == ()
    assert set(answer.coefficients.after) == {"cn_beta", "cn_r"}


def test_unlike_springs_that_are_not_stated_are_no_gap():
    """Fitted together they would be a gap of thousands of noise variances."""
    answer = diagnose(decays(PAIR, bare=range(6)), kinds=vocabulary(["sensor_drift"]), rivals=())
    assert answer.causes == ()
    assert any("may have another spring" in text for text in answer.cautions)


def test_a_wind_on_run_in_another_mode_is_left_out():
    data = decays(PAIR[:3])
    fast = replace(data.runs[2], record=Record(0.5 * data.runs[2].record.time_s, data.runs[2].record.yaw_rad))
    found, (said,) = comparable_runs(replace(data, runs=(*data.runs[:2], fast)))
    assert [run.id for run in found.runs] == ["r01", "r02"]
    assert (said.kind, said.figures["runs"]) == ("another mode", ["r03"])


def cut(run, count, name):
    """The first samples of a run as a run of its own."""
    record = Record(run.record.time_s[:count], run.record.yaw_rad[:count])
    drive = None if run.drive is None else replace(run.drive, values=run.drive.values[:count])
    return replace(run, id=name, record=record, drive=drive)


@pytest.mark.parametrize("given", ["driven", "free"])
def test_one_short_run_is_left_out_and_does_not_refuse_the_others(given):
    data = driven("moment") if given == "driven" else decays(PAIR)
    short = cut(data.runs[0], 150, "short")
    if given == "free":  # too short to show its motion above the noise
        noise = 1e-3 * np.random.default_rng(1).standard_normal(150)
        short = replace(short, record=Record(short.record.time_s, noise))
    found, (remark,) = without_short(replace(data, runs=(short, *data.runs)))
    assert found.runs == data.runs
    assert (remark.outcome, remark.runs) == (Outcome.LEFT_OUT, ("short",))
    assert "too short for the diagnosis" in remark.what
    assert without_short(data) == (data, ())
    assert without_short(replace(data, runs=(short,)))[1] == ()  # refused by name


def test_a_diagnosis_states_the_short_run_that_it_leaves_out():
    data = driven("moment")
    given = replace(data, runs=(*data.runs, cut(data.runs[0], 150, "short")))
    found = diagnose(given, kinds=vocabulary(("coulomb_friction",)), rivals=())
    assert found.causes == ()
    assert found.remarks[0].runs == ("short",)
    assert [run.id for run in found.gap.runs] == [run.id for run in data.runs]


def test_wind_speeds_within_their_reading_are_one_speed():
    """24.9972 and 25 m/s are one setting of the fan, so a run of another spring is left out among them."""
    speeds = (25.0, 24.9972, 25.0, 24.98)
    data = decays([Setting(16.12, speed) for speed in speeds] + [Setting(44.84, 25.01)], bare=range(5))
    found, (said,) = comparable_runs(data)
    assert [run.id for run in found.runs] == ["r01", "r02", "r03", "r04"]
    assert said == Fact("other springs", {"runs": ["r05"]})


def test_a_gain_has_as_many_digits_as_its_deviation():
    data = driven("unknown gain")
    (said,) = gain_words(data, nominal(data))
    found = re.fullmatch(r"The gain of the input is ([0-9.]+) ± ([0-9.]+) N m per unit\.", said)
    assert found, said
    assert abs(float(found[1]) - GAIN) < 4.0 * float(found[2])
    assert len(found[1].partition(".")[2]) == len(found[2].partition(".")[2])
