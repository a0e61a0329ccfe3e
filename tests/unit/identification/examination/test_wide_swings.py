"""Readings of rates whose unit makes the body turn over: the swing of the angle is that over the frequency."""

import numpy as np
import pytest

from identification.examination.examine import noted_readings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

OMEGA, TIME = 1.63, np.arange(0.0, 60.0, 0.02)


def readings(size: float, quantity: str) -> Campaign:
    """One run of rates or accelerations of some size, in rad/s or rad/s²."""
    record = Record(TIME, size * np.exp(-0.01 * TIME) * np.cos(OMEGA * TIME))
    run = Run("imu", record, 0.0)
    return Campaign("imu", RigProperties(), SensorProperties(50.0, quantity=quantity), (run,))


@pytest.mark.parametrize(("quantity", "order", "unit"), [("rate", 1, "deg/s"), ("acceleration", 2, "deg/s2")])
def test_rates_in_degrees_are_asked_about(quantity: str, order: int, unit: str) -> None:
    far = noted_readings(readings(24.0 * OMEGA**order, quantity))
    assert len(far) == 2
    assert far[1].what.endswith("rad, more than half a turn")
    assert far[1].remedy == f"if these are {unit}, import them with --unit {unit}"
    assert len(noted_readings(readings(0.5 * OMEGA**order, quantity))) == 1
