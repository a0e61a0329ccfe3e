"""The law that a fit found for a joint, as moments of native elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.likelihood.motions import condensed
from diagnosis.likelihood.problem import Problem
from diagnosis.model.fact import Fact
from diagnosis.model.joint import Joint, LooseJoint, ServoJoint
from diagnosis.model.similarity import REFERENCE_FREQUENCY
from diagnosis.patch.native_friction import Carried, native_friction
from diagnosis.patch.native_moments import GRID, PATCHED_MISSES, NativeMoments, operation, with_terms
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import JointLaw


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """The law of a fit.

    Args:
        common: common parameters of the fit, shape (common,).
        release: own parameters of a run with the wind off, shape (own,).
        index: index of that run.
        noise: noise of the sensor, rad; 0: not written.
        controlled: own parameters and index of a run that controls the model's actuator; None: none.
        steps: function from the added damping, N m s/rad, to the apparent inertia due to the engine's steps, kg
            m²;
        None: 0.
        native_only: whether every moment is written as the nearest native element, however different it is.
    """

    problem: Problem
    common: Array
    release: Array
    index: int = 0
    noise: float = 0.0
    controlled: tuple[Array, int] | None = None
    steps: Callable[[float], float] | None = None
    native_only: bool = False

    @property
    def law(self) -> JointLaw:
        """The law of the given model, in the units of the similar campaign."""
        model = self.problem.data.model
        assert isinstance(model, Joint | LooseJoint)
        return model.law

    @property
    def rest(self) -> float:
        """The position of the joint at its rest, rad."""
        return self.law.rest + self.problem.data.similarity.rest

    @cached_property
    def physics(self) -> RunSettings:
        """The settings of the run."""
        data = self.problem.data
        chain = self.problem.chain(self.common, self.release, data.runs[self.index])
        return condensed(chain.physics(), data)

    @cached_property
    def fitted(self) -> dict[str, float]:
        """The common parameters by name."""
        return dict(zip(self.problem.names, self.common.tolist(), strict=True))

    def own(self, value: float, unit: str) -> float:
        """A value in the units of the measured campaign."""
        return self.problem.data.similarity.own(value, unit)

    @cached_property
    def moments(self) -> NativeMoments:
        """The moments added to the given model's, in the units of the similar campaign."""
        problem, physics, law = self.problem, self.physics, self.law
        data, model, fitted = problem.data, problem.data.model, self.fitted
        zero = problem.zero(self.common, self.release)
        reach = max(float(np.max(np.abs(run.reading - zero))) for run in data.runs)
        turn = np.sqrt(physics.spring_stiffness / physics.yaw_inertia) or 2.0 * np.pi * REFERENCE_FREQUENCY
        may_miss, parameters = np.inf if self.native_only else PATCHED_MISSES, physics.parameters
        inertial = np.sqrt(physics.spring_stiffness * physics.yaw_inertia)
        loss = parameters.get("loss_factor", 0.0) * inertial
        of_servo = fitted["servo_kp"] - model.kp if isinstance(model, ServoJoint) else 0.0
        added = physics.spring_stiffness - law.stiffness - of_servo
        # the part of the program that effects add to the model's own
        own_program = problem.stated(self.common, self.release, data.runs[self.index]).program
        program, said = physics.program[len(own_program) :], list[Fact]()
        if self.native_only and program:
            program = ()
            said.append(Fact("own law left out"))
        if own_program and program:
            program = (operation("number"), 0.0, *program)
        total = NativeMoments(
            spring=np.array([-fitted.get("moment_offset", 0.0), added, 0.0, 0.0]),
            damping=np.array([physics.mechanical_damping + loss - law.damping, 0.0, 0.0]),
            program=program,
            differences=tuple(said),
        )
        known = {"Kr": physics.spring_stiffness, **parameters}
        total = with_terms(total, known, reach, reach * turn, law.damping, may_miss)
        loads = self._loads() if parameters.get("friction_load", 0.0) else ()
        carried = Carried.over(parameters, loads) if loads else Carried()
        rates = np.linspace(-reach * turn, reach * turn, GRID)
        friction = native_friction(
            parameters, rates[rates > 0.0], law, float(total.damping[0]), may_miss, carried
        )
        return total.plus(friction)

    def _loads(self) -> list[tuple[Array, Array]]:
        """The angle from rest, rad, and the actuator's moment, N m, of every run, each of shape (n,)."""
        problem, found = self.problem, list[tuple[Array, Array]]()
        zero = problem.zero(self.common, self.release)
        for run in problem.data.runs:
            drive = problem.chain(self.common, self.release, run).physics().drive
            moment = np.zeros(run.reading.size)
            if drive is not None and drive.kind.by_actuator:
                moment = drive.at(run.times)
            found.append((run.reading - zero, moment))
        return found
