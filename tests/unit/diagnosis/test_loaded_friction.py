"""Friction in proportion to gravity's moment: recovered by a fit, and offered only where a load varies."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.gap_campaigns import campaign, nominal

from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.patch.native_friction import native_friction
from diagnosis.search.hypothesis import _choices
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.rig import JointLaw, Term

FRICTION, GRAVITY = effect_class("coulomb_friction"), effect_class("gravity_stiffness")
LOAD = "coulomb_friction.load"
CONDITIONS = ((16.12, 0.0), (44.84, 0.0), (44.84, 15.0))


@pytest.fixture(scope="module")
def base():
    truth = effect_from("coulomb_friction", {"friction_moment": 0.003, "load": 0.04})
    gravity = effect_from("gravity_stiffness", {"stiffness": 1.5, "rest_angle": 0.1})
    return nominal(campaign(truth, gravity, conditions=CONDITIONS, duration=6.0))


def test_a_fit_finds_the_share_of_the_load(base):
    problem = Problem(base.problem.data, (GRAVITY, FRICTION), free_forms=(LOAD,))
    begin = {"gravity_stiffness.stiffness": 1.0, "coulomb_friction.friction_moment": 0.005, LOAD: 0.02}
    known = dict(zip(base.problem.names, base.point.common.tolist(), strict=True)) | begin
    start = np.array([known.get(name, 0.0) for name in problem.names])
    found = fit(problem, Point(start, base.point.release))
    for name, truth in {LOAD: 0.04, "coulomb_friction.friction_moment": 0.003}.items():
        assert abs(found.value(name) - truth) < 4.0 * found.std(name)
    assert found.std(LOAD) < 0.01
    assert found.excess < 0.02


def test_the_form_is_offered_where_gravity_makes_the_load_vary(base):
    def offered(*kinds):
        problem = Problem(base.problem.data, kinds)
        fitted = type("Fitted", (), {"problem": problem})
        return {name for forms in _choices(fitted) for form in forms for name in form}

    assert LOAD not in offered(FRICTION)
    assert LOAD in offered(FRICTION, GRAVITY)


def test_the_patch_adds_what_gravity_adds_and_leaves_out_what_a_drive_does():
    terms = (Term("sin(b)-b", 2.0, "N m"),)
    law = JointLaw(0.1, 2.0, terms=terms)
    assert law.weight == (2.0, 0.0)
    parameters = {"friction_moment": 0.01, "friction_load": 0.1, "load_stiffness": 2.0}
    found = native_friction(parameters, np.linspace(0.1, 3.0, 9), law, 0.0, 0.02)
    assert found.loss == 0.01
    assert found.program
    assert [fact.kind for fact in found.differences] == ["no native element"]
    without = native_friction({**parameters, "load_stiffness": 0.0}, np.ones(1), law, 0.0, 0.02)
    assert (without.loss, without.program) == (0.01, ())
    assert [fact.kind for fact in without.differences] == ["friction against load"]
