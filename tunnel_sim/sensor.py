"""From the angle of the rod's upper end to the reading of the potentiometer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tunnel_sim.effects import Effect
from tunnel_sim.motion import Motion
from tunnel_sim.plan import SensorModel
from tunnel_sim.record import Array, Record
from tunnel_sim.run_settings import RunSettings


def read_motion(
    motion: Motion,
    stated: RunSettings,
    sensor: SensorModel,
    rng: np.random.Generator,
    effects: Sequence[Effect] = (),
) -> Record:
    """The reading y = quantised(β + zero + noise), with the sensor's effects at their places.

    Args:
        motion: of the rod's upper end.
        stated: the run as the campaign states it.
        sensor: noise, zero and resolution; a resolution of 0 leaves the reading continuous.
        rng: source of the noise. What effects draw comes from generators spawned of it, so that an effect at
            its null leaves the noise as it is.
        effects: what the nominal model leaves out; those that do not concern the sensor do nothing here.

    Returns:
        The record. The ideal converter has no end stop: clipping is an effect.
    """
    angle = motion.angle
    for effect in effects:
        angle = effect.on_angle(angle, motion.time_s, stated, rng.spawn(1)[0])
        sensor = effect.on_sensor(sensor)
    reading = angle + sensor.zero + sensor.noise_std * rng.standard_normal(angle.shape)
    for effect in effects:
        reading = effect.on_reading(reading)
    return Record(motion.time_s, quantise(reading, sensor.resolution))


def quantise(reading: Array, step: float) -> Array:
    """Round to a multiple of the resolution.

    Args:
        reading: rad, any shape.
        step: rad; 0 leaves the reading as it is.

    Returns:
        The rounded reading, rad.
    """
    return np.round(reading / step) * step if step > 0.0 else reading
