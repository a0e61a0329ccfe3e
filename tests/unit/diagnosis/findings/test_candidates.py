"""The answers of a document. Truth: what a study answers with."""

from __future__ import annotations

from dataclasses import replace

from diagnosis.answer.held_out import excess_base
from diagnosis.findings.candidates import candidates
from tests.support.gap_campaigns import answer, campaign, nominal, studied
from tunnel_sim.effects import effect_from


def test_scatter_alone_has_a_name_beside_an_answer_of_runs_that_repeat():
    data = campaign(effect_from("gravity_stiffness", {"stiffness": 0.5}))
    base = nominal(data)
    study = studied(data, base, ("gravity_stiffness",))
    both = (answer(("gravity_stiffness",), 0.0, 0.9), answer((), 0.0, 0.1))
    found = candidates(replace(study, answers=both), excess_base(study), {})
    scatter = "damping_scatter + stiffness_scatter + wind_speed_scatter"
    assert [one.effect for one in found] == ["gravity_stiffness", scatter, "none"]
