"""Driven joints of small robots, simulated by MuJoCo's own steps, which share nothing with the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Hold, Input
from tunnel_sim.vocabulary.record import Array, Record

RATE, NOISE, GEAR = 250.0, 2e-4, 20.0
TIME = np.arange(1000) / RATE
MOTOR = f'<motor name="motor" joint="elbow" gear="{GEAR:g}"/>'
UPRIGHT, LEVEL = "0 0 1", "0 1 0"  # axes: without and with gravity


def robot(
    joint: str = "",
    *,
    axis: str = UPRIGHT,
    actuators: str = MOTOR,
    option: str = 'timestep="0.001" integrator="RK4"',
    tip: float = 0.5,
) -> str:
    """MJCF of a link of 0.4 m with a mass at its tip, whose joint has further attributes.

    Args:
        tip: kg.
    """
    return f"""<mujoco><compiler angle="radian"/><option {option}/><worldbody><body name="link">
<joint name="elbow" axis="{axis}" {joint}/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1.5"/>
<geom name="tip" type="sphere" pos="0.4 0 0" size="0.03" mass="{tip}"/></body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""


def multisine(seed: int, peak: float) -> Array:
    """Lines from 0.2 to 4 Hz, shape of TIME."""
    lines = np.arange(0.2, 4.0, 0.1)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size)
    found = np.sin(2.0 * np.pi * np.outer(TIME, lines) + phases).sum(axis=1)
    return np.asarray(peak * found / np.abs(found).max(), np.float64)


def positions(
    xml: str,
    values: Array,
    hold: Hold = "zero",
    *,
    start: tuple[float, float] = (0.0, 0.0),
    column: InputColumn = "drive",
    actuator: int = 0,
) -> Array:
    """Positions of the only joint at the samples, rad, shape of TIME, from a start in rad and rad/s."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = start
    steps = round(1.0 / (RATE * model.opt.timestep))
    found = np.empty(values.size)
    for k, value in enumerate(values):
        found[k] = data.qpos[0]
        rise = (values[min(k + 1, values.size - 1)] - value) / steps if hold == "linear" else 0.0
        for i in range(steps):
            given = value + (i + 0.5) * rise
            if column == "drive":
                data.ctrl[actuator] = given
            else:
                data.qfrc_applied[0] = given
            mujoco.mj_step(model, data)
    return found


def robot_campaign(
    xml: str,
    peaks: Sequence[float] = (0.3, 0.2, 0.25),
    hold: Hold = "zero",
    *,
    start: float = 0.0,
    column: InputColumn = "drive",
    gain: float | None = None,
    delay: int = 0,
) -> Campaign:
    """Runs of multisines, one for each peak of the input, read with noise.

    Args:
        start: position at the start, rad.
        gain: stated, N m per unit.
        delay: by which the input acts later than it is stamped, samples.
    """
    runs = []
    for seed, peak in enumerate(peaks):
        values = multisine(seed, peak)
        late = np.concatenate([np.full(delay, values[0]), values[: values.size - delay]])
        reading = positions(xml, late, hold, start=(start, 0.0), column=column)
        reading = reading + np.random.default_rng([seed, 1]).normal(0.0, NOISE, TIME.size)
        drive = Input(column, values, hold, gain)
        runs.append(Run(f"r{seed + 1}", Record(TIME, reading), 0.0, drive=drive))
    return Campaign("robot", RigProperties(), SensorProperties(RATE), tuple(runs))
