"""The laws of effects: an own class and an expression obey them, and broken ones do not."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, ClassVar, Self

import numpy as np
import pytest

from diagnosis.identifiability import identifiability
from tests.support.own_effects import DETENT, OwnCubic
from tunnel_sim.effects import Effect, effect_class
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.effects.sensor import InputDelay
from tunnel_sim.engine.effect_laws import check
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable


@dataclass(frozen=True)
class Broken(OwnCubic):
    name = "broken"


@dataclass(frozen=True)
class ActsAtItsNull(Broken):
    def law(self) -> Mapping[str, float]:
        return {"stiffness_cubic": self.hardening + 0.1}


@dataclass(frozen=True)
class IgnoresItsCondition(Broken):
    condition = "wind_on"


@dataclass(frozen=True)
class Forgets(Broken):
    exponent: float = parameter("p", "1", "power", scale=1.0, lower=1.0, upper=5.0, default=3.0)
    example = (1.0, 4.0)

    def to_json_dict(self) -> dict[str, Any]:
        return {"name": self.name, "parameters": {"hardening": self.hardening}}


@dataclass(frozen=True)
class Wanders(Broken):
    """Its moment depends on how often it was asked."""

    calls: ClassVar[Iterator[int]] = count()

    def law(self) -> Mapping[str, float]:
        return {} if self.is_null else {"stiffness_cubic": self.hardening * (1.0 + next(self.calls))}


@dataclass(frozen=True)
class TooStiff(Broken):
    """Its damping is far too strong for the steps."""

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        del stated, drawn
        for place, effect in enumerate(effects):
            if not effect.is_null:  # number, its value, rate, multiply
                runs.add_moment(place, (0.0, -5000.0 * effect.hardening, 2.0, 7.0))


@dataclass(frozen=True)
class ActsOnFreeDecays(Broken):
    driven = True


@dataclass(frozen=True)
class OfWrongSign(Broken):
    def moment_oracle(self, stated: RunSettings) -> Callable[[float, float, float], float]:
        return lambda _t, angle, _rate: self.hardening * stated.spring_stiffness * angle**3


@pytest.mark.parametrize("kind", [OwnCubic, DETENT], ids=["class", "expression"])
def test_a_sound_effect_obeys_every_law(kind: type[Effect]) -> None:
    assert [verdict.fault for verdict in check(kind)] == [""] * 8


@pytest.mark.parametrize(
    ("kind", "law", "fault"),
    [
        (ActsAtItsNull, "zero severity", "although the severity is 0"),
        (IgnoresItsCondition, "wind off", "its condition is wind_on, but it acts with the wind off"),
        (Forgets, "JSON", "another"),
        (Wanders, "same seed", "differ"),
        (TooStiff, "integration step", "too|bound|changes by"),
        (OfWrongSign, "independently stated", "differs by"),
        (ActsOnFreeDecays, "driven runs only", "acts on a free decay"),
    ],
)
def test_a_broken_effect_violates_the_law_that_it_breaks(kind: type[Effect], law: str, fault: str) -> None:
    violated = {verdict.law: verdict.fault for verdict in check(kind) if verdict.fault}
    (said,) = [text for name, text in violated.items() if law in name]
    assert re.search(fault, said)
    assert "\n" not in said


def test_a_twin_of_a_known_effect_is_recognised() -> None:
    found = identifiability(OwnCubic)
    assert found.cosines["cubic_stiffness"] == pytest.approx(1.0, abs=1e-6)
    assert "cubic_stiffness" in found.fault
    assert identifiability(DETENT).fault == ""
    assert all(np.isfinite(cosine) for cosine in found.cosines.values())


@pytest.mark.parametrize("name", ["reynolds_dependence", "wind_speed_offset"])
def test_an_effect_that_only_the_comparison_of_speeds_shows_is_identifiable(name: str) -> None:
    assert identifiability(effect_class(name)).fault == ""


def test_an_effect_of_the_input_is_judged_on_driven_runs() -> None:
    kind = InputDelay
    assert [verdict.fault for verdict in check(kind)] == [""] * 8
    found = identifiability(kind)
    # of small ones, linear theory tells no delay from a lag
    assert found.fault == "it has the same influence on the motion as actuator_lag"
    assert "24 simulated driven runs" in found.lines()[0]
