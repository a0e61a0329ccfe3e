"""Coloured sensor noise is whitened and is no gap; turbulence, blows and effects are not taken for it."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.fact import Fact
from diagnosis.noise import gap
from diagnosis.noise.bands import p_values
from diagnosis.noise.colour import FADES_RATE, alike_in_all_runs, fades, noise_colour, zero_wanders
from diagnosis.noise.gap import noise_noted
from diagnosis.noise.sensor_noise import NoiseTrend, campaign_noise, noise_trend, reading_step
from diagnosis.settings import Settings
from identification.signal.colour import steady
from tests.marks import slow
from tests.support.gap_campaigns import NOISE, campaign, nominal, with_blow, with_settings
from tests.unit.diagnosis.search.test_process_noise import buffeted
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.record import Record

COLOURS = ("ar1", "ar2", "pink")
NEAR = "near the motion"
#: Recursions of noise from white noise, by name; the last resonates at 0.74 times the softer spring's motion.
POLES = {"ar1": [1.0, -0.9], "ar2": [1.0, -1.6, 0.8], NEAR: [1.0, -1.97787, 0.97914]}


def colour(name, count, rng):
    """Noise of unit variance."""
    white = rng.standard_normal(count + 2000)
    if name == "pink":
        frequency = np.fft.rfftfreq(white.size)
        values = np.fft.irfft(np.fft.rfft(white) / np.sqrt(np.maximum(frequency, frequency[1])))
    else:
        values = lfilter([1.0], POLES[name], white)
    return values[2000:] / np.std(values)


def coloured(data, name, size=2.0, seed=1):
    """The campaign with coloured noise added, its size in standard deviations of the white noise, none stated."""
    return with_zero(data, lambda count, rng: size * NOISE * colour(name, count, rng), seed)


def with_zero(data, zero, seed=1):
    """The campaign with something added to every reading, of its number of samples; no noise is stated."""
    rng = np.random.default_rng(seed)
    runs = []
    for run in data.runs:
        yaw = run.record.yaw_rad + zero(run.record.yaw_rad.size, rng)
        runs.append(dataclasses.replace(run, record=Record(run.record.time_s, yaw)))
    sensor = dataclasses.replace(data.sensor, noise_std=None)
    return dataclasses.replace(data, runs=tuple(runs), sensor=sensor)


def judged(data):
    """Fit, noise and verdict."""
    return gap.gap_or_colour(
        nominal(data),
        campaign_noise(data, Settings().noise),
        noise_trend(data),
        step=reading_step(data),
        coarse_step=False,
    )


@pytest.mark.parametrize("name", COLOURS)
def test_coloured_noise_alone_is_not_a_gap(name):
    fit, noise, found = judged(coloured(campaign(), name))
    assert not found.detected
    assert noise.colour is not None
    # the lowest frequencies hold much of pink noise's power, and are known least
    assert noise.std == pytest.approx(NOISE * np.sqrt(5.0), rel=0.25 if name == "pink" else 0.1)
    assert abs(fit.excess) < 0.06
    # were it taken for white noise, it would be one
    assert min(p_values(nominal(coloured(campaign(), name))).values()) < 1e-6


def random_walk(count, rng):
    return 3.0 * NOISE * np.cumsum(rng.standard_normal(count)) / np.sqrt(count)


def late_step(count, rng):
    return 3.0 * NOISE * (np.arange(count) > rng.uniform(0.3, 0.7) * count)


@pytest.mark.parametrize("zero", [slow(random_walk), late_step])
def test_a_zero_that_wanders_is_a_gap_and_no_colour(zero):
    """Even where noise of its spectrum would close the gap."""
    data = with_zero(campaign(duration=20.0), zero)
    before = nominal(data)
    colour = noise_colour(before)
    whitened = fit(Problem(gap.whitened(before.problem.data, colour)), before.point)
    assert abs(whitened.excess) < 0.1
    _, noise, found = judged(data)
    assert found.detected
    assert noise.colour is None


@pytest.mark.slow
@pytest.mark.parametrize("name", [*COLOURS, NEAR])
def test_coloured_noise_is_taken_for_a_wandering_zero_no_more_often_than_stated(name):
    trials = 60
    alarms = 0
    for seed in range(trials):
        before = nominal(coloured(campaign(seed=seed), name, seed=seed))
        found = noise_colour(before)
        alarms += zero_wanders(
            before, fit(Problem(gap.whitened(before.problem.data, found)), before.point), found
        )
    assert alarms <= binom.ppf(1.0 - 1e-4, trials, Settings().noise.wandering_rate)


def test_noise_that_resonates_near_the_motion_is_a_colour():
    _, noise, found = judged(coloured(campaign(), NEAR, 3.0))
    assert not found.detected
    assert noise.colour is not None


def test_white_noise_fades_as_often_as_stated_and_a_dying_motion_always_does():
    base, rng = nominal(campaign()), np.random.default_rng(7)

    def alarms(last, trials):
        """How many of the trials fade, with noise of so much less power at the end than at the start."""
        drawn = [
            [rng.standard_normal(r.size) * np.linspace(1.0, last, r.size) for r in base.residuals]
            for _ in range(trials)
        ]
        return sum(fades(dataclasses.replace(base, residuals=one)) for one in drawn)

    assert 1 <= alarms(1.0, 200) <= binom.ppf(1.0 - 1e-4, 200, FADES_RATE)
    assert alarms(0.4, 20) > 17


def warming(count, _rng):
    return 12.0 * NOISE * (1.0 - np.exp(-5.0 * np.arange(count) / count))


def test_a_drift_that_every_run_repeats_is_a_gap_and_no_colour():
    data = with_zero(coloured(campaign(), "ar1"), warming)
    assert alike_in_all_runs(nominal(data))
    _, noise, found = judged(data)
    assert found.detected
    assert noise.colour is None


@pytest.mark.parametrize("name", COLOURS)
def test_noise_of_any_colour_repeats_itself_at_the_stated_rate_at_most(name):
    fitted = with_settings(nominal(campaign()), {"noise.repeated_rate": 0.05})
    rng, trials = np.random.default_rng(4), 200
    draws = [[colour(name, r.size, rng) for r in fitted.residuals] for _ in range(trials)]
    alarms = sum(alike_in_all_runs(dataclasses.replace(fitted, residuals=noise)) for noise in draws)
    assert binom.ppf(1e-3, trials, 0.05) <= alarms <= binom.ppf(1.0 - 1e-3, trials, 0.05)


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("ar1", effect_class("coulomb_friction")(0.003)),
        slow("ar2", effect_class("cubic_stiffness")(0.3)),
        slow("pink", effect_class("coulomb_friction")(0.003)),
        slow("ar1", effect_class("cubic_stiffness")(0.3)),
        slow("ar2", effect_class("coulomb_friction")(0.003)),
        slow("pink", effect_class("cubic_stiffness")(0.3)),
    ],
)
def test_an_effect_beneath_coloured_noise_is_still_a_gap(name, effect):
    fit, noise, found = judged(coloured(campaign(effect, duration=10.0), name))
    assert found.detected
    assert noise.colour is not None
    assert not fit.problem.data.runs[0].noise.plain
    assert min(found.tests, key=found.tests.__getitem__) in ("below", "f0", "offset")


def test_a_colour_that_the_wind_hides_is_sought_in_still_air(monkeypatch):
    def hidden(fit, *args, **kwargs):
        windy = any(run.wind_on for run in fit.problem.data.runs)
        return None if windy else noise_colour(fit, *args, **kwargs)

    monkeypatch.setattr(gap, "noise_colour", hidden)
    data = coloured(buffeted(campaign(damping=0.04, duration=10.0), 0.01, 4.0), "ar1")
    fit, noise, found = judged(data)
    assert found.detected
    assert noise.colour is not None
    assert not any(run.noise.plain for run in fit.problem.data.runs)
    still = [r for run, r in zip(fit.problem.data.runs, fit.residuals, strict=True) if not run.wind_on]
    assert np.mean(np.concatenate(still) ** 2) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(("effect", "size"), [("free_play", 0.01), ("asymmetric_stiffness", 0.3)])
@pytest.mark.parametrize("damping", [0.02, slow(0.04)])
def test_a_gap_of_still_air_is_no_colour(effect, size, damping):
    data = campaign(effect_class(effect)(size), damping=damping)
    (still,) = gap._in_still_air(nominal(data))
    assert still.excess > 0.5
    _, noise, found = judged(data)
    assert found.detected
    assert noise.colour is None


def test_two_parts_of_records_show_no_colour():
    data = coloured(campaign(duration=6.0), "ar1")
    assert noise_colour(nominal(data)) is not None
    two = dataclasses.replace(data, runs=(data.runs[0], data.runs[-1]))
    assert noise_colour(nominal(two)) is None


@pytest.mark.parametrize("seed", range(3))
def test_white_noise_is_left_alone(seed):
    data = campaign(seed=seed)
    fit, noise, _ = judged(data)
    assert np.array_equal(fit.point.common, nominal(data).point.common)
    assert noise.colour is None
    assert all(run.noise.plain for run in fit.problem.data.runs)


@pytest.mark.parametrize("keep", [(0.0, 15.0, 25.0), (15.0, 25.0), (25.0,)])
def test_turbulence_is_not_taken_for_coloured_noise(keep):
    """Not even where every run has it, at one wind speed."""
    data = buffeted(campaign(), 0.01, 4.0)
    data = dataclasses.replace(data, runs=tuple(run for run in data.runs if run.wind_speed in keep))
    fit, noise, found = judged(data)
    assert found.detected
    assert noise.colour is None
    assert fit.problem.data.runs[0].noise.plain


@pytest.mark.parametrize(
    "data",
    [
        with_blow(campaign(), 2e-3, 4.0),
        campaign(effect_class("free_play")(0.01)),
        campaign(effect_class("asymmetric_stiffness")(0.3)),
    ],
    ids=("blow", "free play", "asymmetric"),
)
def test_a_gap_beside_white_noise_leaves_it_white(data):
    _, noise, found = judged(data)
    assert found.detected
    assert noise.colour is None


@pytest.mark.slow
def test_the_spectrum_and_its_uncertainty_are_those_of_the_noise():
    """Truth: the spectrum of AR(1) noise beside white noise, from its formula."""
    size, pole = 3.0, 0.9
    colours = [noise_colour(nominal(coloured(campaign(seed=s), "ar1", size, seed=s))) for s in range(12)]
    frequency = np.array([1.0, 3.0, 10.0, 60.0])
    turn = np.exp(-2j * np.pi * frequency * 4e-3)
    density = 1.0 + size**2 * (1.0 - pole**2) / np.abs(1.0 - pole * turn) ** 2
    assumed = [
        campaign_noise(coloured(campaign(seed=s), "ar1", size, seed=s), Settings().noise).used
        for s in range(12)
    ]
    found = [
        found.at(frequency) + np.log(variance / NOISE**2)
        for found, variance in zip(colours, assumed, strict=True)
    ]
    scatter = np.std(found, axis=0, ddof=1)
    assert np.all(np.abs(np.mean(found, axis=0) - np.log(density)) < 4.0 * scatter / np.sqrt(12) + 0.1)
    claimed = np.array([[one.spread(np.array([f])) for f in frequency] for one in colours]).mean(axis=0)
    assert np.all(scatter < 2.0 * claimed)
    assert np.all(scatter > 0.25 * claimed)


@pytest.mark.parametrize(("stated", "believed"), [(np.sqrt(5.0), True), (1.0, False)])
def test_colour_beside_a_gap_is_not_believed_where_more_noise_is_seen_than_stated(stated, believed):
    data = coloured(campaign(effect_class("coulomb_friction")(0.003), duration=10.0), "ar1")
    sensor = dataclasses.replace(data.sensor, noise_std=stated * NOISE)
    _, noise, found = judged(dataclasses.replace(data, sensor=sensor))
    assert found.detected
    assert (noise.colour is not None) == believed


def test_what_is_said_of_the_noise():
    slow = NoiseTrend(0.0, 0.0, 0.0, judged=False)
    data = coloured(campaign(), "pink")
    _, noise, found = judged(data)
    said = [one.fact for one in noise_noted(noise, slow, found, named=False)]
    assert [one.kind for one in said] == ["coloured", "not judged"]
    assert said[0].figures["std_rad"] == noise.std
    low, high = noise.colour.frequency[[0, -1]]
    assert said[0].figures["frequency_ratio"] == high / low
    within = dataclasses.replace(found, within_step=True)
    assert Fact("not judged") not in [one.fact for one in noise_noted(noise, slow, found, named=True)]
    assert noise_noted(noise, slow, within, named=False)[0].fact == Fact("within step")
    assert (
        noise_noted(
            campaign_noise(campaign(), Settings().noise), NoiseTrend(0.0, 0.0, 0.0), found, named=False
        )
        == ()
    )


def test_a_band_is_steady_as_often_as_stated_and_empty_parts_do_not_count():
    """Mean powers of n independent ordinates of one level are gamma variables of shape n."""
    rng = np.random.default_rng(4)
    count = np.tile(np.array([[3.0], [5.0], [10.0], [20.0]]), 4000)
    power = rng.gamma(count) / count
    found = steady(power, count, Settings().noise.colour_band_rate)
    refused = int(np.sum(~found))
    assert 17 <= refused <= 68  # of 4000 at 1 %: outside with probability 3e-5
    louder = power * np.array([[1.0], [1.0], [1.0], [10.0]])
    assert np.mean(steady(louder, count, Settings().noise.colour_band_rate)) < 0.5
    with_empty = (np.vstack((values, np.zeros(4000))) for values in (louder, count))
    assert np.array_equal(
        steady(*with_empty, Settings().noise.colour_band_rate),
        steady(louder, count, Settings().noise.colour_band_rate),
    )
    alone = np.where(np.arange(4)[:, None] == 0, count, 0.0)
    assert not steady(
        power * (alone > 0.0), alone, Settings().noise.colour_band_rate
    ).any()  # one part cannot show that the level is steady
