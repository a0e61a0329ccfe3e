"""Statements of several runs against one another: growing motion, exchanged labels, springs and inertia."""

from __future__ import annotations

from dataclasses import dataclass

from identification.examination.labels import (
    exchanged_labels,
    inertia_off_the_springs,
    springs_off_the_line,
    springs_renumbered,
)
from identification.examination.self_excited import growing_runs
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.status import Remark
from tunnel_sim.files.rig_file import load_rig


@dataclass(frozen=True)
class MotionGrows(StatementSlip):
    """Motion that grows with the wind off. Refused."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """As `growing_runs`."""
        return growing_runs(seen.swings)


@dataclass(frozen=True)
class LabelsExchanged(StatementSlip):
    """Springs or wind speeds of two runs, or of all runs of two settings, are exchanged. Refused."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """As `exchanged_labels`."""
        return exchanged_labels(seen.swings)


@dataclass(frozen=True)
class SpringsRenumbered(StatementSlip):
    """All springs are one number off, in the campaign's own order or in the packaged list. Refused."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """As `springs_renumbered`; not where the campaign states that its values are right."""
        if seen.campaign.sensor.plausible is False:
            return ()
        return springs_renumbered(seen.swings, lambda: list(load_rig().springs.values()))


@dataclass(frozen=True)
class SpringOffTheLine(StatementSlip):
    """A spring that, according to the others, is not as stiff as stated. Noted."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """As `springs_off_the_line`."""
        return springs_off_the_line(seen.swings)


@dataclass(frozen=True)
class InertiaOffTheSprings(StatementSlip):
    """A stated inertia that the springs contradict. Noted."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """As `inertia_off_the_springs`."""
        return inertia_off_the_springs(seen.swings, seen.campaign)
