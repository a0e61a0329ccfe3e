"""The model of a campaign as a function of parameters: nominal, or with effects added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.likelihood.motions import Asked, readings
from diagnosis.model.chance import RunDeparture, Scatter, departure
from diagnosis.model.data import Data
from diagnosis.model.parameters import Parameter, ParameterSet, Point
from diagnosis.model.run_data import RunData
from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.capabilities import Clock
from tunnel_sim.effects.chain import reads_plainly, with_effects
from tunnel_sim.physics.moment_law import WEIGHTS
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array

_BEYOND = 1e6  # rad or rad/s: the integrator stops at such an angle


@dataclass(frozen=True, eq=False)
class Problem:
    """A fit to be made: prepared runs, and the effects added to the nominal model.

    Args:
        effects: effect classes with free parameters.
        fixed: values of fixed effect parameters, as ``effect.parameter``.
        free_forms: free form parameters, as ``effect.parameter``; the others keep the textbook form.
        instants: number of instants in every run for an effect that skips samples.
        scatter: chance differences between runs beside the effects; each run deviates in each of them.
        resolve_rod_mode: whether to integrate a flexible rod with its ringing; else the ringing is added to the
            slow motion, which is much faster, and exact for a linear rig.
    """

    data: Data
    effects: tuple[type[Effect], ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    free_forms: tuple[str, ...] = ()
    instants: int = 1
    scatter: Scatter = ()
    resolve_rod_mode: bool = False

    @cached_property
    def parameters(self) -> ParameterSet:
        """All parameters: the nominal model's first, then the effects' in their order."""
        nominal, held = self.data.model.parameters(self.data), dict(self.fixed)
        found, swing = list(nominal), self.data.swing
        found += [one.parameter for one in self.scatter]
        for kind in self.effects:
            for info in kind.parameters():
                name = f"{kind.name}.{info.name}"
                free = not info.of_input and (not info.form or name in self.free_forms)
                if free and name not in held and self.data.model.tells(info, swing):
                    low, high = info.fit_range(swing)
                    found.append(Parameter(name, info.unit, low, high, info.scale, effect=kind.name))
            for own in kind.per_run_parameters(self.instants):
                found.append(Parameter(f"{kind.name}.{own}", "1", owner="per_run", effect=kind.name))
        return ParameterSet(tuple(found))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all common parameters, the nominal ones first."""
        return self.parameters.names

    @cached_property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the free effect parameters, as ``effect.parameter``."""
        return tuple(one.name for one in self.parameters.common if one.effect)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values of the common parameters."""
        return self.parameters.bounds

    def zero(self, common: Array, own: Array) -> float:
        """The sensor's zero in one run, in the unit of the reading.

        Args:
            common: as in `Point`, shape (common,).
            own: parameters of the run, a row of ``Point.per_run``, shape (own,).
        """
        parameters = self.parameters
        if "zero" in parameters.names:
            return float(common[parameters.names.index("zero")])
        if "zero" in parameters.own_names:
            return float(own[parameters.own_names.index("zero")])
        return self.data.model.held.get("zero", 0.0)

    def _values(self, common: Array, own: Array) -> dict[str, float]:
        """Values of all parameters in one run by name, fixed ones included; arguments as in `zero`."""
        names, own_names = self.parameters.names, self.parameters.own_names
        fitted = dict(zip(names, common.tolist(), strict=True))
        return {**self.data.model.held, **fitted, **dict(zip(own_names, own.tolist(), strict=False))}

    @property
    def carries_load(self) -> bool:
        """Whether the joint carries a moment that varies: gravity's or an actuator's."""
        terms = {*self.data.model.law_parameters, *(term for kind in self.effects for term in kind.law_terms)}
        hangs = any(stiffness in terms for stiffness, _ in WEIGHTS)
        return hangs or any(drive.kind.by_actuator for drive in self.data.inputs)

    def effects_at(self, common: Array) -> tuple[Effect, ...]:
        """The effects with their parameters.

        Args:
            common: as in `Point`, shape (common,).
        """
        values = dict(zip(self.names, common.tolist(), strict=True)) | dict(self.fixed)
        return tuple(
            kind(**{i.name: values.get(f"{kind.name}.{i.name}", i.default) for i in kind.parameters()})
            for kind in self.effects
        )

    def stated(self, common: Array, release: Array, run: RunData) -> RunSettings:
        """The nominal physics of one run, before any effect.

        Args:
            common: as in `Point`, shape (common,).
            release: release of the run, shape (2,).
        """
        return self.data.model.run_settings(self._values(common, release), run)

    def chain(
        self, common: Array, own: Array, run: RunData, effects: tuple[Effect, ...] | None = None
    ) -> EffectChain:
        """The effects of one run, with its phases and instants.

        Args:
            common: as in `Point`, shape (common,).
            own: the run's own parameters, a row of ``Point.per_run``, shape (own,).
            effects: from `effects_at`, if already known.
        """
        drawn = self._drawn(own[None])[0]
        known = self.effects_at(common) if effects is None else effects
        stated = self.stated(common, own, run)
        if not self.scatter:
            return EffectChain(stated, known, drawn)
        deviations = own[None, self.parameters.places(self.scatter)]
        changed = departure(self.scatter, deviations, stated.table, self.data)[0]
        return EffectChain(stated, (*known, RunDeparture()), (*drawn, changed))

    def predict(self, points: Sequence[Point]) -> list[list[Array]]:
        """Predicted block means of the reading, for every point, for every run.

        In rad; infinite where the motion diverges, a parameter is not finite, or an initial state is out of
        range.
        """
        found = [[np.full(run.reading.size, np.inf) for run in self.data.runs] for _ in points]
        places = [
            (i, int(r))
            for i, point in enumerate(points)
            if np.all(np.isfinite(point.common))
            for r in np.flatnonzero(np.all(np.abs(point.per_run) < _BEYOND, axis=1))
        ]
        if places:
            for (i, r), values in zip(places, readings(self.asked(points, places)), strict=True):
                found[i][r] = self.data.runs[r].in_blocks(values)
        return found

    def asked(self, points: Sequence[Point], places: Sequence[tuple[int, int]]) -> Asked:
        """The runs to be predicted, with their physics.

        The runs have their original, shorter blocks where the reading is not the angle, or the rod rings.

        Args:
            places: indices of the points and the runs.
        """
        runs = [self.data.runs[r] for _, r in places]
        common = np.stack([points[i].common for i, _ in places])
        own = np.stack([points[i].per_run[r] for i, r in places])
        values = self._columns(common, own)
        stated = self.data.model.settings(values, runs)
        at = {i: self.effects_at(points[i].common) for i in dict.fromkeys(i for i, _ in places)}
        effects, drawn = [at[i] for i, _ in places], self._drawn(own)
        if self.scatter:
            changed = departure(self.scatter, own[:, self.parameters.places(self.scatter)], stated, self.data)
            last = RunDeparture()
            effects = [(*some, last) for some in effects]
            drawn = [(*some, change) for some, change in zip(drawn, changed, strict=True)]
        physics = with_effects(stated, effects, drawn)
        if not reads_plainly(effects[0]) or any(physics.rod_twist):
            runs = [run.fine for run in runs]
        zero = values.get("zero", np.zeros(len(runs)))
        return Asked(self.data, runs, stated, physics, effects, drawn, zero, self.resolve_rod_mode)

    def _columns(self, common: Array, own: Array) -> dict[str, Array]:
        """Values of all parameters in several runs by name, fixed ones included, shape (runs,) each.

        Args:
            common: shape (runs, common).
            own: shape (runs, own).
        """
        values = {name: np.full(len(own), value) for name, value in self.data.model.held.items()}
        values |= dict(zip(self.names, common.T, strict=True))
        return values | dict(zip(self.parameters.own_names, own.T, strict=False))

    def linear(self, point: Point) -> Array:
        """Inertia, damping and stiffness of every run, as in `Fit.linear`, shape (runs, 3)."""
        runs = self.data.runs
        values = self._columns(np.tile(point.common, (len(runs), 1)), point.per_run[: len(runs)])
        stated, pressure = self.data.model.settings(values, runs), [self.data.air_moment(run) for run in runs]
        stiffness = stated.spring_stiffness - pressure * stated["cn_beta"]
        stiffness += sum(effect.stiffness_at_rest for effect in self.effects_at(point.common))
        rate = np.array([self.data.air_damping(run) for run in runs])
        damping = stated["mechanical_damping"] - rate * stated["cn_r"]
        return np.stack([stated["yaw_inertia"], damping, stiffness], axis=1)

    def _drawn(self, own: Array) -> list[tuple[Drawn, ...]]:
        """Random draws of the effects in several runs, by run.

        Args:
            own: the runs' own parameters, rows of ``Point.per_run``, shape (runs, own).
        """
        columns: list[list[Drawn]] = []
        for kind in self.effects:
            place = self.parameters.own_places.get(kind.name)
            if issubclass(kind, Clock):
                columns.append([None] * len(own) if place is None else list(own[:, place]))
            else:
                columns.append([None] * len(own) if place is None else own[:, place.start].tolist())
        return list(zip(*columns, strict=True)) if columns else [()] * len(own)
