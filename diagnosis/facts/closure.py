"""The size of a gap, its measure, and the share that each cause explains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnosis.facts.reading import from_json_fields
from tunnel_sim.files.writing import as_json

ON_RUNS = "on held-out runs"
ON_STRETCHES = "on held-out stretches of time"
ON_BOTH = f"{ON_RUNS}, and on stretches of time where a run is the only one of its kind"
FITTED = "in the fitted runs (none could be held out)"
"""The readings on which a gap before and after is measured, as in the document."""


@dataclass(frozen=True)
class Misfit:
    """Conversion from an excess to a misfit.

    Args:
        noise: standard deviation of one sample's noise, against which excesses are measured, in ``unit``.
        swing: root mean square of the readings about the mean of each run, in ``unit``.
        unit: of the readings: ``rad``, ``rad/s`` or ``rad/s2``.
    """

    noise: float
    swing: float
    unit: str

    def rms(self, excess: float) -> float:
        """Root mean square in ``unit`` of an excess in noise variances of a sample; below zero it is chance."""
        return self.noise * math.sqrt(max(excess, 0.0))

    def of_swing(self, excess: float) -> float | None:
        """The same as a share of the swing; None where the readings do not move."""
        return self.rms(excess) / self.swing if self.swing > 0.0 else None


def share_closed(before: float, after: float) -> float:
    """Explained share of a gap, 0 to 1.

    Args:
        before: excess of the nominal model, in noise variances of a sample.
        after: excess with the causes, in noise variances of a sample.
    """
    return min(max(1.0 - max(after, 0.0) / before, 0.0), 1.0) if before > 0.0 else 0.0


@dataclass(frozen=True)
class Step:
    """The model with one more cause.

    Args:
        effect: name of the cause added; None for the nominal model.
        excess: with it and all causes before it, on held-out readings, in noise variances of a sample.
    """

    effect: str | None
    excess: float


@dataclass(frozen=True)
class Waterfall:
    """The residual gap as the causes are added one after another.

    Args:
        steps: the nominal model first; then the cause that closes most, and so on.
        without: held-out excess by cause, with only that cause removed and the others refitted. A cause beside a
            random moment has none: the random moment would absorb it.
    """

    steps: tuple[Step, ...] = ()
    without: Mapping[str, float] = field(default_factory=dict)
    held_out: str = ""

    def to_json_dict(self) -> dict[str, Any]:
        """The fields of a document: ``waterfall``, ``waterfall_on`` and ``without``."""
        return {
            "waterfall": as_json(self.steps),
            "waterfall_on": self.held_out,
            "without": dict(self.without),
        }

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, from a whole document."""
        return {"steps": data["waterfall"], "without": data["without"], "held_out": data["waterfall_on"]}


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

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with units in their names."""
        written = {_WITH_UNIT.get(name, name): value for name, value in vars(self).items()}
        return {"model": "mujoco", **written}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, without units in their names."""
        own = {written: name for name, written in _WITH_UNIT.items()}
        return {own.get(key, key): value for key, value in data.items()}


_WITH_UNIT = {name: f"{name}_rad" for name in ("largest_difference", "rms_difference", "tolerance")}


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
