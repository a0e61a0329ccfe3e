"""A value with its standard deviation and unit: the one type of an estimated number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray
    from pydantic import ConfigDict

INTERVAL = 1.959963984540054
"""Half the width of a 95 % interval of a normal distribution, in standard deviations."""
_FINITE: ConfigDict = {"allow_inf_nan": False}


class AsNumber:
    """A value that can be used as a number: by ``float`` and by NumPy."""

    value: float

    def __float__(self) -> float:
        """The value, in its unit."""
        return float(self.value)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The value as an array without dimensions."""
        import numpy as np  # not at the start of a command

        del copy  # it is always new
        return np.array(self.value, dtype=dtype)


@dataclass(frozen=True)
class Quantity(AsNumber):
    """A value with its standard deviation and unit; ``float`` and NumPy use its value.

    Args:
        value: estimate, in ``unit``.
        std: standard deviation, in ``unit``; 0 for a value that was given, not fitted; None if not known.
        unit: unit of both, SI, e.g. ``rad/s``; ``1`` if dimensionless.
        interval: ends of the central interval of 0.95, in ``unit``, if it differs from value ± 1.96 std; else
            None.
        bound: ``lower`` or ``upper`` if the fit ended at that end of the allowed range; ``std`` is then None.
        determined: whether the runs determine it; if not, ``value`` is meaningless and ``std`` is None.
        shares: shares of ``std`` squared by source, fractions; empty if not known.
    """

    __pydantic_config__ = _FINITE

    value: float
    std: float | None
    unit: str
    interval: tuple[float, float] | None = None
    bound: str | None = None
    determined: bool = True
    shares: Mapping[str, float] = field(default_factory=dict)

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the 95 % interval, in ``unit``; both the value if its standard deviation is not known."""
        reach = INTERVAL * (self.std or 0.0)
        return self.interval or (self.value - reach, self.value + reach)

    @property
    def reach(self) -> float:
        """Half the width of the 95 % interval, in ``unit``."""
        low, high = self.ends
        return 0.5 * (high - low)

    def agrees(self, value: float) -> bool:
        """Whether the 95 % interval contains a value, in ``unit``."""
        low, high = self.ends
        return low <= value <= high

    @property
    def known_std(self) -> float:
        """The standard deviation, in ``unit``; every quantity of an `Estimate` has one.

        Raises:
            ValueError: when it is not known, as for a coefficient that a diagnosis does not determine.
        """
        if self.std is None:
            raise ValueError(f"internal error: {self} has no standard deviation")
        return self.std

    def to_json_dict(self) -> dict[str, Any]:
        """Value, std, unit; shares, interval and bound if there are any; ``determined`` if it is false."""
        data: dict[str, Any] = {"value": self.value, "std": self.std, "unit": self.unit}
        if self.shares and self.std is not None:
            data["shares"] = dict(self.shares)
        if self.interval is not None and self.std is not None:
            data["interval"] = list(self.interval)
        if self.bound is not None:
            data["bound"] = self.bound
        return data if self.determined else data | {"determined": False}
