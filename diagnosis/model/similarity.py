"""Dynamically similar campaigns: every rig is diagnosed as a rig of the same frequency and stiffness.

The equation of motion keeps its form when time is multiplied by s, moments by m, lengths along the flow by s
and the frontal area by m/s. Inertias then change by m s² and damping by m s; angles, wind speeds, air
densities, Cnβ and Cnr do not change. Every interval, frequency and moment in the diagnosis therefore refers to
one rig, whatever the time scale of the measured rig. A displacement is diagnosed as an angle of a usual size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.signal.forcing import driven_start
from identification.signal.frequency import peak_of_swing
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.dimensions import angle_power, dimension
from tunnel_sim.vocabulary.record import Record, evenly_spaced

REFERENCE_FREQUENCY = 2.0  # frequency of the similar rig, Hz
REFERENCE_STIFFNESS = 16.0  # median stiffness of its springs, N m/rad
#: Inertia of the similar rig where it has no springs, kg m².
REFERENCE_INERTIA = REFERENCE_STIFFNESS / (2.0 * np.pi * REFERENCE_FREQUENCY) ** 2


@dataclass(frozen=True)
class Similarity:
    """The conversion of a campaign to the similar one.

    Args:
        time: s, the factor on times, dimensionless.
        moment: m, the factor on moments, dimensionless.
        rest: angle subtracted from all readings, rad.
        reading: unit of the readings.
        angle: the factor on angles, and on moments beside the motion's; 1 except for displacements.
    """

    time: float = 1.0
    moment: float = 1.0
    rest: float = 0.0
    reading: str = "rad"
    angle: float = 1.0

    @property
    def area(self) -> float:
        """The factor on the frontal area, dimensionless."""
        return self.moment / self.time

    def own(self, value: float, unit: str) -> float:
        """A value of the similar campaign as a value of the campaign itself.

        Args:
            value: value in the unit.
            unit: SI; a unit without time or moment leaves the value unchanged, and so does the unit of a speed.
        """
        return value / self._factor(unit)

    def similar(self, value: float, unit: str) -> float:
        """A value of the campaign itself as a value of the similar campaign; the inverse of `own`.

        Args:
            value: value in the unit.
            unit: as in `own`.
        """
        return value * self._factor(unit)

    def _factor(self, unit: str) -> float:
        """Speeds do not change, so a length changes like a time; a mass then changes like a moment."""
        kg, metres, seconds = dimension(unit)
        motion = self.angle ** angle_power(unit)
        if kg == seconds == 0.0:  # the rig's sizes have rules of their own
            return float(motion)
        return float(self.moment**kg * self.time ** (metres + seconds) * motion)


AS_MEASURED = Similarity()
"""The similarity of a campaign with itself."""


# zero padding, in lengths of the record: it places the peak of a few cycles to within a few per cent
_PADDING = 8
# maximum corner frequency over the motion's: in a mostly damped body the inertia hardly shows
_MOST_CORNER = 8.0
_MOTION = 0.999  # share of the swing's power in the lines of the motion; the rest is noise


def frequency(record: Record) -> float:
    """The frequency of a decay, the peak of its spectrum, Hz."""
    record = evenly_spaced(record, bridged=False)
    swing = record.yaw_rad - np.mean(record.yaw_rad)
    size = _PADDING * swing.size
    return peak_of_swing(swing, size) * record.sample_rate / size


def free_frequency(run: Run, derivative: int = 0) -> float:
    """The frequency at which a run would swing freely.

    Args:
        derivative: order of the derivative of the angle that the sensor reads.

    Returns:
        The frequency of the decay, Hz. The motion of a driven run may follow its input: for it, the frequency
        is the resonance between them, or the peak of the motion if they show none. A body without a restoring
        moment does not
        swing: the frequency is the mean of the power of the rate, or the frequency above which inertia exceeds
            damping, if that is higher.
    """
    found = response_to_input(run, derivative)
    if run.unrestrained:
        angle = run.record.yaw_rad
        power = np.abs(np.fft.rfft((angle - np.mean(angle)) * np.hanning(angle.size)))[1:] ** 2
        lines = int(np.searchsorted(np.cumsum(power), _MOTION * power.sum())) + 1
        at = np.arange(1, lines + 1) / (angle.size * run.record.sample_interval)
        moved = float(np.sum(at**3 * power[:lines]) / np.sum(at**2 * power[:lines]))
        corner = 0.0 if found is None else found[0] / np.pi
        return float(np.clip(corner, moved, _MOST_CORNER * moved))
    if found is None or found[1] <= 0.0:
        return frequency(run.record)
    return float(np.sqrt(found[1])) / (2.0 * np.pi)


def reach(campaign: Campaign) -> float:
    """The greatest displacement in the records, rad; by way of the frequency if the sensor reads a rate."""
    found = []
    for run in campaign.runs:
        readings = run.record.yaw_rad[np.isfinite(run.record.yaw_rad)]
        turn = 2.0 * np.pi * frequency(run.record) if campaign.sensor.derivative else 1.0
        found.append(float(np.max(np.abs(readings - np.mean(readings)))) / turn**campaign.sensor.derivative)
    return max(found)


def response_to_input(run: Run, derivative: int = 0) -> tuple[float, float, float] | None:
    """Decay rate (1/s), stiffness (1/s²) and gain (rad/s² per unit) of a driven run by itself.

    Args:
        derivative: order of the derivative of the angle that the sensor reads.

    Returns:
        As `driven_start`; None for a free decay, too.
    """
    if run.drive is None:
        return None
    record = evenly_spaced(run.record)
    values = np.interp(record.time_s, run.record.time_s, run.drive.values)
    return driven_start(
        record.time_s, record.yaw_rad, values, sprung=not run.unrestrained, derivative=derivative
    )
