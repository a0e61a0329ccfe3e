"""What breaks the assumptions that simulators, fits and tests share. Truth: closed form, moments of the noise."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.reference.free_decays import damped_cosine
from tests.reference.rigs import rig
from tunnel_reference import make
from tunnel_reference.departures import DEPARTURES, draw_departures
from tunnel_reference.draw import CampaignDraw, EffectDraw, Mixture, draw_campaign, draw_conditions
from tunnel_reference.forms import forms_of
from tunnel_reference.integrator import RodMotion
from tunnel_reference.readings import read_motion
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_reference.true_conditions import FRONTAL_AREA, REFERENCE_LENGTH

RIG = rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35, 0.2, 0.35, 0.14), duration=4.0)

#: What each of them changes.
CHANGES = {
    "sample_rate": {"sample_rate"},
    "rates_differ": {"every"},
    "durations_differ": {"kept"},
    "records_are_short": {"duration"},
    "samples_missing": {"gaps"},
    "times_start_anywhere": {"time_start"},
    "both_sides": {"release_angle", "start_angle"},
    "releases_are_other": {"release_angle", "start_angle"},
    "starts_with_a_rate": {"start_rate"},
    "densities_differ": {"air_density"},
    "speeds_unpaired": {"wind_speed"},
    "other_springs": {"spring_stiffness"},
    "noise_differs": {"noise_scale", "stated_noise"},
    "noise_has_tails": {"noise_tails"},
    "zeros_differ": {"zero_shift"},
    "rests_anywhere": {"offset"},
    "sensor_is_other": {"noise_std", "resolution", "stated_noise"},
    "inertia_is_other": {"yaw_inertia"},
    "air_restores": {"cn_beta", "cn_r"},
    "damping_is_other": {"mechanical_damping"},
}


NOISE = ("noise_differs", "noise_has_tails", "zeros_differ", "sensor_is_other")


def changed(name, seed=3, base=RIG):
    return draw_departures(np.random.default_rng(seed), base, certain=(name,))


@pytest.mark.parametrize("name", list(DEPARTURES))
def test_each_breaks_its_own_assumption_and_no_other(name):
    found = changed(name, base=replace(RIG, stated_noise=4e-4))
    differ = {
        field.name
        for field in fields(RIG)
        if not np.array_equal(
            getattr(found, field.name), getattr(replace(RIG, stated_noise=4e-4), field.name)
        )
    }
    assert differ == CHANGES[name]


def test_nothing_is_broken_or_drawn_where_it_is_not_asked_for():
    rng = np.random.default_rng(1)
    assert draw_departures(rng, RIG) is RIG
    assert rng.random() == np.random.default_rng(1).random()
    plain, named = (
        draw_campaign(np.random.default_rng(5), kind="single", mixture=Mixture(certain=certain)).conditions
        for certain in ((), ("zeros_differ",))
    )
    assert not np.any(plain.zero_shift)
    assert np.all(named.zero_shift != 0.0)


def test_all_together_are_the_motion_of_the_stated_physics():
    """Other rates, durations, clocks, sides, starts, densities, speeds, springs, air and damping at once."""
    quiet = replace(RIG, noise_std=1e-12, resolution=1e-9, zero=0.0)
    names = [name for name in DEPARTURES if name not in NOISE]
    c = draw_departures(np.random.default_rng(7), quiet, certain=names)
    draw = CampaignDraw("none", c, (), 1)
    campaign = make.as_campaign(read_and_fit(draw, simulate_motions([draw])[0]), "c")
    sizes, rates = set(), set()
    for number, run in enumerate(campaign.runs):
        density, start = run.air_density, c.time_start[number]
        assert density == pytest.approx(c.air_density[number])
        pressure = 0.5 * density * run.wind_speed**2 * FRONTAL_AREA * REFERENCE_LENGTH
        lever = 0.5 * density * run.wind_speed * FRONTAL_AREA * REFERENCE_LENGTH**2
        stiffness = (run.spring_stiffness - pressure * c.cn_beta) / c.yaw_inertia
        damping = (c.mechanical_damping - lever * c.cn_r) / c.yaw_inertia
        time = run.record.time_s - start
        assert time[0] == pytest.approx(0.0, abs=1e-9)
        expected = damped_cosine(time, damping, stiffness, c.start_angle[number], c.start_rate[number])
        assert np.allclose(run.record.yaw_rad + c.offset, expected, atol=2e-7)  # readings have seven decimals
        sizes.add(run.record.duration)
        rates.add(round(run.record.sample_rate, 6))
    assert len(sizes) == c.runs
    assert len(rates) > 1
    assert {np.sign(run.release_angle) for run in campaign.runs} == {-1.0, 1.0}
    assert c.cn_beta < 0.0
    assert abs(c.offset) > 0.1
    steps = np.diff(campaign.runs[0].record.time_s)
    assert steps.max() > 3.0 * np.median(steps)  # a gap


def test_the_noise_of_a_run_and_its_tails_are_as_drawn():
    c = replace(RIG, duration=200.0, resolution=1e-9, zero=0.0)
    c = draw_departures(
        np.random.default_rng(4), c, certain=("noise_differs", "noise_has_tails", "zeros_differ")
    )
    c = replace(c, noise_tails=12.0)
    still = RodMotion(np.zeros((c.samples, c.runs)), np.zeros((c.samples, c.runs)))
    read = read_motion(c, still, (), np.random.default_rng(1))
    assert np.allclose(read.std(axis=0), c.noise_std * c.noise_scale, rtol=0.01)
    assert np.allclose(read.mean(axis=0), c.zero_shift, atol=5.0 * c.noise_std * 2.0 / np.sqrt(c.samples))
    scaled = (read - read.mean(axis=0)) / read.std(axis=0)
    assert np.mean(scaled**4) == pytest.approx(3.0 + 6.0 / (12.0 - 4.0), rel=0.05)


def test_a_hum_is_drawn_where_every_run_shows_it():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        c = draw_departures(rng, draw_conditions(rng), certain=("sample_rate", "rates_differ"), mains=True)
        for every in c.every:
            for mains in (50.0, 60.0):
                rate = c.sample_rate / every
                place = abs(mains - rate * round(mains / rate))
                assert 16.0 <= place <= 0.5 * rate - 2.0


def test_a_hum_that_no_change_can_show_is_not_drawn_for_ever():
    """Mains at 15.5 Hz of a rig as fast as this lie beyond no third harmonic, whatever the durations are."""
    fast = replace(RIG, time_scale=0.31)
    found = draw_departures(np.random.default_rng(1), fast, certain=("durations_differ",), mains=True)
    assert np.ptp(found.kept) > 0.0


def test_a_zero_of_every_run_is_stated_and_a_common_one_is_not():
    for c, zero in ((RIG, None), (changed("zeros_differ"), "per_run")):
        draw = CampaignDraw("none", c, (), 1)
        simulated = read_and_fit(draw, simulate_motions([draw], fine=False)[0])
        assert make.as_campaign(simulated, "c").sensor.zero == zero
        assert abs(simulated.excess) < 0.1  # it is no part of an effect's excess


def hum(form, seed=0, **changes):
    """A hum of one form of amplitude 1 in records at rest without noise, and its conditions."""
    c = replace(RIG, duration=20.0, noise_std=0.0, resolution=1e-12, zero=0.0, **changes)
    shape = next(one for one in forms_of("mains_hum") if one.name == form)
    effect = EffectDraw(shape, shape.draw(np.random.default_rng(seed), c), 1, 1.0, 1.0)
    _, term = shape.bind(1.0, effect.extra, c)
    still = RodMotion(np.zeros((c.samples, c.runs)), np.zeros((c.samples, c.runs)))
    return c, effect.extra["frequency"], read_motion(c, still, (term,), np.random.default_rng(1))


def peak(c, values):
    """The frequency of the highest line of a record, Hz, and its amplitude."""
    window = np.hanning(values.size)
    spectrum = np.abs(np.fft.rfft(values * window, 8 * values.size)) * 2.0 / window.sum()
    at = int(np.argmax(spectrum))
    return at * c.sample_rate / (8 * values.size), spectrum[at]


def test_both_mains_are_drawn_within_the_wander_of_a_grid():
    for form in forms_of("mains_hum"):
        drawn = [form.draw(np.random.default_rng(seed), RIG)["frequency"] for seed in range(60)]
        nominal = np.where(np.array(drawn) < 55.0, 50.0, 60.0)
        assert 15 < np.sum(nominal == 50.0) < 45  # of a binomial of 60 draws, one in 10 000 on either side
        apart = np.array(drawn) - nominal
        assert np.max(np.abs(apart)) <= 0.5
        assert np.std(apart) > 0.2


@pytest.mark.parametrize(("form", "multiple"), [("line", 1), ("second_harmonic", 2)])
def test_a_hum_is_a_line_of_its_multiple(form, multiple):
    c, frequency, read = hum(form)
    for run in range(c.runs):
        found, size = peak(c, read[:, run])
        assert found == pytest.approx(multiple * frequency, abs=0.01)
        assert size == pytest.approx(1.0, rel=0.01)


def test_a_wandering_hum_differs_by_run_and_within_it():
    c, frequency, read = hum("wandering")
    lines = [peak(c, read[:, run]) for run in range(c.runs)]
    assert all(abs(place - frequency) < 0.2 for place, _ in lines)
    assert np.ptp([place for place, _ in lines]) > 0.005
    assert np.ptp([size for _, size in lines]) > 0.1
    halves = [
        peak(c, read[half, 0])[0] for half in (slice(None, c.samples // 2), slice(c.samples // 2, None))
    ]
    assert halves[0] != pytest.approx(halves[1], abs=1e-3)
    again = hum("wandering")[2]
    assert np.array_equal(read, again)
