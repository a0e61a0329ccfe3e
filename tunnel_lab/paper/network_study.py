"""The paper's networks against known truth: Fig. 3, the run behind Table III, Table IV and Figs 4 to 6."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from identification import identify
from identification.datasets import paper_derivatives, paper_springs, paper_windows
from identification.decay.damped_oscillation import Decay, response_rows
from identification.estimate import Estimate
from identification.neural.networks import Networks
from identification.neural.shape import cycles_time, network_inputs
from identification.neural.training_set import held_out_points
from tunnel_lab.terminal.inputs import parse_effect
from tunnel_sim.files.plan_file import paper_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.aero import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.plan import CampaignPlan, EffectSetting, SensorModel, Truth
from tunnel_sim.vocabulary.record import Array

NETWORK, CONVENTIONAL, BEST = "neural_network", "conventional", "output_error"
METHODS = (NETWORK, CONVENTIONAL, BEST)
# One of the explanations of Table III that the tutorial on the paper's own gap cannot distinguish.
SOFTENING = (
    parse_effect("cubic_stiffness:coefficient=-0.39"),
    parse_effect("quadratic_damping:coefficient=0.0038"),
)

# N m s/rad: what Tables III and IV leave, and what is left beside a quadratic damping that does part of it.
_MECHANICAL_DAMPING, _DAMPING_BESIDE_QUADRATIC = 0.0095, 0.0035


@dataclass(frozen=True, eq=False)
class HeldOutErrors:
    """Fig. 3: errors on responses that were not trained on.

    Args:
        zeta: true damping ratios, shape (n,).
        omega_n: true natural frequencies, rad/s, shape (n,).
        zeta_percent: errors of ζ, % of ζ, shape (n,).
        omega_percent: errors of ωn, % of ωn, shape (n,).
    """

    zeta: Array
    omega_n: Array
    zeta_percent: Array
    omega_percent: Array


def fig3_errors(networks: Networks, rng: np.random.Generator) -> HeldOutErrors:
    """Put responses over the training range through both networks, noise-free."""
    zeta, omega = held_out_points(networks.spec, rng)
    found = networks.zeta(network_inputs(zeta))
    omega_found = networks.omega_n(found, cycles_time(zeta, omega))
    return HeldOutErrors(zeta, omega, 100.0 * (found / zeta - 1.0), 100.0 * (omega_found / omega - 1.0))


@dataclass(frozen=True)
class SpringInference:
    """What one spring of Table II would imply for the run behind Table III.

    Args:
        spring: number.
        wind_speed: V at which the printed Cnβ brings the spring's wind-off frequency down to the table's
            mean, m/s.
        mechanical_damping: Cr left of the table's mean damping once the printed Cnr is taken off, N m s/rad;
            negative is impossible.
    """

    spring: int
    wind_speed: float
    mechanical_damping: float


def infer_springs() -> tuple[SpringInference, ...]:
    """Which springs can be the one behind Table III: an inference, not a statement of the paper.

    Each spring's own inertia is Kr/ω0², as in the paper's eqs 10 and 11; Cnβ and Cnr are Table IV's of the
    neural network, which the paper took from the means of Table III.

    Returns:
        One row per spring whose wind-off frequency lies above the table's mean, as a positive Cnβ demands.
    """
    rows = paper_windows()
    omega = float(np.mean([row.omega_n_rad_per_s for row in rows]))
    zeta = float(np.mean([row.zeta for row in rows]))
    printed, rig = paper_derivatives()[0], load_rig()
    found = []
    for spring in paper_springs():
        stiffness, omega_0 = spring.stiffness_n_m_per_rad, 2.0 * pi * spring.frequency_hz
        if omega_0 <= omega:
            continue
        inertia = stiffness / omega_0**2
        per_square = aerodynamic_stiffness(printed.cn_beta_per_rad, **rig.body.flow(rig.air.density, 1.0))
        speed = sqrt((stiffness - inertia * omega**2) / per_square)
        lost = aerodynamic_damping(printed.cn_r_per_rad, **rig.body.flow(rig.air.density, speed))
        found.append(SpringInference(spring.number, speed, 2.0 * zeta * omega * inertia + lost))
    return tuple(found)


def paper_run_plan(
    seed: int, *, noisy: bool = True, effects: tuple[EffectSetting, ...] = (), wind_speed: float = 10.0
) -> CampaignPlan:
    """Spring 5 with the wind off and on, released at 20°: what Table III's run may have been, an inference.

    Args:
        noisy: noise of 0.0005 rad and 12 bits; else neither.
        wind_speed: of the second run, m/s.
    """
    plan = paper_plan()
    off = next(one for one in plan.conditions if one.spring_stiffness == 16.12 and one.wind_speed == 0.0)
    damping = _DAMPING_BESIDE_QUADRATIC if effects else _MECHANICAL_DAMPING
    truth = Truth(0.4719, -0.1033, plan.truth.yaw_inertia, damping)
    sensor = SensorModel(zero=0.004) if noisy else SensorModel(noise_std=0.0, resolution=0.0, zero=0.004)
    on = replace(off, id="wind-on", wind_speed=wind_speed)
    return CampaignPlan("paper-run", seed, truth, (replace(off, id="wind-off"), on), sensor, effects)


@dataclass(frozen=True)
class Closeness:
    """How close a method comes on one campaign.

    Args:
        cn_beta: error of Cnβ, % of the truth.
        cn_r: error of Cnr, % of the truth.
        response: misfit of the response regenerated from ζ and ωn, % of the release angle, mean of the runs.
    """

    cn_beta: float
    cn_r: float
    response: float


def closeness(campaign: Campaign, truth: Truth) -> dict[str, Closeness]:
    """Table IV and Figs 4 to 6 for one campaign of known truth."""
    found = {}
    for method in METHODS:
        estimate = identify(campaign, method, throw=False)
        if estimate.cn_beta is None or estimate.cn_r is None:
            continue
        found[method] = Closeness(
            100.0 * (estimate.cn_beta.value / truth.cn_beta - 1.0),
            100.0 * (estimate.cn_r.value / truth.cn_r - 1.0),
            100.0 * _mean_misfit(campaign, estimate),
        )
    return found


def regenerated(run: Run, omega_n: float, zeta: float) -> Array:
    """The response of eq. 16, a release at rest, from ζ and ωn, scaled and shifted to the record.

    Args:
        omega_n: natural frequency, rad/s.
        zeta: damping ratio.

    Returns:
        Yaw angle at the record's samples, rad.
    """
    time = run.record.time_s - run.record.time_s[0]
    unit = response_rows(np.array(time), Decay.from_modal(omega_n, zeta))[0]
    columns = np.column_stack((unit, np.ones_like(unit)))
    return np.asarray(columns @ np.linalg.lstsq(columns, run.record.yaw_rad, rcond=None)[0])


def _mean_misfit(campaign: Campaign, estimate: Estimate) -> float:
    values = []
    for run, one in zip(campaign.runs, estimate.runs, strict=True):
        if one.omega_n is not None and one.zeta is not None:
            left = run.record.yaw_rad - regenerated(run, one.omega_n.value, one.zeta.value)
            values.append(float(np.sqrt(np.mean(left**2))) / abs(run.release_angle or np.nan))
    return float(np.mean(values))
