"""The slips that the examination looks for, in their order."""

from __future__ import annotations

import numpy as np

from identification.examination.slips import (
    compared_labels,
    factors,
    instruments,
    odd_sensors,
    run_labels,
    spoilt_records,
    statements,
)
from identification.examination.slips.base import RecordSlip, SlipEvidence, StatementSlip
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign

#: Slips to be found in the records as given.
RECORD_SLIPS: tuple[RecordSlip, ...] = (
    spoilt_records.code_for_missing,
    spoilt_records.clock_jumps,
    spoilt_records.repeated_record,
    spoilt_records.wrapped_angle,
    spoilt_records.resolution_too_coarse,
    spoilt_records.constant_tail,
    spoilt_records.stuck_reading,
)

#: Slips to be found in the measured oscillations; the search ends at the first refusal.
STATEMENT_SLIPS: tuple[StatementSlip, ...] = (
    statements.motion_grows,
    odd_sensors.angle_in_degrees,
    odd_sensors.odd_gain,
    odd_sensors.odd_noise,
    compared_labels.springs_renumbered,
    factors.wrong_factor,
    run_labels.wrong_label,
    run_labels.wrong_labels,
    compared_labels.labels_exchanged,
    statements.equal_statements_differ,
    statements.wind_exchanged,
    instruments.coupled_sensor,
    instruments.drifting_clock,
    odd_sensors.mirrored_run,
    statements.wind_not_seen,
    statements.yaw_moment_too_large,
    compared_labels.spring_off_the_line,
    compared_labels.inertia_off_the_springs,
    statements.inertia_of_no_body,
    odd_sensors.release_on_the_other_side,
)


def mended(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """A campaign without the faults of its records, and the changes made; up to the first refusal."""
    remarks: tuple[Remark, ...] = ()
    with np.errstate(all="ignore"):  # readings may have any size; methods refuse values too large to square
        for slip in RECORD_SLIPS:
            campaign, said = slip(campaign)
            remarks += said
            if any(remark.outcome is Outcome.REFUSED for remark in said):
                break
    return campaign, remarks


def found_in(evidence: SlipEvidence) -> tuple[Remark, ...]:
    """Remarks on the statements that the measured oscillations contradict; only the refusal if there is one."""
    remarks = []
    with np.errstate(all="ignore"):
        for slip in STATEMENT_SLIPS:
            try:
                said = slip(evidence)
            except np.linalg.LinAlgError:  # values too far apart to be compared
                continue
            if said is not None:
                remarks.append(said)
            if said is not None and said.outcome is Outcome.REFUSED:
                return (said,)
    return tuple(remarks)
