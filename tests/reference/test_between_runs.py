"""Campaigns whose runs differ. Truth: closed form, and the moments of the distributions."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest

from tests.reference.free_decays import damped_cosine
from tests.reference.rigs import rig
from tunnel_reference import draw as drawing
from tunnel_reference import make
from tunnel_reference.catalogue import Group
from tunnel_reference.draw import KINDS, CampaignDraw, Mixture, draw_campaign
from tunnel_reference.scatter_draws import FORMS, LEVELS, MIXED, USUAL, draw_scatter, scattered
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_reference.true_conditions import FRONTAL_AREA, REFERENCE_LENGTH

RIG = rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35, 0.2, 0.35, 0.14), duration=2.0)


def scatter(seed=1, runs=4, **changes):
    chosen = {"level": "usual", "normal": 1.0, "rare": 0.0, "stated": 0.0, **changes}
    return draw_scatter(np.random.default_rng(seed), runs, **chosen)


def of_form(name, seed, runs):
    """Deviations of one form, in widths."""
    _, draw = FORMS[name]
    widths = dict.fromkeys(USUAL, 1.0)
    return np.stack([draw(np.random.default_rng([seed, n]), widths, runs)["wind_speed"] for n in range(3000)])


@pytest.mark.parametrize("kind", KINDS)
def test_all_else_is_drawn_alike_with_and_without_scatter(kind):
    for seed in range(4):
        plain, other = (
            draw_campaign(
                np.random.default_rng(seed), kind=kind, mixture=Mixture(textbook=0.0, scatter=share)
            )
            for share in (0.0, 1.0)
        )
        assert plain.scatter is None
        assert other.scatter is not None
        assert plain.seed == other.seed
        assert [(e.form, e.extra, e.sign, e.target) for e in plain.effects] == [
            (e.form, e.extra, e.sign, e.target) for e in other.effects
        ]
        for one in fields(plain.conditions):
            pair = (getattr(plain.conditions, one.name), getattr(other.conditions, one.name))
            assert np.array_equal(*pair), one.name


def test_half_of_the_campaigns_scatter_where_half_are_asked_for():
    drawn = [
        draw_campaign(np.random.default_rng(seed), kind="none", mixture=Mixture(scatter=0.5)).scatter
        for seed in range(200)
    ]
    assert 70 < sum(one is not None for one in drawn) < 130  # of a binomial, one in 20 000 on either side
    levels = [one.level for one in drawn if one is not None]
    assert set(levels) == {"small", "large"}
    stated = [bool(one.stated) for one in drawn if one is not None]
    assert 0.25 < np.mean(stated) < 0.75


@pytest.mark.parametrize("level", LEVELS)
def test_the_widths_are_of_their_level(level):
    low, high = LEVELS[level]
    for seed in range(60):
        found = scatter(seed, level=level, stated=1.0)
        assert found.level == level
        assert found.widths
        assert set(found.stated) == set(found.widths) == set(found.deviations)
        for name, width in found.widths.items():
            assert low * (1.0 - 1e-12) <= width / USUAL[name] <= high * (1.0 + 1e-12)
            assert found.stated[name] == pytest.approx(width, rel=0.05)
    absent = [set(USUAL) - set(scatter(seed, level=level).widths) for seed in range(60)]
    assert any(absent) == (low < high)


def test_forms_are_of_their_group():
    for seed in range(30):
        assert scatter(seed).form == "normal"
        for rare, group in ((0.0, Group.COMMON), (1.0, Group.RARE)):
            found = scatter(seed, level=MIXED, normal=0.0, rare=rare)
            assert FORMS[found.form][0] is group


@pytest.mark.parametrize("name", ["normal", "students_t", "zeros_too", "random_walk"])
def test_the_variance_of_the_runs_is_that_of_the_width(name):
    """Of the runs about their mean, with n − 1 degrees of freedom: its mean, within five standard errors of it."""
    found = np.var(of_form(name, 1, 12), axis=1, ddof=1)
    assert abs(np.mean(found) - 1.0) < 5.0 * np.std(found) / np.sqrt(found.size)


def test_tails_are_heavier_than_normal_and_a_walk_is_slow():
    """Truth: P(|t| > 3 √2) of four degrees of freedom is 1.3 %; a walk's neighbours are alike."""
    beyond = np.mean(np.abs(of_form("students_t", 2, 12)) > 3.0)
    assert beyond == pytest.approx(0.0132, abs=0.004)
    walk = of_form("random_walk", 3, 12)
    assert np.mean(np.diff(walk, axis=1) ** 2) == pytest.approx(6.0 / 13.0, rel=0.05)


