"""The findings of the examination of a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError


class Outcome(Enum):
    """The consequence of a remark. Listed from the gravest to the least."""

    REFUSED = "refused"
    LEFT_OUT = "left out"
    CUT = "cut"
    NOTED = "noted"


@dataclass(frozen=True)
class Remark:
    """One thing found in the records before the estimation.

    Args:
        outcome: whether the campaign is refused, the runs are left out or cut, or nothing is done.
        runs: ids of the runs it concerns.
        figures: numbers behind it, by name, in JSON's types; units in their names.
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

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; the figures where there are any."""
        document = {
            "outcome": self.outcome.value,
            "runs": list(self.runs),
            "what": self.what,
            "remedy": self.remedy,
        }
        return document | ({"figures": dict(self.figures)} if self.figures else {})

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Remark:
        """The inverse of `to_json_dict`."""
        return cls(
            Outcome(data["outcome"]),
            tuple(map(str, data["runs"])),
            str(data["what"]),
            str(data["remedy"]),
            dict(data.get("figures", {})),
        )


@dataclass(frozen=True)
class Examined:
    """A campaign after its examination.

    Args:
        campaign: the runs to identify; the given campaign itself where nothing was left out or cut.
        remarks: what was found, in the order of the checks.
    """

    campaign: Campaign
    remarks: tuple[Remark, ...] = ()

    def accepted(self) -> Examined:
        """Return itself, unless the examination refuses the campaign.

        Raises:
            TunnelError: for the first remark that refuses it.
        """
        for remark in self.remarks:
            if remark.outcome is Outcome.REFUSED:
                word = "run" if len(remark.runs) == 1 else "runs"
                where = f"{self.campaign.name}, {word} {', '.join(remark.runs)}"
                raise TunnelError(remark.what, where=where, remedy=remark.remedy)
        return self
