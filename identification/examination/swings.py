"""Stiffness over inertia and decay rate of each run, with standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.decay.damped_oscillation import Decay
from identification.decay.decay_fit import Reading, project_run
from identification.decay.first_guess import starting_frequency, thinned_reading
from identification.decay.pencil import PencilDecay, pencil_decay
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array, evenly_spaced

_UNKNOWNS = 5  # decay rate, stiffness, zero, initial angle and rate
_LEAST_SAMPLES = 30  # of a part of a record whose poles are found separately
_E_FOLDING = 0.5  # e-folds in the first part: both parts then determine the frequency about equally well


@dataclass(frozen=True, eq=False)
class Swing:
    """One run's oscillation.

    Args:
        stiffness: k = ωn², 1/s².
        stiffness_std: its standard deviation, 1/s². It includes the change of k along the run: a frequency that
            depends on the amplitude is not known better than that.
        rate: a = ζωn, 1/s; negative where the motion grows.
        rate_std: its standard deviation, 1/s.
        motion: reading less the sensor's zero, thinned, shape (n,), rad.
    """

    run: Run
    stiffness: float
    stiffness_std: float
    rate: float
    rate_std: float
    motion: Array


def swing_of(run: Run) -> Swing | None:
    """Measure a run's oscillation by its poles, which need no starting values and no iteration.

    The residual is taken to be correlated over half a cycle, so a decay that does not explain the record has
    larger standard deviations.

    Args:
        run: the run; its spring and wind are not used.

    Returns:
        The oscillation; None if there is none.
    """
    frequency = starting_frequency(run.record)
    if frequency is None:
        return None
    reading = thinned_reading(evenly_spaced(run.record), frequency)
    omega = 2.0 * np.pi * frequency
    found = _poles(reading, omega)
    fitted = None if found is None else project_run(reading, found.decay)
    if found is None or fitted is None:
        return None
    residual, zero = fitted[0].residual, fitted[1]
    half_cycle = np.pi / found.decay.omega_d * residual.size / float(reading.time[-1])
    variance = float(residual @ residual) / max(residual.size - _UNKNOWNS, 1) * max(half_cycle, 1.0)
    rate_std, stiffness_std = np.sqrt(variance) * np.linalg.norm(found.weights, axis=1)
    return Swing(
        run,
        stiffness=found.decay.stiffness,
        stiffness_std=float(np.hypot(stiffness_std, _change_along(reading, found.decay))),
        rate=found.decay.rate,
        rate_std=float(rate_std),
        motion=reading.yaw - zero,
    )


def _poles(reading: Reading, omega: float) -> PencilDecay | None:
    """The oscillation of a part of a record; None if its poles are not those of an oscillation."""
    found = pencil_decay(reading.yaw, float(reading.time[-1]) / (reading.time.size - 1), omega)
    return found if found is not None and found.decay.omega_d > 0.0 else None


def _change_along(reading: Reading, decay: Decay) -> float:
    """Change of k between the run's first part and the rest, 1/s²; 0 if the record is too short."""
    length = float(reading.time[-1])
    split = 0.5 * length if decay.rate <= 0.0 else min(0.5 * length, _E_FOLDING / decay.rate)
    at = int(np.searchsorted(reading.time, max(split, 2.0 * np.pi / decay.omega_d)))
    if min(at, reading.time.size - at) < _LEAST_SAMPLES:
        return 0.0
    first, rest = (
        _poles(Reading(reading.time[part] - reading.time[part][0], reading.yaw[part]), decay.omega_d)
        for part in (slice(None, at), slice(at, None))
    )
    return 0.0 if first is None or rest is None else abs(first.decay.stiffness - rest.decay.stiffness)
