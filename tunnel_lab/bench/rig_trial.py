"""A trial of the virtual rig by the fast integrator: one run with chosen physics, in milliseconds."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, radians

import numpy as np

from tunnel_sim.effects import Effect, EffectChain, effect_class
from tunnel_sim.engine.sensor import read_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.aero import AeroDerivatives
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array

RATE = 200.0
"""Sample rate of a trial, Hz: ten to a hundred times the rig's frequencies."""


@dataclass(frozen=True)
class Trial:
    """What is chosen.

    Args:
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        release_angle_deg: degrees.
        duration: s.
        effect: its name; empty: none.
        severity: of the effect, in its unit.
    """

    cn_beta: float = 0.4719
    cn_r: float = -0.1033
    spring_stiffness: float = 16.12
    wind_speed: float = 10.0
    release_angle_deg: float = 20.0
    duration: float = 10.0
    effect: str = ""
    severity: float = 0.0


def chosen_effect(trial: Trial) -> Effect | None:
    """The effect of a trial with the values of its example, except the severity; None where it does nothing."""
    if not trial.effect or trial.severity == 0.0:
        return None
    kind = effect_class(trial.effect)
    infos = kind.parameters()
    values = {info.name: value for info, value in zip(infos, kind.example, strict=False)}
    spring = kind.chosen_spring()
    values |= {infos[0].name: trial.severity} | ({} if spring is None else {spring: trial.spring_stiffness})
    return kind(**values)


def simulate(trial: Trial) -> tuple[Array, Array, Array]:
    """Simulate a run without and with the effect.

    Returns:
        Times (s), and readings (rad) of the nominal model and with the effect, shape (n,) each; neither has noise.

    Raises:
        TunnelError: when the motion grows without bound.
    """
    rig = load_rig()
    stated = RunSettings(
        spring_stiffness=trial.spring_stiffness,
        derivatives=AeroDerivatives(trial.cn_beta, trial.cn_r),
        yaw_inertia=rig.dynamics.yaw_inertia,
        mechanical_damping=rig.dynamics.mechanical_damping,
        wind_speed=trial.wind_speed,
        air_density=rig.air.density,
        release_angle=radians(trial.release_angle_deg),
        duration=trial.duration,
    )
    effect = chosen_effect(trial)
    time, nominal = _read(stated, ())
    seen = nominal if effect is None else _read(stated, (effect,))[1]
    size = min(nominal.size, seen.size)  # where samples are dropped there are fewer
    return time[:size], nominal[:size], seen[:size]


def _read(stated: RunSettings, effects: tuple[Effect, ...]) -> tuple[Array, Array]:
    rig = load_rig()
    rng = np.random.default_rng(1)  # the same random moments at every change
    chain = EffectChain.draw(stated, effects, rng)
    try:
        motion = forward_motion(rig, follow_fastest(rig, chain.physics()), RATE)
    except ValueError as error:
        raise TunnelError(
            str(error), where="the rig", remedy="choose a stiffer spring or a smaller Cnβ"
        ) from error
    record = read_motion(motion, SensorModel(RATE, noise_std=0.0, resolution=0.0), rng, chain)
    return record.time_s, record.yaw_rad


def plan_text(trial: Trial, name: str) -> str:
    """The plan of a small campaign with the trial's physics, for ``tunnel simulate``: two springs, wind off and on.

    Args:
        trial: what is chosen; its effect is an option of the command.
    """
    import tomli_w

    return tomli_w.dumps(
        {
            "name": name,
            "seed": 1,
            "spring_stiffness": [trial.spring_stiffness, 2.0 * trial.spring_stiffness],
            "wind_speeds": [0.0, trial.wind_speed] if trial.wind_speed > 0.0 else [0.0],
            "release_angles_deg": [trial.release_angle_deg],
            "duration": trial.duration,
            "truth": {"cn_beta": trial.cn_beta, "cn_r": trial.cn_r},
        }
    )


def effect_words(trial: Trial) -> list[str]:
    """The effect as an option of ``tunnel simulate``; empty where there is none."""
    effect = chosen_effect(trial)
    if effect is None:
        return []
    values = ",".join(f"{info.name}={getattr(effect, info.name)!r}" for info in effect.parameters())
    return ["--effect", f"{effect.name}:{values}"]


def said(trial: Trial, time: Array, nominal: Array, seen: Array) -> str:
    """What the trial shows, in a sentence.

    Args:
        time: s, shape (n,).
        nominal: reading of the nominal model, rad, shape (n,).
        seen: reading with the effect, rad, shape (n,).
    """
    crossings = np.flatnonzero(np.diff(np.sign(nominal)) != 0)
    parts = []
    if crossings.size > 2:
        half = float(np.mean(np.diff(time[crossings])))
        parts.append(f"The nominal model swings at {0.5 / half:.3g} Hz.")
    if trial.effect and trial.severity:
        apart = degrees(float(np.sqrt(np.mean((seen - nominal) ** 2))))
        parts.append(f"With the effect the reading differs by {apart:.2g}° in root mean square.")
    return " ".join(parts)
