"""The noise of a record: its variance, the reading's step, and whether it follows the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from diagnosis.model.fact import Fact
from diagnosis.noise.sensor_noise import (
    LEAST_SAMPLES,
    SmoothCurve,
    accuracy,
    campaign_noise,
    driven_variance,
    estimate_variance,
    floor_periodogram,
    noise_trend,
    reading_step,
    trend_statistics,
)
from diagnosis.settings import Settings
from identification.signal.forcing import driven_rows
from tests.marks import slow
from tests.reference import free_decays
from tests.reference.free_decays import Setting, with_records
from tunnel_sim.vocabulary.record import Record

NOISE = 5e-4
SETTINGS = (Setting(16.12, 0.0), Setting(16.12, 20.0), Setting(44.84, 0.0), Setting(44.84, 20.0))


def decays(seed=1, *, rate=500.0, duration=5.0, **options):
    """Four runs of the nominal model in closed form, with white noise."""
    return free_decays.campaign(
        SETTINGS,
        noise=options.pop("noise", NOISE),
        rate=rate,
        duration=duration,
        rng=np.random.default_rng(seed),
        **options,
    )


def test_the_variance_is_found_beside_motion_and_hum():
    time = np.arange(20_000) / 1000.0
    rng = np.random.default_rng(4)
    motion = 0.35 * np.exp(-0.08 * time) * np.cos(13.0 * time)
    hum = 2e-3 * sum(np.sin(2.0 * np.pi * 50.0 * k * time + k) for k in (1, 2, 3))
    variance, relative = estimate_variance(Record(time, motion + hum + rng.normal(0.0, NOISE, time.size)))
    assert abs(variance / NOISE**2 - 1.0) < 4.0 * relative
    assert relative < 0.02


def test_the_variance_is_as_certain_as_it_says():
    rng = np.random.default_rng(5)
    time = np.arange(2500) / 500.0
    pulls = []
    for _ in range(400):
        variance, relative = estimate_variance(Record(time, rng.normal(0.0, 1.0, time.size)))
        pulls.append((variance - 1.0) / relative)
    spread = np.array(pulls)
    assert abs(spread.mean()) < 4.0 / np.sqrt(400)
    assert chi2.ppf(1e-4, 399) < 399 * spread.var() < chi2.isf(1e-4, 399)


def test_the_periodogram_keeps_the_power():
    values = np.random.default_rng(6).normal(0.0, 2.0, 50_000)
    frequency, power = floor_periodogram(values, 800.0)
    assert power.sum() * frequency[1] == pytest.approx(4.0, rel=0.05)


def test_quantisation_adds_a_twelfth_of_its_square():
    step = 1.5e-3
    found = campaign_noise(decays(resolution=step), Settings().noise)
    assert np.mean(list(found.variance.values())) == pytest.approx(NOISE**2 + step**2 / 12.0, rel=0.1)


def test_stated_noise_that_the_records_bear_out_is_used():
    found = campaign_noise(decays(), Settings().noise)
    assert (found.source, found.stated_variance) == ("stated", NOISE**2)
    assert set(found.variance.values()) == {NOISE**2}
    assert found.used == NOISE**2
    assert found.estimated == pytest.approx(NOISE**2, rel=0.1)
    assert found.estimated != NOISE**2
    assert (found.reason.kind, found.reason.figures["std_rad"]) == ("agrees", found.estimated**0.5)


def test_stated_noise_may_be_that_before_rounding_or_after():
    step = 1.5e-3
    total = np.sqrt(NOISE**2 + step**2 / 12.0)
    for stated in (NOISE, total):
        found = campaign_noise(decays(resolution=step, stated_noise=stated), Settings().noise)
        assert found.source == "stated"
        assert found.used == pytest.approx(total**2)


@pytest.mark.parametrize("factor", [0.5, 0.9, 1.1, 2.0])
def test_stated_noise_that_the_records_contradict_is_not_used(factor):
    found = campaign_noise(decays(stated_noise=factor * NOISE), Settings().noise)
    assert (found.source, found.stated_variance) == ("estimated", pytest.approx((factor * NOISE) ** 2))
    assert found.used == found.estimated == pytest.approx(NOISE**2, rel=0.1)
    assert found.reason.kind == "contradicts"
    assert found.reason.figures["stated_rad"] == pytest.approx(factor * NOISE)


def test_where_no_noise_is_stated_it_is_estimated():
    for stated in (None, 0.0):
        found = campaign_noise(decays(stated_noise=stated), Settings().noise)
        assert (found.source, found.stated_variance) == ("estimated", None)
        assert found.reason == Fact("not stated")


@pytest.mark.slow
def test_true_statements_are_borne_out_as_often_as_said():
    """Beyond three standard deviations of the estimate: 0.27 % of true statements, and none of 10 % errors."""
    trials = 400
    kept = sum(campaign_noise(decays(seed), Settings().noise).source == "stated" for seed in range(trials))
    assert kept >= binom.ppf(1e-4, trials, chi2.cdf(9.0, 1))
    wrong = sum(
        campaign_noise(decays(seed, stated_noise=1.2 * NOISE), Settings().noise).source == "stated"
        for seed in range(20)
    )
    assert wrong == 0


@pytest.mark.parametrize(("rate", "stated"), [(1000.0, None), (200.0, None), (1000.0, 5e-4)])
def test_records_without_noise_are_held_to_the_fits_own_accuracy(rate, stated):
    data = free_decays.campaign(rate=rate, stated_noise=stated)
    found = campaign_noise(data, Settings().noise)
    assert found.source == "floor"
    assert (found.reason.kind, found.reason.figures["fewer"]) == ("floor", len(data.runs))
    assert np.sqrt(found.estimated) < 1e-7 < 1e-5 < np.sqrt(found.used) < 1e-4
    assert [accuracy(run.record) ** 2 for run in data.runs] == list(found.variance.values())


def test_noise_of_a_sensor_is_far_above_the_floor():
    for run in decays().runs:
        assert accuracy(run.record) < 0.2 * NOISE
    faster = free_decays.campaign((Setting(16.12, 0.0), Setting(90.0, 0.0)))
    slow, fast = (accuracy(run.record) for run in faster.runs)
    assert fast > 2.0 * slow


def rescaled(data, place, factor):
    """The campaign with the noise of one run multiplied by a factor."""
    runs = list(data.runs)
    time, quiet = runs[place].record.time_s, decays(noise=0.0).runs[place].record.yaw_rad
    reading = quiet + factor * (runs[place].record.yaw_rad - quiet)
    runs[place] = replace(runs[place], record=Record(time, reading))
    return replace(data, runs=tuple(runs))


@pytest.mark.parametrize("stated", [NOISE, None])
@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_a_run_that_differs_has_its_own_noise_and_the_others_share_theirs(stated, factor):
    data = decays(stated_noise=stated)
    assert len(set(campaign_noise(data, Settings().noise).variance.values())) == 1
    found = campaign_noise(rescaled(data, 2, factor), Settings().noise)
    assert found.reason.kind == ("some runs differ" if stated else "not stated")
    variance = dict(found.variance)
    assert variance.pop(data.runs[2].id) == pytest.approx((factor * NOISE) ** 2, rel=0.3)
    (common,) = set(variance.values())
    assert common == (stated**2 if stated else pytest.approx(NOISE**2, rel=0.1))


def test_without_a_majority_every_run_has_its_own_noise():
    variance = campaign_noise(rescaled(rescaled(decays(), 2, 3.0), 1, 3.0), Settings().noise).variance
    assert len(set(variance.values())) == 4


def test_of_two_meanings_of_a_stated_noise_that_the_records_allow_the_larger_is_used():
    """A noise that is taken too small is a gap."""
    step = 0.5 * NOISE  # rounding adds 2 % to the variance
    total = NOISE**2 + step**2 / 12.0
    larger = 0
    for seed in range(20):
        found = campaign_noise(decays(seed, resolution=step, stated_noise=NOISE), Settings().noise)
        larger += found.used == pytest.approx(total)
    assert larger == 20


@pytest.mark.parametrize("step", [2.0 * np.pi / 3.0 / 4096.0, 2e-3, 5e-3])
def test_the_step_of_the_lattice_is_found(step):
    assert reading_step(decays(resolution=step)) == pytest.approx(step, rel=1e-6)


def test_the_step_survives_being_printed_and_shifted():
    step = 1.7e-3
    data = with_records(decays(), lambda _t, y: np.round(step * np.floor(y / step) + 0.3 * step, 7))
    assert reading_step(data) == pytest.approx(step, abs=2e-7)


def test_continuous_readings_have_a_step_far_below_any_sensor():
    assert reading_step(decays()) < 0.1 * NOISE


def trends(count, change=None, jitter=0.0):
    """Trends of campaigns of white noise, the reading passed through ``change``.

    Args:
        jitter: greatest delay of a sample, a share of the interval.
    """
    found = []
    for seed in range(count):
        data = decays(seed + 100, rate=1000.0, duration=4.0, jitter=jitter)
        trend = noise_trend(data if change is None else with_records(data, change(seed)))
        found.append((trend.amplitude_z, trend.rate_z, trend.spread))
    return np.array(found)


@pytest.mark.parametrize("jitter", [slow(0.0), 0.5])
def test_trends_of_white_noise_are_standard_normal(jitter):
    found = trends(200, jitter=jitter)[:, :2]
    assert np.all(np.abs(found.mean(axis=0)) < 4.0 / np.sqrt(200))
    low, high = chi2.ppf([1e-5, 1.0 - 1e-5], 199) / 199
    assert np.all((low < found.var(axis=0)) & (found.var(axis=0) < high))


@pytest.mark.parametrize("jitter", [0.0, 0.5])
def test_noise_that_follows_the_motion_is_loud(jitter):
    def by_rate(seed):
        rng = np.random.default_rng(seed)
        return lambda t, y: y + rng.normal(0.0, 1.0, y.size) * 2e-4 * np.abs(np.gradient(y, t))

    def by_amplitude(seed):
        rng = np.random.default_rng(seed)
        return lambda _t, y: y + rng.normal(0.0, 1.0, y.size) * 3e-3 * np.abs(y)

    assert np.all(trends(3, by_rate, jitter)[:, 1] > 8.0)
    assert np.all(trends(3, by_amplitude, jitter)[:, 0] > 8.0)


@pytest.mark.parametrize("jitter", [0.0, 0.5])
def test_bursts_are_louder_than_any_steady_noise(jitter):
    def bursts(seed):
        rng = np.random.default_rng(seed)
        return lambda t, y: y + rng.normal(0.0, 5.0 * NOISE, y.size) * (np.sin(2.0 * t) > 0.95)

    assert np.min(trends(3, bursts, jitter)[:, 2]) > 2.0 * np.max(trends(30, jitter=jitter)[:, 2])


def test_repetitions_are_judged_each_by_itself():
    data = decays(rate=1000.0)
    readings = [(run.record.yaw_rad, run.record.time_s) for run in data.runs]
    noisier = [(y + np.random.default_rng(3).normal(0.0, 1e-3 * np.abs(y)), time) for y, time in readings]
    both = trend_statistics(
        [(np.stack([a, b]), time) for (a, time), (b, _) in zip(readings, noisier, strict=True)]
    )
    for i, one in enumerate((readings, noisier)):
        np.testing.assert_allclose(
            both[i], trend_statistics([(y[None], time) for y, time in one])[0], rtol=1e-9
        )


def test_a_record_that_rests_has_finite_statistics():
    resting = with_records(decays(rate=1000.0), lambda _t, y: np.round(y / 0.1) * 0.1)
    trend = noise_trend(resting)
    assert np.all(np.isfinite([trend.amplitude_z, trend.rate_z, trend.spread]))


def test_too_slow_a_sampling_has_no_trend():
    assert not noise_trend(decays(rate=200.0)).judged


def test_a_window_that_holds_a_fourth_difference_has_a_trend():
    """Half the power in the motion's second half shows at 7 samples a window, as of 3 Hz at 500 Hz."""
    slow = decays(rate=350.0)
    assert noise_trend(slow).judged
    rng = np.random.default_rng(2)
    louder = with_records(slow, lambda _t, y: y + 0.02 * y * rng.standard_normal(y.size))
    assert noise_trend(louder).amplitude_z > noise_trend(slow).amplitude_z + 5.0


