"""Inputs of known gain over the inertia, and a check of their sign and unit against the motion."""

from __future__ import annotations

import numpy as np

from identification.policy import REFUSAL_DEVIATIONS
from identification.signal.decay_fit import Reading, fit_decays
from identification.signal.forcing import driven_start
from identification.statistics import determined, inverse
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import evenly_spaced

_DEGREES = 180.0 / np.pi
_SAME_GAIN = 0.5  # maximum relative error of a start's gain: errors of sign and unit are far larger


def refuse_other_gains(campaign: Campaign) -> None:
    """Refuse the acceleration of a base with a sign or unit that the motion contradicts.

    The gain over the inertia is known for such an input. The input is refused if the motion shows another gain
    beyond
    doubt: of opposite sign, or in degrees instead of radians (if the sensor's values must be plausible).

    Raises:
        TunnelError: for the first such input.
    """
    sensor = campaign.sensor
    for run in campaign.runs:
        if run.drive is not None and run.drive.kind.by_inertia:
            where = f"{campaign.name}, run '{run.id}'"
            _refuse_other_gain(run, run.drive, sensor.derivative, where, judged=sensor.plausible is not False)


def _refuse_other_gain(run: Run, drive: Input, derivative: int, where: str, *, judged: bool) -> None:
    record, column = evenly_spaced(run.record), drive.column
    values = np.interp(record.time_s, run.record.time_s, drive.values)
    start = driven_start(record.time_s, record.yaw_rad, values, derivative=derivative)
    if start is None or not start[1] > 0.0:  # other checks refuse a motion that does not oscillate
        return
    ratio = start[2] / drive.kind.scale
    turned, degrees, radians = (
        abs(ratio * factor - 1.0) < _SAME_GAIN for factor in (-1.0, _DEGREES, 1.0 / _DEGREES)
    )
    if not (turned or (judged and (degrees or radians))) or not _gain_differs(run, start, derivative):
        return
    if turned:
        what = (
            f"the motion follows {column} with the other sign: a base that accelerates leaves the body behind"
        )
        raise TunnelError(what, where=where, remedy="turn the sign of the acceleration or of the reading")
    unit = "degrees" if degrees else "radians in place of degrees"
    what = f"the motion follows {column} with a gain of {-ratio:.3g} in place of −1, as if it were in {unit}"
    raise TunnelError(what, where=where, remedy="convert it to rad/s2, and the reading to rad")


def _gain_differs(run: Run, start: tuple[float, float, float], derivative: int) -> bool:
    """Whether the best-fitting gain of a run differs from the known gain far beyond the noise."""
    reading = Reading.from_run(run, derivative)
    found = fit_decays([reading], [np.eye(3)], np.array(start) - reading.forcing.fixed)
    if not found.converged or not determined(found.normal):
        return False
    std = float(np.std(found.runs[0].residual) * np.sqrt(inverse(found.normal)[2, 2]))
    return abs(float(found.parameters[2])) > REFUSAL_DEVIATIONS * std
