"""What changes where the sensor measures the yaw rate or acceleration instead of the angle.

Every derivative of a linear decay has its ωn and ζ, so that the estimators take it as they take an angle.
"""

from __future__ import annotations

from dataclasses import replace

from identification.estimate import Estimate, Quantity, RunEstimate, WindowEstimate
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, SensorProperties


def noted_quantity(campaign: Campaign) -> tuple[Remark, ...]:
    """Note that the readings are not angles.

    Returns:
        One remark on all runs; none where the readings are angles.
    """
    sensor = campaign.sensor
    if sensor.derivative == 0:
        return ()
    return (
        Remark(
            Outcome.NOTED,
            tuple(run.id for run in campaign.runs),
            f"the readings are {sensor.quantity}s: omega_n and zeta are those of the angle, and its amplitude "
            f"follows from them; zero and noise are in {sensor.unit}",
            "state quantity = 'angle' under [sensor] if the readings are angles",
        ),
    )


def as_angles(estimate: Estimate, sensor: SensorProperties) -> Estimate:
    """The estimate of readings that are not angles, in terms of the angle.

    Args:
        estimate: in which the reading was taken for an angle.

    Returns:
        The estimate with amplitudes of the angle and zeros in the unit of the reading. The initial state and the
        intensity of a random moment are those of the reading and are left out. The estimate itself for angles.
    """
    if sensor.derivative == 0:
        return estimate
    return replace(
        estimate,
        runs=tuple(_run(run, sensor) for run in estimate.runs),
        sensor_zero=_in_unit(estimate.sensor_zero, sensor.unit),
    )


def _run(run: RunEstimate, sensor: SensorProperties) -> RunEstimate:
    return replace(
        run,
        initial_angle=None,
        initial_rate=None,
        process_noise=None,
        sensor_zero=_in_unit(run.sensor_zero, sensor.unit),
        windows=tuple(_window(window, sensor.derivative) for window in run.windows),
    )


def _in_unit(quantity: Quantity | None, unit: str) -> Quantity | None:
    return None if quantity is None else replace(quantity, unit=unit)


def _window(window: WindowEstimate, derivative: int) -> WindowEstimate:
    factor = window.omega_n.value**-derivative
    amplitude = Quantity(factor * window.amplitude.value, factor * window.amplitude.std, "rad")
    return replace(window, amplitude=amplitude)
