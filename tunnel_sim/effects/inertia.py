"""An inertia that differs from spring to spring, as adapters and clamps do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from tunnel_sim.effects.base import SPRING_TOLERANCE, Drawn, Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter
from tunnel_sim.effects.traits import Text
from tunnel_sim.physics.run_settings import SettingsTable

_SCALE = 0.003  # an adapter or a clamp changes Izz by some tenths of a per cent
_NAMES = ("first", "second", "third", "fourth")


def _difference(which: str, symbol: str, *, with_spring: str = "") -> Any:
    """The inertia with a spring, relative to the inertia with the springs that are not named."""
    return parameter(
        symbol, "1", f"inertia with the {which} spring over that with the others, minus one",
        scale=_SCALE, lower=-0.5, upper=1.0, relative=True, with_spring=with_spring,
    )  # fmt: skip


def _spring(which: str, symbol: str) -> Any:
    """A spring of the campaign."""
    return parameter(
        symbol, "N m/rad", f"stated stiffness of the {which} spring; 0: none",
        scale=16.12, lower=0.0, upper=1e6, chosen_spring=True,
    )  # fmt: skip


@dataclass(frozen=True)
class InertiaBySpring(Effect):
    """An inertia that differs from spring to spring, because each has its own adapter or clamp.

    The springs that are not named have the campaign's Izz; a fit names all but one, or one.
    """

    name = "inertia_by_spring"
    place = 35
    channel = "calibration"
    condition = "always"
    advice = "Weigh the adapters and clamps, and state Izz for every spring"
    equation = (
        "(1 + x1) Izz instead of Izz in the runs of the spring Kr1; the same with x2 and Kr2, x3 and Kr3, "
        "x4 and Kr4"
    )
    signature = (
        "With the wind off the same as a wrong spring; with the wind on the stiffness of the air, too, acts on the "
        "other inertia, which no error of a spring does."
    )
    references = ("Ewins, Modal Testing: Theory, Practice and Application, Research Studies Press 2000",)
    example = (0.004, 16.12)
    tries = 3
    caveat = "Izz is the inertia with the spring that is not named."

    first: float = _difference("first", "x1")
    first_spring: float = _spring("first", "Kr1")
    second: float = _difference("second", "x2", with_spring="second_spring")
    second_spring: float = _spring("second", "Kr2")
    third: float = _difference("third", "x3", with_spring="third_spring")
    third_spring: float = _spring("third", "Kr3")
    fourth: float = _difference("fourth", "x4", with_spring="fourth_spring")
    fourth_spring: float = _spring("fourth", "Kr4")

    @property
    def is_null(self) -> bool:
        """Whether the inertia is the same with all springs."""
        return not any(getattr(self, name) for name in _NAMES)

    @classmethod
    def phrase(cls, values: Mapping[str, float], stds: Mapping[str, float | None], text: Text) -> str:
        """The relative difference of the inertia with each spring."""
        each = []
        for name in _NAMES:
            spring = values.get(f"{name}_spring", 0.0)
            if spring > 0.0 and name in values:
                std = stds.get(name)
                size = text(100.0 * values[name], None if std is None else 100.0 * std, "%")
                each.append(f"{size} with {spring:g} N m/rad")
        return f"an inertia that differs by spring: {', '.join(each)}"

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """All springs but one, and each alone; none where the springs are too many."""
        springs = campaign.springs
        if not 1 < len(springs) <= len(_NAMES) + 1 or campaign.normalised:
            return ()
        groups = [springs[1:]] if len(springs) > 2 else []
        found = []
        for group in (*groups, *((spring,) for spring in springs)):
            named = dict(zip(_NAMES, group, strict=False))
            chosen = {f"{name}_spring": spring for name, spring in named.items()}
            found.append(Trial(chosen | {"first": _SCALE}, "first", beside=tuple(named)[1:]))
        return found

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Change the inertia of the springs' runs."""
        del drawn
        spring = stated.spring_stiffness
        for name in _NAMES:
            its = cls.column(effects, f"{name}_spring")
            apart = np.abs(spring - its)
            concerned = (its > 0.0) & (apart <= SPRING_TOLERANCE * np.maximum(np.abs(spring), its))
            runs["yaw_inertia"][concerned] *= 1.0 + cls.column(effects, name)[concerned]
