"""The size of a gap, its measure, and the share that each cause explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from diagnosis.findings.judged import Misfit
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.files.writing import as_json


@dataclass(frozen=True)
class RunGap:
    """A run's excess before and after the causes are added.

    Args:
        before: ratio of mean squared residual to noise variance, minus one, of the nominal model, predicted from
            the other runs where the run could be held out.
        after: the same ratio minus one with the causes added.
        held_out: whether the run could be held out; else both are those of the fits of all runs.
    """

    id: str
    before: float
    after: float
    held_out: bool = True


@dataclass(frozen=True)
class GapSummary:
    """The gap of the campaign.

    Args:
        excess_before: of the nominal model, in units of the noise variance, on held-out readings; where
            nothing is found, in the fitted runs.
        excess_after: with the causes added, on the same readings, in units of the noise variance.
        closed: share of the gap that is closed, 0 to 1.
        closed_on: the readings on which these are measured (`diagnosis.findings.closure`).
        false_alarm_rate: of the test of detection, a fraction of the campaigns without a gap.
        p_value: of the strongest test, corrected for the number of tests.
        tests: p-value by name of test.
        closed_ahead: share of the gap in the later half of driven runs that the causes explain, fitted to the
            earlier half; None where runs are held out whole, or are not driven.
    """

    detected: bool
    excess_before: float
    excess_after: float
    closed: float
    closed_on: str
    runs: tuple[RunGap, ...]
    false_alarm_rate: float
    p_value: float
    tests: Mapping[str, float] = field(default_factory=dict)
    misfit: Misfit | None = None
    closed_ahead: float | None = None

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name, and in ``misfit`` those of `Misfit` and the root mean squares before and after."""
        found = {name: as_json(getattr(self, name)) for name in self.__dataclass_fields__}
        if self.misfit is not None:
            before, after = self.misfit.rms(self.excess_before), self.misfit.rms(self.excess_after)
            found["misfit"] |= {"before": before, "after": after}
        return found


FITTED = "in the fitted runs (none could be held out)"
"""The readings on which a gap before and after is measured, as in the document."""


@dataclass(frozen=True)
class Confirmation:
    """Agreement of the fits' integrator and the MuJoCo model on the reported runs.

    Args:
        agrees: whether every run's difference is within the tolerance, and MuJoCo could predict them all.
        largest_difference: of any block mean of any run, rad.
        run: id of the run that is closest to its tolerance, or farthest beyond it.
        rms_difference: root mean square of that run's differences, rad.
        tolerance: of it, a tenth of a block mean's noise, rad.
        failure: why MuJoCo could not predict the runs; empty where it could.
    """

    agrees: bool
    largest_difference: float
    run: str
    rms_difference: float
    tolerance: float
    failure: str = ""

    def scaled(self, factor: float) -> Confirmation:
        """The same with all readings times a factor: from a similar rig's to the measured one's."""
        return replace(
            self,
            largest_difference=self.largest_difference * factor,
            rms_difference=self.rms_difference * factor,
            tolerance=self.tolerance * factor,
        )

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with units in their names."""
        written = {WITH_UNIT.get(name, name): value for name, value in vars(self).items()}
        return {"model": "mujoco", **written}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, without units in their names."""
        own = {written: name for name, written in WITH_UNIT.items()}
        return {own.get(key, key): value for key, value in data.items()}


WITH_UNIT = {name: f"{name}_rad" for name in ("largest_difference", "rms_difference", "tolerance")}


@dataclass(frozen=True)
class NoiseSummary:
    """The reference noise of the gap.

    Args:
        std: of one sample, quantisation included, rad.
        stated_std: of one sample, as stated by the campaign, rad; None where it is not stated.
        source: origin of ``std``: ``stated``, ``estimated`` or ``floor``, the accuracy of the fits.
        reason: for it, in words; empty until they are written.
    """

    std: float
    stated_std: float | None
    source: str
    reason: str = ""
