"""Data of a diagnosis' figures: plain arrays, small enough to be part of its JSON, in the measured rig's units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.where.along_motion import Backbone, PhasePlane
from diagnosis.where.excess import BandExcess, Profile, ResidualLine
from tunnel_sim.vocabulary.record import Array

_DIGITS = 5  # significant: more than any figure shows


@dataclass(frozen=True)
class RunMap:
    """One run in the map of runs.

    Args:
        spring_stiffness: stated, N m/rad; None in normalised form.
        wind_speed: stated, m/s.
        amplitude: at the start of the record, rad.
        frequency: of the free motion in the nominal model, Hz.
        excess: mean squared residual over the noise variance, minus one, a ratio.
        std: its standard deviation where there is no gap, a ratio.
        p_value: probability of as large an excess without a gap.
        share: of the campaign's excess, a fraction.
    """

    id: str
    spring_stiffness: float | None
    wind_speed: float
    amplitude: float
    frequency: float
    excess: float
    std: float
    p_value: float
    share: float


@dataclass(frozen=True)
class GroupExcess:
    """Runs that share a condition.

    Args:
        by: ``wind``, ``spring``, ``speed`` or ``amplitude``.
        label: in words, with unit.
        excess: mean over the runs, a ratio.
        std: its standard deviation where there is no gap, a ratio.
    """

    by: str
    label: str
    runs: int
    excess: float
    std: float


@dataclass(frozen=True, eq=False)
class RunTrace:
    """One run against time: the readings and the residuals of the models.

    A model's prediction is the reading minus its residual.

    Args:
        time: s, shape (n,); without the times at which the record has no sample.
        reading: means of the fitted reading, shape (n,), rad.
        before: residuals of the nominal model, shape (n,), rad.
        after: residuals with the causes added, shape (n,), rad; None where nothing was added.
        noise_std: of one value, rad.
        differ: the few cycles in which the models differ most, s; where nothing was added, in which the nominal
            model has its largest misfit.
    """

    id: str
    time: Array
    reading: Array
    before: Array
    after: Array | None
    noise_std: float
    differ: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ExcessMap:
    """Excess by amplitude and by wind speed, or by time where the runs have one speed.

    Args:
        amplitude: edges of the rows, rad, shape (m + 1,).
        speeds: of the columns, m/s, shape (n,); None where the columns are times.
        time: edges of the columns since the start of the record, s, shape (n + 1,); None where they are speeds.
        excess: mean by cell, shape (m, n), in noise variances of a sample; NaN where a cell is empty.
        std: of it where there is no gap, shape (m, n).
    """

    amplitude: Array
    speeds: Array | None
    time: Array | None
    excess: Array
    std: Array


@dataclass(frozen=True, eq=False)
class Maps:
    """All maps of a campaign.

    Args:
        time: excess over time since the start of the record, s.
        time_by_run: mean excess by run (rows) and bin of time (columns), shape (runs, n); NaN after a run's end.
        moment_time: energy of the apparent moment by bin of ``time``, shape (n,), as shares of the whole.
        amplitude: excess over the amplitude of the motion, rad.
        frequency: excess over frequency, Hz.
        frequency_by_run: mean excess by run and bin of frequency, shape (runs, n); NaN where a bin is empty.
        frequency_after: mean by bin with the causes added, shape of ``frequency.mean``; None where not added.
        resonance: least and greatest frequency of the runs' free motion, Hz.
        bands: the residual by multiples of the runs' own frequency.
        phase_plane: missing moment by angle and rate; None where there is none.
        traces: every run against time, the largest excess first.
        grid: excess by amplitude and speed, or amplitude and time.
        unit: of the readings and residuals.
    """

    runs: tuple[RunMap, ...]
    groups: tuple[GroupExcess, ...]
    time: Profile
    time_by_run: Array
    moment_time: Array
    amplitude: Profile
    frequency: Profile
    frequency_by_run: Array
    frequency_after: Array | None
    resonance: tuple[float, float]
    bands: tuple[BandExcess, ...]
    lines: tuple[ResidualLine, ...]
    backbones: tuple[Backbone, ...]
    phase_plane: PhasePlane | None
    traces: tuple[RunTrace, ...]
    grid: ExcessMap
    unit: str = "rad"

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name with their units, in JSON's types; null where a bin is empty."""
        return {
            "runs": [_fields(run, amplitude="amplitude_rad", frequency="frequency_hz") for run in self.runs],
            "groups": [vars(group) for group in self.groups],
            "time": {
                **_profile(self.time, "edges_s"),
                "by_run": _plain(self.time_by_run),
                "moment_share": _plain(self.moment_time),
            },
            "amplitude": _profile(self.amplitude, "edges_rad"),
            "frequency": {
                **_profile(self.frequency, "edges_hz"),
                "after": _plain(self.frequency_after),
                "by_run": _plain(self.frequency_by_run),
                "resonance_hz": list(self.resonance),
            },
            "bands": [vars(band) for band in self.bands],
            "lines": [
                _fields(line, frequency="frequency_hz", amplitude="amplitude_rad") for line in self.lines
            ],
            "backbones": [
                _fields(curve, **_OF_BACKBONE)
                | {
                    "frequency_hz": [float(f"{v:.8g}") for v in curve.frequency],
                    "zeta": [float(f"{v:.8g}") for v in curve.zeta],
                }
                for curve in self.backbones
            ],
            "phase_plane": None if self.phase_plane is None else _fields(self.phase_plane, edges="edges_rad"),
            "grid": _fields(
                self.grid, amplitude="amplitude_edges_rad", speeds="wind_speeds", time="time_edges_s"
            ),
            "unit": self.unit,
            "traces": [_fields(trace, **_OF_TRACE) for trace in self.traces],
        }


_OF_BACKBONE = {
    "time": "time_s", "amplitude": "amplitude_rad", "frequency": "frequency_hz",
    "nominal_frequency": "nominal_frequency_hz", "alone_frequency": "alone_frequency_hz",
}  # fmt: skip
_OF_TRACE = {
    "time": "time_s", "reading": "reading_rad", "before": "before_rad", "after": "after_rad",
    "noise_std": "noise_std_rad", "differ": "differ_s",
}  # fmt: skip


def _fields(value: object, **names: str) -> dict[str, Any]:
    """The fields of a dataclass in JSON's types; some under names with their units."""
    return {names.get(name, name): _plain(field) for name, field in vars(value).items()}


def _plain(value: Any) -> Any:
    """A field in JSON's types: arrays as lists, by row, of rounded numbers; None for values that are not finite."""
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return [_plain(row) for row in value]
    if isinstance(value, np.ndarray):
        return [float(f"{v:.{_DIGITS}g}") if np.isfinite(v) else None for v in value.tolist()]
    return list(value) if isinstance(value, tuple) else value


def _profile(values: Profile, edges: str) -> dict[str, Any]:
    return {edges: _plain(values.edges), "excess": _plain(values.mean), "std": _plain(values.std)}
