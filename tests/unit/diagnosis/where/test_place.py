"""Where the gap is: on campaigns whose gap was put in one place, the place is found."""

import dataclasses
import json
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from diagnosis.compose import localise
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import without_start
from diagnosis.model.fact import Fact
from diagnosis.search.investigate import nominal_study
from diagnosis.settings import Settings
from diagnosis.where.along_motion import amplitude_about_rest, apparent_moment, backbones, drift
from diagnosis.where.described import Nowhere
from diagnosis.where.excess import RunExcess, run_excesses, shortest_interval
from diagnosis.where.place import (
    _between_runs,
    infer_channel,
    infer_condition,
    locate,
    runs_beyond_chance,
)
from tests.marks import slow
from tests.support import gap_campaigns
from tests.support.driven_runs import driven
from tests.support.gap_campaigns import INTERVAL, added, nominal, studied, with_blow
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.record import Record

DURATION = 7.0
campaign = partial(gap_campaigns.campaign, duration=DURATION)
UNKNOWN = ("unknown",)


def test_a_gap_that_needs_wind_is_found_in_the_wind_on_runs():
    data = campaign(effect_from("nonlinear_yaw_moment", {"coefficient": -1.0}))
    where, maps, _ = localise(studied(data, nominal(data), UNKNOWN))
    assert where.condition == "wind_on"
    assert where.channel == "stiffness"
    # how much of the misfit the joint fit moves to wind-off runs is its own affair: the strong ones are windy
    assert {"r3", "r6"} <= set(where.runs)
    groups = {group.label: group.excess for group in maps.groups if group.by == "wind"}
    assert groups["on"] > 5.0 * groups["off"]


def test_a_mechanical_gap_shows_with_the_wind_off():
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    where, _, _ = localise(studied(data, nominal(data), UNKNOWN))
    assert (where.channel, where.condition) == ("damping", "always")


@pytest.mark.parametrize(
    "cause", ["quadratic_damping", slow("coulomb_friction"), slow("cubic_stiffness"), "sensor_drift"]
)
def test_the_place_does_not_depend_on_the_names(cause):
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    base = nominal(data)
    unnamed, _, nothing = localise(studied(data, base, UNKNOWN))
    named, _, said = localise(studied(data, base, (cause,)))
    assert named == unnamed
    agrees = effect_class(cause).channel == "damping"
    assert said == dataclasses.replace(nothing, compared=(cause,), agrees=agrees, elsewhere=not agrees)
    assert nothing.compared == ()


def test_the_whole_set_is_judged_by_the_place():
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    names = ("cubic_stiffness", "structural_damping")
    _, _, said = localise(studied(data, nominal(data), names))
    assert (said.compared, said.agrees) == (names, True)
    assert not localise(studied(data, nominal(data), ("cubic_stiffness", "rod_flexibility")))[2].agrees


def test_runs_whose_frequencies_disagree_leave_the_channel_open():
    data = campaign(effect_from("wind_speed_offset", {"offset": 0.6}))
    where, _, said = localise(studied(data, nominal(data), ("wind_speed_offset",)))
    assert (where.channel, where.condition) == (None, "wind_on")
    assert said.channel.kind == "frequency between runs"
    assert not said.agrees


def test_of_two_causes_the_one_that_closes_more_is_named():
    strong = effect_from("quadratic_damping", {"coefficient": 0.01})
    drift_too = 4e-4 * np.linspace(0.0, 1.0, round(DURATION / INTERVAL))
    data = campaign(strong, added=drift_too)
    base = nominal(data)
    best = added(base, "quadratic_damping", "sensor_drift")
    where, _, _ = localise(studied(data, base, ("quadratic_damping", "sensor_drift"), best))
    assert where.channel == "damping"