def test_a_drift_goes_along_the_runs():
    slopes = np.abs(np.polyfit(np.linspace(0.0, 1.0, 12), of_form("drifting", 4, 12).T, 1)[0])
    assert np.mean(slopes) == pytest.approx(2.5, abs=0.3)  # of 1 to 4 widths, and of chance
    widths = dict.fromkeys(USUAL, 1.0)
    damping = FORMS["drifting"][1](np.random.default_rng(5), widths, 2000)["mechanical_damping"]
    assert abs(np.polyfit(np.linspace(0.0, 1.0, 2000), damping, 1)[0]) < 0.5


def simulated(*scatters, base=RIG):
    draws = [CampaignDraw("none", scattered(base, found), (), 1, scatter=found) for found in scatters]
    return [read_and_fit(*pair) for pair in zip(draws, simulate_motions(draws), strict=True)]


def test_every_run_moves_with_its_own_numbers():
    quiet = replace(RIG, noise_std=1e-12, resolution=1e-9, zero=0.0)
    found = scatter(3, level="large", normal=0.0, rare=0.0)
    deviations = {
        "wind_speed": np.array([0.02, -0.01, 0.03, -0.02]),
        "spring_stiffness": np.array([0.01, -0.02, 0.005, 0.015]),
        "mechanical_damping": np.array([0.2, -0.1, 0.3, -0.4]),
        "zero": np.array([0.003, -0.001, 0.002, 0.0]),
    }
    found = replace(found, deviations=deviations)
    campaign = make.as_campaign(*simulated(found, base=quiet), "c")
    assert campaign.sensor.zero is None  # it is not stated
    for number, run in enumerate(campaign.runs):
        own = {name: values[number] for name, values in deviations.items()}
        assert run.wind_speed == RIG.wind_speed[number]
        assert run.spring_stiffness == RIG.spring_stiffness[number]
        speed = run.wind_speed * (1.0 + own["wind_speed"])
        pressure = 0.5 * 1.2 * speed**2 * FRONTAL_AREA * REFERENCE_LENGTH
        lever = 0.5 * 1.2 * speed * FRONTAL_AREA * REFERENCE_LENGTH**2
        spring = run.spring_stiffness * (1.0 + own["spring_stiffness"])
        stiffness = (spring - pressure * RIG.cn_beta) / RIG.yaw_inertia
        damping = RIG.mechanical_damping * (1.0 + own["mechanical_damping"])
        damping = (damping - lever * RIG.cn_r) / RIG.yaw_inertia
        expected = damped_cosine(run.record.time_s, damping, stiffness, RIG.start_angle[number], 0.0)
        assert np.allclose(run.record.yaw_rad, expected + own["zero"], atol=2e-7)


def test_a_campaign_states_what_is_known_and_its_truth_the_rest():
    found = scatter(4, stated=1.0)
    one, plain = simulated(found, None, base=replace(RIG, duration=4.0))
    stated = make.as_campaign(one, "c").repeatability
    assert stated is not None
    assert stated.stated == {"wind_speed": 0.003, "spring_stiffness": 0.0005, "mechanical_damping": 0.01}
    truth = make.truth_of(one)
    assert truth["effects"] == []
    assert truth["scatter"] == truth["repeatability"] == dict(found.widths)
    assert (truth["scatter_level"], truth["scatter_form"]) == ("usual", "normal")
    assert list(truth["runs"]) == ["r01", "r02", "r03", "r04"]
    assert [run["wind_speed"] for run in truth["runs"].values()] == found.deviations["wind_speed"].tolist()
    assert make.as_campaign(plain, "c").repeatability is None
    assert {"scatter", "runs", "repeatability"} & make.truth_of(plain).keys() == set()
    assert one.excess > plain.excess + 0.1


def test_effects_are_sized_without_the_scatter(monkeypatch):
    monkeypatch.setattr(drawing, "draw_conditions", lambda _rng: RIG)
    usual = Mixture(textbook=1.0, variety=0.0, small=0.0, level="usual")
    plain, other = make.simulate_set(
        [
            draw_campaign(
                np.random.default_rng(2),
                kind="single",
                mixture=replace(usual, scatter=share),
                families=("cubic_stiffness",),
            )
            for share in (0.0, 1.0)
        ]
    )
    assert not np.any(plain.draw.conditions.speed_deviation)
    assert np.any(other.draw.conditions.speed_deviation)
    assert plain.draw.effects[0].value == other.draw.effects[0].value


def test_no_hash_decides_the_order_of_draws():
    """Sets of names are iterated in another order in every process; the draws must not be."""
    program = (
        "import numpy as np; from tunnel_reference.scatter_draws import FORMS, USUAL\n"
        "for name, (_, draw) in FORMS.items():\n"
        "    found = draw(np.random.default_rng(1), USUAL, 3)\n"
        "    print(name, sorted((of, values.tolist()) for of, values in found.items()))"
    )
    said = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
            capture_output=True, text=True, check=True,
        ).stdout
        for seed in (0, 1, 2, 5)
    }  # fmt: skip
    assert len(said) == 1
