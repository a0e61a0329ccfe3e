"""Rigs of another scale, coloured noise, uneven stamps, and effects that imitate each other. Truth: closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.rigs import rig
from tunnel_reference import make
from tunnel_reference.draw import (
    BEYOND,
    CIRCUMSTANCES,
    CampaignDraw,
    EffectDraw,
    Mixture,
    draw_campaign,
    draw_circumstances,
    redraw,
)
from tunnel_reference.forms import forms_of
from tunnel_reference.integrator import RodMotion
from tunnel_reference.readings import read_motion
from tunnel_reference.severity import (
    OWN_EXCESS,
    OWN_SHARE,
    _Search,
    own_excesses,
    read_and_fit,
    simulate_motions,
    size_effects,
)

RIG = rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35,) * 4)


def test_a_rig_of_another_scale_has_the_same_coefficients():
    c = replace(RIG, time_scale=0.1, moment_scale=0.02)
    draw = CampaignDraw("none", c, (), 1)
    simulated = read_and_fit(draw, simulate_motions([draw], fine=False)[0])
    written, truth = make.as_campaign(simulated, "c"), make.truth_of(simulated)
    props = written.rig
    for number, run in enumerate(written.runs):
        q = 0.5 * run.air_density * run.wind_speed * props.frontal_area * props.reference_length
        inertia = truth["yaw_inertia"]
        square = (run.spring_stiffness - q * run.wind_speed * c.cn_beta) / inertia
        sigma = (truth["mechanical_damping"] - q * props.reference_length * c.cn_r) / (2.0 * inertia)
        expected = (c.true_stiffness[number] - c.air_stiffness[number]) / c.yaw_inertia
        assert square == pytest.approx(
            expected / 0.1**2, rel=1e-4
        )  # the density is written with four decimals
        lost = (c.mechanical_damping - c.air_damping[number]) / (2.0 * c.yaw_inertia)
        assert sigma == pytest.approx(lost / 0.1, rel=1e-4)
        assert run.record.time_s[-1] == pytest.approx(0.1 * c.time[-1])
    assert truth["scale"] == {"time": 0.1, "moment": 0.02}


def test_coloured_noise_has_the_stated_variance_and_colour():
    c = replace(RIG, duration=40.0, coloured_share=0.8, noise_corner=10.0, resolution=1e-9)
    still = RodMotion(np.zeros((c.samples, 4)), np.zeros((c.samples, 4)))
    noise = read_motion(c, still, (), np.random.default_rng(1)) - c.zero
    assert noise.std() == pytest.approx(c.noise_std, rel=0.05)
    power = np.mean(np.abs(np.fft.rfft(noise, axis=0)) ** 2, axis=1)
    frequency = np.fft.rfftfreq(c.samples, 1.0 / c.sample_rate)
    low, high = (power[(frequency > a) & (frequency < b)].mean() for a, b in ((0.1, 3.0), (300.0, 500.0)))
    assert 60.0 < low / high < 200.0  # 0.8 of 1/(1 + (f/10)²), whose mean is near 0.031, on 0.2 of white


def test_jittered_samples_are_those_of_the_motion_when_they_were_taken():
    c = replace(RIG, clock_jitter=0.5, clock_seed=3, noise_std=0.0, resolution=1e-9)
    even = np.arange(c.samples) / c.sample_rate
    motion = RodMotion(
        np.tile(np.sin(20.0 * even)[:, None], 4), np.tile(20.0 * np.cos(20.0 * even)[:, None], 4)
    )
    found = read_motion(c, motion, (), np.random.default_rng(1))[:-1, 0] - c.zero
    assert np.allclose(found, np.sin(20.0 * c.time[:-1]), atol=3e-9)
    assert np.all(np.diff(c.time) > 0.0)


def test_every_circumstance_comes_up_and_none_at_zero_probability():
    rng = np.random.default_rng(2)
    found = [draw_circumstances(rng, RIG, probability=0.5, mains=i % 2 == 0) for i in range(60)]
    assert {c.runs for c in found} >= {2, 4}
    assert any(c.coloured_share for c in found)
    assert any(c.clock_jitter for c in found)
    assert any(c.stamp_step for c in found)
    assert min(c.time_scale for c in found) < 0.2
    assert max(c.time_scale for c in found) > 5.0
    for c in found:
        assert np.any(c.wind_on)
        assert not np.all(c.wind_on)
        assert c.wind_speed.max() * c.length_scale / c.time_scale < 100.0 + 1e-9
    for c in found[::2]:
        assert 3.0 < 50.0 * c.time_scale < 500.0
    assert draw_circumstances(rng, RIG, probability=0.0) is RIG


def effect(family, which=0):
    form = forms_of(family)[which]
    extra = form.draw(np.random.default_rng(0), RIG)
    return EffectDraw(form, extra, form.signs[0], 4.0, form.start)


@pytest.mark.slow
def test_effects_that_imitate_each_other_have_no_excess_of_their_own():
    alike = CampaignDraw("pair", RIG, (effect("coulomb_friction"), effect("coulomb_friction", 1)), 1)
    apart = CampaignDraw("pair", RIG, (effect("cubic_stiffness"), effect("coulomb_friction")), 1)
    sized = own_excesses(size_effects([alike, apart]))
    assert all(e.own < 0.1 * e.target for e in sized[0].effects)
    assert all(e.own > 0.5 * e.target for e in sized[1].effects)


def test_an_effect_outside_the_vocabulary_must_matter_too():
    weak, strong = (
        CampaignDraw("outside", RIG, (replace(outside("damping_warms_up"), value=value),), 1)
        for value in (1e-6, 1e-3)
    )
    found = [draw.effects[0] for draw in own_excesses([weak, strong])]
    assert [e.own >= max(OWN_EXCESS, OWN_SHARE * e.target) for e in found] == [False, True]


def outside(name):
    form = next(form for form in BEYOND["outside"] if form.name == name)
    return EffectDraw(form, form.draw(np.random.default_rng(0), RIG), form.signs[0], 1.0, form.start)


def test_a_motion_that_is_no_decay_is_infinitely_severe(monkeypatch):
    seen = []
    monkeypatch.setattr(_Search, "learn", lambda _, excess: seen.append(excess))
    search = _Search(0, 0, CampaignDraw("single", RIG, (effect("cubic_stiffness"),), 1))
    n = round(RIG.duration * RIG.sample_rate)
    away = np.full((n, RIG.runs), 1e200)
    for angle in (away, np.full_like(away, np.nan)):
        search.motion = RodMotion(angle, away)
        search.try_out()
    assert seen == [np.inf, np.inf]


@pytest.mark.parametrize(("kind", "number"), [("none", 0), ("single", 1), ("three", 3), ("four", 4)])
def test_kinds_have_their_number_of_effects_and_small_ones_beside(kind, number):
    draw = draw_campaign(np.random.default_rng(4), kind=kind, mixture=Mixture(small=1.0))
    mattering = [e for e in draw.effects if not e.small]
    small = [e for e in draw.effects if e.small]
    assert len(mattering) == number
    assert len(small) == (2 if number else 0)
    assert len({e.form.family for e in draw.effects}) == len(draw.effects)
    assert all(e.target < 0.31 for e in small)
    assert all(e.target >= 1.0 for e in mattering)
    again = redraw(draw)
    assert again.kind == kind
    assert [e.form.family for e in again.effects[:1]] == [e.form.family for e in draw.effects[:1]]
    assert redraw(draw).seed == again.seed


@pytest.mark.parametrize("name", CIRCUMSTANCES)
def test_a_certain_circumstance_is_in_every_campaign_and_the_others_in_none(name):
    for seed in range(30):
        c = draw_campaign(
            np.random.default_rng(seed),
            kind="single",
            mixture=Mixture(variety=0.0, small=0.0, certain=(name,)),
        ).conditions
        has = {
            "few_runs": c.runs <= 6 and np.unique(c.spring_stiffness).size <= 2,
            "coloured": c.coloured_share > 0.0,
            "uneven_stamps": c.clock_jitter > 0.0 or c.stamp_step > 0.0,
            "scaled": c.time_scale != 1.0,
        }
        assert has[name]
        assert not any(has[other] for other in CIRCUMSTANCES if other not in (name, "few_runs"))
