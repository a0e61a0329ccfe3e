"""The slips that the examination looks for, in their order."""

from __future__ import annotations

import numpy as np

from identification.examination.slips.base import RecordSlip, SlipEvidence, StatementSlip
from identification.examination.slips.compared_labels import (
    InertiaOffTheSprings,
    LabelsExchanged,
    SpringOffTheLine,
    SpringsRenumbered,
)
from identification.examination.slips.factors import WrongFactor
from identification.examination.slips.instruments import CoupledSensor, DriftingClock
from identification.examination.slips.odd_sensors import (
    AngleInDegrees,
    MirroredRun,
    OddGain,
    OddNoise,
    ReleaseOnTheOtherSide,
)
from identification.examination.slips.run_labels import WrongLabel, WrongLabels
from identification.examination.slips.spoilt_records import (
    ClockJumps,
    ConstantTail,
    RepeatedRecord,
    ResolutionTooCoarse,
    StandingForMissing,
    StuckReading,
    WrappedAngle,
)
from identification.examination.slips.statements import (
    EqualStatementsDiffer,
    InertiaOfNoBody,
    MotionGrows,
    WindExchanged,
    WindNotSeen,
    YawMomentTooLarge,
)
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign

#: Slips to be found in the records as given.
RECORD_SLIPS: tuple[RecordSlip, ...] = (
    StandingForMissing(),
    ClockJumps(),
    RepeatedRecord(),
    WrappedAngle(),
    ResolutionTooCoarse(),
    ConstantTail(),
    StuckReading(),
)

#: Slips to be found in the measured oscillations; the search ends at the first refusal.
STATEMENT_SLIPS: tuple[StatementSlip, ...] = (
    MotionGrows(),
    AngleInDegrees(),
    OddGain(),
    OddNoise(),
    SpringsRenumbered(),
    WrongFactor(),
    WrongLabel(),
    WrongLabels(),
    LabelsExchanged(),
    EqualStatementsDiffer(),
    WindExchanged(),
    CoupledSensor(),
    DriftingClock(),
    MirroredRun(),
    WindNotSeen(),
    YawMomentTooLarge(),
    SpringOffTheLine(),
    InertiaOffTheSprings(),
    InertiaOfNoBody(),
    ReleaseOnTheOtherSide(),
)


def mended(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """A campaign without the faults of its records, and the changes made; up to the first refusal."""
    remarks: tuple[Remark, ...] = ()
    with np.errstate(all="ignore"):  # readings may have any size; methods refuse values too large to square
        for slip in RECORD_SLIPS:
            campaign, said = slip.mend(campaign)
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
                said = slip.find(evidence)
            except np.linalg.LinAlgError:  # values too far apart to be compared
                continue
            remarks += said
            if any(remark.outcome is Outcome.REFUSED for remark in said):
                return said
    return remarks
