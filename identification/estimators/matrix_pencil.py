"""Matrix pencil: poles by linear algebra, without starting values and without iteration on the parameters.

A first-order perturbation gives the covariance of the poles: see `identification.signal.frequency.pencil_decay`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.campaign.combination import Found, RunByRun, RunDecay
from identification.estimate import Status
from identification.signal.decay_fit import Reading, block_means, even_reading, project_run
from identification.signal.frequency import pencil_decay, starting_frequency
from identification.signal.run_fit import Gained, describe_run, noise_and_failure
from tunnel_sim.vocabulary.campaign import Run, SensorProperties

_DECAY_TIMES = 8.0  # in units of 1/σ: later samples contain e^−16 of the energy, and noise


@dataclass(frozen=True)
class MatrixPencil(RunByRun):
    """Poles from the shift of a Hankel matrix.

    Args:
        blocks_per_cycle: minimum number of block means per period. Fewer are faster but lose signal: averaging
            lowers its amplitude by (π/blocks)²/6.
    """

    name = "matrix_pencil"
    blocks_per_cycle: int = 16

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        frequency = starting_frequency(run.record)
        if frequency is None:
            return Status.NO_OSCILLATION
        reading = Reading.from_record(run.record)
        thin, factor = block_means(even_reading(reading), frequency, self.blocks_per_cycle)
        interval = float(thin.time[-1] - thin.time[0]) / max(thin.time.size - 1, 1)
        found = pencil_decay(thin.yaw, interval, 2.0 * np.pi * frequency)
        if found is not None and found.decay.rate * float(thin.time[-1]) > 1.5 * _DECAY_TIMES:
            # The decay fills a small part of the record: the pencil is applied again to this part.
            count = int(_DECAY_TIMES / (found.decay.rate * interval))
            found = pencil_decay(thin.yaw[:count], interval, 2.0 * np.pi * frequency) or found
        projected = None if found is None else project_run(reading, found.decay)
        if found is None or projected is None or found.decay.stiffness <= 0.0:
            return Status.NOT_CONVERGED
        fitted, zero = projected
        noise, failure = noise_and_failure(reading, fitted, zero, sensor)
        if failure is not None:
            return failure
        variance = noise.variance
        covariance = found.weights @ found.weights.T * (variance / factor)
        estimate = describe_run(run, reading, fitted, zero, covariance, variance, noise=noise.level)
        coefficients = np.array([fitted.decay.rate, fitted.decay.stiffness, 0.0])
        return RunDecay(estimate, Gained.of(coefficients, covariance))
