"""Neural posterior: rival models of every record and of the campaign, weighed by a trained network.

A record is reduced to windows of envelope and phase, in which the nominal model and each of many rivals is a linear
fit (`identification.neural.posterior`). A network trained on simulated campaigns with effects in many forms gives
every rival a weight and a width. Values are medians of the mixture that follows, with its 95 % intervals, and the
standard deviation is the interval's width over 3.92. What is unlike anything trained on is refused.

ζ and ωn are those at small amplitude, Cnβ, Cnr, Izz and Cr the linear coefficients, whatever else acts. Torch is
not needed.
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
    build_design,
    combine,
    design_statuses,
    filled_estimate,
    loads,
    noise_statuses,
    statuses_of_runs,
)
from identification.estimate import Estimate, NoiseLevel, Quantity, RunEstimate, Status, by_severity
from identification.neural.demodulated import Demodulated, demodulate
from identification.neural.posterior import (
    Posterior,
    TrainedPosterior,
    posteriors,
    read_trained,
    shipped_posteriors,
)
from identification.neural.rivals import (
    CAMPAIGN_NAMES,
    Features,
    Rivals,
    campaign_features,
    record_features,
)
from identification.policy import MISFIT_DEVIATIONS, MISFIT_RATE, NOISE_TOLERANCE
from identification.statistics import inverse
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class _DemodulatedRun:
    """A run that was identified."""

    run: Run
    windows: Demodulated
    alone: Rivals
    posterior: Posterior


@dataclass(frozen=True)
class NeuralPosterior:
    """Posterior medians and intervals by a trained network.

    Args:
        weights: a safetensors file written by ``tunnel train --estimator neural_posterior``; the packaged weights
            where None.
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
        """Identify every run, then the campaign.

        Args:
            campaign: at least one run.

        Returns:
            The estimate. A run that could not be identified, or that is unlike anything trained on, is left out.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)
        found = _runs(campaign.runs, self.networks["record"])
        runs = tuple(
            _described(one, campaign.sensor)
            if isinstance(one, _DemodulatedRun)
            else RunEstimate(run.id, (one,))
            for run, one in zip(campaign.runs, found, strict=True)
        )
        estimate = Estimate(campaign.name, self.name, runs)
        statuses = statuses_of_runs(campaign, runs) | noise_statuses([run.noise for run in runs])
        linked = [
            one for one in found if isinstance(one, _DemodulatedRun) and one.run.spring_stiffness is not None
        ]
        if not linked or Status.NO_RUN_IDENTIFIED in statuses:
            return replace(estimate, statuses=by_severity(statuses))
        return _of_campaign(campaign, estimate, linked, statuses, self.networks["campaign"])

    def effects(self, campaign: Campaign) -> dict[str, float]:
        """Probability of every effect of the vocabulary in a campaign, by name.

        They come from simulated campaigns in which any effect is as likely as another. They can order what a
        diagnosis tries; they are not its answer.

        Returns:
            The probabilities; none where the campaign has no coefficients.
        """
        found = _runs(campaign.runs, self.networks["record"])
        linked = [
            one for one in found if isinstance(one, _DemodulatedRun) and one.run.spring_stiffness is not None
        ]
        features = _campaign_features(campaign, linked) if linked else None
        return {} if features is None else posteriors([features], self.networks["campaign"])[0].effects


def _runs(runs: Sequence[Run], network: TrainedPosterior) -> list[_DemodulatedRun | Status]:
    windows = [demodulate(run.record) for run in runs]
    places = [place for place, one in enumerate(windows) if isinstance(one, Demodulated)]
    shown = [one for one in windows if isinstance(one, Demodulated)]
    features = record_features(shown) if shown else []
    pairs = [(place, one) for place, one in zip(places, features, strict=True) if one is not None]
    found: list[_DemodulatedRun | Status] = [
        one if isinstance(one, Status) else Status.NOT_DETERMINED for one in windows
    ]
    for (place, (_, alone)), posterior in zip(
        pairs, posteriors([one for _, (one, _) in pairs], network), strict=True
    ):
        seen = windows[place]
        assert isinstance(seen, Demodulated)
        found[place] = (
            Status.UNLIKE_TRAINING
            if posterior.unlike
            else _DemodulatedRun(runs[place], seen, alone, posterior)
        )
    return found


def _described(seen: _DemodulatedRun, sensor: SensorProperties) -> RunEstimate:
    noise = _noise(seen, sensor)
    zeta, omega_n = (seen.posterior.quantity(place, unit) for place, unit in enumerate(("1", "rad/s")))
    weight = seen.windows.samples
    zero = float(weight @ seen.windows.zero / weight.sum())
    statuses = noise_statuses([noise])
    if seen.run.spring_stiffness is None:
        statuses.add(Status.NO_STIFFNESS)
    return RunEstimate(
        seen.run.id,
        by_severity(statuses),
        omega_n=omega_n,
        zeta=zeta,
        sensor_zero=Quantity(zero, seen.windows.noise / float(np.sqrt(weight.sum())), "rad"),
        noise=noise,
    )


def _noise(seen: _DemodulatedRun, sensor: SensorProperties) -> NoiseLevel:
    """The noise within the windows; the χ² of envelope and phase and the largest harmonic judge the model."""
    total, freedom = float(seen.alone.remaining[0]), seen.alone.freedom
    std = seen.windows.noise * float(np.sqrt(seen.windows.block))
    harmonics = np.concatenate((seen.windows.second, seen.windows.third))
    distorted = float(np.max(np.tile(seen.windows.information, 2) * np.abs(harmonics) ** 2))
    limit = 0.5 * MISFIT_RATE
    departs = total > chdtri(freedom, limit) or distorted > chdtri(2, limit / harmonics.size)
    disagrees = False
    if sensor.noise_std is not None:
        stated = float(np.hypot(sensor.noise_std, (sensor.resolution or 0.0) / np.sqrt(12.0)))
        tolerance = MISFIT_DEVIATIONS * float(
            np.hypot(NOISE_TOLERANCE, 1.0 / np.sqrt(2.0 * seen.windows.samples.sum()))
        )
        disagrees = stated > 0.0 and abs(std / stated - 1.0) > tolerance
    slow = max(total / freedom, 1.0) if departs else 1.0
    return NoiseLevel(std, "residual", std, slow, bool(departs), disagrees)


def _campaign_features(campaign: Campaign, linked: Sequence[_DemodulatedRun]) -> Features | None:
    runs = [one.run for one in linked]
    design = build_design(runs, campaign.rig)
    return campaign_features(runs, [one.windows for one in linked], design, [one.alone for one in linked])


def _of_campaign(
    campaign: Campaign,
    estimate: Estimate,
    linked: Sequence[_DemodulatedRun],
    statuses: set[Status],
    network: TrainedPosterior,
) -> Estimate:
    runs = [one.run for one in linked]
    design = build_design(runs, campaign.rig)
    combined = combine(design, *_decays(linked))
    if combined is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    statuses = statuses | design_statuses(design, combined[0])
    features = _campaign_features(campaign, linked)
    if features is None:
        nothing = Derivatives((), np.zeros(0), np.zeros((0, 0)))
        return filled_estimate(campaign, estimate, runs, design, nothing, np.zeros((0, 0)), statuses)
    posterior = posteriors([features], network)[0]
    if posterior.unlike:
        return replace(estimate, statuses=by_severity(statuses | {Status.UNLIKE_TRAINING}))
    known = np.flatnonzero(features.known)
    names = tuple(CAMPAIGN_NAMES[place] for place in known)
    values = Derivatives(names, posterior.values[known], np.eye(known.size))
    covariance = posterior.covariance[np.ix_(known, known)]
    result = filled_estimate(campaign, estimate, runs, design, values, covariance, statuses)
    intervals = {
        name: replace(quantity, interval=posterior.quantity(int(place), "").interval)
        for name, place in zip(names, known, strict=True)
        if (quantity := getattr(result, name)) is not None
    }
    return replace(result, **intervals)


def _decays(linked: Sequence[_DemodulatedRun]) -> tuple[Array, list[Array]]:
    """The runs' (a, k) by their nominal fits, and the information on them."""
    decays, informations = [], []
    for one in linked:
        rate, omega = np.array([one.windows.rate, one.windows.omega]) + one.alone.parameters
        decays.append([rate, omega**2 + rate**2])
        slopes = np.array([[1.0, 0.0], [2.0 * rate, 2.0 * omega]])
        informations.append(inverse(slopes @ one.alone.covariances[0] @ slopes.T))
    return np.array(decays), informations
