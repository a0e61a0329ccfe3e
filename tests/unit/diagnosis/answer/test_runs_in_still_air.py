"""Steady causes beside a random moment are tested in still air. Truth: the effect with which the runs are made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.runs_in_still_air import left_in_still_air
from diagnosis.findings.decision import STILL_AIR_LEAVES
from diagnosis.search.answer import Answer
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import MomentLayer, ProcessNoise
from diagnosis.search.random_spectra import SpectrumPart
from diagnosis.search.study import Study
from diagnosis.search.weights import FittedSet
from tests.support.gap_campaigns import added, campaign, nominal, studied
from tunnel_sim.effects import effect_class, effect_from

PLAY = effect_from("free_play", {"half_width": 0.01})


def shaken(cause: str, *, windy_only: bool = True) -> Study:
    """Runs with free play, as answered by one steady cause and buffeting of the runs with the wind on."""
    data = campaign(PLAY, duration=6.0)
    base = nominal(data)
    runs = tuple(run.id for run in data.runs if run.wind_on or not windy_only)
    count, kind = len(runs), effect_class("buffeting")
    process = ProcessNoise(
        (SpectrumPart(0.01, 5.0),), runs, np.full(count, 2.5), np.ones(count), 5.0, 0.25,
        [np.ones(9)] * count, 0.012, np.ones(3), 0.0,
    )  # fmt: skip
    names = (kind.name, cause)
    layer = MomentLayer((kind,), process, FittedSet(names, 0.01, np.zeros(6)))
    own = Hypothesis((cause,), added(base, cause), moment=layer)
    return replace(studied(data, base, names), answers=(Answer(names, 0.01, 0.9, own, own),))


@pytest.mark.parametrize(("cause", "explains"), [("free_play", True), ("structural_damping", False)])
def test_a_steady_cause_must_explain_the_runs_in_still_air(cause: str, explains: bool) -> None:
    left = left_in_still_air(shaken(cause))
    assert left is not None
    assert (left < STILL_AIR_LEAVES) == explains


def test_nothing_is_asked_without_a_random_moment_or_without_runs_in_still_air() -> None:
    study = shaken("cubic_stiffness")
    (answer,) = study.answers
    assert answer.hypothesis is not None
    steady = replace(answer, hypothesis=replace(answer.hypothesis, moment=None))
    assert left_in_still_air(replace(study, answers=(steady,))) is None
    assert left_in_still_air(shaken("cubic_stiffness", windy_only=False)) is None