def test_a_blow_is_found_in_time():
    data = with_blow(campaign(), 0.02, 5.5)
    where, _, _ = localise(studied(data, nominal(data), UNKNOWN))
    assert where.channel == "forcing"
    assert where.time_s is not None
    assert where.time_s[0] <= 5.5 <= where.time_s[1]
    assert where.time_s[1] - where.time_s[0] < 0.1 * DURATION


def test_a_drift_is_found_below_the_oscillation():
    data = campaign(added=0.004 * np.linspace(0.0, 1.0, round(DURATION / INTERVAL)))
    where, maps, _ = localise(studied(data, nominal(data), UNKNOWN))
    assert (where.channel, where.condition) == ("sensor", "always")
    assert where.frequency_hz is not None
    assert where.frequency_hz[1] < 0.5 * maps.frequency.resonance_hz[0]


def test_hum_in_the_records_is_found_though_the_fit_had_it_taken_out():
    clean = campaign()
    hum = 5e-4 * np.sin(2.0 * np.pi * 50.0 * INTERVAL * np.arange(round(DURATION / INTERVAL)))
    where, maps, _ = localise(studied(campaign(added=hum), nominal(clean), ("mains_hum",)))
    assert (where.channel, where.condition) == ("sensor", "always")
    assert where.frequency_hz is not None
    assert where.frequency_hz[0] < 50.0 < where.frequency_hz[1]
    assert where.frequency_hz[1] - where.frequency_hz[0] < 1.0
    assert {line.run for line in maps.lines} == {run.id for run in clean.runs}
    for line in maps.lines:
        assert line.frequency_hz == pytest.approx(50.0, abs=0.1)
        assert line.amplitude_rad == pytest.approx(5e-4, rel=0.2)


def test_no_cause_gives_no_place():
    data = campaign()
    where, maps, said = localise(studied(data, nominal(data)))
    assert (where.channel, where.condition, where.runs) == (None, None, ())
    assert (where.time_s, where.amplitude_rad, where.frequency_hz) == (None, None, None)
    assert isinstance(said, Nowhere)
    assert (said.runs, said.within_step) == (len(data.runs), False)
    assert maps.lines == ()


def test_maps_are_small_and_plain_json():
    data = campaign(effect_from("coulomb_friction", {"friction_moment": 0.003}))
    _, maps, _ = localise(studied(data, nominal(data), ("coulomb_friction",)))
    text = json.dumps(maps.rounded().to_json_dict(), allow_nan=False)
    assert len(text) < 200_000
    assert len(json.loads(text)["time"]["by_run"]) == len(data.runs)


def test_runs_are_named_by_chance_no_oftener_than_stated():
    rng = np.random.default_rng(11)
    frequency = np.arange(600) / 12.0
    trials = 1500
    alarms = sum(
        RunExcess("r", frequency, rng.chisquare(1.0, 600), 2.0, 0.0, 0.0).p_value() < 0.05
        for _ in range(trials)
    )
    assert alarms <= binom.ppf(0.9999, trials, 0.05)
    # a gap that is there is seen: twice the noise variance in one band
    power = rng.chisquare(1.0, 600)
    power[(frequency > 1.0) & (frequency < 3.0)] *= 3.0
    assert RunExcess("r", frequency, power, 2.0, 0.0, 0.0).p_value() < 1e-3


def test_gap_free_runs_are_not_named():
    named = 0
    for seed in range(8):
        data = campaign(seed=100 + seed)
        named += bool(runs_beyond_chance(run_excesses(data, nominal(data)), Settings().where))
    assert named <= binom.ppf(0.9999, 8, 0.01)


def test_excess_keeps_the_sum_of_squares():
    data = campaign(effect_from("cubic_stiffness", {"coefficient": 0.05}))
    found = nominal(data)
    for run, residual in zip(run_excesses(data, found), found.residuals, strict=True):
        assert run.power.sum() == pytest.approx(residual @ residual, rel=1e-12)


