"""Each wind-on run against the wind-off runs of its spring: eqs 7, 8, 17 and 18 of the paper.

    N̂β = −{4π²(f² − f₀²) + ln²2 (1/t½² − 1/t½₀²)}         (eq. 7)
    N̂r = −2 ln 2 (1/t½ − 1/t½₀)                            (eq. 8; printed with the first term squared)

With ωn² = 4π²f² + ln²2/t½² and 2ζωn = 2 ln 2/t½ these are the differences of eqs 10 and 11, which the paper uses
with its networks: the same code serves both methods. With N̂β = +Ka/Izz and N̂r = +Ca/Izz (the text after eq. 6
has the signs reversed) eqs 17 and 18 give Cnβ and Cnr, averaged over the wind-on runs. Izz is the gradient of Kr
against ωn² of the wind-off runs (eq. 1).

Standard deviations of f and σ are propagated numerically, one input at a time (Kragten, Analyst 119 (1994)
2161–2165, doi 10.1039/AN9941902161). Where the scatter over the wind-on runs, or of the springs about their line,
is larger, it is used instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from identification.campaign.derivatives import has_size, wind_off
from identification.campaign.springs import inertia_of_springs
from identification.estimate import PARAMETERS, UNITS, Estimate, Quantity, Status, by_severity
from identification.policy import LEAST_FOR_SCATTER
from identification.statistics import widened_covariance
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

LN2 = float(np.log(2.0))


@dataclass(frozen=True, eq=False)
class PairedRun:
    """The oscillation of a run.

    Args:
        run: the run, with its conditions.
        frequency: damped, Hz.
        frequency_std: its standard deviation, Hz.
        rate: decay rate σ = ζωn, 1/s.
        rate_std: its standard deviation, 1/s.
        omega_n: natural angular frequency, rad/s.
    """

    run: Run
    frequency: float
    frequency_std: float
    rate: float
    rate_std: float
    omega_n: Quantity


@dataclass(frozen=True, eq=False)
class _Pairing:
    """The runs with a stated spring as arrays, and their pairs.

    Args:
        stiffness: Kr, N m/rad, shape (r,).
        loads: factors of Cnβ and Cnr, shape (r, 2).
        off: places of the wind-off runs.
        on: places of the wind-on runs that have a wind-off run of their spring.
        partners: per place in ``on``, the places of those wind-off runs.
    """

    stiffness: Array
    loads: Array
    off: list[int]
    on: list[int]
    partners: list[list[int]]


def _pair(sprung: Sequence[tuple[PairedRun, tuple[float, float]]]) -> _Pairing:
    stiffness = np.array([one.run.spring_stiffness for one, _ in sprung], dtype=np.float64)
    off = [i for i, (one, _) in enumerate(sprung) if not one.run.wind_on]
    partners = {
        i: [j for j in off if np.isclose(stiffness[j], stiffness[i], rtol=1e-9)]
        for i, (one, _) in enumerate(sprung)
        if one.run.wind_on
    }
    on = [i for i, found in partners.items() if found]
    return _Pairing(stiffness, np.array([load for _, load in sprung]), off, on, [partners[i] for i in on])


def normalised_derivatives(
    frequency: float, half_time: float, frequency_off: float, half_time_off: float
) -> tuple[float, float]:
    """Eqs 7 and 8, corrected: the air's stiffness and damping over the inertia.

    Args:
        frequency: wind-on, Hz.
        half_time: wind-on time to half amplitude, s; infinite where nothing decays, negative where it grows.
        frequency_off: wind-off, Hz.
        half_time_off: wind-off, s.

    Returns:
        N̂β = Ka/Izz in 1/s² and N̂r = Ca/Izz in 1/s.
    """
    change = frequency**2 - frequency_off**2
    n_beta = -(4.0 * np.pi**2 * change + LN2**2 * (1.0 / half_time**2 - 1.0 / half_time_off**2))
    return n_beta, -2.0 * LN2 * (1.0 / half_time - 1.0 / half_time_off)


def _outcome(pairing: _Pairing, frequency: Array, rate: Array, *, with_line: bool) -> Array:
    # Izz and Cr, then Ka of each paired run, then Ca of each: the quantities that are propagated.
    off = pairing.off
    omega = np.hypot(2.0 * np.pi * frequency[off], rate[off])
    inertia = inertia_of_springs(pairing.stiffness[off], omega**2, with_line=with_line)
    damping = 2.0 * inertia * float(rate[off].mean())
    moments = np.zeros((2, len(pairing.on)))
    for place, (i, partners) in enumerate(zip(pairing.on, pairing.partners, strict=True)):
        half_time = LN2 / rate[i] if rate[i] != 0.0 else np.inf
        rate_off = float(rate[partners].mean())
        half_time_off = LN2 / rate_off if rate_off != 0.0 else np.inf
        frequency_off = float(np.sqrt(np.mean(frequency[partners] ** 2)))
        n_beta, n_r = normalised_derivatives(float(frequency[i]), half_time, frequency_off, half_time_off)
        moments[:, place] = n_beta * inertia, n_r * inertia
    return np.concatenate(([inertia, damping], moments[0], moments[1]))


def paired_estimate(
    campaign: Campaign,
    estimate: Estimate,
    known: Sequence[tuple[PairedRun, tuple[float, float]]],
    statuses: set[Status],
) -> Estimate:
    """The campaign's coefficients from its runs, each wind-on run against the wind-off runs of its spring.

    Args:
        known: the runs that could be identified, at least one, each with what `derivatives.loads` gives.
        statuses: found so far.

    Returns:
        The estimate with Cnβ, Cnr, Izz and Cr, as far as there are pairs; wind-on runs without a wind-off run
        of their spring, and runs without a stated spring, are left out.
    """
    sprung = [(one, load) for one, load in known if one.run.spring_stiffness is not None]
    if any(run.spring_stiffness is None for run in campaign.runs):
        statuses = statuses | {Status.NO_STIFFNESS}
    if not sprung:
        return replace(estimate, statuses=by_severity(statuses))
    statuses = set(statuses)
    pairing = _pair(sprung)
    windy = sum(one.run.wind_on for one, _ in sprung)
    if windy == 0:
        statuses.add(Status.NO_WIND_ON)
    if len(pairing.on) < windy:
        statuses.add(Status.NO_WIND_OFF_PAIR)
    if windy and not has_size(campaign.rig):
        statuses.add(Status.NO_REFERENCE_SIZE)
    if not pairing.off:
        return replace(estimate, statuses=by_severity(statuses))
    seen = [one for one, _ in sprung]
    line = wind_off(estimate.runs, campaign.runs)
    if line["wind_off_inertia"] is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.INERTIA_NOT_POSITIVE}))
    centre, moves = _propagated(pairing, seen, with_line=line["wind_off_intercept"] is not None)
    air = _air_of_runs(pairing, seen, centre, np.linalg.norm(moves, axis=1))
    return replace(
        estimate,
        statuses=by_severity(statuses),
        runs=tuple(replace(run, **air.get(run.id, {})) for run in estimate.runs),
        **line,
        **_coefficients(
            pairing,
            centre,
            moves,
            line["wind_off_inertia"],
            _mean_std(2.0 * float(centre[0]) * np.array([seen[i].rate for i in pairing.off])),
            has_size(campaign.rig),
        ),
    )


def _propagated(pairing: _Pairing, seen: Sequence[PairedRun], *, with_line: bool) -> tuple[Array, Array]:
    # The outcome, and its move per input moved by one standard deviation: shapes (q,) and (q, inputs).
    frequency = np.array([one.frequency for one in seen])
    rate = np.array([one.rate for one in seen])
    outcome = partial(_outcome, pairing, with_line=with_line)
    centre = outcome(frequency, rate)
    moves = []
    for i, one in enumerate(seen):
        unit = np.eye(len(seen))[i]
        moves.append(outcome(frequency + unit * one.frequency_std, rate) - centre)
        moves.append(outcome(frequency, rate + unit * one.rate_std) - centre)
    return centre, np.array(moves).T


def _mean_std(values: Array) -> float:
    # Of the mean, from the scatter; 0 for too few values, so that the propagated one is used.
    if values.size < LEAST_FOR_SCATTER:
        return 0.0
    return float(values.std(ddof=1)) / float(np.sqrt(values.size))


def _coefficients(
    pairing: _Pairing, centre: Array, moves: Array, inertia: Quantity, damping_scatter: float, sized: bool
) -> dict[str, Any]:
    count = len(pairing.on)
    rows: dict[str, Array] = {
        "yaw_inertia": np.eye(centre.size)[0],
        "mechanical_damping": np.eye(centre.size)[1],
    }
    scatter: dict[str, float] = {"yaw_inertia": inertia.std, "mechanical_damping": damping_scatter}
    if count and sized:
        for name, offset, column in (("cn_beta", 2, 0), ("cn_r", 2 + count, 1)):
            per_run = np.zeros((count, centre.size))
            per_run[np.arange(count), offset + np.arange(count)] = 1.0 / pairing.loads[pairing.on, column]
            rows[name] = per_run.mean(axis=0)
            scatter[name] = _mean_std(per_run @ centre)
    names = tuple(name for name in PARAMETERS if name in rows)
    jacobian = np.array([rows[name] for name in names])
    values = jacobian @ centre
    propagated = jacobian @ moves @ moves.T @ jacobian.T
    covariance = widened_covariance(propagated, np.array([scatter[name] for name in names]))
    quantities: dict[str, Any] = {
        name: Quantity(float(values[i]), float(np.sqrt(covariance[i, i])), UNITS[name])
        for i, name in enumerate(names)
    }
    return quantities | {"parameters": names, "covariance": tuple(map(tuple, covariance.tolist()))}


def _air_of_runs(
    pairing: _Pairing, seen: Sequence[PairedRun], centre: Array, deviations: Array
) -> dict[str, dict[str, Any]]:
    count = len(pairing.on)
    return {
        seen[i].run.id: {
            "aerodynamic_stiffness": Quantity(float(centre[2 + k]), float(deviations[2 + k]), "N m/rad"),
            "aerodynamic_damping": Quantity(
                float(centre[2 + count + k]), float(deviations[2 + count + k]), "N m s/rad"
            ),
        }
        for k, i in enumerate(pairing.on)
    }
