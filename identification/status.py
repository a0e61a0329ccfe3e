"""The outcome of an estimate, in words that say what to do next."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """The outcome of an estimate; its text states the remedy. Listed from the gravest to none."""

    NO_RUN_IDENTIFIED = "no run could be identified: check that the records hold a free decay in radians"
    NOT_CONVERGED = "the fit did not converge: cut the record to the free decay, or lengthen it"
    NO_OSCILLATION = (
        "no decaying motion above the noise: check the sensor, or let the record start at the release"
    )
    NOT_DETERMINED = "the record does not determine frequency and damping: lengthen it, or sample it faster"
    TOO_FEW_CYCLES = (
        "fewer than the three cycles the networks need after the first zero crossing: lengthen the record, or use "
        "output_error"
    )
    OUTSIDE_TRAINING = (
        "damping or frequency outside the networks' training range: use output_error, or train others"
    )
    RUN_LEFT_OUT = "a run could not be identified and was left out: see the status of the runs"
    REPEATED_RUN = "the same samples as another run, counted once: leave the run out, or name its own file"
    MODEL_DEPARTS = "model departs from the data: run the diagnosis; the intervals are widened meanwhile"
    NOISE_DISAGREES = (
        "the noise is not what noise_std states: correct noise_std or leave it out; the residual's is used"
    )
    FEW_CYCLES = "fewer than three cycles: lengthen the record for windows and a firm damping"
    NO_STIFFNESS = "no spring_stiffness, so normalised form only (omega_n, zeta): state it in campaign.toml"
    INERTIA_NOT_POSITIVE = (
        "the frequencies contradict the stated springs, so no inertia: check which spring and wind speed each run "
        "states"
    )
    NO_WIND_ON = "no wind-on runs, so no cn_beta and cn_r: add runs with the wind on"
    NO_WIND_OFF_PAIR = (
        "a wind-on run has no wind-off run of its spring: record one with the wind off, or use output_error"
    )
    STIFFNESS_NOT_SEPARABLE = (
        "spring and air stiffness cannot be told apart: add a wind-off run or a second spring"
    )
    DAMPING_NOT_SEPARABLE = (
        "mechanical and air damping cannot be told apart: add a wind-off run or a second wind speed"
    )
    NO_REFERENCE_SIZE = (
        "no frontal_area or reference_length, so dimensional stiffness and damping per run only: "
        "state both under [rig]"
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
)
_GRAVITY = {status: rank for rank, status in enumerate(Status)}


def by_gravity(statuses: set[Status]) -> tuple[Status, ...]:
    """The statuses from the gravest to the least; OK alone where there is none.

    Args:
        statuses: what was met; OK need not be among them.

    Returns:
        At least one status.
    """
    return tuple(sorted(statuses - {Status.OK}, key=_GRAVITY.__getitem__)) or (Status.OK,)