def test_shortest_interval_holds_its_share():
    edges = np.linspace(0.0, 10.0, 11)
    energy = np.array([0.0, 1.0, 0.0, 8.0, 8.0, 1.0, -0.5, 0.5, 1.0, 1.0])
    assert shortest_interval(edges, energy, 0.8) == (3.0, 5.0)
    assert shortest_interval(edges, energy, 1.0) == (1.0, 10.0)
    assert shortest_interval(edges, -energy, 0.8) is None


def test_the_apparent_moment_gives_a_moment_back():
    found = nominal(campaign())
    index, amplitude = 1, 0.01
    inertia, damping, stiffness = linear_coefficients(found, index)
    run = found.problem.data.runs[index]
    for ratio in (0.5, 1.0, 1.5):
        omega = ratio * np.sqrt(stiffness / inertia)
        time = run.interval * np.arange(run.reading.size)
        gain = 1.0 / (stiffness - inertia * omega**2 + 1j * omega * damping)
        response = amplitude * (gain * np.exp(1j * omega * time)).real / run.noise.scale
        planted = dataclasses.replace(
            found, residuals=[response if i == index else r for i, r in enumerate(found.residuals)]
        )
        moment = apparent_moment(planted, index)
        assert moment is not None
        inner = slice(moment.start, moment.start + moment.moment.size)
        expected = amplitude * np.cos(omega * time)[inner]
        # the smoothing is exact at resonance and fades away from it
        assert np.max(np.abs(moment.moment - expected)) < (0.02 if ratio == 1.0 else 0.25) * amplitude


def test_backbones_are_level_for_a_linear_rig_and_bend_for_friction():
    level = backbones(nominal(campaign()))
    assert all(curve.time_s.size >= 4 for curve in level)
    count = sum(curve.time_s.size - 1 for curve in level)
    assert max(np.abs(drift(level))) < 6.0 * np.sqrt(2.0 * count)
    data = campaign(effect_from("coulomb_friction", {"friction_moment": 0.004}))
    curved = backbones(nominal(data))
    frequency, damping = drift(curved)
    assert damping > 20.0 * max(frequency, 1.0)
    first = curved[0]
    assert np.all(np.diff(first.amplitude_rad) < 0.0)
    assert first.zeta[-1] > first.zeta[0]


def test_the_fit_itself_is_left_alone():
    data = campaign(effect_from("cubic_stiffness", {"coefficient": 0.05}))
    found = nominal(data)
    before = [r.copy() for r in found.residuals]
    localise(studied(data, found, UNKNOWN))
    assert isinstance(found.problem, Problem)
    for old, new in zip(before, found.residuals, strict=True):
        np.testing.assert_array_equal(old, new)


def test_times_count_from_the_start_of_the_record_though_the_fit_begins_later():
    data = with_blow(campaign(), 0.02, 5.5)
    late = without_start(nominal(data).problem.data)
    found = fit(Problem(late), nominal_start(late))
    assert found.residuals[0].size < round(DURATION / INTERVAL)
    where, maps, _ = localise(studied(data, found, UNKNOWN))
    assert where.time_s is not None
    assert where.time_s[0] <= 5.5 <= where.time_s[1]
    assert maps.time.edges_s[-1] == pytest.approx(DURATION)
    assert all(trace.time_s[-1] == pytest.approx(DURATION, abs=0.05) for trace in maps.traces)


@pytest.mark.parametrize(("frequency", "channel"), [(33.3, "sensor"), (13.7, "forcing")])
def test_a_line_beside_the_harmonics_has_its_frequency_and_amplitude(frequency, channel):
    """Above 30 Hz no moment moves a rig of this inertia: the line is then the sensor's."""
    time = INTERVAL * np.arange(round(10.0 / INTERVAL))
    data = campaign(added=5e-4 * np.sin(2.0 * np.pi * frequency * time), duration=10.0)
    where, maps, _ = localise(studied(data, nominal(data), UNKNOWN))
    assert where.channel == channel
    assert {line.run for line in maps.lines} == {run.id for run in data.runs}
    for line in maps.lines:
        assert line.frequency_hz == pytest.approx(frequency, abs=0.1)
        assert line.amplitude_rad == pytest.approx(5e-4, rel=0.1)