def test_records_of_a_few_windows_have_no_trend():
    long = decays(rate=1000.0)
    runs = [replace(r, record=Record(r.record.time_s[:40], r.record.yaw_rad[:40])) for r in long.runs]
    assert noise_trend(long).judged
    assert not noise_trend(replace(long, runs=tuple(runs))).judged


def test_the_noise_of_the_shortest_record_is_that_which_was_added() -> None:
    omega, step, found = 2.0 * np.pi * 1.6, 0.01, []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time, given = step * np.arange(LEAST_SAMPLES), rng.normal(size=LEAST_SAMPLES)
        response = driven_rows(time, given, 0.025 * omega, omega**2, held=False)[0]
        level = 1e-3 * response.std()
        variance, relative = driven_variance(response + level * rng.normal(size=time.size), given, 0.6)
        found.append((variance / level**2 - 1.0) / relative)
    # the mean of 40 values of unit variance: beyond this once in ten thousand
    assert abs(np.mean(found)) < 3.9 / np.sqrt(40.0)


@pytest.mark.parametrize("burst", [1.0, 0.3, 1e-5], ids=["even", "uneven", "bursts"])
def test_residuals_from_a_smooth_curve_do_not_depend_on_the_clock(burst):
    """A logger may write samples in bursts, a few microseconds apart, with pauses between them."""
    rng = np.random.default_rng(9)
    time = np.cumsum(np.where(rng.random(600) < 0.1, 1.0, burst))
    curve = SmoothCurve(time, 5)
    polynomial = ((time - time[0]) / (time[-1] - time[0]) - 0.4) ** 5
    inside = curve.residuals(rng.normal(size=time.size)[:, None] + 1e3 * polynomial[:, None] * [0.0, 1.0])
    np.testing.assert_allclose(inside[:, 0], inside[:, 1], atol=1e-6)  # a quintic is a curve too
    again = curve.residuals(inside[:, 0])  # and nothing of a curve is left in residuals
    np.testing.assert_allclose(again, inside[:, 0], atol=1e-6)
