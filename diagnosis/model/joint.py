"""The joint of the user's own model: its law and its actuator replace spring, damper and input gain."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from diagnosis.model.loose import LooseBody
from diagnosis.model.nominal import FitStart, NominalModel
from diagnosis.model.parameters import Parameter
from diagnosis.model.rig import SpringModel
from diagnosis.model.run_data import PreparedRuns, RunData
from diagnosis.model.servo import OF_GEAR
from diagnosis.model.similarity import Similarity, reach
from diagnosis.model.starts import Shown, ShownResponse
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import Backlash
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.physics.run_settings import SettingsTable
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.freedom import DISPLACEMENT
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Actuator, JointLaw

if TYPE_CHECKING:
    from tunnel_sim.engine.joint_model import Recorded

_SAME_GAIN = 1e-3  # relative tolerance within which a stated gain, or a limit, is the model's
_FEW = 5  # number of blocks that give the initial rate of a run
_OF_SERVO = "These effects of a spring are not tried, because the actuator is a servo: {}."
_OF_GEAR = (
    "Gravity holds the joint. Play would be in the gears between motor and link, which requires a model of two "
    "bodies, so these effects are not tried: {}."
)


@dataclass(frozen=True)
class _OfLaw(NominalModel):
    """The common part of all joints with a law.

    Args:
        law: law of the joint in the similar campaign, like all values.
    """

    law: JointLaw = field(kw_only=True)

    of_robot: ClassVar[bool] = True
    own_size: ClassVar[bool] = True
    resonance_known: ClassVar[bool] = True

    @property
    def held(self) -> Mapping[str, float]:
        """The values fixed by the model, and by the user."""
        return self.law.held

    def similar(self, change: Similarity) -> NominalModel:
        """The joint of the similar campaign."""
        law = self.law
        similar = dataclasses.replace(
            law,
            inertia=change.similar(law.inertia, "kg m2"),
            stiffness=change.similar(law.stiffness, "N m/rad"),
            damping=change.similar(law.damping, "N m s/rad"),
            friction=change.similar(law.friction, "N m"),
            rest=law.rest - change.rest,
            step=change.similar(law.step, "s"),
            lead=change.similar(law.lead, "s"),
            terms=tuple(
                dataclasses.replace(term, coefficient=change.similar(term.coefficient, term.unit))
                for term in law.terms
            ),
        )
        return replace(self, law=similar)

    def inertial(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The inertial parameters of a rig, and a stiffness beside the law's stiffness."""
        return *super().inertial(data), Parameter("added_stiffness", "N m/rad")

    @property
    def law_parameters(self) -> Mapping[str, float]:
        """The law's dry friction, with gravity as its load; gravity's moment is in the spring and the terms."""
        stiffness, angle = self.law.weight
        hung = {"load_stiffness": stiffness, "load_angle": angle} if stiffness else {}
        return {"friction_moment": self.law.friction, **hung}

    @property
    def moment(self) -> str:
        """The terms of the law, of the displacement from its rest."""
        return "".join(f"-({term.coefficient!r})*({term.expression})" for term in self.law.terms)

    @property
    def lead(self) -> float:
        """Time by which the joint's motion leads its input, s."""
        return self.law.lead

    def untried(self, campaign: Campaign, kinds: Sequence[type[Effect]]) -> dict[str, list[type[Effect]]]:
        """Effects of a spring, if it is the servo of an actuator, and play, if gravity replaces a spring."""
        actuator, gone = self.law.actuator, dict[str, list[type[Effect]]]()
        if actuator is not None and actuator.servo[1] != 0.0:
            gone[OF_GEAR] = [kind for kind in kinds if issubclass(kind, Backlash)]
            gone[_OF_SERVO] = [kind for kind in kinds if kind.on_spring and not issubclass(kind, Backlash)]
        elif self.law.hangs:
            gone[_OF_GEAR] = [kind for kind in kinds if issubclass(kind, Backlash)]
        left = [kind for kind in kinds if not any(kind in some for some in gone.values())]
        return gone | super().untried(campaign, left)

    def refuse(self, campaign: Campaign) -> None:
        """Refuse driven runs of rates, and free runs of a joint without a restoring moment.

        Raises:
            TunnelError: for the first such run.
        """
        if campaign.driven and campaign.sensor.derivative:
            raise TunnelError(
                "the run is driven and its sensor reads rates, which do not determine the position of the model's "
                "joint",
                where=f"{campaign.name}, run '{campaign.driven_runs[0].id}'",
                remedy="record the angle, or leave --model out",
            )
        free = [run.id for run in campaign.decays]
        if self.law.stiffness == 0.0 and free:
            raise TunnelError(
                f"the joint of the model has no restoring moment, and {', '.join(free)} have no input",
                where=campaign.name,
                remedy="leave these runs out, or add a spring or gravity to the model",
            )
        super().refuse(campaign)

    def possible_leads(self) -> tuple[float, ...]:
        """Zero, a quarter and half of the model's step, s; empty if the model has no step."""
        return tuple(0.5 * self.law.step * share for share in (0.0, 0.5, 1.0)) if self.law.step else ()

    def with_lead(self, lead: float) -> NominalModel:
        """This model with another lead, s."""
        return replace(self, law=replace(self.law, lead=lead))

    def gain_words(self) -> str:
        """The gain of the actuator, in a sentence."""
        actuator = self.law.actuator
        if actuator is None:
            return ""
        said = f"gives {actuator.gain:.5g} N m per unit of control"
        return f"By the model, actuator {one_line(actuator.name)!r} {said}."

    def lead_words(self, change: Similarity) -> tuple[str, ...]:
        """The lead of the motion, in a sentence."""
        if self.law.lead == 0.0:
            return ()
        lead, step = (1e3 * change.own(value, "s") for value in (self.law.lead, self.law.step))
        return (
            f"The motion leads its input by {lead:.2g} ms. MuJoCo's first-order integrators cause a lead of up to "
            f"half the step of {step:.3g} ms, so it is subtracted and is not a cause.",
        )

    def spring(self, values: Mapping[str, float], run: RunData) -> float:
        """The slope of the law, plus the fitted stiffness."""
        return super().spring(values, run) + values.get("added_stiffness", 0.0)


