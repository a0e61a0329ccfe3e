"""Does one damped oscillation explain a record? The same question, and the same answer, for every method.

A method's own motion misses a clear record by the method's error alone, so it is no judge of the record. Judged is
the least-squares motion nearest to the method's decay, by `noise.noise_level`: it departs in one run of a thousand
that a damped oscillation with white noise explains (`identification.policy.MISFIT_RATE`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.decay.damped_oscillation import Decay
from identification.decay.decay_fit import Reading
from identification.decay.run_fit import decay_covariance_of, fit_from, judge
from identification.estimate import NoiseLevel
from identification.statistics.widening import widened_covariance
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class ResidualCheck:
    """What the least-squares residual of a run says.

    Args:
        noise: its level and the verdict on the model.
        covariance: of (a, k) by least squares, widened where the model departs, shape (2, 2), in 1/s and 1/s².
    """

    noise: NoiseLevel
    covariance: Array

    def widened(self, covariance: Array) -> Array:
        """A method's covariance of (a, k), raised to the least squares' where the model departs.

        Args:
            covariance: the method's own, shape (2, 2), in 1/s and 1/s².

        Returns:
            Shape (2, 2): no standard deviation is less than that of the widened least squares.
        """
        if not self.noise.departs:
            return covariance
        return widened_covariance(covariance, np.sqrt(self.covariance.diagonal()))


def residual_check(run: Run, decay: Decay, sensor: SensorProperties) -> ResidualCheck | None:
    """Fit a run by least squares from a method's decay on, and judge what is left.

    Args:
        run: the run.
        decay: what the method found.
        sensor: what is stated of the noise.

    Returns:
        The verdict; None where the least squares do not converge to a decay that the record determines.
    """
    reading = Reading.from_record(run.record)
    fit = fit_from(run, reading, decay)
    if fit is None:
        return None
    noise, failure = judge(reading, fit.runs[0], fit.zero, sensor)
    if failure is not None:
        return None
    covariance = decay_covariance_of(fit.runs[0]) * (noise.std**2 * noise.slow_ratio)
    return ResidualCheck(noise, covariance)
