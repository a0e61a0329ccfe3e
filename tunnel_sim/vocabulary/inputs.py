"""The input of a driven run at the samples of its record, and the checks that refuse bad inputs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tunnel_sim.vocabulary.columns import read_only_column
from tunnel_sim.vocabulary.errors import TunnelError, one_of
from tunnel_sim.vocabulary.input_kinds import INPUT_COLUMNS, INPUTS, InputColumn, InputKind
from tunnel_sim.vocabulary.record import Array, Record

Hold = Literal["zero", "linear"]
"""Whether the input keeps its value between samples, or is linear."""

HOLDS: tuple[Hold, ...] = ("zero", "linear")
"""The holds, by order: 0 and 1."""

INPUT_KEYS = ("drive_hold", "drive_gain", "servo_kv")
"""The keys of a run that state its input."""

_CONSTANT = 1e-9  # share of the largest value within which an input is constant
_ITSELF = 1e-7  # share of the variance by which an input must differ from every multiple of the response
_FLAT = 3  # equal extreme values in a row that a clipped input has
_CLIPPED = 0.01  # share of the samples at an extreme from which an input is clipped
_LEVELS = 0.6  # share of the samples at both extremes above which they are the levels of a square wave
_NEIGHBOURS = 5.0  # ratio of samples at the extreme to samples within a hundredth of the range of it


@dataclass(frozen=True, eq=False)
class Input:
    """The input of a run at the samples of its record.

    Args:
        column: column of a run file; it determines the kind of input (`INPUTS`).
        values: values at the times of the record, shape (n,), in the unit of the column.
        hold: hold between the samples; None: not stated, and assumed linear.
        gain: N m per unit, for kinds with a gain; for ``base_acceleration_m_s2`` mass times arm, kg m. None if
            it is not stated.
        servo_kv: for ``command_rad``, the servo's damping against the ground, N m s/rad; None if it is not
            stated. The servo's kp is the stiffness of the run's spring.
    """

    column: InputColumn
    values: Array
    hold: Hold | None = None
    gain: float | None = None
    servo_kv: float | None = None

    def __post_init__(self) -> None:
        """Copy the values, check that they are numbers, and make them read-only."""
        object.__setattr__(self, "values", read_only_column(self.values, self.column, "Input"))

    @property
    def stated(self) -> dict[str, float | str | None]:
        """The stated properties by the key of the format (`INPUT_KEYS`), in its units; None: not stated."""
        return {"drive_hold": self.hold, "drive_gain": self.gain, "servo_kv": self.servo_kv}

    @property
    def held(self) -> bool:
        """Whether the input keeps its value between samples; else it is linear."""
        return self.hold == "zero"

    @property
    def kind(self) -> InputKind:
        """The kind of input."""
        return INPUTS[self.column]

    @property
    def on_body(self) -> bool:
        """Whether it is a moment on the body; else it acts through the spring."""
        return not self.kind.of_spring

    @property
    def gain_stated(self) -> bool:
        """Whether its moment on the body follows from the run's statements, without an inertia or a fitted gain."""
        return self.kind.gain(self.gain, 1.0) is not None


