"""The effect of each cause on a swing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.model.parameters import Point
from diagnosis.search.study import Study
from identification.show.numbers import joined_mark, motion_shown, significant, unit_shown
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.free_decay import Decay
from tunnel_sim.effects.capabilities import Friction
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.vocabulary.record import Array

_VISIBLE = 0.005  # least change of a damping ratio that is stated
_VISIBLE_FREQUENCY = 5e-5  # least relative change of a frequency that is stated


@dataclass(frozen=True)
class CauseSize:
    """Effect of a cause on three cycles of a swing, by the fitted model with it and without it.

    Args:
        run: id of the run that supplies the conditions.
        amplitude: release angle, rad.
        damping_ratio: with the cause, dimensionless.
        damping_ratio_without: with every cause but this one, dimensionless.
        frequency_change: relative change of the natural frequency by the cause, a fraction.
        zero_change: change of the middle of the swing by the cause, in the unit of the readings.
        reading_change: root mean square of the change of the reading, in its unit.
        stands: angle from rest within which the cause stops the body for good, rad; 0 where it never stops it.
    """

    effect: str
    run: str
    amplitude: float
    damping_ratio: float
    damping_ratio_without: float
    frequency_change: float
    zero_change: float
    reading_change: float
    stands: float = 0.0

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with the units of angles in their names."""
        found = dict(vars(self))
        return found | {"amplitude_rad": found.pop("amplitude"), "stands_rad": found.pop("stands")}

    def words(self, unit: str) -> str:
        """The effect in a sentence, with damping and frequency if they change visibly.

        Args:
            unit: unit of the readings.

        Returns:
            Empty where the simulated run does not show it.
        """
        (mark, factor), (degree, angle) = unit_shown(unit), motion_shown(unit)
        mark, degree = joined_mark(mark), joined_mark(degree)
        changes = []
        zeta, without = self.damping_ratio, self.damping_ratio_without
        if abs(zeta - without) > _VISIBLE * max(abs(zeta), abs(without)):
            changes.append(f"damping ratio {significant(without, 3)} becomes {significant(zeta, 3)}")
        if abs(self.frequency_change) > _VISIBLE_FREQUENCY:
            change = 100.0 * self.frequency_change
            changes.append(f"frequency {'+' if change > 0.0 else ''}{significant(change, 2)} %")
        reading = factor * self.reading_change
        if abs(self.zero_change) > 0.5 * self.reading_change:
            changes.append(f"the middle moves by {significant(factor * self.zero_change, 2)}{mark}")
        if not changes and not reading:
            return ""
        changes.append(f"the reading changes by {significant(reading, 2)}{mark} root mean square")
        held = angle * self.stands
        stands = f"; it stops the body up to {significant(held, 2)}{degree} from rest" if held > 0.0 else ""
        amplitude = significant(angle * self.amplitude, 2)
        return f"Over three cycles from {amplitude}{degree}: {', '.join(changes)}{stands}"

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, without units in their names."""
        return {**data, "amplitude": data["amplitude_rad"], "stands": data["stands_rad"]}


_CYCLES = 3.0
_FEWEST = 10  # minimum number of block means in the cycles
_CLOSE = 1e-12  # tolerance of the fit of a curve without noise
_SHARE = 0.5  # share of the largest swing: an amplitude that every run passes through


def cause_sizes(study: Study) -> tuple[CauseSize, ...]:
    """Simulate the fitted model with each cause and without it.

    Returns:
        The size of every fitted cause, in the measured campaign's units. The simulated runs are free decays. A
        cause therefore has no size if it was detected in the records, is random, stops the motion at once, acts
        on driven runs only, or acts on a body without a spring.
    """
    fit, data = study.chosen, study.chosen.problem.data.undriven()
    if not data.model.restored:
        return ()
    problem = replace(fit.problem, data=data)
    reading_unit, amplitude = study.similarity.own(1.0, study.similarity.reading), _SHARE * data.swing
    sizes = []
    for kind, effect in zip(problem.effects, problem.effects_at(fit.point.common), strict=True):
        severity = f"{kind.name}.{kind.parameters()[0].name}"
        if not data.may_show(kind) or severity not in problem.names:
            continue
        acts = np.flatnonzero(data.acts(kind)).tolist()
        release, without = fit.point.per_run.copy(), fit.point.common.copy()
        release[:, :2] = amplitude, 0.0
        without[problem.names.index(severity)] = 0.0
        both = problem.predict([Point(fit.point.common, release), Point(without, release)])
        # only some runs show a cause in one spring or one wind
        shown = [i for i in acts or range(len(data.runs)) if not np.array_equal(both[0][i], both[1][i])]
        if not shown:
            continue
        # the softest spring, on which a moment acts most
        index = min(shown, key=lambda i: data.runs[i].spring_stiffness or 0.0)
        run, frequency = data.runs[index], resonance(fit, index)
        count = min(run.reading.size, round(_CYCLES / (frequency * run.interval)))
        curves = [readings[index][:count] for readings in both]
        decay, decay_without = (_decay(run.interval, curve, frequency) for curve in curves)
        if decay is None or decay_without is None:
            continue
        size = CauseSize(
            effect=kind.name,
            run=run.id,
            amplitude=study.similarity.own(amplitude, "rad"),
            damping_ratio=decay[1],
            damping_ratio_without=decay_without[1],
            frequency_change=decay[0] / decay_without[0] - 1.0,
            zero_change=reading_unit * (decay[2] - decay_without[2]),
            reading_change=reading_unit * float(np.sqrt(np.mean((curves[0] - curves[1]) ** 2))),
            stands=(
                study.similarity.own(effect.stands(linear_coefficients(fit, index)[2]), "rad")
                if isinstance(effect, Friction)
                else 0.0
            ),
        )
        sizes.append(size)
    return tuple(sizes)


def decay_of_swing(fit: Fit) -> tuple[float, float] | None:
    """Decay of the fitted motion over three cycles, from half of the largest swing.

    Returns:
        Angular frequency (rad/s) and damping ratio, of the first run; None unless its motion there is a decay.
    """
    data = fit.problem.data
    release = fit.point.per_run.copy()
    release[:, :2] = _SHARE * data.swing, 0.0
    run, frequency = data.runs[0], resonance(fit, 0)
    count = min(run.reading.size, round(_CYCLES / (frequency * run.interval)))
    decay = _decay(
        run.interval, fit.problem.predict([Point(fit.point.common, release)])[0][0][:count], frequency
    )
    return None if decay is None or decay[1] <= 0.0 else decay[:2]


def _decay(interval: float, curve: Array, frequency: float) -> tuple[float, float, float] | None:
    """Angular frequency (rad/s), damping ratio and mean of a few cycles; None unless they are a decay."""
    if curve.size < _FEWEST or not np.all(np.isfinite(curve)):
        return None
    reading = Reading(interval * np.arange(curve.size, dtype=np.float64), curve)
    found = fit_run(reading, Decay(0.0, (2.0 * np.pi * frequency) ** 2), tolerance=_CLOSE)
    if not found.runs or found.runs[0].decay.omega_d == 0.0:  # without the cause the body does not swing
        return None
    decay = found.runs[0].decay
    return decay.omega_n, decay.zeta, found.zero
