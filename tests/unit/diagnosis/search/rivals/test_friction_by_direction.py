"""Friction that differs between drive and back-drive, of a joint under gravity.

Truth: steps of second order with the friction's level by the sign of moment times rate, which share nothing with
the diagnosis. A contact that yields deflects by Dahl's law and carries that share of the level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import copysign, exp, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.result import Diagnosis
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.rivals import RIVALS
from diagnosis.search.rivals.friction_by_direction import FrictionByDirection, _grip, _words
from diagnosis.search.rivals.rival import Rival
from tests.marks import slow
from tests.reference.robot_joints import GEAR, LEVEL, NOISE, RATE, TIME, multisine, robot
from tests.support.robots import TRUE, inertia, own_model
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout", "models_in_this_process")

MODEL = robot(TRUE, axis=LEVEL, tip=0.2)
INERTIA, WEIGHT, DAMPING = inertia(MODEL), 9.81 * (1.5 * 0.2 + 0.2 * 0.4), 0.4  # kg m2, N m, N m s/rad
SUBSTEPS = 10
KINDS = vocabulary(("coulomb_friction", "quadratic_damping", "gravity_stiffness"))


class Rubbing:
    """A joint from its start at rest on, rad from where it hangs; levels in N m and per N m of the load."""

    def __init__(self, start: float, sizes: Mapping[str, tuple[float, float]], yields: float) -> None:
        self.angle, self.rate, self.deflection = start, 0.0, 0.0
        self.moments, self.shares = sizes.get("moments", (0.0, 0.0)), sizes.get("shares", (0.0, 0.0))
        self.yields = yields

    def level(self, motor: float, angle: float, side: float) -> float:
        back = motor * side <= 0.0
        return self.moments[back] + self.shares[back] * max(abs(motor), abs(WEIGHT * sin(angle)))

    def friction(self, motor: float, angle: float, rate: float) -> float:
        side = copysign(1.0, rate)
        return self.level(motor, angle, side) * (self.deflection if self.yields else side)

    def relax(self, step: float) -> None:
        kept = exp(-abs(self.rate) * step / self.yields)
        self.deflection = self.deflection * kept + copysign(1.0 - kept, self.rate)

    def moved(self, motor: float, step: float) -> None:
        """One step; a joint that stops within it sticks, or turns back for the rest of the step."""
        if self.yields:
            self.relax(0.5 * step)
        for _ in range(3):
            other = motor - WEIGHT * sin(self.angle)
            if self.rate == 0.0 and not self.yields:
                if abs(other) <= self.level(motor, self.angle, copysign(1.0, other)):
                    return
                self.rate = copysign(1e-12, other)
            first = (other - DAMPING * self.rate - self.friction(motor, self.angle, self.rate)) / INERTIA
            angle, rate = self.angle + 0.5 * step * self.rate, self.rate + 0.5 * step * first
            if not self.yields and rate * self.rate < 0.0:
                rate = copysign(1e-12, self.rate)
            slope = motor - WEIGHT * sin(angle) - DAMPING * rate - self.friction(motor, angle, rate)
            after = self.rate + step * slope / INERTIA
            if self.yields or after * self.rate >= 0.0:
                self.angle += step * 0.5 * (self.rate + after)
                self.rate = after
                break
            part = step * self.rate / (self.rate - after)
            self.angle, self.rate, step = self.angle + 0.5 * part * self.rate, 0.0, step - part
        if self.yields:
            self.relax(0.5 * step)


def driven(seed: int, yields: float = 0.0, **sizes: tuple[float, float]) -> Campaign:
    """Two runs of multisines; sizes in drive and in back-drive."""
    runs, step = [], 1.0 / RATE / SUBSTEPS
    for place, (start, peak) in enumerate([(0.4, 0.3), (0.8, 0.25)]):
        control, joint = multisine(100 * seed + place, peak), Rubbing(start - 0.5 * pi, sizes, yields)
        found = np.empty(TIME.size)
        for k, value in enumerate(control.tolist()):
            found[k] = joint.angle
            for _ in range(SUBSTEPS):
                joint.moved(GEAR * value, step)
        noise = np.random.default_rng([seed, place]).normal(0.0, NOISE, TIME.size)
        record = Record(TIME, 0.5 * pi + found + noise)
        runs.append(Run(f"r{place + 1}", record, 0.0, drive=Input("drive", control, "zero")))
    return Campaign("elbow", RigProperties(), SensorProperties(RATE), tuple(runs))


ALONE = (FrictionByDirection(),)


def answer(folder: Path, data: Campaign, rivals: Sequence[Rival] = ALONE) -> Diagnosis:
    return diagnose(data, kinds=KINDS, model=own_model(folder, data, MODEL), rivals=rivals)


def stated(found: Diagnosis) -> Mapping[str, Any] | None:
    """The figures of the difference; None where none is said."""
    return next((fact.figures for fact in found.found.rivals if fact.kind == "friction by direction"), None)


def near(found: Mapping[str, Any], *truth: float) -> bool:
    """Whether moment or share is within its intervals, which are a hundredth of it at most."""
    sizes = [found[name] for name in ("drive", "back_drive")]
    return all(
        abs(one["value"] - true) < 4.0 * one["std"] and one["std"] < max(0.01 * true, 1e-3)
        for one, true in zip(sizes, truth, strict=True)
    )


@pytest.mark.parametrize(
    ("seed", "yields", "shares"),
    [
        (1, 0.0, (0.08, 0.12)),
        slow(2, 0.02, (0.08, 0.12)),
        slow(3, 0.0, (0.12, 0.06)),
        slow(4, 0.015, (0.1, 0.09)),
    ],
)
def test_a_share_of_the_load_that_differs_is_said_with_both_sizes(
    tmp_path: Path, seed: int, yields: float, shares: tuple[float, float]
) -> None:
    found = answer(tmp_path, driven(seed, yields, moments=(0.1, 0.1), shares=shares), RIVALS)
    assert tuple(found.causes) == UNKNOWN or not found.decision.decided
    figures = stated(found)
    assert figures is not None
    assert figures["differs"] == ["share"]
    assert near(figures["share"], *shares)
    assert near(figures["moment"], 0.1, 0.1)
    assert figures["beside"] == []
    assert 0.2 < figures["back_driven"] < 0.4
    assert "Friction that differs between drive" in found.verdict
    assert " % of the moment carried in drive, and 0." in found.verdict
    assert "dead zone" not in found.verdict


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "yields"), [(5, 0.0), (6, 0.015)])
def test_a_moment_that_differs_is_said_with_both_sizes(tmp_path: Path, seed: int, yields: float) -> None:
    found = answer(tmp_path, driven(seed, yields, moments=(0.2, 0.3)))
    assert tuple(found.causes) == UNKNOWN
    figures = stated(found)
    assert figures is not None
    assert figures["differs"] == ["moment"]
    assert near(figures["moment"], 0.2, 0.3)
    assert near(figures["share"], 0.0, 0.0)
    assert "A dead zone of the actuator would look alike." in found.verdict


@pytest.mark.parametrize(
    ("yields", "sizes"),
    [
        (0.0, {"moments": (0.1, 0.1), "shares": (0.1, 0.1)}),
        slow(0.02, {"moments": (0.1, 0.1), "shares": (0.1, 0.1)}),
        slow(0.0, {"moments": (0.3, 0.3)}),
        slow(0.02, {"moments": (0.3, 0.3)}),
    ],
)
def test_friction_without_direction_keeps_its_name(
    tmp_path: Path, yields: float, sizes: dict[str, tuple[float, float]]
) -> None:
    found = answer(tmp_path, driven(7, yields, **sizes))
    assert found.causes == ("coulomb_friction",)
    assert stated(found) is None


def test_a_moment_that_differs_is_said_with_what_looks_alike() -> None:
    sizes = {"drive": {"value": 0.2, "std": 0.001}, "back_drive": {"value": 0.3, "std": 0.001}}
    found = {"differs": ["moment"], "moment": sizes, "back_driven": 0.3, "beside": []}
    assert "would explain the gap; it is not in the vocabulary. It is 0.2000 ± 0.0010 N m in drive" in _words(
        found
    )
    assert _words(found).endswith("30.0 % of the travel. A dead zone of the actuator would look alike.")
    assert "dead zone" not in _words(found | {"differs": ["share"]})


def test_the_grip_of_a_contact_is_dahls() -> None:
    """Closed form: 1 − e^(−x/zs) onward, and from a reversal at full deflection 1 − 2 e^(−x/zs)."""
    way = np.linspace(0.0, 1.0, 2001)
    path: Array = np.concatenate([way, way[-2::-1]])
    found = _grip(path, 0.1)
    np.testing.assert_allclose(found[: way.size], 1.0 - np.exp(-way / 0.1), atol=1e-12)
    np.testing.assert_allclose(found[way.size :], 1.0 - 2.0 * np.exp(-way[1:] / 0.1), atol=1e-4)
