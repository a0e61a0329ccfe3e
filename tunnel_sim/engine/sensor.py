"""From the angle of the rod's upper end to the reading of the potentiometer."""

from __future__ import annotations

import numpy as np

from tunnel_sim.effects.chain import EffectChain
from tunnel_sim.physics.motion import Motion
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array, Record


def read_motion(
    motion: Motion, sensor: SensorModel, rng: np.random.Generator, chain: EffectChain | None = None
) -> Record:
    """The reading y = quantised(β + zero + noise), with the effects that act on sensor and reading.

    Args:
        motion: of the rod's upper end.
        sensor: noise, zero and resolution; with a resolution of 0 the reading is not quantised.

    Returns:
        The record. The ideal converter has an unlimited range: clipping is an effect.
    """
    angle, time = motion.angle, motion.time_s
    if chain is not None and chain.skips:
        time = time[: round(chain.stated.duration / (time[1] - time[0]))]
        angle = chain.seen(motion, time)
    elif chain is not None:
        angle = chain.angle(angle, time)
    sensor = sensor if chain is None else chain.sensor(sensor)
    reading = angle + sensor.zero + sensor.noise_std * rng.standard_normal(angle.shape)
    if chain is not None:
        reading = chain.reading(reading)
    return Record(time, quantise(reading, sensor.resolution))


def quantise(reading: Array, step: float) -> Array:
    """Round to a multiple of the resolution.

    Args:
        reading: rad, any shape.
        step: rad; 0 leaves the reading as it is.

    Returns:
        The rounded reading, rad.
    """
    return np.round(reading / step) * step if step > 0.0 else reading
