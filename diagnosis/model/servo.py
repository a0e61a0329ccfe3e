"""A position servo: the moment kp (command − angle) − kv rate holds the joint at the commanded position.

It acts as a spring of stiffness kp from the command to the joint, and as a damper of kv to the ground. The runs
show only the sum of kv and the joint's own damping.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from diagnosis.model.nominal import FitStart, NominalModel
from diagnosis.model.rig import PerInertia, SpringModel
from diagnosis.model.run_data import PreparedRuns, RunData
from diagnosis.model.similarity import Similarity
from diagnosis.model.starts import ShownResponse
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import Backlash
from tunnel_sim.physics.run_settings import SettingsTable
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_NO_SPRING = "These effects of a spring are not tried, because the servo is not a spring: {}."
#: Why play is not tried if a servo holds the joint.
OF_GEAR = (
    "The servo holds the motor. Play would be between motor and link, which requires a model of two bodies, so "
    "these effects are not tried: {}."
)
_SLOW = 0.1  # 1/s: a small decay rate of the similar rig


def by_command(campaign: Campaign) -> bool:
    """Whether the command of a servo drives any run."""
    return bool(campaign.driven_by("command_rad"))


@dataclass(frozen=True)
class _OfServo(NominalModel):
    """The common part of servos of known and unknown gain.

    Args:
        kv: kv of the servo, N m s/rad; the fitted damping is added to it.
    """

    kv: float = 0.0

    of_robot: ClassVar[bool] = True
    resonance_known: ClassVar[bool] = True  # the damping of a servo may hide the resonance

    def of(self, campaign: Campaign) -> NominalModel:
        """The model with the kv stated by the runs."""
        stated = min((drive.servo_kv or 0.0 for drive in campaign.inputs), default=0.0)
        return replace(super().of(campaign), kv=stated)  # type: ignore[call-arg]  # refuse: they are one

    def refuse(self, campaign: Campaign) -> None:
        """Refuse runs without the servo, and servos of several gains.

        Raises:
            TunnelError: for the first such run.
        """
        commanded = {run.id for run in campaign.driven_by("command_rad")}
        for run in campaign.runs:
            if run.id not in commanded:
                raise TunnelError(
                    "the run has no command_rad, but other runs do: the servo may have been off",
                    where=f"{campaign.name}, run '{run.id}'",
                    remedy="diagnose the runs without the servo separately",
                )
        if len({(run.spring_stiffness, run.drive and run.drive.servo_kv) for run in campaign.runs}) > 1:
            raise TunnelError(
                "the runs state servos of several gains",
                where=campaign.name,
                remedy="diagnose the runs of each servo separately",
            )
        super().refuse(campaign)

    def untried(self, campaign: Campaign, kinds: Sequence[type[Effect]]) -> dict[str, list[type[Effect]]]:
        """Effects of a spring, and play."""
        play: list[type[Effect]] = [kind for kind in kinds if issubclass(kind, Backlash)]
        of_spring = [k for k in kinds if (k.on_spring or k.chosen_spring() is not None) and k not in play]
        left = [kind for kind in kinds if kind not in (*play, *of_spring)]
        return {OF_GEAR: play, _NO_SPRING: of_spring} | super().untried(campaign, left)

    def settings(self, values: Mapping[str, Array], runs: Sequence[RunData]) -> SettingsTable:
        """The physics of several runs, with the damping of the servo."""
        return super().settings(
            {**values, "mechanical_damping": values["mechanical_damping"] + self.kv}, runs
        )

    def unseen(self, data: PreparedRuns) -> Sequence[str]:
        """The two dampers."""
        del data
        which = (
            "which part of the damping is the servo's kv" if self.kv == 0.0 else "an error of the servo's kv"
        )
        return (f"{which}: only its sum with the joint's damping is visible",)

    def planned_springs(self, data: PreparedRuns) -> tuple[float, ...]:
        """None: the servo cannot be exchanged."""
        del data
        return ()


@dataclass(frozen=True)
class Servo(_OfServo, SpringModel):
    """A joint held by a servo of stated kp: Izz β̈ + (C + kv) β̇ = kp (command − β).

    Args:
        kv: kv of the servo, N m s/rad; the fitted damping is added to it.
    """

    coefficient_units: ClassVar[Mapping[str, str]] = {
        "yaw_inertia": "kg m2", "mechanical_damping": "N m s/rad", **SpringModel.coefficient_units,
    }  # fmt: skip

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether a run has a command, and every run states the kp."""
        return by_command(campaign) and SpringModel.describes(campaign)

    def similar(self, change: Similarity) -> NominalModel:
        """The kv of the similar campaign."""
        return replace(self, kv=change.similar(self.kv, "N m s/rad"))

    def starts(self, data: PreparedRuns) -> Iterator[FitStart]:
        """Inertia and damping by the response to the command (its gain is the kp); then as for a rig."""
        shown = [
            (run.spring_stiffness / response.stiffness, 2.0 * response.rate)
            for run in data.runs
            if (response := ShownResponse.of(run)) is not None and run.spring_stiffness is not None
        ]
        if shown and not self.own_zeros:
            inertia, loss = np.median(shown, axis=0).tolist()
            damping = max(inertia * max(loss, _SLOW) - self.kv, 0.0)
            own = [{"release_angle": float(np.mean(run.reading[:3]))} for run in data.runs]
            yield FitStart({"yaw_inertia": inertia, "mechanical_damping": damping}, own)
        yield from super().starts(data)


@dataclass(frozen=True)
class ServoPerInertia(_OfServo, PerInertia):
    """A joint held by a servo of unknown kp: all moments are per unit inertia, the kp among them.

    Args:
        kv: kv of the servo, also unknown: 0 N m s/rad.
    """

    of_spring: ClassVar[str] = "servo_kp"

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether a run has a command, and one states no kp."""
        return by_command(campaign) and PerInertia.describes(campaign)

    def refuse(self, campaign: Campaign) -> None:
        """Refuse a kv without a kp, as for every servo.

        Raises:
            TunnelError: for the first such run.
        """
        super().refuse(campaign)
        if any(drive.servo_kv for drive in campaign.inputs):
            what = "servo_kv is stated without kp; moments are then known per unit inertia only"
            remedy = "state the kp as spring_stiffness, or leave servo_kv out"
            raise TunnelError(what, where=campaign.name, remedy=remedy)