@dataclass(frozen=True)
class Joint(_OfLaw, SpringModel):
    """A joint with a restoring moment in its law."""

    coefficient_units: ClassVar[Mapping[str, str]] = {
        **LooseBody.coefficient_units, **SpringModel.coefficient_units,
    }  # fmt: skip

    def starts(self, data: PreparedRuns) -> Iterator[FitStart]:
        """For driven runs, which may lack a resonance, first by the response to a moment; then as for a rig."""
        if data.driven and not self.own_zeros:
            yield self._driven_start(data)
            yield self._start(data, Shown.of(data))
        else:
            yield from super().starts(data)

    def _driven_start(self, data: PreparedRuns) -> FitStart:
        """Start for driven runs; the readings count as positions of the joint."""
        law = self.law
        found = filter(None, map(ShownResponse.of, data.runs))
        shown = [(one.inertia, one.rate) for one in found if one.scale * one.gain > 0.0]
        inertia, loss = np.median(shown, axis=0).tolist() if shown else (law.inertia, 0.0)
        damping = max(2.0 * loss * inertia, law.damping)
        own = [
            {
                "release_angle": float(np.mean(r.reading[:3]) - law.rest),
                "release_rate": float((r.reading[_FEW] - r.reading[0]) / (_FEW * r.interval)),
            }
            for r in data.runs
        ]
        return FitStart({"yaw_inertia": inertia, "mechanical_damping": damping, "zero": law.rest}, own)

    def tells(self, info: ParameterInfo, swing: float) -> bool:
        """If gravity alone restores the joint, its rest is inseparable from the sensor's zero."""
        del swing
        return not (info.beside_spring and self.law.hangs and "zero" not in self.held)

    def coefficient_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """The free inertia, damping and stiffness, then the aerodynamic derivatives."""
        own = (name for name in LooseBody.coefficient_units if name in names)
        return *own, *SpringModel.coefficient_units

    def unseen(self, data: PreparedRuns) -> Sequence[str]:
        """The limits of a single spring."""
        if data.driven:
            return ("structural as opposed to viscous damping: the joint has one stiffness",)
        return super().unseen(data)

    @property
    def unseen_scale(self) -> str:
        """The clause on a common scale that driven runs cannot show."""
        return "a scale of the input moment as opposed to a scale of the inertia and all moments of the model"


