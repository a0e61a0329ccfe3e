"""Data of the figures of a diagnosis, small enough to be part of its JSON, in the measured rig's units.

An excess is the mean squared residual over the noise variance, minus one, a ratio.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, is_dataclass, replace
from typing import Any

import numpy as np

from diagnosis.where.along_motion import Backbone, PhasePlane
from diagnosis.where.excess import BandExcess, ResidualLine
from tunnel_sim.files.from_json import Row, Rows

_DIGITS = 5  # significant digits: more than any figure shows
# the same for values shown as differences from the nominal model
_DIGITS_OF_BACKBONE = {"frequency_hz": 8, "zeta": 8}


@dataclass(frozen=True)
class RunMap:
    """One run in the map of runs.

    Args:
        spring_stiffness: stated stiffness, N m/rad; None in normalised form.
        wind_speed: stated wind speed, m/s.
        id: id of the run.
        amplitude_rad: amplitude at the start of the record, rad.
        frequency_hz: frequency of the free motion in the nominal model, Hz.
        excess: excess of the nominal model.
        std: standard deviation of the excess without a gap, a ratio.
        p_value: probability of as large an excess without a gap.
        share: of the campaign's excess, a fraction.
    """

    id: str
    spring_stiffness: float | None
    wind_speed: float
    amplitude_rad: float
    frequency_hz: float
    excess: float
    std: float
    p_value: float
    share: float


@dataclass(frozen=True)
class GroupExcess:
    """Runs that share a condition.

    Args:
        by: ``wind``, ``spring``, ``speed`` or ``amplitude``.
        label: the condition in words, with unit.
        runs: number of runs.
        excess: mean excess over the runs.
        std: standard deviation of the mean without a gap, a ratio.
    """

    by: str
    label: str
    runs: int
    excess: float
    std: float


@dataclass(frozen=True, eq=False)
class TimeExcess:
    """Excess over time, all runs together.

    Args:
        edges_s: edges of the bins, since the start of the record, shape (n + 1,), s.
        excess: mean excess by bin, shape (n,); NaN where a bin is empty.
        std: standard deviation of the mean without a gap, shape (n,).
        by_run: mean excess by run (rows) and bin (columns), shape (runs, n); NaN after a run's end.
        moment_share: energy of the apparent moment by bin, shape (n,), as shares of the whole.
    """

    edges_s: Row
    excess: Row
    std: Row
    by_run: Rows
    moment_share: Row


@dataclass(frozen=True, eq=False)
class AmplitudeExcess:
    """Excess over the amplitude of the motion, all runs together.

    Args:
        edges_rad: edges of the bins, shape (n + 1,), rad.
        excess: mean excess by bin, shape (n,); NaN where a bin is empty.
        std: standard deviation of the mean without a gap, shape (n,).
    """

    edges_rad: Row
    excess: Row
    std: Row


@dataclass(frozen=True, eq=False)
class ExcessSpectrum:
    """Excess over frequency, all runs together.

    Args:
        edges_hz: edges of the bins, shape (n + 1,), Hz.
        excess: mean excess by bin, shape (n,); NaN where a bin is empty.
        std: standard deviation of the mean without a gap, shape (n,).
        after: mean excess by bin with the causes added, shape (n,); None where no cause was added.
        by_run: mean excess by run (rows) and bin (columns), shape (runs, n); NaN where a bin is empty.
        resonance_hz: least and greatest frequency of the runs' free motion, Hz.
    """

    edges_hz: Row
    excess: Row
    std: Row
    after: Row | None
    by_run: Rows
    resonance_hz: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ExcessMap:
    """Excess by amplitude and by wind speed; by amplitude and time if the runs have one speed.

    Args:
        amplitude_edges_rad: edges of the rows, rad, shape (m + 1,).
        wind_speeds: wind speeds of the columns, m/s, shape (n,); None where the columns are times.
        time_edges_s: edges of the columns, since the start of the record, s, shape (n + 1,); None where they
            are speeds.
        excess: mean excess by cell, shape (m, n), in noise variances of a sample; NaN where a cell is empty.
        std: standard deviation of the mean without a gap, shape (m, n).
    """

    amplitude_edges_rad: Row
    wind_speeds: Row | None
    time_edges_s: Row | None
    excess: Rows
    std: Rows


@dataclass(frozen=True, eq=False)
class RunTrace:
    """One run against time: the readings and the residuals of the models, in the unit of the readings.

    A model's prediction is the reading minus its residual.

    Args:
        id: id of the run.
        time_s: times, s, shape (n,); without the times at which the record has no sample.
        reading_rad: means of the fitted reading, shape (n,).
        before_rad: residuals of the nominal model, shape (n,).
        after_rad: residuals with the causes added, shape (n,); None where no cause was added.
        noise_std_rad: noise of one value.
        differ_s: the few cycles in which the models differ most, s; without causes, the cycles in which the
            nominal model has its largest misfit.
    """

    id: str
    time_s: Row
    reading_rad: Row
    before_rad: Row
    after_rad: Row | None
    noise_std_rad: float
    differ_s: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Maps:
    """All maps of a campaign.

    Args:
        runs: every run, in the order of the campaign.
        groups: runs that share a condition; conditions that do not vary are left out.
        time: excess over time.
        amplitude: excess over the amplitude of the motion.
        frequency: excess over frequency.
        bands: the residual by multiples of the runs' own frequency.
        lines: narrow lines in the residuals of single runs.
        backbones: frequency and damping of every run by amplitude.
        phase_plane: missing moment by angle and rate; None if there is none.
        grid: excess by amplitude and speed, or amplitude and time.
        unit: unit of the readings and residuals.
        traces: every run against time, the largest excess first.
    """

    runs: tuple[RunMap, ...]
    groups: tuple[GroupExcess, ...]
    time: TimeExcess
    amplitude: AmplitudeExcess
    frequency: ExcessSpectrum
    bands: tuple[BandExcess, ...]
    lines: tuple[ResidualLine, ...]
    backbones: tuple[Backbone, ...]
    phase_plane: PhasePlane | None
    grid: ExcessMap
    unit: str
    traces: tuple[RunTrace, ...]

    @property
    def windy(self) -> bool:
        """Whether any run had wind."""
        return any(run.wind_speed > 0.0 for run in self.runs)

    @property
    def excess_std(self) -> float:
        """Standard deviation of the campaign's excess by chance, in noise variances."""
        return math.sqrt(sum(run.std**2 for run in self.runs)) / len(self.runs)

    def rounded(self) -> Maps:
        """The maps with the number of digits that a document has in its arrays."""
        return replace(self, **{name: _rounded(value) for name, value in vars(self).items()})

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, in JSON's types; null for NaN."""
        return {name: _plain(value) for name, value in vars(self).items()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Maps) and self.to_json_dict() == other.to_json_dict()


def _rounded(value: Any, digits: int = _DIGITS) -> Any:
    """A value with arrays of fewer digits."""
    if isinstance(value, np.ndarray):
        return np.array([float(f"{v:.{digits}g}") for v in value.ravel().tolist()]).reshape(value.shape)
    if is_dataclass(value) and not isinstance(value, type):
        digits_of = _DIGITS_OF_BACKBONE if isinstance(value, Backbone) else {}
        changed = {name: _rounded(one, digits_of.get(name, _DIGITS)) for name, one in vars(value).items()}
        return replace(value, **changed)
    return tuple(map(_rounded, value)) if isinstance(value, tuple) else value


def _plain(value: Any) -> Any:
    """A value in JSON's types: arrays and tuples as lists, dataclasses by field, None for NaN."""
    if isinstance(value, np.ndarray):
        found = value.astype(object)
        found[~np.isfinite(value)] = None
        return found.tolist()
    if is_dataclass(value):
        return {name: _plain(one) for name, one in vars(value).items()}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value
