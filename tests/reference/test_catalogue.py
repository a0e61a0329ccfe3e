"""Every form of every family, and what is drawn from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.effect_cases import BETWEEN_RUNS, ON_DRIVEN_RUNS, VOCABULARY
from tests.reference.rigs import rig
from tunnel_reference.catalogue import Group
from tunnel_reference.draw import KINDS, NUMBERS, CampaignDraw, EffectDraw, Mixture, draw_campaign
from tunnel_reference.forms import FAMILIES, FORMS, forms_of
from tunnel_reference.moments import shaking, turbulence
from tunnel_reference.nominal_fit import fit_nominal
from tunnel_reference.outside import LAW_FORMS, OUTSIDE_FORMS
from tunnel_reference.severity import bind_effects, read_and_fit, simulate_motions, size_effects
from tunnel_reference.true_conditions import DrivenInput

ALL_FORMS = (*FORMS, *OUTSIDE_FORMS, *LAW_FORMS)


def drawn(form, value, sign=1, seed=3, **changes):
    c = rig(
        stiffness=(21.02, 67.98, 21.02, 67.98), speed=(0.0, 0.0, 25.0, 15.0), angle=(0.35,) * 4, **changes
    )
    moment = 0.3 * np.sin(15.0 * c.time)[:, None] * np.ones(4) if form.driven else np.zeros((c.samples, 4))
    c = (
        replace(c, drive=DrivenInput("moment_nm", moment, np.full(4, False), np.full(4, 0.1)))
        if form.driven
        else c
    )
    extra = {k: float(v) for k, v in form.draw(np.random.default_rng(seed), c).items()}
    return CampaignDraw("single", c, (EffectDraw(form, extra, sign, 1.0, value),), seed)


def test_every_effect_is_a_family_with_its_one_textbook_form_first():
    assert set(FAMILIES) == set(VOCABULARY) - ON_DRIVEN_RUNS - BETWEEN_RUNS
    for family in FAMILIES:
        first, *others = forms_of(family)
        assert first.group is Group.TEXTBOOK
        assert all(form.group is not Group.TEXTBOOK for form in others)
    assert len({(f.family, f.name) for f in ALL_FORMS}) == len(ALL_FORMS)
    assert len(OUTSIDE_FORMS) >= 10


@pytest.fixture(scope="module")
def motions():
    """Every form at ten times its start (limits kept), and the nominal motion."""
    draws = [
        drawn(
            f,
            min(10 * f.start, f.limits[1] / 2),
            f.signs[-1],
            duration=0.75,
            resolution=1e-9,
            sample_rate=500.0,
        )
        for f in ALL_FORMS
    ]
    plain = [CampaignDraw("none", draw.conditions, (), 3) for draw in draws]
    of = {
        driven: next(p for p in plain if (p.conditions.drive is not None) == driven)
        for driven in (False, True)
    }
    return draws, simulate_motions([*draws, *of.values()], fine=False)


@pytest.mark.parametrize("number", range(len(ALL_FORMS)), ids=[f"{f.family}-{f.name}" for f in ALL_FORMS])
def test_every_form_changes_the_reading_and_only_where_it_acts(number, motions):
    draws, results = motions
    draw = draws[number]
    plain = CampaignDraw("none", draw.conditions, (), draw.seed)
    reading = read_and_fit(draw, results[number]).readings
    nominal = read_and_fit(plain, results[-1 if draw.conditions.drive else -2]).readings
    changed = np.max(np.abs(reading - nominal), axis=0) > 1e-5
    assert changed.any()
    if VOCABULARY.get(draw.effects[0].form.family, ("", ""))[1] == "wind_on":
        assert not changed[:2].any()


@pytest.mark.parametrize("kind", KINDS)
def test_draws_are_reproducible_and_of_their_kind(kind):
    one, two = (draw_campaign(np.random.default_rng(7), kind=kind) for _ in range(2))
    assert one.seed == two.seed
    assert one.conditions.cn_beta == two.conditions.cn_beta
    assert [e.form for e in one.effects] == [e.form for e in two.effects]
    assert sum(not e.small for e in one.effects) == NUMBERS.get(kind, 1)
    assert len({e.form.family for e in one.effects}) == len(one.effects)


def test_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="kind must be one of"):
        draw_campaign(np.random.default_rng(0), kind="triple")


def test_tuning_mixture_has_no_rare_forms():
    for seed in range(60):
        draw = draw_campaign(
            np.random.default_rng(seed), kind="pair", mixture=Mixture(textbook=0.2, rare=0.0)
        )
        assert all(e.form.group is not Group.RARE for e in draw.effects)


def test_nominal_fit_recovers_a_linear_campaign():
    c = rig(
        stiffness=(21.02, 67.98, 21.02, 67.98), speed=(0.0, 0.0, 25.0, 15.0), angle=(0.35,) * 4, zero=0.003
    )
    draw = CampaignDraw("none", c, (), 1)
    (motion,) = simulate_motions([draw])
    fit = fit_nominal(c, motion.angle + c.zero)
    assert fit.parameters == pytest.approx([0.1, 0.012, 0.45, -0.12], rel=1e-6)
    assert fit.zero == pytest.approx(0.003, abs=1e-8)
    assert read_and_fit(draw, motion).excess == pytest.approx(0.0, abs=0.05)


@pytest.mark.slow
def test_effects_are_sized_to_their_target():
    form = forms_of("quadratic_damping")[0]
    draw = drawn(form, form.start)
    (sized,) = size_effects([draw])
    (motion,) = simulate_motions([sized])
    assert read_and_fit(sized, motion).excess == pytest.approx(1.0, rel=0.25)


@pytest.mark.parametrize("kind", ["band", "dryden", "von_karman", "octave"])
def test_turbulence_has_unit_variance_and_is_still_wind_off(kind):
    c = rig(stiffness=(20.0,) * 41, speed=(0.0, *(25.0,) * 40), angle=(0.3,) * 41, duration=10.0)
    series = turbulence(kind, c, seed=1, scale=5.0 if kind in ("band", "octave") else 0.5)
    assert np.all(series[0] == 0.0)
    assert np.mean(series[1:] ** 2) == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("kind", ["flat", "corner", "floor", "octave", "traffic"])
def test_what_shakes_the_rig_has_unit_variance_in_every_run(kind):
    c = rig(stiffness=(20.0,) * 60, speed=(0.0, 25.0) * 30, angle=(0.3,) * 60, duration=10.0)
    series = shaking(kind, c, seed=1, scale=20.0 if kind in ("flat", "traffic") else 5.0, ratio=0.2)
    for half in (series[::2], series[1::2]):  # with the wind off, and on
        # lognormal swelling of 0.2 raises the mean square by e^(2 · 0.04)
        assert np.mean(half**2) == pytest.approx(np.exp(0.08) if kind == "traffic" else 1.0, rel=0.15)
    assert np.max(np.abs(np.corrcoef(series)[~np.eye(60, dtype=bool)])) < 0.9  # of its own in every run


def test_pairs_with_a_calibration_effect_bind_both():
    first = drawn(forms_of("wind_speed_offset")[0], 0.5)
    pair = CampaignDraw("pair", first.conditions, (drawn(forms_of("unsteady_aero_lag")[0], 0.5).effects[0],
                                                   first.effects[0]), 1)  # fmt: skip
    conditions, terms = bind_effects(pair)
    assert conditions.true_speed.max() == 25.5
    assert terms[0].params["tau1"][2] == pytest.approx(0.5 * 0.625 / 25.5)
