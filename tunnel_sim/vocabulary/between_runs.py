"""Differences between the runs of a campaign: statements on them, and their draws in a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

USUAL_SCATTER: Mapping[str, float] = {
    "wind_speed": 0.003,  # a good tunnel keeps its speed to some tenths of a per cent
    "spring_stiffness": 0.0005,  # a spring clamped again repeats to some hundredths of a per cent
    "mechanical_damping": 0.01,  # bearings and cables repeat to a per cent
}
"""Quantities that may differ between runs, with the usual relative standard deviation in a rig."""

SCATTERED = tuple(USUAL_SCATTER)
"""These quantities, in the order of a campaign's ``[repeatability]``."""

WIDEST_SCATTER = 0.2
"""Maximum relative standard deviation between runs: a deviation that reverses the sign is five times as large."""

LARGEST_DRIFT = 0.5
"""Maximum relative change from the first to the last run, to either side: a larger one is another spring or
speed."""


@dataclass(frozen=True)
class Repeatability:
    """The experimenter's statement on the scatter between runs, as one standard deviation each; None: not stated.

    Args:
        wind_speed: of the true speed about the stated one, a fraction of it.
        spring_stiffness: of the true stiffness about the stated one, a fraction of it.
        mechanical_damping: of the mechanical damping about its mean, a fraction of it.
    """

    wind_speed: float | None = None
    spring_stiffness: float | None = None
    mechanical_damping: float | None = None

    def __post_init__(self) -> None:
        """Refuse a number that is not a standard deviation of a positive quantity."""
        for name, value in vars(self).items():
            if value is not None and not (_number(value) and 0.0 <= value < 1.0):
                raise TunnelError(
                    f"{name} = {value!r} is not a relative standard deviation",
                    where="repeatability",
                    remedy="give a number from 0 to below 1, such as 0.003 for 0.3 %",
                )

    @property
    def stated(self) -> dict[str, float]:
        """The stated values, by name, dimensionless."""
        return {name: value for name, value in vars(self).items() if value is not None}


@dataclass(frozen=True)
class Scatter:
    """Differences between the runs of a simulated campaign, which its labels do not show.

    Args:
        wind_speed, spring_stiffness, mechanical_damping: standard deviation between runs, a fraction of each.
        zero: standard deviation of the sensor's zero between runs, rad.
        spring_stiffness_drift, wind_speed_drift_between_runs: change from the first to the last run, in
            proportion to the number of the run, a fraction of each.
    """

    wind_speed: float = 0.0
    spring_stiffness: float = 0.0
    mechanical_damping: float = 0.0
    zero: float = 0.0
    spring_stiffness_drift: float = 0.0
    wind_speed_drift_between_runs: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a number out of range."""
        ranges = {name: (0.0, WIDEST_SCATTER, "a fraction") for name in SCATTERED}
        ranges |= {name: (-LARGEST_DRIFT, LARGEST_DRIFT, "a fraction") for name in self._drifts.values()}
        ranges["zero"] = (0.0, 1.0, "rad")
        for name, (low, high, unit) in ranges.items():
            value = getattr(self, name)
            if not (_number(value) and low <= value <= high):
                remedy = f"give a number from {low:g} to {high:g}, {unit}"
                raise TunnelError(f"{name} = {value!r} is out of range", where="scatter", remedy=remedy)

    @property
    def _drifts(self) -> dict[str, str]:
        """The drift of each property that drifts."""
        return {"spring_stiffness": "spring_stiffness_drift", "wind_speed": "wind_speed_drift_between_runs"}

    @property
    def stated(self) -> dict[str, float]:
        """The nonzero values, by name, dimensionless, and rad for ``zero``."""
        return {name: float(value) for name, value in vars(self).items() if value != 0.0}

    def deviations(self, rng: np.random.Generator, share: Array) -> list[dict[str, float]]:
        """Draw the deviations of runs; the first runs' deviations do not depend on the number of runs.

        Args:
            share: position of each run from the first to the last, 0 to 1, shape (runs,), a fraction.

        Returns:
            By run, the deviation of every property that scatters or drifts: relative, and rad for ``zero``.
        """
        found = []
        for along in share.tolist():
            own, run = rng.standard_normal(len(SCATTERED) + 1).tolist(), dict[str, float]()
            for name, deviate in zip((*SCATTERED, "zero"), own, strict=True):
                scattered, drift = getattr(self, name) * deviate, 0.0
                if name in self._drifts:
                    drift = getattr(self, self._drifts[name]) * along
                if getattr(self, name) or (name in self._drifts and getattr(self, self._drifts[name])):
                    run[name] = together(scattered, drift)
            found.append(run)
        return found


_APART = 2**32 - 1


def between_runs(seed: np.random.SeedSequence) -> np.random.Generator:
    """The generator of the scatter, apart from those spawned from the same seed, whose draws do not change."""
    key = (*seed.spawn_key, _APART)
    return np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=key))


def together(one: float, other: float) -> float:
    """The sum of two deviations; exact if one of them is zero.

    Args:
        one: relative, dimensionless.
        other: relative, dimensionless.
    """
    return one + other + one * other


def along(runs: int) -> Array:
    """Position of each run from the first to the last, from 0 to 1, shape (runs,), a fraction; 0 for a single run.

    Args:
        runs: number of runs.
    """
    return np.arange(runs) / max(1, runs - 1)


def _number(value: object) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and abs(value) < 1e300
        and isfinite(value)
    )
