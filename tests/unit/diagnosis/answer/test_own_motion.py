"""The frequency and the damping of a run that is left out. Truth: the spring and the damper of the run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.own_motion import with_own_motions
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.prepared import HUM
from tests.support.gap_campaigns import campaign, nominal, studied
from tunnel_sim.vocabulary.campaign import Campaign

STIFFER = 0.004
"""Relative error of the stiffness that is stated for the odd run."""
CONDITIONS = ((16.12, 0.0), (16.12, 20.0), (44.84, 0.0), (44.84, 20.0), (44.84, 0.0))


def with_an_odd_run() -> Campaign:
    """Five runs; the spring of the last is stiffer than stated."""
    actual = (*CONDITIONS[:4], (44.84 * (1.0 + STIFFER), 0.0))
    data = campaign(conditions=actual, duration=6.0)
    odd = replace(data.runs[4], spring_stiffness=44.84)
    return replace(data, runs=(*data.runs[:4], odd))


@pytest.mark.parametrize("hum", [False, True])
def test_a_run_is_compared_with_the_model_of_the_others_where_it_holds_no_hum(hum: bool) -> None:
    data = with_an_odd_run()
    others = replace(data, runs=data.runs[:4])
    study = studied(others, nominal(others), (HUM.name,) if hum else ())
    odd = Disturbance(data.runs[4].id, None, None, 1e-5)
    (found,) = with_own_motions(replace(study, disturbed=(odd,)), data)
    if hum:
        assert found == odd
        return
    assert found.frequency is not None
    assert found.damping is not None
    frequency = np.sqrt(1.0 + STIFFER)
    assert found.frequency.value == pytest.approx(frequency - 1.0, abs=4.0 * found.frequency.known_std)
    assert 0.0 < found.frequency.known_std < 0.05 * STIFFER
    assert found.damping.value == pytest.approx(1.0 / frequency - 1.0, abs=4.0 * found.damping.known_std)
    assert found.as_they


def test_a_run_of_which_a_part_is_used_keeps_its_facts() -> None:
    data = with_an_odd_run()
    others = replace(data, runs=data.runs[:4])
    held = Disturbance(data.runs[4].id, None, None, 1e-5, kept_from_s=0.8)
    study = replace(studied(others, nominal(others)), disturbed=(held,))
    assert with_own_motions(study, data) == (held,)
