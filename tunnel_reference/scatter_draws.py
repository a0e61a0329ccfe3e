"""Differences between the runs of a campaign: their draws, and a campaign's statement on them.

The widths are shares of a usual rig's: its tunnel keeps its speed to 0.3 %, its springs repeat to 0.05 % when they
are clamped again, and its bearing and cable repeat their damping to 1 %.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tunnel_reference.catalogue import Group
from tunnel_reference.true_conditions import Array, TrueConditions

USUAL: Mapping[str, float] = {"wind_speed": 0.003, "spring_stiffness": 0.0005, "mechanical_damping": 0.01}
"""Usual standard deviations between runs, relative."""

LEVELS: Mapping[str, tuple[float, float]] = {
    "small": (0.03, 0.3),
    "usual": (1.0, 1.0),
    "large": (0.3, 2.0),
}
"""Least and greatest width of a level, in usual ones; drawn evenly in the logarithm, for each number by itself."""

MIXED = "mixed"
"""Small or large, equally likely."""

_ABSENT = 0.25  # probability that a property repeats in a campaign whose others scatter
_TAILS = 4.0  # degrees of freedom of Student's t: one run in ninety is beyond three standard deviations
_ZERO = (1e-3, 5e-3)  # rad, standard deviation of the zeros
_DRIFT = (1.0, 4.0)  # from the first to the last run, in widths


@dataclass(frozen=True, eq=False)
class ScatterDraw:
    """The differences between the runs of a campaign.

    Args:
        level: name of the level of the widths, in ``LEVELS``.
        form: name of the distribution, in ``FORMS``.
        widths: relative standard deviation by property.
        deviations: deviations of every run by property, relative (rad for ``zero``), shape (runs,).
        stated: the campaign's statement by property, relative; empty if there is none.
    """

    level: str
    form: str
    widths: Mapping[str, float]
    deviations: Mapping[str, Array]
    stated: Mapping[str, float]

    def truth(self, runs: int) -> dict[str, Any]:
        """Widths and deviations in the form of ``truth.json``.

        Args:
            runs: number of runs.
        """
        return {
            "scatter": dict(self.widths),
            "scatter_level": self.level,
            "scatter_form": self.form,
            "repeatability": dict(self.stated),
            "runs": {
                f"r{run + 1:02d}": {name: float(values[run]) for name, values in self.deviations.items()}
                for run in range(runs)
            },
        }


Widths = Mapping[str, float]
Draw = Callable[[np.random.Generator, Widths, int], dict[str, Array]]


def _normal(rng: np.random.Generator, widths: Widths, runs: int) -> dict[str, Array]:
    """Every run by itself, normally distributed."""
    return {name: width * rng.standard_normal(runs) for name, width in widths.items()}


def _tails(rng: np.random.Generator, widths: Widths, runs: int) -> dict[str, Array]:
    """Student's t of the same standard deviation: most runs repeat well, and one does not."""
    scale = np.sqrt((_TAILS - 2.0) / _TAILS)
    return {name: width * scale * rng.standard_t(_TAILS, runs) for name, width in widths.items()}


def _zeros(rng: np.random.Generator, widths: Widths, runs: int) -> dict[str, Array]:
    """Normal, and the sensor's zero differs too, which the campaign does not state."""
    found = _normal(rng, widths, runs)
    width = float(np.exp(rng.uniform(*np.log(_ZERO))))
    return {**found, "zero": width * rng.standard_normal(runs)}


def _walk(rng: np.random.Generator, widths: Widths, runs: int) -> dict[str, Array]:
    """A random walk over the order of the runs; its mean variance about its mean is the square of the width."""
    step = np.sqrt(6.0 / (runs + 1.0))
    return {name: width * step * np.cumsum(rng.standard_normal(runs)) for name, width in widths.items()}


def _drifting(rng: np.random.Generator, widths: Widths, runs: int) -> dict[str, Array]:
    """Normal, and speed and spring drift from the first run to the last, as in a lab that warms up."""
    found = _normal(rng, widths, runs)
    for name in ("wind_speed", "spring_stiffness"):  # an order of draws that no hash decides
        if name not in found:
            continue
        change = widths[name] * rng.uniform(*_DRIFT) * rng.choice([-1.0, 1.0])
        found[name] = found[name] + change * np.arange(runs) / max(1, runs - 1)
    return found


NORMAL = "normal"
FORMS: Mapping[str, tuple[Group, Draw]] = {
    NORMAL: (Group.TEXTBOOK, _normal),
    "students_t": (Group.COMMON, _tails),
    "zeros_too": (Group.COMMON, _zeros),
    "random_walk": (Group.RARE, _walk),
    "drifting": (Group.RARE, _drifting),
}
"""Distributions of the runs' deviations, by name."""


def draw_scatter(
    rng: np.random.Generator, runs: int, *, level: str, normal: float, rare: float, stated: float
) -> ScatterDraw:
    """Draw the differences between the runs of a campaign.

    Args:
        rng: source of all random numbers.
        runs: number of runs, a count.
        level: name of the level, in ``LEVELS``, or ``MIXED``.
        normal: probability that the deviations are normal.
        rare: probability that another form is a rare one.
        stated: probability that the campaign states the widths.
    """
    of = str(rng.choice(["small", "large"])) if level == MIXED else level
    names = (
        [name for name in USUAL if rng.random() >= _ABSENT] if LEVELS[of][0] < LEVELS[of][1] else list(USUAL)
    )
    names = names or [str(rng.choice(list(USUAL)))]
    widths = {name: USUAL[name] * float(np.exp(rng.uniform(*np.log(LEVELS[of])))) for name in names}
    group = Group.TEXTBOOK if rng.random() < normal else Group.RARE if rng.random() < rare else Group.COMMON
    form = str(rng.choice([name for name, (of_form, _) in FORMS.items() if of_form is group]))
    known = {name: float(f"{width:.2g}") for name, width in widths.items()} if rng.random() < stated else {}
    return ScatterDraw(of, form, widths, FORMS[form][1](rng, widths, runs), known)


def scattered(conditions: TrueConditions, drawn: ScatterDraw | None) -> TrueConditions:
    """The conditions of a campaign whose runs differ; unchanged without scatter."""
    if drawn is None:
        return conditions
    none = np.zeros(1)
    return replace(
        conditions,
        speed_deviation=drawn.deviations.get("wind_speed", none),
        stiffness_deviation=drawn.deviations.get("spring_stiffness", none),
        damping_deviation=drawn.deviations.get("mechanical_damping", none),
        zero_deviation=drawn.deviations.get("zero", none),
    )
