"""Messages on a campaign: the outcome of an estimate with its remedy, and the remarks of the examination."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.campaign import Campaign


class Status(Enum):
    """The outcome of an estimate; its text states the remedy. Listed from the gravest to the least."""

    NO_RUN_IDENTIFIED = (
        "no run could be identified: check that the records hold a free decay, or the response to their input, in "
        "radians"
    )
    NOT_CONVERGED = (
        "the fit did not converge: cut a free record to its decay, check the input of a driven one, or lengthen "
        "the record"
    )
    NO_OSCILLATION = (
        "no decaying motion above the noise: check the sensor, start a free record at its release, or check the "
        "input of a driven one"
    )
    NOT_DETERMINED = "the record does not determine frequency and damping: lengthen it, or sample faster"
    TOO_FEW_CYCLES = (
        "fewer cycles than the networks need, three from the first zero crossing or four above the noise: lengthen "
        "the record, or use output_error"
    )
    OUTSIDE_TRAINING = "damping or frequency outside the networks' training range: use output_error"
    UNLIKE_TRAINING = "unlike anything the network was trained on: use output_error, and run the diagnosis"
    RUN_LEFT_OUT = "a run could not be identified and was left out: see the status of the runs"
    REPEATED_RUN = (
        "the same samples as another run, so counted once: remove the run, or correct its file name"
    )
    LIMIT_CYCLE = (
        "a limit cycle, which has no damping ratio: record its growth, or a decay at a lower wind speed"
    )
    AMBIENT_VIBRATION = (
        "ambient vibration: the motion comes and goes as under a random moment, and a fitted decay "
        "does not give its damping: use -e filter_error"
    )
    FREQUENCY_CHANGES = (
        "the frequency changes so much along the decay, as in a pendulum, that no single omega_n and zeta describe "
        "it; the intervals span the values of the windows: use the windows, record smaller swings, or run the "
        "diagnosis"
    )
    MODEL_DEPARTS = "the model does not explain the data, so the intervals are widened: run the diagnosis"
    NOISE_DISAGREES = (
        "the records contradict noise_std, so the residual's is used: correct or remove noise_std"
    )
    FEW_CYCLES = "fewer than three cycles: lengthen the record for windows and a reliable damping"
    NO_STIFFNESS = "no spring_stiffness, so only omega_n and zeta are given: state it in campaign.toml"
    INERTIA_NOT_POSITIVE = (
        "the motion contradicts the stated springs or moments, so no inertia is given: check the spring and wind "
        "speed of each run, and the sign of its input"
    )
    NO_WIND_ON = "no wind-on runs, so cn_beta and cn_r are not given: add runs with the wind on"
    NO_WIND_OFF_PAIR = (
        "a wind-on run has no wind-off run with the same spring: record one, or use output_error"
    )
    STIFFNESS_NOT_SEPARABLE = (
        "spring and aerodynamic stiffness cannot be separated: add a wind-off run or a second spring"
    )
    DAMPING_NOT_SEPARABLE = (
        "mechanical and aerodynamic damping cannot be separated: add a wind-off run or a second wind speed"
    )
    COEFFICIENTS_WITHHELD = (
        "a value is in a wrong unit, so no coefficients are given: correct it as the note says, or state "
        "plausible = false under [sensor]"
    )
    NO_REFERENCE_SIZE = (
        "no frontal_area or reference_length, so the air's stiffness and damping are given per run, without "
        "coefficients: state both under [rig]"
    )
    OK = "identified"

    @property
    def failed(self) -> bool:
        """Whether there is no result at all."""
        return self in _FAILED


_FAILED = (
    Status.NO_RUN_IDENTIFIED,
    Status.NOT_CONVERGED,
    Status.NO_OSCILLATION,
    Status.NOT_DETERMINED,
    Status.TOO_FEW_CYCLES,
    Status.OUTSIDE_TRAINING,
    Status.UNLIKE_TRAINING,
)
_GRAVITY = {status: rank for rank, status in enumerate(Status)}


def by_severity(statuses: set[Status]) -> tuple[Status, ...]:
    """The statuses from the gravest to the least; OK alone if there are none."""
    return tuple(sorted(statuses - {Status.OK}, key=_GRAVITY.__getitem__)) or (Status.OK,)


class Outcome(Enum):
    """The consequence of a remark. Listed from the gravest to the least."""

    REFUSED = "refused"
    LEFT_OUT = "left out"
    CUT = "cut"
    NOTED = "noted"


WITHHOLDS = "withholds_coefficients"
"""Figure of a remark that withholds the coefficients: true or absent."""

SYSTEMATIC = "systematic"
"""Figure of a remark on runs that differ systematically: the words for the difference."""


@dataclass(frozen=True)
class Remark:
    """A finding in the records before the estimation.

    Args:
        outcome: whether the campaign is refused, the runs are left out or cut, or nothing is done.
        runs: ids of the runs concerned.
        figures: numbers behind the remark, by name, in JSON's types; units in their names.
    """

    outcome: Outcome
    runs: tuple[str, ...]
    what: str
    remedy: str
    figures: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        """The remark in one line: runs, what, remedy."""
        word = "run" if len(self.runs) == 1 else "runs"
        return f"{word} {', '.join(self.runs)}: {self.what}; {self.remedy}"

    @property
    def withholds(self) -> bool:
        """Whether the coefficients are withheld, because a value in a wrong unit makes them wrong by decades."""
        return bool(self.figures.get(WITHHOLDS))

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name, with the figures if there are any."""
        said = {"what": self.what, "remedy": self.remedy}
        document = {"outcome": self.outcome.value, "runs": list(self.runs), **said}
        return document | ({"figures": dict(self.figures)} if self.figures else {})

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Remark:
        """The inverse of `to_json_dict`."""
        outcome, runs, figures = (
            Outcome(data["outcome"]),
            tuple(map(str, data["runs"])),
            data.get("figures", {}),
        )
        return cls(outcome, runs, str(data["what"]), str(data["remedy"]), dict(figures))


def left_out_as_asked(ids: Collection[str]) -> tuple[Remark, ...]:
    """The remark on runs that the user left out; none if there are none."""
    if not ids:
        return ()
    remedy = f"repeat the run{'s' if len(ids) > 1 else ''}"
    return (Remark(Outcome.LEFT_OUT, tuple(ids), "left out on request", remedy),)


@dataclass(frozen=True)
class Examined:
    """A campaign after its examination.

    Args:
        campaign: the runs to identify; the given campaign itself if no run was left out or cut.
        remarks: the findings, in the order of the checks.
    """

    campaign: Campaign
    remarks: tuple[Remark, ...] = ()

    def accepted(self) -> Examined:
        """Return the examined campaign itself, unless the examination refuses it."""
        for remark in self.remarks:
            if remark.outcome is Outcome.REFUSED:
                word = "run" if len(remark.runs) == 1 else "runs"
                where = f"{self.campaign.name}, {word} {', '.join(remark.runs)}"
                raise TunnelError(remark.what, where=where, remedy=remark.remedy)
        return self
