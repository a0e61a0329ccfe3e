"""What each cause does to a swing of a stated amplitude: to its damping, frequency, middle and reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.problem import Point
from diagnosis.fitting.spectra import linear_coefficients, resonance
from diagnosis.result import CauseSize
from diagnosis.study import Study
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.record import Array

_CYCLES = 3.0
_SHARE = 0.5  # of the largest swing: an amplitude that every run passes through


def cause_sizes(study: Study) -> tuple[CauseSize, ...]:
    """Simulate the fitted model with each cause and without it.

    Returns:
        The size of every fitted cause, in the measured campaign's units. A cause that was read off the records or
        is random has none, and neither has one that stops the motion at once.
    """
    fit = study.chosen
    found = (_size(study, fit, kind) for kind in fit.problem.effects)
    return tuple(size for size in found if size is not None)


def _size(study: Study, fit: Fit, kind: type[Effect]) -> CauseSize | None:
    problem = fit.problem
    data = problem.data.undriven()
    problem = replace(problem, data=data)
    runs = range(len(data.runs))
    shown = [i for i in runs if data.runs[i].wind_on] if kind.condition == "wind_on" else []
    # the softest spring, where a moment of any size does most
    index = min(shown or runs, key=lambda i: data.runs[i].spring_stiffness or 0.0)
    amplitude = _SHARE * data.swing
    release = fit.point.release.copy()
    release[index, :2] = amplitude, 0.0
    without = fit.point.common.copy()
    severity = f"{kind.name}.{kind.parameters()[0].name}"
    if severity not in problem.names:
        return None
    without[problem.names.index(severity)] = 0.0
    both = problem.predict([Point(fit.point.common, release), Point(without, release)])
    run = data.runs[index]
    frequency = resonance(fit, index)
    count = min(run.reading.size, round(_CYCLES / (frequency * run.interval)))
    curves = [readings[index][:count] for readings in both]
    decay, decay_without = (_decay(run.interval, curve, frequency) for curve in curves)
    if decay is None or decay_without is None:
        return None
    rate, zeta, zero = decay
    rate_without, zeta_without, zero_without = decay_without
    own = study.similarity.own(1.0, study.similarity.reading)
    effect = next(effect for effect in problem.effects_at(fit.point.common) if isinstance(effect, kind))
    return CauseSize(
        effect=kind.name,
        run=run.id,
        amplitude=amplitude,
        damping_ratio=zeta,
        damping_ratio_without=zeta_without,
        frequency_change=rate / rate_without - 1.0,
        zero_change=own * (zero - zero_without),
        reading_change=own * float(np.sqrt(np.mean((curves[0] - curves[1]) ** 2))),
        stands=effect.stands(linear_coefficients(fit, index)[2]),
    )


def _decay(interval: float, curve: Array, frequency: float) -> Sequence[float] | None:
    """Angular frequency (rad/s), damping ratio and mean of a few cycles; None where they are no decay."""
    from scipy.optimize import least_squares  # only here: slow to load

    time = (np.arange(curve.size) + 0.5) * interval

    def left(point: Array) -> Array:
        omega, delta, a, b, zero = point
        swing: Array = np.exp(-delta * time) * (a * np.cos(omega * time) + b * np.sin(omega * time)) + zero
        return swing - curve

    if curve.size < 10 or not np.all(np.isfinite(curve)):
        return None
    size = 0.5 * float(np.ptp(curve))
    omega = 2.0 * np.pi * frequency
    try:
        with np.errstate(over="raise", invalid="raise"):
            found = least_squares(left, (omega, 0.0, size, 0.0, 0.0), method="lm")
    except (ValueError, FloatingPointError):
        return None
    if not found.success:
        return None
    omega, delta, *_, zero = found.x
    natural = float(np.hypot(omega, delta))
    return natural, float(delta) / natural, float(zero)