def test_a_centre_that_shifts_with_the_second_harmonic_is_the_springs():
    data = campaign(effect_from("asymmetric_stiffness", {"coefficient": 0.1}))
    where, _, said = localise(studied(data, nominal(data), UNKNOWN))
    assert where.channel == "stiffness"
    assert said.channel.kind == "shifted centre and harmonic"


@pytest.mark.parametrize(
    ("bands", "condition", "channel"),
    [
        ({"above": 0.9, "f0": 0.1}, "always", "sensor"),
        ({"0": 0.9, "f0": 0.1}, "always", "sensor"),
        ({"0": 0.9, "f0": 0.1}, "wind_on", "forcing"),
        ({"0": 0.9, "2f0": 0.1}, "wind_on", "stiffness"),
        ({"0": 0.9, "2f0": 0.01, "f0": 0.09}, "wind_on", "forcing"),
        ({"2f0": 0.4, "3f0": 0.4, "f0": 0.2}, "always", "sensor"),
        ({"2f0": 0.1, "3f0": 0.2, "f0": 0.7}, "always", None),
        ({"above": 0.4, "0": 0.4, "f0": 0.2}, "always", None),  # neither has three fifths of the excess
        ({"above": 0.9, "f0": -5.0}, "always", "sensor"),  # less than the noise is none
    ],
)
def test_the_band_of_most_of_the_excess_decides_the_channel(monkeypatch, bands, condition, channel):
    monkeypatch.setattr("diagnosis.where.place.drift", lambda _: (0.0, 0.0))
    given = tuple(SimpleNamespace(band=name, excess=excess) for name, excess in bands.items())
    found = infer_channel(_ONE_DECAY, _without_a_blow(given), condition)
    assert found.value == channel
    assert (found.reason.kind != "both along the decay") == (channel is not None)


@pytest.mark.parametrize(
    ("frequency", "damping", "channel"),
    [
        (1.6, 1.0, "stiffness"),
        (1.4, 1.0, None),
        (1.0, 1.6, "damping"),
        (1.0, 1.4, None),
        (1.0, -2.0, "stiffness"),
        (-2.0, 1.0, "damping"),
        (-2.0, -1.0, None),
    ],
)
def test_the_larger_drift_decides_from_one_and_a_half_times_the_other(
    monkeypatch, frequency, damping, channel
):
    monkeypatch.setattr("diagnosis.where.place.drift", lambda _: (frequency, damping))
    assert infer_channel(_ONE_DECAY, _without_a_blow(()), "always").value == channel


_DECAY = SimpleNamespace(reading=np.zeros(100))
_ONE_DECAY = SimpleNamespace(
    settings=Settings(), problem=SimpleNamespace(data=SimpleNamespace(runs=[_DECAY], decays=[_DECAY]))
)


def _without_a_blow(bands):
    """Maps of one run with these excesses by band, no blow, and nothing between the runs."""
    maps = SimpleNamespace(
        time=SimpleNamespace(edges_s=np.arange(3.0)),
        bands=bands,
        lines=(),
        runs=(),
        backbones=[_curve(0.0, 0.0, None)],
    )
    return SimpleNamespace(maps=maps, moment_energy=np.zeros(2))


