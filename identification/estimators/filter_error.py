"""Filter error: maximum likelihood with a random moment on the model and noise in the sensor.

For runs in a turbulent stream, where the residual of output error is not white and its intervals are too
narrow or, after widening, too wide. A Kalman filter predicts every sample from the previous ones, and decay rate,
stiffness and intensity of the moment maximise the likelihood of the prediction errors
(`identification.signal.filter`). A run without a random moment has the result of output error; for a body
without a spring no random moment is sought.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.campaign.combination import Found, RunByRun, RunDecay
from identification.estimate import Quantity, Status
from identification.signal.decay_fit import Reading, block_means, even_reading, mean_of_blocks, project_run
from identification.signal.driven_fit import DrivenRun, Gained, driven_run, input_response
from identification.signal.filter import DrivenFit, KnownInput, fit_driven
from identification.signal.free_decay import Decay
from identification.signal.noise import Residual, noise_level, white_noise
from identification.signal.run_fit import (
    NO_WINDOWS,
    FittedRun,
    decay_covariance_of,
    describe_run,
    identify_run,
)
from identification.statistics import inverse
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

_DECIDED = 6  # parameters fitted to a run's data: decay, stiffness, intensity, initial state, zero
_INNOVATIONS_BLOCK = 3  # innovations in an eighth of a cycle
INTENSITY_UNIT = "rad2/s3"


@dataclass(frozen=True)
class FilterError(RunByRun):
    """Maximum likelihood with measurement and process noise.

    A run's ``process_noise`` is the random moment's spectral intensity q over the inertia,
    ⟨w(t)w(t′)⟩ = q δ(t − t′); where its spectrum is not flat, that at the natural frequency.

    Args:
        blocks_per_cycle: block means per period that the filter uses, at least.
    """

    name = "filter_error"
    takes_driven = True
    blocks_per_cycle: int = 24

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        bare = (
            identify_run(run, sensor, cycles_per_window=NO_WINDOWS)
            if run.drive is None
            else driven_run(run, sensor)
        )
        if bare.fit is None or bare.noise is None:
            return RunDecay(bare.estimate)
        driven = self._driven(run, bare, sensor)
        if driven is None:
            variance = bare.noise.std**2 * bare.noise.slow_ratio
            of_run = bare.gained if isinstance(bare, DrivenRun) else None
            return RunDecay(bare.estimate, bare.fit.decay, decay_covariance_of(bare.fit) * variance, of_run)
        found, noise_std = driven
        decay, reading, drive = found.model.decay, bare.reading, run.drive
        known = run.known_gain
        gain = found.innovations.gain if known is None else known.at(decay.stiffness)
        if drive is not None:
            response = input_response(reading, drive, decay, sensor.derivative)
            reading = Reading(reading.time, reading.yaw - gain * response)
        projected = project_run(reading, decay)
        if projected is None:
            return Status.NOT_CONVERGED
        fitted, zero = projected
        # The innovations judge the model, since they are white if it is right; the residual is not.
        values, expected = found.innovations.values, found.innovations.variance
        level = noise_level(
            [Residual(values, _INNOVATIONS_BLOCK, _DECIDED, float(np.abs(values).max()))],
            SensorProperties(noise_std=float(np.sqrt(expected))),
        )
        departs = level.departs or level.disagrees
        ratio = max(level.slow_ratio, float(values @ values) / values.size / expected) if departs else 1.0
        noise = replace(bare.noise, std=noise_std, departs=departs, slow_ratio=ratio)
        covariance = found.covariance * noise.slow_ratio
        # The initial state is from least squares; its error due to the moment has the power of the residual.
        variance = max(noise_std, noise.residual_std) ** 2
        estimate = describe_run(run, reading, fitted, zero, covariance[:2, :2], variance, noise=noise)
        q = found.model.intensity_at_resonance
        process_noise = Quantity(q, q * float(np.sqrt(covariance[2, 2])), INTENSITY_UNIT)
        estimate = replace(estimate, process_noise=process_noise)
        if drive is None:
            return RunDecay(estimate, decay, covariance[:2, :2])
        size, weight = 3 if known is None else 2, np.zeros((3, 3))
        weight[:size, :size] = inverse(found.gained[:size, :size] * noise.slow_ratio)
        gained = Gained(np.array([decay.rate, decay.stiffness, gain]), weight)
        return RunDecay(estimate, decay, covariance[:2, :2], gained)

    def _driven(self, run: Run, bare: FittedRun, sensor: SensorProperties) -> tuple[DrivenFit, float] | None:
        # The fit, and its assumed sensor noise of one sample.
        fit, noise = bare.fit, bare.noise
        if fit is None or noise is None or fit.decay.omega_d == 0.0:
            return None
        noise_std = white_noise(fit.residual, sensor) if noise.departs else noise.std
        thin, factor = block_means(
            even_reading(bare.reading), fit.decay.omega_d / (2.0 * np.pi), self.blocks_per_cycle
        )
        if thin.time.size < 4 * _DECIDED:
            return None
        interval = float(thin.time[-1] - thin.time[0]) / (thin.time.size - 1)
        deviations = np.sqrt(np.diag(decay_covariance_of(fit))) * noise_std
        known, drive = None, run.drive
        if drive is not None:

            def response(decay: Decay) -> Array:
                """The response to the input, in the means of the blocks."""
                driven = input_response(bare.reading, drive, decay, sensor.derivative)
                motion = Reading(bare.reading.time, driven)
                return mean_of_blocks(even_reading(motion).yaw, factor)

            known = KnownInput(response, run.known_gain)
        found = fit_driven(thin.yaw, interval, fit.decay, deviations, noise_std**2 / factor, known)
        return None if found is None or found.model.decay.stiffness <= 0.0 else (found, noise_std)
