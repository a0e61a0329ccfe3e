"""Whether one damped oscillation explains a record: one test for every method.

On a record of little noise a method's own motion misses the record by the error of the method alone, so its
residual does not judge the record. The least-squares motion nearest to the method's decay is tested instead, by
`residual_noise.noise_level`. The false-alarm rate is `identification.policy.MISFIT_RATE`.
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
    """The verdict of the least-squares residual of a run.

    Args:
        covariance: of (a, k) by least squares, widened where the model departs, shape (2, 2), in 1/s and 1/s².
    """

    noise: NoiseLevel
    covariance: Array

    def widened(self, covariance: Array) -> Array:
        """A method's covariance of (a, k), raised to that of least squares where the model departs.

        Args:
            covariance: the method's own, shape (2, 2), in 1/s and 1/s².

        Returns:
            Shape (2, 2); no standard deviation is smaller than that of the widened least squares.
        """
        if not self.noise.departs:
            return covariance
        return widened_covariance(covariance, np.sqrt(self.covariance.diagonal()))


def residual_check(run: Run, decay: Decay, sensor: SensorProperties) -> ResidualCheck | None:
    """Fit a run by least squares, starting from a method's decay, and test the residual.

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
