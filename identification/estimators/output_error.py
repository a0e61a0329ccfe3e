"""Output error: maximum likelihood of the free decay, run by run and jointly over the campaign.

The measurement is the model's output plus white Gaussian noise. Every run is fitted by itself (ωn, ζ, initial
state, zero); those fits start the joint one, in which Izz, Cr, Cnβ, Cnr and the sensor's zero are common and
the initial state is each run's own. Nothing nominal is needed, only the spring stiffnesses. Sources: the
equation of motion (2)–(6) of the paper; Jategaonkar, Flight Vehicle System Identification, 2nd ed. (2015),
ch. 4, doi 10.2514/4.102790.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from identification.decay_fit import DecayFit, fit_decays
from identification.derivatives import (
    Derivatives,
    Design,
    build_design,
    combine,
    derivatives,
    loads,
)
from identification.estimate import UNITS, Estimate, NoiseLevel, Quantity, RunEstimate, Status, by_gravity
from identification.information import eliminate
from identification.noise import noise_level
from identification.run_fit import FittedRun, identify_run, residuals_of
from identification.springs import wind_off_line
from identification.uncertainty import fisher_covariance, jackknife_std, widened_covariance
from tunnel_sim.campaign import Campaign, Run
from tunnel_sim.record import Array

_JOINT_UNKNOWNS = 2  # of a run's own in the joint fit: its initial angle and rate


@dataclass(frozen=True)
class OutputError:
    """Maximum likelihood with white measurement noise and no process noise.

    Args:
        cycles_per_window: periods in each window of a run; where None three, or one in a record of fewer than
            twelve cycles.
    """

    name: ClassVar[str] = "output_error"
    cycles_per_window: int | None = None

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign.

        Args:
            campaign: at least one run.

        Returns:
            The estimate. A run that could not be identified is left out; a run without spring stiffness
            counts for itself only.

        Raises:
            TunnelError: when a wind-on run states no air density.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)  # refuses a wind-on run without density before any work is done
        fitted = [
            identify_run(run, campaign.sensor, cycles_per_window=self.cycles_per_window)
            for run in campaign.runs
        ]
        estimate = Estimate(campaign.name, self.name, tuple(item.estimate for item in fitted))
        statuses = _statuses_of_runs(campaign, fitted)
        if Status.NO_RUN_IDENTIFIED in statuses:
            return replace(estimate, statuses=by_gravity(statuses))
        pairs = [
            (run, item)
            for run, item in zip(campaign.runs, fitted, strict=True)
            if item.fit is not None and run.spring_stiffness is not None
        ]
        if not pairs:
            return replace(estimate, statuses=by_gravity(statuses | _departures([i.noise for i in fitted])))
        return _joint_estimate(campaign, estimate, pairs, statuses)


def _statuses_of_runs(campaign: Campaign, fitted: Sequence[FittedRun]) -> set[Status]:
    identified = [item.fit is not None for item in fitted]
    if not any(identified):
        return {Status.NO_RUN_IDENTIFIED}
    statuses = set()
    if not all(identified):
        statuses.add(Status.RUN_LEFT_OUT)
    if any(run.spring_stiffness is None for run in campaign.runs):
        statuses.add(Status.NO_STIFFNESS)
    if any(Status.FEW_CYCLES in item.estimate.statuses for item in fitted):
        statuses.add(Status.FEW_CYCLES)
    return statuses


def _departures(levels: Sequence[NoiseLevel | None]) -> set[Status]:
    known = [level for level in levels if level is not None]
    statuses = set()
    if any(level.departs for level in known):
        statuses.add(Status.MODEL_DEPARTS)
    if any(level.disagrees for level in known):
        statuses.add(Status.NOISE_DISAGREES)
    return statuses


def _joint_estimate(
    campaign: Campaign, estimate: Estimate, pairs: Sequence[tuple[Run, FittedRun]], statuses: set[Status]
) -> Estimate:
    runs = [run for run, _ in pairs]
    design = build_design(runs, campaign.rig)
    fit = _joint_fit(design, [item for _, item in pairs])
    if not fit.converged:
        return replace(estimate, statuses=by_gravity(statuses | {Status.NOT_CONVERGED}))
    readings = [item.reading for _, item in pairs]
    noise = noise_level(residuals_of(readings, fit.runs, fit.zero, _JOINT_UNKNOWNS), campaign.sensor)
    covariance = fisher_covariance(fit.normal, noise)
    found = derivatives(design, fit.parameters)
    own = found.jacobian @ covariance[:-1, :-1] @ found.jacobian.T
    if noise.departs and found.names:
        own = widened_covariance(own, jackknife_std(fit.runs, design.links, found.jacobian))
    statuses = statuses | _departures([noise]) | _limits(design)
    air = _air_of_runs(design, found, own, runs)
    line = _wind_off(estimate.runs, campaign.runs)
    return replace(
        estimate,
        statuses=by_gravity(statuses),
        runs=tuple(replace(run, **air.get(run.id, {})) for run in estimate.runs),
        sensor_zero=Quantity(fit.zero, float(np.sqrt(covariance[-1, -1])), "rad"),
        noise=noise,
        **line,
        **_quantities(found, own, design.has_size),
    )


def _joint_fit(design: Design, items: Sequence[FittedRun]) -> DecayFit:
    # The runs' own (a, k), weighed by what each knows of them, are within a few deviations of the optimum.
    own = [item.fit for item in items if item.fit is not None]
    decays = np.array([[fit.decay.rate, fit.decay.stiffness] for fit in own])
    informations = [eliminate(fit.information, fit.score, 2)[0] for fit in own]
    start, _ = combine(design, decays, informations)
    return fit_decays([item.reading for item in items], design.links, start)


def _limits(design: Design) -> set[Status]:
    statuses = set()
    if not np.any(design.stiffness_loads > 0.0):
        statuses.add(Status.NO_WIND_ON)
    elif not design.has_size:
        statuses.add(Status.NO_REFERENCE_SIZE)
    if "g" not in design.columns:
        statuses.add(Status.STIFFNESS_NOT_SEPARABLE)
    if "d" not in design.columns:
        statuses.add(Status.DAMPING_NOT_SEPARABLE)
    return statuses


def _quantities(found: Derivatives, covariance: Array, has_size: bool) -> dict[str, Any]:
    # Without the rig's size the coefficients still multiply A·l and A·l²: Ka and Ca per run say as much.
    kept = [i for i, name in enumerate(found.names) if has_size or name not in ("cn_beta", "cn_r")]
    quantities: dict[str, Any] = {
        found.names[i]: Quantity(
            float(found.values[i]), float(np.sqrt(covariance[i, i])), UNITS[found.names[i]]
        )
        for i in kept
    }
    quantities["parameters"] = tuple(found.names[i] for i in kept)
    quantities["covariance"] = tuple(tuple(float(covariance[i, j]) for j in kept) for i in kept)
    return quantities


def _air_of_runs(
    design: Design, found: Derivatives, covariance: Array, runs: Sequence[Run]
) -> dict[str, dict[str, Any]]:
    air: dict[str, dict[str, Any]] = {}
    for name, target, load, unit in (
        ("cn_beta", "aerodynamic_stiffness", design.stiffness_loads, "N m/rad"),
        ("cn_r", "aerodynamic_damping", design.damping_loads, "N m s/rad"),
    ):
        value = found.get(name)
        if value is None:
            continue
        place = found.names.index(name)
        std = float(np.sqrt(covariance[place, place]))
        for run, factor in zip(runs, load, strict=True):
            if run.wind_on:
                quantity = Quantity(float(factor) * value, float(factor) * std, unit)
                air.setdefault(run.id, {})[target] = quantity
    return air


def _wind_off(estimates: Sequence[RunEstimate], runs: Sequence[Run]) -> dict[str, Any]:
    rows = [
        (run.spring_stiffness, found.omega_n)
        for run, found in zip(runs, estimates, strict=True)
        if not run.wind_on and run.spring_stiffness is not None and found.omega_n is not None
    ]
    if not rows:
        return {}
    stiffness = np.array([spring for spring, _ in rows])
    inertia, intercept = wind_off_line(
        stiffness, np.array([omega.value for _, omega in rows]), np.array([omega.std for _, omega in rows])
    )
    return {"wind_off_inertia": inertia, "wind_off_intercept": intercept}