def checked_input(drive: Input, record: Record, where: str, *, judged: bool = True) -> None:
    """Refuse an input that cannot belong to its record; if ``judged``, also an input that looks clipped."""
    values, name = drive.values, drive.column
    if values.shape != record.yaw_rad.shape:
        what = f"the input {name} has {values.size} samples, the record {record.yaw_rad.size}"
        remedy = "give the input at the times of the record, one value for each sample"
        raise TunnelError(what, where=where, remedy=remedy)
    if not np.isfinite(values).all():
        remedy = "give all its values"
        raise TunnelError(f"the input {name} contains NaN or an infinity", where=where, remedy=remedy)
    span = float(np.ptp(values))
    if span <= _CONSTANT * float(np.abs(values).max()):
        remedy = f"leave the column out if the run is a free decay, or record what drives it in {name}"
        raise TunnelError(f"the input {name} is constant", where=where, remedy=remedy)
    x, y = values - values.mean(), record.yaw_rad - record.yaw_rad.mean()
    alike = float(x @ y) ** 2 / max(float(x @ x) * float(y @ y), 1e-300)
    if 1.0 - alike < _ITSELF:
        what = f"the input {name} is proportional to the response"
        remedy = f"record what drives the body in {name}, not the sensor's reading"
        raise TunnelError(what, where=where, remedy=remedy)
    ends = (float(values.min()), float(values.max()))
    between = (values[1:] != ends[0]) & (values[1:] != ends[1])
    if not judged or between.mean() < 1.0 - _LEVELS:
        return
    if (
        np.mean((values[1:] == values[:-1])[between]) > 0.5
    ):  # it stays at every level, not only at the extremes
        return
    # A clipped input is often at an extreme for several samples, and seldom near it.
    for end in ends:
        there = values == end
        count = int(np.count_nonzero(there))
        near = int(np.count_nonzero(np.abs(values - end) < 0.01 * span)) - count
        flat = there[2:] & there[1:-1] & there[:-2]
        stands = int(np.count_nonzero(flat)) * _FLAT > count
        if count > max(_CLIPPED * values.size, _FLAT) and stands and count > _NEIGHBOURS * max(near, 1):
            raise TunnelError(
                f"the input {name} saturates: {_CLIPPED:.0%} or more of the record is at its extreme value",
                where=where,
                remedy="record the input in a wider range; where the actuator itself saturates, state "
                "plausible = false under [sensor] to keep it",
            )


def refuse_untreated(
    drive: Input,
    spring_stiffness: float | None,
    quantity: Literal["angle", "rate", "acceleration"],
    where: str,
    *,
    wind_on: bool = False,
) -> None:
    """Refuse an input with which no driven run can be identified or diagnosed.

    Args:
        spring_stiffness: stated stiffness, N m/rad; None if not stated.
        quantity: quantity that the sensor measures.
        wind_on: whether the wind blows.
    """
    kind = drive.kind
    remedy = "state the spring's stiffness, or name the input moment_nm or drive"
    what = ""
    if spring_stiffness == 0.0 and "servo_kv" in kind.keys:
        what = "the command acts through the servo, whose kp is spring_stiffness, which is 0"
        remedy = "state the kp of the servo as spring_stiffness, or leave spring_stiffness out"
    elif spring_stiffness == 0.0 and not drive.on_body:
        what = "the motion of the root acts through the spring, but spring_stiffness is 0"
    elif spring_stiffness == 0.0 and kind.by_inertia:
        what = "without a spring, a turning base does not determine a moment in N m"
        remedy = "leave the run out, or drive the body by a moment"
    elif kind.of_base and wind_on:
        what = "a shaken base is not supported with the wind on"
        remedy = "shake the base with the wind off, or leave the run out"
    elif quantity == "acceleration":  # it jumps with a held input
        what, remedy = "the run is driven, and its sensor reads accelerations", "record the angle or its rate"
    elif quantity == "rate" and spring_stiffness == 0.0:
        what = "in a driven run without a spring, the zero of a rate sensor looks like a constant moment"
        remedy = "record the angle"
    if what:
        raise TunnelError(what, where=where, remedy=remedy)


def refuse_several_gains(drives: Iterable[Input], where: str) -> None:
    """Refuse inputs of several columns with unknown gains: one gain is fitted, common to the runs."""
    columns = sorted({one.column for one in drives if one.kind.takes_gain and one.gain is None})
    if len(columns) > 1:
        raise TunnelError(
            f"the gains of {' and '.join(columns)} are unknown, but the fit has one common gain",
            where=where,
            remedy="state drive_gain of one of them, or take the runs of each input separately",
        )


def without_spring_needs_input(spring_stiffness: float | None, drive: Input | None, where: str) -> None:
    """Refuse a run with neither a spring nor an input.

    Args:
        spring_stiffness: stated stiffness, N m/rad; None if not stated.
    """
    if spring_stiffness == 0.0 and drive is None:
        raise TunnelError(
            "'spring_stiffness' = 0 is not greater than 0, and only a driven run may have no spring",
            where=where,
            remedy="give spring_stiffness as a positive number in N m/rad, or the run file an input column "
            f"{one_of(INPUT_COLUMNS)}",
        )
