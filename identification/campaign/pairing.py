"""Each wind-on run against the wind-off runs of its spring: eqs 7, 8, 17 and 18 of the paper.

    N̂β = −{4π²(f² − f₀²) + ln²2 (1/t½² − 1/t½₀²)}         (eq. 7)
    N̂r = −2 ln 2 (1/t½ − 1/t½₀)                            (eq. 8; printed with the first term squared)

With ωn² = 4π²f² + ln²2/t½² and 2ζωn = 2 ln 2/t½ these are the differences of eqs 10 and 11, which the paper uses
with its networks: the same code serves both methods. With N̂β = +Ka/Izz and N̂r = +Ca/Izz (the signs in the text
after eq. 6 are reversed) eqs 17 and 18 give Cnβ and Cnr, averaged over the wind-on runs; Izz is from eq. 1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from identification.campaign.derivatives import has_size, loads, wind_off
from identification.campaign.linked_runs import LinkedRuns
from identification.campaign.run_scatter import ScatterFit
from identification.campaign.springs import inertia_of_springs
from identification.estimate import PARAMETERS, UNITS, Estimate, RunEstimate, Status, by_severity
from identification.policy import LEAST_FOR_SCATTER
from identification.progress import counted
from identification.show.quantity import Quantity
from identification.signal.run_fit import Gained
from identification.statistics import decay_covariance, determined, widened_covariance
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

LN2 = float(np.log(2.0))


@dataclass(frozen=True, eq=False)
class PairedRun:
    """The oscillation of a run.

    Args:
        frequency: damped, Hz.
        frequency_std: standard deviation of the frequency, Hz.
        rate: decay rate σ = ζωn, 1/s.
        rate_std: standard deviation of the rate, 1/s.
    """

    run: Run
    frequency: float
    frequency_std: float
    rate: float
    rate_std: float

    @cached_property
    def gained(self) -> Gained | None:
        """Decay rate and stiffness; a free decay has no gain. None where their deviations are not determined."""
        omega, variances = (
            2.0 * np.pi * self.frequency,
            (self.rate_std**2, (2.0 * np.pi * self.frequency_std) ** 2),
        )
        covariance = decay_covariance(self.rate, omega, *variances)
        values = np.array([self.rate, omega**2 + self.rate**2, 0.0])
        return Gained.of(values, covariance) if determined(covariance) else None


@dataclass(frozen=True, eq=False)
class _Pairing:
    """The runs with a stated spring as arrays, and their pairs.

    Args:
        stiffness: Kr, N m/rad, shape (r,).
        loads: factors of Cnβ and Cnr, shape (r, 2).
    """

    stiffness: Array
    loads: Array
    off: list[int]
    on: list[int]
    partners: list[list[int]]

    @classmethod
    def of(cls, sprung: Sequence[tuple[PairedRun, tuple[float, float]]]) -> _Pairing:
        stiffness = np.array([one.run.spring_stiffness for one, _ in sprung], dtype=np.float64)
        off = [i for i, (one, _) in enumerate(sprung) if not one.run.wind_on]
        partners = {
            i: [j for j in off if np.isclose(stiffness[j], stiffness[i], rtol=1e-9)]
            for i, (one, _) in enumerate(sprung)
            if one.run.wind_on
        }
        on = [i for i, found in partners.items() if found]
        return cls(stiffness, np.array([load for _, load in sprung]), off, on, [partners[i] for i in on])

    def outcome(self, frequency: Array, rate: Array, *, with_line: bool) -> Array:
        # Izz and Cr, then Ka of each paired run, then Ca of each: the propagated quantities.
        off = self.off
        omega = np.hypot(2.0 * np.pi * frequency[off], rate[off])
        inertia = inertia_of_springs(self.stiffness[off], omega**2, with_line=with_line)
        damping = 2.0 * inertia * float(rate[off].mean())
        moments = np.zeros((2, len(self.on)))
        for place, (i, partners) in enumerate(zip(self.on, self.partners, strict=True)):
            half_time = LN2 / rate[i] if rate[i] != 0.0 else np.inf
            rate_off = float(rate[partners].mean())
            half_time_off = LN2 / rate_off if rate_off != 0.0 else np.inf
            frequency_off = float(np.sqrt(np.mean(frequency[partners] ** 2)))
            change = float(frequency[i]) ** 2 - frequency_off**2
            n_beta = -(4.0 * np.pi**2 * change + LN2**2 * (1.0 / half_time**2 - 1.0 / half_time_off**2))
            moments[:, place] = (
                n_beta * inertia,
                -2.0 * LN2 * (1.0 / half_time - 1.0 / half_time_off) * inertia,
            )
        return np.concatenate(([inertia, damping], moments[0], moments[1]))


def _mean_std(values: Array) -> float:
    # Standard deviation of the mean, from the scatter; 0 for too few values, where the propagated one is used.
    if values.size < LEAST_FOR_SCATTER:
        return 0.0
    return float(values.std(ddof=1)) / float(np.sqrt(values.size))


def _moved(outcome: Callable[[Array, Array], Array], centre: Array, scatter: ScatterFit) -> list[Array]:
    """Change of the outcome by one standard deviation of each kind of scatter, by kind, shape (q, runs)."""
    every = []
    values = np.array([seen[:2] for seen in scatter.values])
    for kind in range(len(scatter.names)):
        columns = []
        for place, move in enumerate(scatter.moves):
            rate, stiffness = (values + np.eye(len(values))[:, place, None] * move[:2, kind]).T
            columns.append(outcome(np.sqrt(stiffness - rate**2) / (2.0 * np.pi), rate) - centre)
        every.append(np.array(columns).T)
    return every


def _filled(
    estimate: Estimate,
    pairing: _Pairing,
    paired: Sequence[PairedRun],
    campaign: Campaign,
    scatter: ScatterFit | None,
) -> Estimate:
    """The estimate with its wind-off line, the coefficients and the aerodynamic terms of its runs.

    The deviations of f and σ are propagated one input at a time (Kragten, Analyst 119 (1994) 2161–2165, doi
    10.1039/AN9941902161). The runs' own deviations are propagated too if scatter between runs counts. If it
    does not, the scatter over the wind-on runs or of the springs is used where it is larger.
    """
    rig = campaign.rig
    inertia, count = estimate.wind_off_inertia, len(pairing.on)
    assert inertia is not None
    frequency = np.array([run.frequency for run in paired])
    rate = np.array([run.rate for run in paired])
    outcome = partial(pairing.outcome, with_line=estimate.wind_off_intercept is not None)
    centre = outcome(frequency, rate)
    moved = []
    for run, unit in zip(paired, np.eye(len(paired)), strict=True):
        moved.append(outcome(frequency + unit * run.frequency_std, rate) - centre)
        moved.append(outcome(frequency, rate + unit * run.rate_std) - centre)
    moves = np.array(moved).T
    rows: dict[str, Array] = {
        "yaw_inertia": np.eye(centre.size)[0],
        "mechanical_damping": np.eye(centre.size)[1],
    }
    damping = 2.0 * float(centre[0]) * np.array([paired[i].rate for i in pairing.off])
    spread = {"yaw_inertia": inertia.std, "mechanical_damping": _mean_std(damping)}
    if count and has_size(rig):
        for name, offset, column in (("cn_beta", 2, 0), ("cn_r", 2 + count, 1)):
            per_run = np.zeros((count, centre.size))
            per_run[np.arange(count), offset + np.arange(count)] = 1.0 / pairing.loads[pairing.on, column]
            rows[name] = per_run.mean(axis=0)
            spread[name] = _mean_std(per_run @ centre)
    names = tuple(name for name in PARAMETERS if name in rows)
    jacobian = np.array([rows[name] for name in names])
    propagated, repeatability = moves @ moves.T, None
    if scatter is None:
        least = np.array([spread[name] for name in names])
        covariance = widened_covariance(jacobian @ propagated @ jacobian.T, least)
        own = np.sqrt(np.diag(propagated))
    else:
        between = _moved(outcome, centre, scatter)
        own = np.sqrt(np.diag(scatter.counted(propagated, between)[0]))
        noise = jacobian @ propagated @ jacobian.T
        covariance, added = scatter.counted(noise, [jacobian @ part for part in between])
        repeatability = scatter.described(added)
    stds = np.sqrt(np.diag(covariance))
    quantities: dict[str, Any] = {
        name: Quantity(float(value), float(std), UNITS[name])
        for name, value, std in zip(names, jacobian @ centre, stds, strict=True)
    }
    values, stds = centre.tolist(), own.tolist()
    air: dict[str, dict[str, Any]] = {
        paired[i].run.id: {
            "aerodynamic_stiffness": Quantity(values[2 + k], stds[2 + k], "N m/rad"),
            "aerodynamic_damping": Quantity(values[2 + count + k], stds[2 + count + k], "N m s/rad"),
        }
        for k, i in enumerate(pairing.on)
    }
    return replace(
        estimate,
        runs=tuple(replace(run, **air.get(run.id, {})) for run in estimate.runs),
        parameters=names,
        covariance=tuple(map(tuple, covariance.tolist())),
        repeatability=repeatability,
        **quantities,
    )


class Paired(ABC):
    """An estimator that identifies each run by itself and then pairs wind-on with wind-off runs of a spring."""

    name: ClassVar[str]

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign by pairs of wind-on and wind-off runs of a spring.

        Wind-on runs without a wind-off run of their spring, and runs without a stated spring, are left out.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        pairs = [loads(run, campaign.rig) for run in campaign.runs]
        outcomes = [self._run(run, campaign.sensor) for run in counted(campaign.runs)]
        estimate = Estimate(campaign.name, self.name, tuple(identified for identified, _ in outcomes))
        known = [
            (paired, load) for (_, paired), load in zip(outcomes, pairs, strict=True) if paired is not None
        ]
        if not known:
            return replace(estimate, statuses=(Status.NO_RUN_IDENTIFIED,))
        of_runs = {status for run in estimate.runs for status in run.statuses}
        statuses = of_runs & {Status.MODEL_DEPARTS, Status.NOISE_DISAGREES}
        if len(known) < len(outcomes):
            statuses.add(Status.RUN_LEFT_OUT)
        if any(run.spring_stiffness is None for run in campaign.runs):
            statuses.add(Status.NO_STIFFNESS)
        sprung = [(paired, load) for paired, load in known if paired.run.spring_stiffness is not None]
        if not sprung:
            return replace(estimate, statuses=by_severity(statuses))
        pairing = _Pairing.of(sprung)
        windy = sum(paired.run.wind_on for paired, _ in sprung)
        if windy == 0:
            statuses.add(Status.NO_WIND_ON)
        if len(pairing.on) < windy:
            statuses.add(Status.NO_WIND_OFF_PAIR)
        if windy and not has_size(campaign.rig):
            statuses.add(Status.NO_REFERENCE_SIZE)
        paired_runs = [paired for paired, _ in sprung]
        scatter = None  # computed in the same way for every method
        if pairing.off and all(paired.gained is not None for paired in paired_runs):
            scatter = LinkedRuns.of(
                campaign, [None if paired is None else paired.gained for _, paired in outcomes]
            ).scatter
        between = None if scatter is None else scatter.described()
        line = wind_off(estimate.runs, campaign.runs, between)
        if pairing.off and line["wind_off_inertia"] is None:
            statuses.add(Status.INERTIA_NOT_POSITIVE)
        estimate = replace(estimate, statuses=by_severity(statuses))
        if not pairing.off or line["wind_off_inertia"] is None:
            return estimate
        return _filled(replace(estimate, **line), pairing, paired_runs, campaign, scatter)

    @abstractmethod
    def _run(self, run: Run, sensor: SensorProperties) -> tuple[RunEstimate, PairedRun | None]:
        """Identify one run."""
