"""The slips that the examination looks for, in their order."""

from __future__ import annotations

import numpy as np

from identification.examination.slips.base import RecordSlip, SlipEvidence, StatementSlip
from identification.examination.slips.compared_labels import (
    inertia_off_the_springs,
    labels_exchanged,
    spring_off_the_line,
    springs_renumbered,
)
from identification.examination.slips.factors import wrong_factor
from identification.examination.slips.instruments import coupled_sensor, drifting_clock
from identification.examination.slips.odd_sensors import (
    angle_in_degrees,
    mirrored_run,
    odd_gain,
    odd_noise,
    release_on_the_other_side,
)
from identification.examination.slips.run_labels import wrong_label, wrong_labels
from identification.examination.slips.spoilt_records import (
    clock_jumps,
    code_for_missing,
    constant_tail,
    repeated_record,
    resolution_too_coarse,
    stuck_reading,
    wrapped_angle,
)
from identification.examination.slips.statements import (
    equal_statements_differ,
    inertia_of_no_body,
    motion_grows,
    wind_exchanged,
    wind_not_seen,
    yaw_moment_too_large,
)
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign

#: Slips to be found in the records as given.
RECORD_SLIPS: tuple[RecordSlip, ...] = (
    code_for_missing,
    clock_jumps,
    repeated_record,
    wrapped_angle,
    resolution_too_coarse,
    constant_tail,
    stuck_reading,
)

#: Slips to be found in the measured oscillations; the search ends at the first refusal.
STATEMENT_SLIPS: tuple[StatementSlip, ...] = (
    motion_grows,
    angle_in_degrees,
    odd_gain,
    odd_noise,
    springs_renumbered,
    wrong_factor,
    wrong_label,
    wrong_labels,
    labels_exchanged,
    equal_statements_differ,
    wind_exchanged,
    coupled_sensor,
    drifting_clock,
    mirrored_run,
    wind_not_seen,
    yaw_moment_too_large,
    spring_off_the_line,
    inertia_off_the_springs,
    inertia_of_no_body,
    release_on_the_other_side,
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
    remarks: tuple[Remark, ...] = ()
    with np.errstate(all="ignore"):
        for slip in STATEMENT_SLIPS:
            try:
                said = slip(evidence)
            except np.linalg.LinAlgError:  # values too far apart to be compared
                continue
            remarks += said
            if any(remark.outcome is Outcome.REFUSED for remark in said):
                return said
    return remarks