@dataclass(frozen=True)
class ServoJoint(Joint):
    """A joint with a position servo of fitted kp, which acts with the angle and with the command.

    Args:
        kp: kp of the model, N m/rad.
        held_at: position of the joint at its rest, rad, if the servo carries a moment against gravity.
    """

    kp: float = field(kw_only=True)
    held_at: float = field(kw_only=True)

    coefficient_units: ClassVar[Mapping[str, str]] = {"servo_kp": "N m/rad", **Joint.coefficient_units}

    def similar(self, change: Similarity) -> NominalModel:
        """The joint and the kp of the similar campaign."""
        return replace(super().similar(change), kp=change.similar(self.kp, "N m/rad"))  # type: ignore[call-arg]

    def inertial(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The joint's parameters, and the kp."""
        return *super().inertial(data), Parameter("servo_kp", "N m/rad", lower=0.0, size=self.kp)

    def spring(self, values: Mapping[str, float], run: RunData) -> float:
        """Stiffness of the spring with the fitted kp instead of the model's, N m/rad."""
        return super().spring(values, run) + values["servo_kp"] - self.kp

    def settings(self, values: Mapping[str, Array], runs: Sequence[RunData]) -> SettingsTable:
        """The physics of several runs: commands act with the kp, and with a smaller kp the joint hangs lower."""
        table = super().settings(values, runs)
        for place, kp in enumerate(values["servo_kp"].tolist()):
            drive = table.drive[place]
            if drive is not None:
                offset = drive.offset - (kp - self.kp) * self.held_at
                table.drive[place] = replace(drive, scale=drive.scale * kp / self.kp, offset=offset)
        return table

    def starts(self, data: PreparedRuns) -> Iterator[FitStart]:
        """Starts at the model's kp."""
        for start in super().starts(data):
            yield replace(start, common={**start.common, "servo_kp": self.kp})

    def coefficient_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """The coefficients, the kp first."""
        return "servo_kp", *super().coefficient_names(names)


@dataclass(frozen=True)
class LooseJoint(_OfLaw, LooseBody):
    """A driven joint without a restoring moment."""

    @property
    def held(self) -> Mapping[str, float]:
        """A constant moment replaces the rest angle."""
        return {name: value for name, value in self.law.held.items() if name != "zero"}


def recorded(campaign: Campaign, actuator: str | None = None) -> Recorded:
    """The recorded motion of a joint: its range, and whether a control drives it.

    Args:
        actuator: name of the actuator; None: the only one of the joint.
    """
    from tunnel_sim.engine.joint_model import Recorded  # imported here because MuJoCo is slow to load

    controlled = bool(campaign.driven_by("drive", "command_rad"))
    if not campaign.driven or campaign.sensor.derivative:  # driven runs of rates are refused later
        return Recorded(reach(campaign), 0.0 if campaign.driven else None, controlled, actuator)
    means = [np.nanmean(run.record.yaw_rad) for run in campaign.runs]
    middle = float(np.median(means))  # similar campaigns subtract it
    far = max(float(np.nanmax(np.abs(run.record.yaw_rad - middle))) for run in campaign.runs)
    return Recorded(far, middle, controlled, actuator)


def with_law(campaign: Campaign, law: JointLaw) -> tuple[Campaign, NominalModel]:
    """The campaign with a joint's law in place of a spring, and its nominal model.

    The runs state the stiffness at rest, and a control has the gain of the model's actuator.

    Raises:
        TunnelError: when the runs state more than one spring, a reference size is missing for a run with wind,
            or an input cannot belong to the joint.
    """
    springs = {run.spring_stiffness for run in campaign.runs} - {None}
    if len(springs) > 1:
        raise TunnelError(
            f"the runs state {len(springs)} springs, and a model has one",
            where="--model",
            remedy="diagnose the runs of each spring separately",
        )
    rig = campaign.rig
    if campaign.in_wind and None in (rig.frontal_area, rig.reference_length):
        raise TunnelError(
            "runs with a wind speed need the rig's sizes beside the model",
            where="--model",
            remedy="state frontal_area and reference_length under [rig] in campaign.toml",
        )
    runs = tuple(
        replace(run, spring_stiffness=law.stiffness, drive=run.drive and _of_joint(run, run.drive, law))
        for run in campaign.runs
    )
    if campaign.sensor.motion == DISPLACEMENT.motion and not law.slide:
        what = "the records are of a displacement, and the joint of the model is a hinge"
        raise TunnelError(what, where="--model", remedy="name a slide, or leave motion out of [sensor]")
    sensor = replace(campaign.sensor, motion=DISPLACEMENT.motion if law.slide else None)
    found = replace(campaign, sensor=sensor, runs=runs, law=law)
    if "gain" in law.free and law.actuator is not None:
        return found, ServoJoint(law=law, kp=-law.actuator.servo[1], held_at=law.rest)
    return found, (LooseJoint if found.unrestrained else Joint)(law=law)


def _as_control(drive: Input, actuator: Actuator, where: str) -> Input:
    """The command of a position servo as the control of its actuator.

    Raises:
        TunnelError: when the actuator does not hold the joint at the commanded position.
    """
    kp, said = -actuator.servo[1], f"actuator {one_line(actuator.name)!r}"
    if not kp > 0.0:
        what = f"the input is command_rad, but {said} does not hold a position"
        raise TunnelError(what, where=where, remedy="name the position actuator, or name the input drive")
    return Input("drive", drive.values * (kp / actuator.gain), drive.hold)


def _of_joint(run: Run, drive: Input, law: JointLaw) -> Input:
    """The input of a run with the gain of the joint's actuator; refused where the actuator could not follow it."""
    where, actuator = f"run {run.id}", law.actuator
    if drive.column == "base_rad":
        what, remedy = "the joint of a model has no moving root", "name the input moment_nm or drive"
        raise TunnelError(f"{what}, and the input is base_rad", where=where, remedy=remedy)
    if drive.kind.of_base:
        what = f"the base of a model's joint is fixed, but the input is {drive.column}"
        remedy = "diagnose without the model, or record the moment of the base's motion as moment_nm"
        raise TunnelError(what, where=where, remedy=remedy)
    if drive.column == "moment_nm":
        return drive
    if actuator is None:
        if drive.gain is None:
            what = f"the model has no actuator of the joint for the column {drive.column}"
            raise TunnelError(
                what, where=where, remedy="add it to the model, state drive_gain, or give moment_nm"
            )
        return drive
    named = f"actuator {one_line(actuator.name)!r}"
    if drive.column == "command_rad":
        drive = _as_control(drive, actuator, where)
    if drive.gain is not None and abs(drive.gain - actuator.gain) > _SAME_GAIN * abs(actuator.gain):
        what = f"drive_gain = {drive.gain:g} is stated, but {named} gives {actuator.gain:g} N m per unit of control"
        raise TunnelError(
            what, where=where, remedy="leave drive_gain out, or correct gear and gain of the model"
        )
    moments = actuator.gain * drive.values + actuator.servo[0] + actuator.servo[1] * run.record.yaw_rad
    for values, (low, high), name, unit in (
        (drive.values, actuator.control, "control", "of its ctrlrange"),
        (moments, actuator.moment, "moment", "N m of its force range"),
    ):
        slack = _SAME_GAIN * max(abs(low), abs(high))
        far = values[np.argmax(np.maximum(values - high, low - values))]
        if not low - slack <= far <= high + slack:
            what = f"the {name} of {named} reaches {far:.4g}, outside {low:.4g} to {high:.4g} {unit}"
            remedy = (
                "correct the range or the unit of the input, or leave out the run: clipping is not diagnosed"
            )
            raise TunnelError(what, where=where, remedy=remedy)
    return replace(drive, gain=actuator.gain)
