"""What a gap is measured with: the noise, and how far MuJoCo confirms the fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Confirmation:
    """How far the fits' integrator and the MuJoCo model agree on what is reported.

    Args:
        agrees: whether every run's difference is within the tolerance, and MuJoCo could predict them all.
        largest_difference: of any block mean of any run, rad.
        run: id of the run that is closest to its tolerance, or farthest beyond it.
        rms_difference: root mean square of that run's differences, rad.
        tolerance: of it, a tenth of a block mean's noise, rad.
        failure: why MuJoCo could not predict the runs; empty where it did.
    """

    agrees: bool
    largest_difference: float
    run: str
    rms_difference: float
    tolerance: float
    failure: str = ""

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with units in their names."""
        names = {name: f"{name}_rad" for name in ("largest_difference", "rms_difference", "tolerance")}
        return {"model": "mujoco", **{names.get(name, name): value for name, value in vars(self).items()}}


@dataclass(frozen=True)
class NoiseSummary:
    """The noise the gap is measured against.

    Args:
        std: of one sample, quantisation included, rad.
        stated_std: likewise as the campaign states it, rad; None where it does not.
        source: ``stated``, ``estimated`` or ``floor``: whose ``std`` is; the floor is the accuracy of the fits.
        reason: for it, in words; empty until they are written.
    """

    std: float
    stated_std: float | None
    source: str
    reason: str = ""
