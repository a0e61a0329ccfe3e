"""Bayesian: the posterior of each run's decay, and of the campaign's coefficients under all of them.

The initial state, the zero and the noise level are integrated out in closed form and damping and frequency
are summed over a grid (see `identification.decay.posterior`). So the logarithm of the likelihood need not be a
parabola, which it is not in records of one to three cycles or of few samples. Values are posterior means, with the
posterior's standard deviations, and ωn and ζ carry their 95 % intervals. The campaign's coefficients are drawn from
the product of the runs' likelihoods. Sources: Bretthorst, Bayesian Spectrum Analysis and Parameter Estimation
(1988), doi 10.1007/978-1-4684-9399-3; Jeffreys, Proc. R. Soc. A 186 (1946) 453–461,
doi 10.1098/rspa.1946.0056.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.campaign.assembly import Combination, RunDecay
from identification.campaign.derivatives import Design
from identification.decay.damped_oscillation import Decay
from identification.decay.decay_fit import Reading, fit_run, project_run
from identification.decay.first_guess import starting_decay
from identification.decay.importance import shared_moments
from identification.decay.posterior import NoiseKnowledge, Posterior, posterior_of
from identification.decay.run_fit import decay_covariance_of, describe_run, judge
from identification.decay.thinning import block_means
from identification.estimate import NoiseLevel, Quantity, Status
from identification.estimators.run_by_run import Found, RunByRun
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

_LINEAR = 3  # initial angle and rate, zero


@dataclass(frozen=True, eq=False)
class _PosteriorDecay(RunDecay):
    posterior: Posterior = field(kw_only=True)


@dataclass(frozen=True)
class Bayesian(RunByRun):
    """Posterior means, deviations and intervals.

    Args:
        blocks_per_cycle: block means per period that the posterior is computed from, at least.
        seed: of the draws that combine the runs.
    """

    name = "bayesian"
    blocks_per_cycle: int = 20
    seed: int = 0

    def _together(self, found: Sequence[RunDecay]) -> Combination:
        def together(
            design: Design, places: list[int], centre: Array, covariance: Array
        ) -> tuple[Array, Array]:
            posteriors = [one.posterior for i in places if isinstance(one := found[i], _PosteriorDecay)]
            rng = np.random.default_rng(self.seed)
            return shared_moments(posteriors, design.links, centre, covariance, rng)

        return together

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        start = starting_decay(run.record)
        if start is None:
            return Status.NO_OSCILLATION
        reading = Reading.from_record(run.record)
        fit = fit_run(reading, start)
        if not fit.runs or fit.runs[0].decay.stiffness <= 0.0:
            return Status.NOT_CONVERGED
        noise, failure = judge(reading, fit.runs[0], fit.zero, sensor)
        if failure is not None:
            return failure
        variance = noise.std**2 * noise.slow_ratio
        guess = decay_covariance_of(fit.runs[0]) * variance
        found = self._posterior(reading, fit.runs[0].decay, fit.runs[0].residual, guess, noise)
        if found is None:
            return Status.NOT_CONVERGED
        mean, covariance = found.moments()
        projected = project_run(reading, Decay(float(mean[0]), float(mean[1])))
        if projected is None:
            return Status.NOT_CONVERGED
        described = describe_run(run, reading, *projected, covariance, variance, noise=noise)
        omega_n, zeta = found.modal()
        estimate = replace(
            described,
            omega_n=Quantity(omega_n[0], omega_n[1], "rad/s", omega_n[2:]),
            zeta=Quantity(zeta[0], zeta[1], "1", zeta[2:]),
        )
        return _PosteriorDecay(estimate, projected[0].decay, covariance, posterior=found)

    def _posterior(
        self, reading: Reading, decay: Decay, residual: Array, guess: Array, noise: NoiseLevel
    ) -> Posterior | None:
        frequency = decay.omega_n / (2.0 * np.pi)
        thin, factor = block_means(reading, frequency, self.blocks_per_cycle)
        means, _ = block_means(Reading(reading.time, residual), frequency, self.blocks_per_cycle)
        known = noise.std**2 * noise.slow_ratio if noise.source == "stated" or noise.departs else None
        within = float(residual @ residual) - factor * float(means.yaw @ means.yaw)
        knowledge = NoiseKnowledge(known, factor, max(within, 0.0), reading.time.size - _LINEAR)
        return posterior_of(thin, decay, guess, knowledge)
