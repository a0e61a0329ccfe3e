"""Neural posterior: rival models of every record and of the campaign, weighed by a trained network.

In windows of envelope and phase, the nominal model and each of many rivals is a linear fit
(`identification.neural.rivals`). Values are medians of the mixture with the network's weights, with its 95 %
intervals; the standard deviation is the interval's width over 3.92. ζ and ωn are values at small amplitude, and
Cnβ, Cnr, Izz and Cr the linear coefficients, whatever effects act. The estimator refuses records unlike its
training, and campaigns that state a scatter between runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.special import chdtri

from identification.campaign.derivatives import (
    Derivatives,
    derivatives,
    design_statuses,
    filled_estimate,
    loads,
    noise_statuses,
    statuses_of_runs,
)
from identification.campaign.linked_runs import LinkedRuns
from identification.estimate import Estimate, NoiseLevel, RunEstimate, Status, by_severity
from identification.neural.demodulated import Demodulated, demodulate
from identification.neural.posterior import (
    Posterior,
    TrainedPosterior,
    posteriors,
    read_trained,
    shipped_posteriors,
)
from identification.neural.rivals import CAMPAIGN_NAMES, Rivals, campaign_features, record_features
from identification.policy import MISFIT_DEVIATIONS, MISFIT_RATE, NOISE_TOLERANCE
from identification.show.quantity import Quantity
from identification.signal.free_decay import Decay
from identification.signal.noise import stated_noise
from identification.signal.run_fit import Gained, residual_check
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties


@dataclass(frozen=True, eq=False)
class _DemodulatedRun:
    """A run that was identified."""

    run: Run
    windows: Demodulated
    alone: Rivals
    posterior: Posterior

    @property
    def rate_and_omega(self) -> tuple[float, float]:
        """Decay rate, 1/s, and damped angular frequency, rad/s, of the nominal fit."""
        rate, omega = np.array([self.windows.rate, self.windows.omega]) + self.alone.parameters
        return float(rate), float(omega)

    @property
    def departs(self) -> bool:
        """Whether envelope and phase depart from the nominal fit by more than the noise within the windows."""
        freedom = self.alone.freedom
        return bool(self.alone.remaining[0] > chdtri(freedom, 0.5 * MISFIT_RATE))

    @property
    def slow(self) -> float:
        """Variance of envelope and phase, over the variance due to noise within the windows; 1 where they agree."""
        return max(float(self.alone.remaining[0]) / self.alone.freedom, 1.0) if self.departs else 1.0

    @property
    def gained(self) -> Gained:
        """Decay rate and stiffness of the nominal fit; a free decay has no gain."""
        rate, omega = self.rate_and_omega
        slopes = np.array([[1.0, 0.0], [2.0 * rate, 2.0 * omega]])
        covariance = self.slow * (slopes @ self.alone.covariances[0] @ slopes.T)
        return Gained.of(np.array([rate, omega**2 + rate**2, 0.0]), covariance)


@dataclass(frozen=True)
class NeuralPosterior:
    """Posterior medians and intervals by a trained network.

    Args:
        weights: a safetensors file written by ``tunnel train --estimator neural_posterior``; None: the packaged
            weights.
    """

    name = "neural_posterior"
    weights: Path | None = None

    @cached_property
    def networks(self) -> dict[str, TrainedPosterior]:
        """The networks of a record and of a campaign.

        Raises:
            TunnelError: when the weights cannot be read.
        """
        return shipped_posteriors() if self.weights is None else read_trained(self.weights)

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign; runs without a result, or unlike the training, are left out.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)
        outcomes = _runs(campaign.runs, self.networks["record"])
        runs = tuple(
            RunEstimate(run.id, (outcome,))
            if isinstance(outcome, Status)
            else _described(outcome, campaign.sensor)
            for run, outcome in zip(campaign.runs, outcomes, strict=True)
        )
        estimate = Estimate(campaign.name, self.name, runs)
        statuses = statuses_of_runs(campaign, runs) | noise_statuses([run.noise for run in runs])
        linked = LinkedRuns.of(
            campaign, [None if isinstance(outcome, Status) else outcome.gained for outcome in outcomes]
        )
        if not linked.runs:
            return replace(estimate, statuses=by_severity(statuses))
        known_runs, design = linked.runs, linked.design
        if linked.least_squares is None:
            return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
        statuses = statuses | design_statuses(design, linked.least_squares[0])
        shown = [outcome for place in linked.places if not isinstance(outcome := outcomes[place], Status)]
        features = campaign_features(
            known_runs, [outcome.windows for outcome in shown], design, [outcome.alone for outcome in shown]
        )
        if features is None:
            nothing = Derivatives((), np.zeros(0), np.zeros((0, 0)))
            return filled_estimate(
                campaign, estimate, known_runs, design, nothing, np.zeros((0, 0)), statuses
            )
        posterior = posteriors([features], self.networks["campaign"])[0]
        # the runs of the training differ by noise and effects alone
        if posterior.unlike or (campaign.repeatability is not None and campaign.repeatability.stated):
            return replace(estimate, statuses=by_severity(statuses | {Status.UNLIKE_TRAINING}))
        known = np.flatnonzero(features.known)
        names = tuple(CAMPAIGN_NAMES[place] for place in known)
        values = Derivatives(names, posterior.values[known], np.eye(known.size))
        covariance, repeatability = posterior.covariance[np.ix_(known, known)], None
        scatter = linked.scatter
        linear = derivatives(design, linked.least_squares[0] if scatter is None else scatter.parameters)
        if scatter is not None and set(names) <= set(linear.names):
            # the network knows only the noise; the scatter is added, as in a linear combination of the runs
            rows = linear.jacobian[[linear.names.index(name) for name in names]]
            covariance, added = scatter.counted(covariance, scatter.moved(rows))
            repeatability = scatter.described(added)
        result = filled_estimate(
            campaign, estimate, known_runs, design, values, covariance, statuses, repeatability
        )
        intervals = {}
        for name, place in zip(names, known, strict=True):
            quantity, own = getattr(result, name), posterior.quantity(int(place), "")
            if quantity is None or own.interval is None:
                continue
            wider = quantity.std / own.std  # 1 where scatter does not count
            ends = [own.value + wider * (end - own.value) for end in own.interval]
            intervals[name] = replace(quantity, interval=(ends[0], ends[1]))
        return replace(result, **intervals)


def _runs(runs: Sequence[Run], network: TrainedPosterior) -> list[_DemodulatedRun | Status]:
    windows = [demodulate(run.record) for run in runs]
    shown = [window for window in windows if isinstance(window, Demodulated)]
    features = iter(record_features(shown) if shown else [])
    pairs = [None if isinstance(window, Status) else next(features) for window in windows]
    weighed = iter(posteriors([pair[0] for pair in pairs if pair is not None], network))
    outcomes: list[_DemodulatedRun | Status] = []
    for run, window, pair in zip(runs, windows, pairs, strict=True):
        if isinstance(window, Status):
            outcomes.append(window)
        elif pair is None:
            outcomes.append(Status.NOT_DETERMINED)
        else:
            posterior = next(weighed)
            demodulated = _DemodulatedRun(run, window, pair[1], posterior)
            outcomes.append(Status.UNLIKE_TRAINING if posterior.unlike else demodulated)
    return outcomes


def _described(demodulated: _DemodulatedRun, sensor: SensorProperties) -> RunEstimate:
    # The noise within the windows; the χ² of envelope and phase and the largest harmonic judge the model.
    std = demodulated.windows.noise * float(np.sqrt(demodulated.windows.block))
    rate, omega = demodulated.rate_and_omega
    harmonics = np.concatenate((demodulated.windows.second, demodulated.windows.third))
    distorted = float(np.max(np.tile(demodulated.windows.information, 2) * np.abs(harmonics) ** 2))
    departs = demodulated.departs or bool(distorted > chdtri(2, 0.5 * MISFIT_RATE / harmonics.size))
    stated = stated_noise(sensor)
    disagrees = False
    if stated is not None:
        own = 1.0 / np.sqrt(2.0 * demodulated.windows.samples.sum())
        tolerance = MISFIT_DEVIATIONS * float(np.hypot(NOISE_TOLERANCE, own))
        disagrees = stated > 0.0 and abs(std / stated - 1.0) > tolerance
    noise = NoiseLevel(std, "residual", std, demodulated.slow, departs, disagrees)
    if departs:  # coloured noise is not a departure
        check = residual_check(demodulated.run, Decay(rate, omega**2 + rate**2), sensor)
        noise = noise if check is None or check.colour is None else check.noise
    zeta, omega_n = (demodulated.posterior.quantity(place, unit) for place, unit in enumerate(("1", "rad/s")))
    weight = demodulated.windows.samples
    zero = float(weight @ demodulated.windows.zero / weight.sum())
    statuses = noise_statuses([noise])
    if demodulated.run.spring_stiffness is None:
        statuses.add(Status.NO_STIFFNESS)
    return RunEstimate(
        demodulated.run.id,
        by_severity(statuses),
        omega_n=omega_n,
        zeta=zeta,
        sensor_zero=Quantity(zero, demodulated.windows.noise / float(np.sqrt(weight.sum())), "rad"),
        noise=noise,
    )
