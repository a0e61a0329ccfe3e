"""A gap in the units that people use: root mean square beyond the noise in degrees, and over the swing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from identification.printing import significant


@dataclass(frozen=True)
class Misfit:
    """What turns an excess into a misfit.

    Args:
        noise: standard deviation of one sample's noise, against which excesses are measured, in ``unit``.
        swing: root mean square of the readings about the mean of each run, in ``unit``.
        unit: of the readings: ``rad``, ``rad/s`` or ``rad/s2``.
    """

    noise: float
    swing: float
    unit: str

    def rms(self, excess: float) -> float:
        """Root mean square of what a model leaves beyond the noise.

        Args:
            excess: in noise variances of a sample; below zero it is chance.

        Returns:
            In ``unit``.
        """
        return self.noise * math.sqrt(max(excess, 0.0))


def unit_shown(unit: str) -> tuple[str, float]:
    """The unit in which readings are shown to people.

    Args:
        unit: of the readings: ``rad``, ``rad/s`` or ``rad/s2``.

    Returns:
        Its mark, and the factor on values in ``unit``.
    """
    return {"rad": "°", "rad/s": "°/s", "rad/s2": "°/s²"}[unit], math.degrees(1.0)


def misfit_of(document: Mapping[str, Any]) -> Misfit | None:
    """The misfit of a diagnosis' document; None where it has none, as a document of an earlier version."""
    given = document["gap"].get("misfit")
    return None if given is None else Misfit(given["noise"], given["swing"], given["unit"])


def rms_shown(misfit: Misfit, excess: float) -> str:
    """A misfit to three digits, such as ``0.134°``.

    Args:
        excess: in noise variances of a sample, a ratio.
    """
    mark, factor = unit_shown(misfit.unit)
    value = factor * misfit.rms(excess)
    return f"{significant(value, 3) if value else '0'}{mark if mark == '°' else f' {mark}'}"


def of_swing(misfit: Misfit, excess: float) -> str:
    """A misfit as a share of the swing in words, such as ``2.1 % of the swing``.

    Args:
        excess: in noise variances of a sample, a ratio.
    """
    share = 100.0 * misfit.rms(excess) / misfit.swing if misfit.swing > 0.0 else 0.0
    return f"{significant(share, 2) if share else '0'} % of the swing"
