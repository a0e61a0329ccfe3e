"""From the angle of the rod's upper end to the reading of the potentiometer."""

from __future__ import annotations

import numpy as np

from tunnel_sim.plan import SensorModel
from tunnel_sim.record import Array


def read_angle(angle: Array, sensor: SensorModel, rng: np.random.Generator) -> Array:
    """The reading y = quantised(β + zero + noise).

    Args:
        angle: true angle of the sensor's end of the rod, rad, shape (n,).
        sensor: noise, zero and resolution; a resolution of 0 leaves the reading continuous.
        rng: source of the noise.

    Returns:
        The reading, rad, shape (n,). It is the ideal converter's without an end stop: clipping is an effect.
    """
    noisy = angle + sensor.zero + sensor.noise_std * rng.standard_normal(angle.shape)
    return quantise(noisy, sensor.resolution)


def quantise(reading: Array, step: float) -> Array:
    """Round to a multiple of the resolution.

    Args:
        reading: rad, any shape.
        step: rad; 0 leaves the reading as it is.

    Returns:
        The rounded reading, rad.
    """
    return np.round(reading / step) * step if step > 0.0 else reading
