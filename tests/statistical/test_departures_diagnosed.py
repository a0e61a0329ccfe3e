"""The diagnosis where an assumption of simulators, fits and tests is broken. Truth: the reference simulator."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.search.investigate import nominal_study
from tests.marks import slow
from tests.reference.rigs import rig
from tunnel_reference.departures import DEPARTURES, draw_departures
from tunnel_reference.draw import CampaignDraw, EffectDraw, Mixture, draw_campaign, draw_conditions
from tunnel_reference.forms import forms_of
from tunnel_reference.make import as_campaign, simulate_set
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_sim.effects import ALL_EFFECTS

TOGETHER = (
    "both_sides densities_differ speeds_unpaired other_springs noise_differs durations_differ zeros_differ"
)
BROKEN = [*((name,) for name in DEPARTURES), tuple(TOGETHER.split()), ("rates_differ", "durations_differ")]
QUICK = (tuple(TOGETHER.split()),)  # most departures at once
CASES = [pytest.param(names) if names in QUICK else slow(names) for names in BROKEN]


@pytest.mark.parametrize("names", CASES, ids=lambda names: "+".join(names))
def test_a_campaign_without_a_gap_has_none(names):
    base = rig(
        (21.02, 67.98, 21.02, 67.98),
        (0.0, 0.0, 25.0, 15.0),
        (0.35, 0.2, 0.35, 0.14),
        duration=5.0,
        zero=0.003,
    )
    c = draw_departures(np.random.default_rng(11), base, certain=names)
    draw = CampaignDraw("none", c, (), 4)
    campaign = as_campaign(read_and_fit(draw, simulate_motions([draw])[0]), "c")
    found = nominal_study(campaign, ALL_EFFECTS)
    assert not found.gap.test.detected
    assert found.causes == ()
    fitted, std = (getattr(found.nominal, name)("cn_beta") for name in ("value", "std"))
    assert abs(fitted - c.cn_beta) < 5.0 * std


@pytest.mark.slow
@pytest.mark.parametrize("cause", ["coulomb_friction", "quadratic_damping", "nonlinear_yaw_moment"])
@pytest.mark.parametrize("names", BROKEN, ids="+".join)
def test_a_single_cause_is_named(names, cause):
    mixture = Mixture(textbook=1.0, variety=0.0, small=0.0, certain=names)
    draw = draw_campaign(np.random.default_rng([2, 7]), kind="single", mixture=mixture, families=(cause,))
    answer = diagnose(as_campaign(simulate_set([draw])[0], "c"))
    assert answer.causes == (cause,)


@pytest.mark.parametrize("form", [0, slow(1), slow(2), slow(3), 4])
@pytest.mark.parametrize(
    "names",
    [pytest.param(()), slow(("sample_rate",)), slow(("rates_differ", "durations_differ"))],
    ids=lambda names: "+".join(names),
)
def test_a_hum_of_every_form_is_found_and_removed(names, form):
    """Of either mains, wandering, swelling, or of an even multiple alone, and folded by the sample rate."""
    shape = forms_of("mains_hum")[form]
    rng = np.random.default_rng([1, form])
    c = draw_departures(rng, draw_conditions(rng), certain=names, mains=True)
    extra = shape.draw(rng, c)
    effect = EffectDraw(shape, extra, 1, 4.0, 1e-3)
    draw = CampaignDraw("single", c, (effect,), 3)
    campaign = as_campaign(read_and_fit(draw, simulate_motions([draw], fine=False)[0]), "c")
    found = nominal_study(campaign, ALL_EFFECTS)
    assert found.prepared.hum is not None
    wander = 0.03 if shape.name == "wandering" else 3e-3  # Hz
    assert found.similarity.own(found.prepared.hum.frequency, "Hz") == pytest.approx(
        extra["frequency"], abs=wander
    )
    assert found.prepared.hum.amplitude == pytest.approx(1e-3, rel=0.3 if shape.name == "wandering" else 0.03)
    assert not found.gap.test.detected
