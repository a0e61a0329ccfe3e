"""The cost of the gap: the moments of the air without and with the causes, at the campaign's top wind speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar

from diagnosis.findings.finding import Answered, Finding, Judged, Picture
from identification.show.blocks import Section, TextTable
from identification.show.drawing import AFTER, BEFORE, NARROW
from identification.show.numbers import estimated, relative_change, size_change, with_std
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.vocabulary.campaign import RigProperties, Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class AirMoment:
    """A moment of the air on the body, by the nominal model and by the model with the causes.

    Args:
        motion: the motion that the moment opposes or follows: ``1° of yaw``, or ``1 °/s of yaw rate``.
        before: moment by the nominal model, N m.
        after: moment with the causes, N m.
    """

    motion: str
    before: Quantity
    after: Quantity


@dataclass(frozen=True)
class WhatItCosts(Finding):
    """The moments of the air at the top wind speed of a campaign, and their change by the causes.

    A positive moment turns the body further in the direction of the yaw or of the yaw rate.

    Args:
        wind_speed: the top speed, m/s.
        moments: moments of the coefficients that the runs determine.
    """

    after: ClassVar[str] = "uncertainty"

    wind_speed: float
    moments: tuple[AirMoment, ...]

    @classmethod
    def find(cls, answered: Answered) -> WhatItCosts | None:
        """The moments; None without named causes, without wind, and where no coefficient is determined."""
        top = max(answered.campaign.in_wind, key=lambda run: run.wind_speed, default=None)
        if not answered.study.named or top is None or top.air_density is None:
            return None
        moments = []
        for name, before in answered.before.items():
            after, factor = answered.after.get(name), _moment_per(name, top, answered.campaign.rig)
            if after is not None and factor is not None and before.determined and after.determined:
                motion = "1° of yaw" if name.startswith("cn_beta") else "1 °/s of yaw rate"
                moments.append(AirMoment(motion, _times(before, factor), _times(after, factor)))
        return cls(top.wind_speed, tuple(moments)) if moments else None

    def section(self, judged: Judged) -> Section:
        """The moments in a table and a figure."""
        rows = tuple(
            (one.motion, *map(_shown, (one.before, one.after)), _change(one) or "–") for one in self.moments
        )
        heads = ("moment of the air at", "nominal model [N m]", "with the causes [N m]", "change of size")
        title = f"Moments of the air at {self.wind_speed:g} m/s, with 95 % intervals"
        table = TextTable(title, heads, rows, right=heads[1:])
        drawn = (one.block for one in self.pictures(judged))
        return Section("costs", "What the gap costs", (table, *drawn))

    def pictures(self, judged: Judged) -> tuple[Picture, ...]:
        """The moments before and after, a panel each."""
        del judged
        caption = f"Moments of the air at {self.wind_speed:g} m/s, with 95 % intervals."
        description = "Moments of the air at the top wind speed, by the nominal model and with the causes."
        return (Picture("costs", caption, description, partial(costs_figure, self)),)


def _moment_per(name: str, run: Run, rig: RigProperties) -> float | None:
    """Moment in N m at one degree, or one degree per second, per unit of a coefficient.

    Args:
        name: name of the coefficient, times the sizes in its name, which the rig does not state.
    """
    rate = name.startswith("cn_r")
    if not (rate or name.startswith("cn_beta")) or run.air_density is None:
        return None
    area = 1.0 if "_area" in name else rig.frontal_area
    length = 1.0 if "_length" in name else rig.reference_length
    if area is None or length is None:
        return None
    pressure = 0.5 * run.air_density * run.wind_speed ** (1 if rate else 2)
    return math.radians(1.0) * pressure * area * length ** (2 if rate else 1)


def _times(given: Quantity, factor: float) -> Quantity:
    std = None if given.std is None else abs(factor) * given.std
    ends = None if given.interval is None else (factor * given.interval[0], factor * given.interval[1])
    return Quantity(factor * given.value, std, "N m", ends, given.bound)


def _ends(given: Quantity) -> tuple[float, float] | None:
    """Ends of the 95 % interval, N m; None where it is not known."""
    return given.interval if given.std is None else given.ends


def _shown(given: Quantity) -> str:
    """A moment with its 95 % interval, N m, such as ``0.0683 ± 0.0004``."""
    return estimated(given if given.std is None else replace(given, std=INTERVAL * given.std))


def _change(one: AirMoment) -> str:
    """The change of a moment's size by the causes, in per cent of the nominal size; empty where one is at a bound.

    ± is the 95 % interval of the moment with the causes. The nominal moment is the reference that the causes
    change, so its standard deviation is not included.
    """
    before, after = one.before, one.after
    if before.bound or after.bound or not before.value:
        return ""
    if before.value * after.value < 0.0 or after.std is None:
        return size_change(before.value, after.value)
    change = 100.0 * relative_change(before.value, after.value)
    std = 100.0 * INTERVAL * abs(after.std / before.value)
    if max(abs(change), std) < _NO_CHANGE:
        return f"less than {_NO_CHANGE:g} %"
    text = with_std(abs(change), std)
    nothing = not text.partition(" ")[0].strip("(0.")
    return f"{'' if nothing else '-' if change < 0.0 else '+'}{text} %"


_NO_CHANGE = 0.01  # %: a smaller change is stated as this


@styled
def costs_figure(costs: WhatItCosts) -> Figure:
    """The moments of the air before and after the causes are added, with 95 % intervals."""
    fig = figure(NARROW, 0.3 + 1.3 * len(costs.moments))
    for place, one in enumerate(costs.moments, 1):
        axes = fig.add_subplot(len(costs.moments), 1, place)
        for row, (given, colour, marker) in enumerate(((one.before, BEFORE, "s"), (one.after, AFTER, "o"))):
            ends = _ends(given) or (given.value, given.value)
            reach = [[given.value - ends[0]], [ends[1] - given.value]]
            axes.errorbar(given.value, row, xerr=reach, color=colour, marker=marker, ms=6, capsize=4)
        axes.set_yticks([0, 1], ["before", "after"])
        axes.set(ylim=(1.6, -0.6), xlabel=f"moment at {one.motion} [N m]")
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
    return fig
