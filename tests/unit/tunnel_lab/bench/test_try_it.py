"""Trials of the rig. Truth: the closed form of the nominal motion, and the effects' own ranges."""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians, sqrt

import numpy as np
import pytest

from tunnel_lab.bench.try_it import RigTrial, chosen_effect, effect_words, plan_text, simulate, trial_sentence
from tunnel_lab.terminal.arguments import parse_effect
from tunnel_sim.effects import known_effects
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError


def test_the_nominal_model_swings_as_its_spring_says() -> None:
    trial = RigTrial(wind_speed=0.0)
    time, nominal, seen = simulate(trial)
    assert nominal is not None
    assert nominal[0] == pytest.approx(radians(20.0))
    assert np.array_equal(nominal, seen)
    assert time[-1] == pytest.approx(10.0, abs=0.01)
    frequency = sqrt(trial.spring_stiffness / load_rig().dynamics.yaw_inertia) / (2.0 * pi)
    assert f"swings at {frequency:.3g} Hz" in trial_sentence(trial, time, nominal, seen)


@pytest.mark.parametrize(
    "kind", [kind for kind in known_effects() if not kind.driven], ids=lambda kind: kind.name
)
def test_every_effect_can_be_tried_and_simulated(kind: type) -> None:
    trial = RigTrial(effect=kind.name, severity=kind.example[0], duration=4.0)
    time, nominal, seen = simulate(trial)
    assert time.shape == nominal.shape == seen.shape
    assert np.all(np.isfinite(seen))
    assert not np.array_equal(nominal, seen)
    name, text = effect_words(trial)
    assert name == "--effect"
    setting = parse_effect(text)
    assert kind(**setting.parameters) == chosen_effect(trial)
    assert effect_words(replace(trial, severity=0.0)) == []


def test_a_motion_without_bound_is_refused_in_a_line() -> None:
    with pytest.raises(TunnelError, match="grows without bound; choose a stiffer spring"):
        simulate(RigTrial(cn_beta=-1.0, cn_r=0.5, spring_stiffness=1.0, wind_speed=40.0, duration=40.0))


def test_the_plan_can_be_read(tmp_path) -> None:
    from tunnel_sim.files.plan_file import load_plan

    path = tmp_path / "plan.toml"
    path.write_text(plan_text(RigTrial(), "rig"))
    plan = load_plan(path)
    assert len(plan.conditions) == 4
    assert {one.wind_speed for one in plan.conditions} == {0.0, 10.0}
