"""Terms of which a formula may consist: their text, their own numbers and where these are searched."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product as combinations

import numpy as np

from diagnosis.law.bases import Ranges
from tunnel_sim.physics.expression import Expression, parse
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.units import Dimension, dimension

_NAMES = {"b": "rad", "r": "rad/s", "t": "s", "V": "m/s", "Kr": "N m/rad", "omega": "rad/s", "y": "rad"}
_INNER = {"w": "rad", "c": "rad", "n": "1", "v": "rad/s", "q": "s", "d": "s", "f": "rad/s"}
"""Own numbers of terms: widths, places, numbers per radian, rates, times and frequencies."""


@dataclass(frozen=True)
class Term:
    """A term with the values of its own numbers.

    Args:
        text: of ``b``, ``r``, ``t``, ``V``, ``Kr``, ``omega`` or ``y``, and its own numbers.
        inner: value of each of its own numbers, in the unit of `_INNER`.
    """

    text: str
    inner: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def formula(self) -> Expression:
        """The text, parsed."""
        return parse(self.text, frozenset({*_NAMES, *_INNER}))

    @cached_property
    def dimension(self) -> Dimension:
        """Powers of kg, m and s."""
        return self.formula.dimension({name: dimension(unit) for name, unit in (_NAMES | _INNER).items()})

    @property
    def units(self) -> dict[str, str]:
        """Unit of each of its own numbers."""
        return {name: _INNER[name] for name in self.inner}

    def value(self, places: Mapping[str, float | Array]) -> Array:
        """The term along a motion, in its own unit.

        Args:
            places: by name, numbers or arrays of shape (n,).

        Returns:
            Shape (n,) or ().
        """
        return self.formula.value({**places, **self.inner})


_ANGLE = ("b^2", "b^3", "b^5", "abs(b)", "abs(b)*b")
_ANGLE_WIDE = ("tanh(b/w)", "b*exp(-(b/w)^2)", "b/(1+(b/w)^2)")
_ANGLE_PLACE = ("max(abs(b)-c,0)*sign(b)", "max(b-c,0)", "max(-b-c,0)")
_RATE = ("sign(r)", "abs(r)", "abs(r)*r", "r^3")
_STATE = (
    "b^2*r", "abs(b)*r", "b*r", "b*r^2", "b*sign(r)", "abs(b)*sign(r)", "b^2*sign(r)", "b^4*r", "max(b,0)*r",
    "b*sqrt(b^2+(r/omega)^2)", "r/omega*sqrt(b^2+(r/omega)^2)", "b^2*r/omega*sqrt(b^2+(r/omega)^2)",
)  # fmt: skip
_STATE_WIDE = (
    "exp(-(b/w)^2)*r", "b/(1+(b^2+(r/omega)^2)/w^2)", "r/omega/(1+(b^2+(r/omega)^2)/w^2)",
    "b/sqrt(b^2+(r/omega)^2+w^2)", "r/omega/sqrt(b^2+(r/omega)^2+w^2)",
)  # fmt: skip
_TIME_SLOW = ("b*exp(-t/q)", "r*exp(-t/q)", "sign(r)*exp(-t/q)", "exp(-t/q)")
_TIME = ("b*t", "r*t", "b*t^2")
_TIME_WAVE = ("b*sin(f*t)", "b*cos(f*t)", "r*sin(f*t)")
_READING = ("y^2", "y^3", "y^5", "abs(y)", "abs(y)*y", "t", "t^2")
_READING_PLACE = ("max(abs(y)-c,0)*sign(y)", "max(y-c,0)", "max(-y-c,0)")


def terms(kind: str, r: Ranges) -> list[Term]:
    """The terms that may explain a kind.

    Args:
        kind: of `diagnosis.closable.KINDS`.
        r: what the runs visit.

    Returns:
        Without a factor for spring or wind; none for kinds that no formula explains.
    """
    makers = {
        "angle": (_of_angle,),
        "rate": (_of_rate,),
        "state": (_of_angle, _of_rate, _of_state),
        "wind": (_of_angle, _of_rate, _of_state),
        "time": (_of_time,),
        "reading": (_of_reading,),
    }
    return [term for maker in makers.get(kind, ()) for term in maker(r)]


def _grid(texts: tuple[str, ...], **inner: Array) -> Iterator[Term]:
    for text in texts:
        for values in combinations(*(grid.tolist() for grid in inner.values())):
            yield Term(text, dict(zip(inner, values, strict=True)))


def _widths(r: Ranges, count: int = 6) -> Array:
    return np.geomspace(0.05, 0.8, count) * r.angle


def _places(r: Ranges) -> Array:
    return np.linspace(0.08, 0.92, 15) * r.angle


def _numbers(r: Ranges) -> Array:
    """Waves over the range: from one to ten, near enough to each other for a fit to find the one between."""
    return np.arange(1.0, 10.1, 0.35) * np.pi / r.angle


def _of_angle(r: Ranges) -> Iterator[Term]:
    yield from map(Term, _ANGLE)
    yield from _grid(_ANGLE_WIDE, w=_widths(r, 9))
    yield from _grid(_ANGLE_PLACE, c=_places(r))
    yield from _grid(("sin(n*b)",), n=_numbers(r))
    yield from _grid(("tanh(max(abs(b)-c,0)/w)*sign(b)",), c=_places(r)[::2], w=_widths(r, 3))
    yield from _grid(("exp(-((b-c)/w)^2)",), c=np.linspace(-0.8, 0.8, 9) * r.angle, w=_widths(r, 3))


def _of_rate(r: Ranges) -> Iterator[Term]:
    yield from map(Term, _RATE)
    yield from _grid(("tanh(r/v)",), v=np.geomspace(0.02, 0.5, 6) * r.rate)


def _of_state(r: Ranges) -> Iterator[Term]:
    yield from map(Term, _STATE)
    yield from _grid(_STATE_WIDE, w=_widths(r))
    places = np.linspace(-0.85, 0.85, 18) * r.angle
    yield from _grid(("exp(-((b-c)/w)^2)*sign(r)",), c=places, w=_widths(r, 5)[:3])


def _of_time(r: Ranges) -> Iterator[Term]:
    yield from map(Term, _TIME)
    yield from _grid(_TIME_SLOW, q=np.geomspace(0.04, 1.5, 9) * r.time)
    yield from _grid(_TIME_WAVE, f=2.0 * np.pi * np.arange(0.1, 2.0, 0.05) / (2.0 * r.cycle))
    instants = np.linspace(0.04, 0.96, 24) * r.time
    yield from _grid(("b*tanh((t-d)/q)", "r*tanh((t-d)/q)"), d=instants, q=np.array([0.1 * r.cycle]))
    often = np.arange(0.1, 0.98 * r.time / r.cycle, 0.2) * r.cycle
    yield from _grid(("exp(-((t-d)/q)^2)",), d=often, q=np.array([0.06, 0.2]) * r.cycle)


def _of_reading(r: Ranges) -> Iterator[Term]:
    yield from map(Term, _READING)
    yield from _grid(_READING_PLACE, c=_places(r))
    yield from _grid(("sin(n*y)",), n=np.arange(1.0, 14.1, 0.35) * np.pi / r.angle)
    instants = np.linspace(0.04, 0.96, 47) * r.time
    yield from _grid(("tanh((t-d)/q)", "y*tanh((t-d)/q)"), d=instants, q=np.array([0.02 * r.cycle]))
    yield from _grid(("exp(-t/q)", "y*exp(-t/q)"), q=np.geomspace(0.04, 1.5, 9) * r.time)
