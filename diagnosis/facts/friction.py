"""Friction against rate, as a curve with a band and as points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tunnel_sim.files.writing import as_json


@dataclass(frozen=True)
class FrictionPoint:
    """The friction of the strokes of similar rates, from their energy losses.

    Args:
        rate_rad_s: mean over the distance, rad/s.
        moment: mean of the strokes, in the unit of the curve.
        std: its standard error by their scatter, in that unit.
        strokes: their number.
    """

    rate_rad_s: float
    moment: float
    std: float
    strokes: int


@dataclass(frozen=True)
class FrictionCurve:
    """The friction of an effect against the rate.

    Args:
        effect: its name.
        unit: of the moments: N m, or rad/s² per unit inertia.
        rate_rad_s: ascending, rad/s.
        moment: of the fitted law, at these rates, in the unit.
        std: its standard deviation by the covariance of the fit, in the unit.
        points: by the energy balance, of ascending rates; none where the records give none.
        per_load: further friction per moment carried by the joint, dimensionless; law and points are without it.
    """

    effect: str
    unit: str
    rate_rad_s: tuple[float, ...]
    moment: tuple[float, ...]
    std: tuple[float, ...]
    points: tuple[FrictionPoint, ...] = ()
    per_load: float = 0.0

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, in JSON's types."""
        return {name: as_json(value) for name, value in vars(self).items()}
