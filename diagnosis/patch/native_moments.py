"""Moments on a joint in MuJoCo: polynomials, dry friction, and a program of the plugin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from diagnosis.model.fact import Fact
from tunnel_sim.physics.expression import OF_ANGLE, OF_RATE, TEXTBOOK_POWERS, parse
from tunnel_sim.physics.moment_law import operation_names
from tunnel_sim.vocabulary.record import Array

PATCHED_MISSES: Final = 0.02
"""Maximum error of a polynomial in the patched model, as a share of the largest moment. Judgement."""

GRID = 201  # number of angles, and of rates, at which moments are compared
_NAMES = frozenset(
    {"b", "r", "Kr", "gravity_angle", *TEXTBOOK_POWERS, *(name for name, *_ in (*OF_ANGLE, *OF_RATE))}
)


@dataclass(frozen=True, eq=False)
class NativeMoments:
    """A sum of moments, in the units of the law.

    Args:
        spring: added restoring moment, the coefficients of 1, b, b² and b³, N m to N m/rad³, shape (4,).
        damping: added coefficients of ḃ, |ḃ|ḃ and ḃ³, N m s/rad, N m s²/rad² and N m s³/rad³, shape (3,).
        loss: sliding friction of the joint, N m; for the plugin's friction the greatest in the runs.
        presliding: deflection at which a contact of that friction slides, rad or m; 0: none.
        program: of a further moment of the plugin; empty: none.
        contact: numerics of the plugin's own friction, with their values and units, angles from rest; empty:
            MuJoCo's friction.
        differences: differences between the native element and the law, and causes left out.
    """

    spring: Array = field(default_factory=lambda: np.zeros(4))
    damping: Array = field(default_factory=lambda: np.zeros(3))
    loss: float = 0.0
    presliding: float = 0.0
    program: tuple[float, ...] = ()
    contact: tuple[tuple[str, float, str], ...] = ()
    differences: tuple[Fact, ...] = ()

    def plus(self, other: NativeMoments) -> NativeMoments:
        """The sum of both; only one of them has dry friction."""
        both = self.program and other.program
        return NativeMoments(
            self.spring + other.spring,
            self.damping + other.damping,
            self.loss + other.loss,
            self.presliding + other.presliding,
            (*self.program, *other.program, *((operation("add"),) if both else ())),
            (*self.contact, *other.contact),
            (*self.differences, *other.differences),
        )


def with_terms(
    start: NativeMoments, known: Mapping[str, float], reach: float, rate: float, own: float, may_miss: float
) -> NativeMoments:
    """Moments and the terms of the moment law in angle and rate, each as a polynomial or a program.

    Args:
        known: parameters of the moment law and the stiffness ``Kr``, by name.
        reach: greatest angle from rest, rad.
        rate: greatest rate, rad/s.
        own: damping of the joint in the given model, N m s/rad; the sum is not negative.
        may_miss: greatest error of a polynomial, as a share of the greatest moment; infinite: no plugin.
    """
    total, b, r = start, np.linspace(-reach, reach, GRID), np.linspace(-rate, rate, GRID)
    for terms, name, grid, forms in (
        (OF_ANGLE, "b", b, (b**0, b, b**2, b**3)),
        (OF_RATE, "r", r, (r, np.abs(r) * r, r**3)),
    ):
        columns = np.array(forms).T
        for coefficient, words, text in terms:
            if known.get(coefficient, 0.0) == 0.0:
                continue
            formula = parse(text, _NAMES)
            values = {
                constant: known.get(constant, 0.0) or TEXTBOOK_POWERS.get(constant, 0.0)
                for constant in formula.names - {"b", "r"}
            }
            wanted = -formula.value({**values, name: grid})
            least, greatest = np.full(len(forms), -np.inf), np.max(np.abs(wanted))
            if may_miss == np.inf and name == "r":
                least[0] = -(total.damping[0] + own)
            found = nearest_polynomial(columns, wanted, least)
            found[np.abs(found) * np.max(np.abs(columns), axis=0) < 1e-9 * greatest] = 0.0
            missed = float(np.max(np.abs(columns @ found - wanted)) / greatest)
            falls = name == "r" and total.damping[0] + own + found[0] < 0.0
            if may_miss != np.inf and (missed >= may_miss or falls):
                program = formula.program(values, {"b": "angle", "r": "rate"})
                total = total.plus(NativeMoments(program=program, differences=(by_plugin(words),)))
                continue
            figures = {"moment": words, "missed_percent": 100.0 * missed}
            said = (Fact("polynomial", figures),) if missed >= 1e-6 else ()
            moment = NativeMoments(spring=found) if name == "b" else NativeMoments(damping=found)
            total = total.plus(replace(moment, differences=said))
    return total


def nearest_polynomial(powers: Array, wanted: Array, least: Array) -> Array:
    """Least-squares coefficients with lower bounds; the unbounded ones if they meet the bounds.

    Args:
        powers: shape (n, m).
        wanted: shape (n,).
        least: lower bounds, shape (m,), infinite for no bound.
    """
    sizes = np.max(np.abs(powers), axis=0)
    found: Array = np.linalg.lstsq(powers / sizes, wanted, rcond=1e-12)[0] / sizes
    if np.all(found >= least):
        return found
    from scipy.optimize import lsq_linear  # imported here because the bounds seldom matter

    bounded: Array = lsq_linear(powers / sizes, wanted, (least * sizes, np.inf)).x / sizes
    return bounded


def by_plugin(moment: str) -> Fact:
    """The fact that a moment needs the plugin."""
    return Fact("no native element", {"moment": moment})


def operation(name: str) -> float:
    """The code of an operation of the plugin's programs."""
    return float(operation_names().index(name))
