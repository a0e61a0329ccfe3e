"""The formula for the residual of driven runs. Truth: the friction that was simulated."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from diagnosis import Diagnosis, diagnose, vocabulary
from tunnel_lab.commands.diagnose import write_proposal
from tunnel_sim.effects.expression_effect import read_effects
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record

RATE, STEP, SECONDS = 100.0, 5e-4, 12.0
INERTIA, DAMPING, STIFFNESS = 0.12, 0.1, 3.0
SLIDING, RISE, WIDTH = 0.06, 0.06, 0.15  # N m, N m and rad/s
BY_ANGLE = 0.1  # N m/rad
LOAD = 0.05  # friction over the moment of the input


def multisine(seed: int, peak: float) -> Callable[[Array], Array]:
    lines = np.arange(0.2, 3.0, 0.1)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size)

    def moment(time: Array) -> Array:
        return np.asarray(peak / 8.0 * np.sin(2.0 * np.pi * np.outer(time, lines) + phases).sum(axis=1))

    return moment


def campaign(rise: float, by_angle: float = 0.0, load: float = 0.0) -> Campaign:
    """Three runs of a body on a spring, with friction that rises at low rates, with the angle or with the input."""
    runs = []
    clock = np.arange(round(SECONDS / STEP)) * STEP
    every = round(1.0 / (RATE * STEP))
    for seed, peak in enumerate((2.0, 1.6, 1.2)):
        moment = multisine(seed, peak)(clock)
        angle, rate, found = 0.0, 0.0, np.empty(clock.size)
        for i, given in enumerate(moment.tolist()):
            found[i] = angle
            rate += STEP / INERTIA * (given - STIFFNESS * angle - DAMPING * rate)
            friction = SLIDING + rise * np.exp(-((rate / WIDTH) ** 2)) + by_angle * abs(angle)
            friction += load * abs(given)
            rate = float(np.sign(rate)) * max(abs(rate) - STEP * friction / INERTIA, 0.0)
            angle += STEP * rate
        reading = found[::every] + 2e-4 * np.random.default_rng([seed, 1]).standard_normal(
            clock[::every].size
        )
        drive = Input("moment_nm", moment[::every])
        runs.append(Run(f"r{seed + 1}", Record(clock[::every], reading), 0.0, STIFFNESS, drive=drive))
    return Campaign("driven", RigProperties(), SensorProperties(RATE), tuple(runs))


def answer(rise: float, by_angle: float = 0.0, load: float = 0.0) -> Diagnosis:
    kinds = vocabulary(include=["coulomb_friction"])
    return diagnose(campaign(rise, by_angle, load), kinds=kinds, rivals=())


@pytest.mark.slow
def test_the_rise_of_friction_at_low_rates_is_a_form_of_dry_friction() -> None:
    found = answer(RISE)
    assert found.causes == ("coulomb_friction",)
    values = {name: given.value for name, given in found.candidates[0].parameters.items()}
    # the simulation's own steps, of first order, allow for a few per cent
    assert values["friction_moment"] == pytest.approx(SLIDING, rel=0.05)
    assert values["peak"] * values["friction_moment"] == pytest.approx(RISE, rel=0.05)
    assert values["peak_rate"] == pytest.approx(WIDTH, rel=0.05)
    assert found.closable is None


def test_the_rise_of_friction_with_the_angle_is_proposed(tmp_path: Path) -> None:
    found = answer(0.0, BY_ANGLE)
    assert found.closable is not None
    law = found.closable.law
    assert law is not None
    assert law.effect["moment"] == "k*abs(b)*sign(r)"
    assert law.closed > 0.9
    assert law.parameters["k"][0] == pytest.approx(-BY_ANGLE, rel=0.05)
    assert "The formula k*abs(b)*sign(r) explains" in found.closable.words
    path = write_proposal(tmp_path / "law.toml", found)
    assert path is not None
    assert tomllib.loads(path.read_text())["effects"][0]["name"].startswith("proposed_")
    assert next(kind.name for kind in read_effects(path)).startswith("proposed_")


@pytest.mark.slow
def test_the_rise_at_low_rates_is_proposed_beside_friction_with_load() -> None:
    found = answer(RISE, load=LOAD)
    assert found.causes == ("coulomb_friction",)
    assert found.candidates[0].parameters["load"].value == pytest.approx(LOAD, rel=0.05)
    assert found.closable is not None
    law = found.closable.law
    assert law is not None
    assert law.effect["moment"] == "k*exp(-(r/v1)^2)*sign(r)"
    assert law.parameters["k"][0] == pytest.approx(-RISE, rel=0.05)
    assert law.parameters["v1"][0] == pytest.approx(WIDTH, rel=0.05)


@pytest.mark.slow
def test_plain_dry_friction_needs_no_formula() -> None:
    found = answer(0.0)
    assert found.causes == ("coulomb_friction",)
    assert found.closable is None or found.closable.law is None
