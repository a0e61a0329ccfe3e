"""The records of a cell with their truth and bounds.

The motion comes from the compiled forward integrator, the reading from the virtual potentiometer. A trial depends
on the seed, its cell and its number only. Therefore every estimator gets the same records, and a cell keeps them
in any grid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from tunnel_lab.scoring.grid import NO_EFFECT, Cell
from tunnel_lab.terminal.inputs import parse_effect
from tunnel_sim.effects import Effect, EffectChain, effect_from
from tunnel_sim.engine.sensor import read_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import follow_fastest, whole_steps
from tunnel_sim.vocabulary.aero import AeroDerivatives
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel, Truth
from tunnel_sim.vocabulary.record import Record
from tunnel_sim.vocabulary.rig import Rig

_ZETA_SPREAD, _FREQUENCY_SPREAD, _RELEASE_SPREAD = 0.05, 0.02, 0.03
_ZERO_STD = 0.004  # rad


@dataclass(frozen=True, eq=False)
class Trial:
    """One campaign of known truth.

    Args:
        campaign: input of the estimators; it does not state the noise.
        truth: value of each scored quantity, by name, SI.
        bound: the Cramér–Rao bound of each, by name, SI; of the nominal model, with or without an effect.
    """

    campaign: Campaign
    truth: Mapping[str, float]
    bound: Mapping[str, float]


def draw_trial(cell: Cell, seed: int, number: int) -> Trial:
    """Make one trial.

    Args:
        number: of the trial in its cell, from 0.

    Returns:
        The trial; the same arguments give the same bits.

    Raises:
        TunnelError: when a run leaves the finite range.
    """
    rng = np.random.default_rng([seed, crc32(cell.label.encode()), number])
    return _decay_trial(cell, rng) if cell.kind == "decay" else _campaign_trial(cell, rng)


def _decay_trial(cell: Cell, rng: np.random.Generator) -> Trial:
    from identification.uncertainty.cramer_rao import damped_sinusoid_bound

    rig = load_rig()
    zeta = cell.zeta * (1.0 + _ZETA_SPREAD * rng.uniform(-1.0, 1.0))
    omega = 2.0 * np.pi * cell.frequency * (1.0 + _FREQUENCY_SPREAD * rng.uniform(-1.0, 1.0))
    inertia = rig.dynamics.yaw_inertia
    truth = Truth(0.0, 0.0, inertia, 2.0 * zeta * omega * inertia)
    runs = ((inertia * omega**2, 0.0, cell.amplitude),)
    campaign = _campaign(cell, truth, runs, rig, rng, stated=False)
    # Released at rest: A cos φ is the angle and A sin φ = −(decay rate)·angle/ωd.
    damped = omega * np.sqrt(1.0 - zeta**2)
    lag = -zeta * omega / damped
    bound = damped_sinusoid_bound(
        campaign.runs[0].record.time_s,
        amplitude=cell.amplitude * float(np.hypot(1.0, lag)),
        phase=float(np.arctan2(lag, 1.0)),
        frequency=float(damped) / (2.0 * np.pi),
        zeta=zeta,
        noise_std=_noise(cell),
    )
    return Trial(campaign, {"zeta": zeta, "omega_n": omega}, {"zeta": bound.zeta, "omega_n": bound.omega_n})


def _campaign_trial(cell: Cell, rng: np.random.Generator) -> Trial:
    from identification.uncertainty.cramer_rao import campaign_bound

    truth = Truth(
        cn_beta=rng.uniform(0.25, 0.57),
        cn_r=-rng.uniform(0.06, 0.24),
        yaw_inertia=rng.uniform(0.098, 0.110),
        mechanical_damping=rng.uniform(0.007, 0.020),
    )
    runs = tuple(
        (spring, speed, cell.amplitude * (1.0 + _RELEASE_SPREAD * rng.standard_normal()))
        for spring in cell.springs
        for speed in (0.0, cell.wind_speed)
    )
    campaign = _campaign(cell, truth, runs, load_rig(), rng, stated=True)
    states = [(release, 0.0) for _, _, release in runs]
    bound = campaign_bound(campaign, **vars(truth), noise_std=_noise(cell), initial_states=states)
    return Trial(campaign, dict(vars(truth)), {name: bound.std(name) for name in bound.parameters})


def _noise(cell: Cell) -> float:
    return float(np.hypot(cell.noise * cell.amplitude, cell.resolution / np.sqrt(12.0)))


def _campaign(
    cell: Cell,
    truth: Truth,
    conditions: Sequence[tuple[float, float, float]],
    rig: Rig,
    rng: np.random.Generator,
    *,
    stated: bool,
) -> Campaign:
    """Runs of (spring, speed, release); unless ``stated``, without their spring, which gives normalised form."""
    effects = _effects(cell)
    sensor = SensorModel(
        cell.sample_rate, cell.noise * cell.amplitude, cell.resolution, _ZERO_STD * rng.standard_normal()
    )
    runs = []
    for number, (spring, speed, release) in enumerate(conditions, 1):
        settings = RunSettings(
            spring_stiffness=spring,
            derivatives=AeroDerivatives(truth.cn_beta, truth.cn_r),
            yaw_inertia=truth.yaw_inertia,
            mechanical_damping=truth.mechanical_damping,
            wind_speed=speed,
            air_density=rig.air.density,
            release_angle=release,
            duration=cell.duration,
            timestep=whole_steps(cell.sample_rate),
        )
        runs.append(
            Run(
                id=f"r{number:02d}",
                record=_record(cell, settings, rig, sensor, effects, rng),
                wind_speed=speed,
                spring_stiffness=spring if stated else None,
                air_density=rig.air.density if speed > 0.0 else None,
                release_angle=cell.amplitude,
            )
        )
    stated_sensor = SensorProperties(cell.sample_rate, cell.resolution or None)
    return Campaign("trial", RigProperties.of(rig), stated_sensor, tuple(runs))


def _record(
    cell: Cell,
    settings: RunSettings,
    rig: Rig,
    sensor: SensorModel,
    effects: Sequence[Effect],
    rng: np.random.Generator,
) -> Record:
    chain = EffectChain.draw(settings, effects, rng)
    try:
        motion = forward_motion(rig, follow_fastest(rig, chain.physics()), cell.sample_rate)
    except ValueError as error:
        remedy = "choose a stiffer spring or less wind"
        raise TunnelError(str(error), where=cell.label, remedy=remedy) from error
    return read_motion(motion, sensor, rng, chain)


def _effects(cell: Cell) -> tuple[Effect, ...]:
    if cell.effect == NO_EFFECT:
        return ()
    setting = parse_effect(cell.effect)
    return (effect_from(setting.name, setting.parameters),)
