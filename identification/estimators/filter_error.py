"""Filter error: maximum likelihood with a random moment on the model and noise in the sensor.

For runs in a turbulent stream, where the residual of output error is not white and its intervals are too narrow
or, after widening, too wide. A Kalman filter predicts every sample from the previous ones. Decay rate,
stiffness and intensity of the moment maximise the likelihood of the prediction errors
(`identification.signal.filter`). Without a random moment, a run has the result of output error, and a remark
says so; for a body without a spring no random moment is sought.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.campaign.combination import Found, RunByRun, RunDecay
from identification.estimate import Status
from identification.show.quantity import Quantity
from identification.signal.colour import Autoregression
from identification.signal.decay_fit import Reading, block_means, even_reading, mean_of_blocks, project_run
from identification.signal.filter import DrivenFit, KnownInput, fit_driven
from identification.signal.forcing import Forced
from identification.signal.free_decay import Decay
from identification.signal.noise import Residual, noise_level, white_noise
from identification.signal.run_fit import (
    NO_WINDOWS,
    FittedRun,
    Gained,
    decay_covariance_of,
    describe_run,
    identify_run,
)
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

_DECIDED = 6  # parameters fitted to a run's data: decay, stiffness, intensity, initial state, zero
_INNOVATIONS_CYCLE = 24.0  # number of innovations in a cycle
INTENSITY_UNIT = "rad2/s3"


@dataclass(frozen=True)
class FilterError(RunByRun):
    """Maximum likelihood with measurement and process noise.

    A run's ``process_noise`` is the random moment's spectral intensity q over the inertia,
    ⟨w(t)w(t′)⟩ = q δ(t − t′); where its spectrum is not flat, q at the natural frequency.

    Args:
        blocks_per_cycle: minimum number of block means per period for the filter.
    """

    name = "filter_error"
    takes_driven = True
    blocks_per_cycle: int = 24

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        bare = identify_run(run, sensor, cycles_per_window=NO_WINDOWS)
        if bare.fit is None or bare.noise is None:
            return RunDecay(bare.estimate)
        driven = self._driven(bare, sensor)
        if isinstance(driven, str):
            remedy = "run the diagnosis" if bare.noise.departs else "use output_error, which is faster"
            what = f"{driven}, so the result is that of output error"
            return RunDecay(bare.estimate, bare.gained, (what, remedy))
        filtered, noise_std = driven
        decay, forcing = filtered.model.decay, bare.reading.forcing
        gain = filtered.innovations.gain if forcing.known is None else forcing.known.at(decay.stiffness)
        reading = bare.reading.freed(decay, gain)
        projected = project_run(reading, decay)
        if projected is None:
            return Status.NOT_CONVERGED
        fitted, zero = projected
        # The innovations judge the model, since they are white if it is right; the residual is not.
        values, expected = filtered.innovations.values, filtered.innovations.variance
        level = noise_level(
            [Residual(values, _INNOVATIONS_CYCLE, _DECIDED, float(np.abs(values).max()))],
            SensorProperties(noise_std=float(np.sqrt(expected))),
        )
        departs = level.departs or level.disagrees
        ratio = max(level.slow_ratio, float(values @ values) / values.size / expected) if departs else 1.0
        noise = replace(bare.noise, std=noise_std, departs=departs, slow_ratio=ratio)
        covariance = filtered.covariance * noise.slow_ratio
        # The initial state is from least squares; its error due to the moment has the power of the residual.
        variance = max(noise_std, noise.residual_std) ** 2
        estimate = describe_run(run, reading, fitted, zero, covariance[:2, :2], variance, noise=noise)
        q = filtered.model.intensity_at_resonance
        process_noise = Quantity(q, q * float(np.sqrt(covariance[2, 2])), INTENSITY_UNIT)
        estimate = replace(estimate, process_noise=process_noise)
        sought, coefficients = forcing.sought, np.array([decay.rate, decay.stiffness, gain])
        of_sought = filtered.gained[np.ix_(sought, sought)] * noise.slow_ratio
        return RunDecay(estimate, Gained.of(coefficients, of_sought, sought))

    def _driven(self, bare: FittedRun, sensor: SensorProperties) -> tuple[DrivenFit, float] | str:
        # The fit, with its assumed sensor noise of one sample; or the reason why there is none.
        fit, noise = bare.fit, bare.noise
        if fit is None or noise is None or fit.decay.omega_d == 0.0:
            return "no random moment is sought in a motion without oscillation"
        white = noise.slow_ratio == 1.0
        noise_std = noise.std if white else white_noise(fit.residual, sensor)
        frequency = fit.decay.omega_d / (2.0 * np.pi)
        thin, factor = block_means(even_reading(bare.reading), frequency, self.blocks_per_cycle)
        if thin.time.size < 4 * _DECIDED:
            return "the record is too short for a random moment"
        interval = float(thin.time[-1] - thin.time[0]) / (thin.time.size - 1)
        deviations = np.sqrt(np.diag(decay_covariance_of(fit))) * noise_std
        known, forcing, time = None, bare.reading.forcing, bare.reading.time
        if isinstance(forcing, Forced):

            def response(decay: Decay) -> Array:
                """The response to the input, in the means of the blocks."""
                motion = Reading(time, forcing.responses(time, decay)[0])
                return mean_of_blocks(even_reading(motion).yaw, factor)

            known = KnownInput(response, forcing.known)
        found = fit_driven(thin.yaw, interval, fit.decay, deviations, noise_std**2 / factor, known)
        if found is None:
            return "no random moment is found beside the noise of the sensor"
        if found.model.decay.stiffness <= 0.0:
            return "the fit with a random moment has no positive stiffness"
        if not white and not noise.departs:  # coloured noise of the sensor explains the residual too
            residual, _ = block_means(
                even_reading(Reading(time, fit.residual)), frequency, self.blocks_per_cycle
            )
            rival = Autoregression.of(residual.yaw, 1.0 / (frequency * interval))
            if rival is not None and rival.cost(residual.yaw) < found.innovations.cost:
                return "coloured noise of the sensor explains the residual as well as a random moment"
        return found, noise_std
