"""A campaign whose nominal model is a model of one's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.fitting.similarity import frequency
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.joint_law import JointLaw

SLIDE = "The joint slides: read m for rad, N for N m and kg for kg m2 throughout."


def reach(campaign: Campaign) -> float:
    """The greatest displacement in the records.

    Returns:
        rad; from the frequency where the sensor measures a rate or an acceleration.
    """
    found = []
    for run in campaign.runs:
        readings = run.record.yaw_rad[np.isfinite(run.record.yaw_rad)]
        turn = 2.0 * np.pi * frequency(run.record) if campaign.sensor.derivative else 1.0
        found.append(float(np.max(np.abs(readings - np.mean(readings)))) / turn**campaign.sensor.derivative)
    return max(found)


def with_law(campaign: Campaign, law: JointLaw) -> Campaign:
    """The campaign with a joint's law in place of a spring.

    Args:
        law: of the joint.

    Returns:
        The campaign; its runs state the stiffness at rest.

    Raises:
        TunnelError: when the runs state more than one spring, or the wind blows and a reference size is missing.
    """
    springs = {run.spring_stiffness for run in campaign.runs} - {None}
    if len(springs) > 1:
        raise TunnelError(
            f"the runs state {len(springs)} springs, and a model has one",
            where="--model",
            remedy="diagnose the runs of each spring separately",
        )
    rig = campaign.rig
    if any(run.wind_on for run in campaign.runs) and None in (rig.frontal_area, rig.reference_length):
        raise TunnelError(
            "runs with a wind speed need the rig's sizes beside the model",
            where="--model",
            remedy="state frontal_area and reference_length under [rig] in campaign.toml",
        )
    runs = tuple(replace(run, spring_stiffness=law.stiffness) for run in campaign.runs)
    return replace(campaign, runs=runs, law=law)
