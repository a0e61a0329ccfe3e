"""The law found for a joint, in the units of the model given: as native elements, the rest as a program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.problem import Problem, condensed
from tunnel_sim.engine.joint_patch import JointPatch, Start
from tunnel_sim.physics.expression import OF_ANGLE, OF_RATE, TEXTBOOK_POWERS, Expression, parse
from tunnel_sim.physics.moment_law import operation_names
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array

_FAITHFUL = 0.02  # of a moment's greatest value: what a polynomial may miss of it
_GRID = 201


@dataclass(frozen=True)
class FoundLaw:
    """What is written into the model, and what is not.

    Args:
        patch: to write.
        notes: where the native element is not the same law, and what is left out, in sentences.
    """

    patch: JointPatch
    notes: tuple[str, ...]


def found_law(problem: Problem, common: Array, release: Array, noise: float, index: int = 0) -> FoundLaw:
    """The law of a fit.

    Args:
        common: its common parameters, shape (common,).
        release: of a run, shape (own,).
        noise: of the sensor, rad; 0: not written.
        index: of that run, with the wind off.

    Returns:
        In the units of the measured campaign.
    """
    data = problem.data
    law = data.law
    assert law is not None
    chain = problem.chain(common, release, data.runs[index])
    physics = condensed(chain.physics(), data)
    own = data.similarity.own
    reach = max(float(np.max(np.abs(run.reading))) for run in data.runs)
    b = np.linspace(-reach, reach, _GRID)
    rate = reach * np.sqrt(physics.spring_stiffness / physics.yaw_inertia)
    r = np.linspace(-rate, rate, _GRID)
    notes: list[str] = []
    loss = physics.parameters.get("loss_factor", 0.0) * np.sqrt(
        physics.spring_stiffness * physics.yaw_inertia
    )
    spring = np.array([0.0, physics.spring_stiffness - law.stiffness, 0.0, 0.0])
    damping = np.array([physics.mechanical_damping + loss - law.damping, 0.0, 0.0])
    program = _further(physics.program, data.program)
    for terms, name, grid, forms, native in (
        (OF_ANGLE, "b", b, (b**0, b, b**2, b**3), spring),
        (OF_RATE, "r", r, (r, np.abs(r) * r, r**3), damping),
    ):
        for coefficient, words, text in terms:
            if physics.parameters.get(coefficient, 0.0) == 0.0:
                continue
            formula = parse(text, _NAMES)
            values = _values(formula, physics)
            found, missed = _polynomial(forms, -formula.value({**values, name: grid}))
            if missed < _FAITHFUL and not (name == "r" and native[0] + law.damping + found[0] < 0.0):
                native += found
                notes += _approximation(words, missed)
            else:
                program = _joined(program, formula.program(values, {"b": "angle", "r": "rate"}))
                notes.append(f"The {words} has no native element; the plugin vwt.yaw_moment adds it.")
    notes += _unwritten(physics, problem)
    place = law.rest + data.similarity.rest
    units = ("N m", "N m/rad", "N m/rad2", "N m/rad3"), ("N m s/rad", "N m s2/rad2", "N m s3/rad3")
    k0, k1, k2, k3 = (own(float(v), unit) for v, unit in zip(spring, units[0], strict=True))
    c0, c1, c2 = (own(float(v), unit) for v, unit in zip(damping, units[1], strict=True))
    friction = own(physics.parameters.get("friction_moment", 0.0), "N m")
    patch = JointPatch(
        inertia=own(physics.yaw_inertia, "kg m2"),
        spring=(k0, k1, k2, k3),
        damping=(c0, c1, c2),
        friction=friction,
        program=_own_program(program, place, own) if program else (),
        noise=noise,
    )
    return FoundLaw(patch, tuple(notes))


def start_of(problem: Problem, own: Array, index: int) -> Start:
    """Where a run starts, in the units of the measured campaign.

    Args:
        problem: gives the runs.
        own: the run's own parameters, shape (own,).
    """
    run, change = problem.data.runs[index], problem.data.similarity
    return Start(run.id, change.own(run.start, "s"), float(own[0]), change.own(float(own[1]), "rad/s"))


_NAMES = frozenset(
    {"b", "r", "Kr", "gravity_angle", *TEXTBOOK_POWERS, *(name for name, *_ in (*OF_ANGLE, *OF_RATE))}
)


def _values(formula: Expression, physics: RunSettings) -> dict[str, float]:
    """Values of the constants in an expression."""
    known = {"Kr": physics.spring_stiffness, **physics.parameters}
    return {
        name: known.get(name, 0.0) or TEXTBOOK_POWERS.get(name, 0.0) for name in formula.names - {"b", "r"}
    }


def _polynomial(forms: tuple[Array, ...], wanted: Array) -> tuple[Array, float]:
    """Coefficients of native forms, and what they miss as a share of the greatest moment."""
    columns = np.array(forms).T
    sizes = np.max(np.abs(columns), axis=0)
    found = np.linalg.lstsq(columns / sizes, wanted, rcond=1e-12)[0]
    found[np.abs(found) < 1e-9 * np.max(np.abs(wanted))] = 0.0
    found /= sizes
    return found, float(np.max(np.abs(columns @ found - wanted)) / np.max(np.abs(wanted)))


def _approximation(words: str, missed: float) -> list[str]:
    if missed < 1e-6:
        return []
    return [
        f"The {words} is written as a polynomial of third order, which misses {100.0 * missed:.2g} % of its "
        f"greatest moment within the records."
    ]


def _unwritten(physics: RunSettings, problem: Problem) -> list[str]:
    notes = []
    if physics.parameters.get("friction_moment"):
        notes.append(
            "frictionloss is a soft constraint: near rest it yields as a damper does, and the joint creeps. Its "
            "time constant is set to two steps, the shortest allowed."
        )
    if physics.parameters.get("presliding"):
        notes.append("The presliding of the friction has no native element and is left out.")
    if physics.rod_twist is not None:
        notes.append("The twist of the rod is left out: it needs a body and a joint of its own.")
    if problem.data.wind_on:
        notes.append("The air's moment is left out: the patched model is that of the runs with the wind off.")
    sensors = [kind.name for kind in problem.effects if kind.channel == "sensor"]
    if sensors:
        named = ", ".join(name.replace("_", " ") for name in sensors)
        notes.append(
            f"Of the sensor, and not part of the model: {named}; the comparison applies it to the reading."
        )
    return notes


def _further(whole: tuple[float, ...], known: tuple[float, ...]) -> tuple[float, ...]:
    """The part of a program that effects added to the model's own."""
    rest = whole[len(known) :]
    return (_number("number"), 0.0, *rest) if known and rest else rest


def _joined(one: tuple[float, ...], other: tuple[float, ...]) -> tuple[float, ...]:
    return (*one, *other, _number("add")) if one else other


def _number(operation: str) -> float:
    return float(operation_names().index(operation))


def _own_program(
    program: tuple[float, ...], rest: float, own: Callable[[float, str], float]
) -> tuple[float, ...]:
    """A program of the similar campaign as one of the model's joint: its position, rate, time and moment."""
    value = _number("number")
    replaced = {
        _number("angle"): (value, rest, _number("subtract")),
        _number("rate"): (value, 1.0 / own(1.0, "rad/s"), _number("multiply")),
        _number("time"): (value, 1.0 / own(1.0, "s"), _number("multiply")),
    }
    code: list[float] = []
    elements = iter(program)
    for element in elements:
        code.append(element)
        if element == value:
            code.append(next(elements))
        code += replaced.get(element, ())
    return (*code, value, own(1.0, "N m"), _number("multiply"))
