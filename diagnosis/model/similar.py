"""The similar campaign: the measured motion on a rig of the reference frequency and stiffness."""

from __future__ import annotations

import dataclasses

import numpy as np

from diagnosis.model.choose import nominal_model
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similarity import REFERENCE_FREQUENCY, Similarity, free_frequency, reach
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record


def similar_campaign(campaign: Campaign, model: NominalModel | None = None) -> tuple[Campaign, Similarity]:
    """The campaign of the similar rig.

    Args:
        model: nominal model of the campaign; None: the model of its kind.

    Returns:
        The similar campaign, and the conversion. Its wind-off runs have a median frequency of
        `REFERENCE_FREQUENCY`, and its springs a median stiffness of `REFERENCE_STIFFNESS`. If no stiffness is
        stated, the inertia is 1 before and after. Without a restoring moment, the inertia is chosen to swing at
        this frequency on a spring of this stiffness.
    """
    rig, sensor = campaign.rig, campaign.sensor
    still = campaign.in_still_air or campaign.runs
    time = float(np.median([free_frequency(run, sensor.derivative) for run in still])) / REFERENCE_FREQUENCY
    model = model or nominal_model(campaign)
    moment = model.moment_factor(campaign, time)
    rest = float(np.median([np.mean(run.record.yaw_rad) for run in campaign.runs]))
    unit = ("rad", "rad/s", "rad/s2")[sensor.derivative]
    freedom = sensor.freedom
    own_size = freedom.turns or model.own_size or model.moment
    angle = 1.0 if own_size else freedom.scale(reach(campaign))
    change = Similarity(time, moment, rest if unit == "rad" else 0.0, unit, angle)

    def known(value: float | None, unit: str) -> float | None:
        return None if value is None else change.similar(value, unit)

    similar_rig = RigProperties(
        known(rig.yaw_inertia, "kg m2"),
        None if rig.frontal_area is None else rig.frontal_area * change.area,
        None if rig.reference_length is None else rig.reference_length * time,
        None if rig.width is None else rig.width * time,
    )
    similar_sensor = dataclasses.replace(
        sensor,
        sample_rate=known(sensor.sample_rate, "Hz"),
        resolution=known(sensor.resolution, unit),
        noise_std=known(sensor.noise_std, unit),
    )
    runs = tuple(similar_run(run, change) for run in campaign.runs)
    return dataclasses.replace(campaign, rig=similar_rig, sensor=similar_sensor, runs=runs), change


def similar_run(run: Run, change: Similarity) -> Run:
    """A run of the similar rig."""
    readings = (run.record.yaw_rad - change.rest) * change.similar(1.0, change.reading)
    record, spring = Record(run.record.time_s * change.time, readings), run.spring_stiffness
    drive = None if run.drive is None else _drive(run.drive, change)
    spring = None if spring is None else spring * change.moment
    return dataclasses.replace(run, record=record, spring_stiffness=spring, drive=drive)


def _drive(drive: Input, change: Similarity) -> Input:
    """An input at the times of its record."""
    if drive.kind.takes_gain:  # the values stay as they are
        gain = None if drive.gain is None else change.similar(drive.gain, "N m")
        return dataclasses.replace(drive, gain=gain)
    return dataclasses.replace(drive, values=drive.values * change.similar(1.0, drive.kind.unit))
