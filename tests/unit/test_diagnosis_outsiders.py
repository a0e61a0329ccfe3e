"""Rivals from outside the vocabulary: found where they act, and no match for the vocabulary where they do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.attribution.outsiders import weigh_outsiders
from tests.unit.gap_campaigns import campaign, nominal
from tunnel_sim.effects import effect_from
from tunnel_sim.vocabulary.record import Record


def changed(data, change):
    """The campaign with ``change(time, angle)`` added to every reading."""
    runs = [
        replace(run, record=Record(time, angle + change(time, angle)))
        for run in data.runs
        for time, angle in [(run.record.time_s, run.record.yaw_rad)]
    ]
    return replace(data, runs=tuple(runs))


def follows_power(time, angle, delay=0.7, size=0.05):
    """A zero that follows the squared angle late, by explicit steps."""
    zero, zeros = angle[0] ** 2, []
    for square in angle**2:
        zeros.append(size * zero)
        zero += (square - zero) * (time[1] - time[0]) / delay
    return np.array(zeros)


def test_a_zero_that_follows_the_motion_is_an_outsider():
    found = weigh_outsiders(nominal(changed(campaign(), follows_power)))
    assert found is not None
    assert "zero" in found.words
    assert found.share < 0.08  # the nearest of the delays tried


def test_a_gain_that_drifts_leaves_no_gap():
    fit = nominal(changed(campaign(), lambda time, angle: 0.01 * time / time[-1] * angle))
    assert fit.excess < 0.05  # the damping absorbs it: exp(g t/T) to first order


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("cubic_stiffness", {"coefficient": 0.05}),
        ("coulomb_friction", {"friction_moment": 0.004}),
        ("sensor_drift", {"drift": 0.004}),
        ("asymmetric_stiffness", {"coefficient": 0.05}),
    ],
)
def test_what_the_vocabulary_holds_no_outsider_explains(name, values):
    found = weigh_outsiders(nominal(campaign(effect_from(name, values))))
    assert found is None or found.share > 0.1


def test_without_a_gap_there_is_nothing_to_explain():
    fit = nominal(campaign())
    found = weigh_outsiders(replace(fit, chi2=np.array([0.9 * r.size for r in fit.residuals])))
    assert found is None