def _curve(frequency, damping, alone):
    """A run whose own fit departs by these from the nominal model, and leaves an excess."""
    return SimpleNamespace(
        alone_excess=alone, alone_frequency_hz=2.0 * (1.0 + frequency), nominal_frequency_hz=2.0,
        alone_zeta=0.01 + damping, nominal_zeta=0.01,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("curves", "channel"),
    [
        ([(0.02, 0.001, 0.0), (-0.02, 0.001, 0.1)], "open"),
        ([(0.001, 0.02, 0.0), (0.001, -0.02, 0.1)], "damping"),
        ([(0.02, 0.001, 0.0), (-0.02, 0.001, 0.1), (0.0, 0.0, 0.0)], "open"),
        ([(0.02, 0.001, 0.0), (-0.02, 0.001, 0.5)], None),  # a quarter of the excess is within the runs
        ([(0.02, 0.001, 0.0), (-0.02, 0.001, None)], None),  # a run that could not be fitted by itself
        ([(0.02, 0.001, 0.0)], None),
    ],
)
def test_runs_that_are_linear_each_and_do_not_agree_leave_the_channel_open_or_lack_damping(curves, channel):
    runs = [SimpleNamespace(reading=np.zeros(100)) for _ in curves]
    problem = SimpleNamespace(data=SimpleNamespace(runs=runs))
    data = SimpleNamespace(problem=problem, settings=Settings())
    found = SimpleNamespace(
        maps=SimpleNamespace(backbones=[_curve(*values) for values in curves]),
        excesses=[SimpleNamespace(excess=1.0) for _ in curves],
    )
    chosen = _between_runs(data, found)
    assert (None if chosen is None else chosen.value or "open") == channel


def test_runs_have_their_amplitude_frequency_and_share_of_the_gap():
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    base = nominal(data)
    _, maps, _ = localise(studied(data, base, UNKNOWN))
    assert sum(run.share for run in maps.runs) == pytest.approx(1.0)
    for i, (one, run) in enumerate(zip(maps.runs, base.problem.data.runs, strict=True)):
        inertia, _, stiffness = linear_coefficients(base, i)
        omega = np.sqrt(stiffness / inertia)
        assert one.frequency_hz == pytest.approx(omega / (2.0 * np.pi))
        assert one.amplitude_rad == pytest.approx(np.hypot(*(base.point.per_run[i] / (1.0, omega))), rel=2e-3)
        assert (one.id, one.wind_speed) == (run.id, run.wind_speed)
        assert one.spring_stiffness == pytest.approx(run.spring_stiffness)
        assert one.excess == pytest.approx(float(np.mean(base.residuals[i] ** 2)) - 1.0, rel=0.01)
        assert one.share == pytest.approx(one.excess / sum(run.excess for run in maps.runs), rel=0.01)


@pytest.mark.parametrize(
    ("shares", "lone"),
    [((0.05, 0.9, 0.05), True), ((0.1, 0.8, 0.1), False), ((0.1, 0.9), False), ((0.9, 0.05, 0.05), False)],
)
def test_one_windy_run_of_three_or_more_with_nearly_all_of_the_gap_says_nothing_of_the_wind(shares, lone):
    data = campaign()
    data = dataclasses.replace(data, runs=data.runs[: len(shares)])
    base = nominal(data)
    found = locate(data, base).survey
    runs = [
        dataclasses.replace(run, share=share, p_value=0.0)
        for run, share in zip(found.maps.runs, shares, strict=True)
    ]
    found = dataclasses.replace(found, maps=dataclasses.replace(found.maps, runs=tuple(runs)))
    assert (
        infer_condition(data, base, found, lambda fitted: fitted).reason == Fact("one run", {"run": "r2"})
    ) == lone


@pytest.mark.parametrize("turned", [0.0, 0.5 * np.pi])
def test_amplitudes_are_about_the_rest_of_the_body(turned):
    """An arm that is driven about an angle of 90° swings by as much as about zero."""
    data = driven("loose")
    runs = tuple(
        dataclasses.replace(run, record=Record(run.record.time_s, run.record.yaw_rad + turned))
        for run in data.runs
    )
    found = nominal_study(dataclasses.replace(data, runs=runs), ()).nominal
    swing = max(float(np.ptp(run.record.yaw_rad)) for run in data.runs)
    largest = max(float(amplitude_about_rest(found, i).max()) for i in range(len(runs)))
    assert 0.3 * swing < largest < 1.5 * swing
    assert swing < 1.0
