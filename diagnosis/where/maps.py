"""Data of a diagnosis' figures: plain arrays, small enough to be part of its JSON, in the units of the campaign."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagnosis.likelihood.nondimensional import Similarity
from diagnosis.where.backbone import Backbone
from diagnosis.where.excess import BandExcess, Profile, ResidualLine
from diagnosis.where.phase_plane import PhasePlane
from tunnel_sim.vocabulary.record import Array

_DIGITS = 5  # significant: more than any figure shows


@dataclass(frozen=True)
class RunMap:
    """One run in the map of runs.

    Args:
        id: of the run.
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
        runs: how many.
        excess: mean over the runs, a ratio.
        std: its standard deviation where there is no gap, a ratio.
    """

    by: str
    label: str
    runs: int
    excess: float
    std: float


@dataclass(frozen=True, eq=False)
class Trace:
    """One run against time: what was measured, and what the models leave of it.

    What a model predicts is the reading minus its residual.

    Args:
        id: of the run.
        time: s, shape (n,); without the times at which the record has no sample.
        reading: means of the reading as it is fitted, shape (n,), rad.
        before: residuals of the nominal model, shape (n,), rad.
        after: residuals with the causes added, shape (n,), rad; None where nothing was added.
        noise_std: of one value, rad.
        differ: the few cycles in which the models differ most, s; where nothing was added, in which the nominal
            model misses most.
    """

    id: str
    time: Array
    reading: Array
    before: Array
    after: Array | None
    noise_std: float
    differ: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Grid:
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
        runs: by run.
        groups: by condition.
        time: excess over time since the start of the record, s.
        time_by_run: mean excess by run (rows) and bin of time (columns), shape (runs, n); NaN after a run's end.
        moment_time: energy of the apparent moment by bin of ``time``, shape (n,), as shares of the whole.
        amplitude: excess over the amplitude of the motion, rad.
        frequency: excess over frequency, Hz.
        frequency_by_run: mean excess by run and bin of frequency, shape (runs, n); NaN where a bin is empty.
        frequency_after: mean by bin with the causes added, shape of ``frequency.mean``; None where not added.
        resonance: least and greatest frequency of the runs' free motion, Hz.
        bands: the residual by multiples of the runs' own frequency.
        lines: narrow lines.
        backbones: by run.
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
    traces: tuple[Trace, ...]
    grid: Grid
    unit: str = "rad"

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name with their units, in JSON's types; null where a bin is empty."""
        after = self.frequency_after
        return {
            "runs": [_run(run) for run in self.runs],
            "groups": [vars(group) for group in self.groups],
            "time": {
                "edges_s": numbers(self.time.edges),
                "excess": numbers(self.time.mean),
                "std": numbers(self.time.std),
                "by_run": [numbers(row) for row in self.time_by_run],
                "moment_share": numbers(self.moment_time),
            },
            "amplitude": _profile(self.amplitude, "edges_rad"),
            "frequency": {
                **_profile(self.frequency, "edges_hz"),
                "after": None if after is None else numbers(after),
                "by_run": [numbers(row) for row in self.frequency_by_run],
                "resonance_hz": list(self.resonance),
            },
            "bands": [vars(band) for band in self.bands],
            "lines": [
                {
                    "run": line.run,
                    "frequency_hz": line.frequency,
                    "share": line.share,
                    "amplitude_rad": line.amplitude,
                }
                for line in self.lines
            ],
            "backbones": [_backbone(curve) for curve in self.backbones],
            "phase_plane": None if self.phase_plane is None else _plane(self.phase_plane),
            "grid": _grid(self.grid),
            "unit": self.unit,
            "traces": [_trace(trace) for trace in self.traces],
        }


def numbers(values: Array) -> list[float | None]:
    """An array as JSON's numbers.

    Args:
        values: of any shape, flattened, shape (n,).

    Returns:
        Five significant digits each; None for what is not finite.
    """
    return [float(f"{v:.{_DIGITS}g}") if np.isfinite(v) else None for v in np.ravel(values).tolist()]


def _profile(values: Profile, edges: str) -> dict[str, Any]:
    return {edges: numbers(values.edges), "excess": numbers(values.mean), "std": numbers(values.std)}


def _run(run: RunMap) -> dict[str, Any]:
    return {
        "id": run.id,
        "spring_stiffness": run.spring_stiffness,
        "wind_speed": run.wind_speed,
        "amplitude_rad": run.amplitude,
        "frequency_hz": run.frequency,
        "excess": run.excess,
        "std": run.std,
        "p_value": run.p_value,
        "share": run.share,
    }


def _backbone(curve: Backbone) -> dict[str, Any]:
    return {
        "id": curve.id,
        "time_s": numbers(curve.time),
        "amplitude_rad": numbers(curve.amplitude),
        "frequency_hz": [float(f"{v:.8g}") for v in curve.frequency],
        "frequency_std": numbers(curve.frequency_std),
        "zeta": [float(f"{v:.8g}") for v in curve.zeta],
        "zeta_std": numbers(curve.zeta_std),
        "nominal_frequency_hz": curve.nominal_frequency,
        "nominal_zeta": curve.nominal_zeta,
        "alone_frequency_hz": curve.alone_frequency,
        "alone_zeta": curve.alone_zeta,
        "alone_excess": curve.alone_excess,
    }


def _plane(plane: PhasePlane) -> dict[str, Any]:
    return {
        "edges_rad": numbers(plane.edges),
        "moment": [numbers(row) for row in plane.moment],
        "std": [numbers(row) for row in plane.std],
        "by_angle": numbers(plane.by_angle),
        "by_angle_std": numbers(plane.by_angle_std),
        "by_rate": numbers(plane.by_rate),
        "by_rate_std": numbers(plane.by_rate_std),
        "unit": plane.unit,
        "runs": list(plane.runs),
    }


def _grid(grid: Grid) -> dict[str, Any]:
    return {
        "amplitude_edges_rad": numbers(grid.amplitude),
        "wind_speeds": None if grid.speeds is None else numbers(grid.speeds),
        "time_edges_s": None if grid.time is None else numbers(grid.time),
        "excess": [numbers(row) for row in grid.excess],
        "std": [numbers(row) for row in grid.std],
    }


def _trace(trace: Trace) -> dict[str, Any]:
    return {
        "id": trace.id,
        "time_s": numbers(trace.time),
        "reading_rad": numbers(trace.reading),
        "before_rad": numbers(trace.before),
        "after_rad": None if trace.after is None else numbers(trace.after),
        "noise_std_rad": trace.noise_std,
        "differ_s": list(trace.differ),
    }


def maps_in_own_units(maps: Maps, similarity: Similarity) -> Maps:
    """The maps with the times, frequencies, stiffnesses and moments of the measured rig.

    Args:
        maps: of the similar campaign.
        similarity: how that was made.

    Returns:
        The same maps in the measured campaign's units.
    """

    def hertz(value: float) -> float:
        return similarity.own(value, "Hz")

    def known(value: float | None, unit: str) -> float | None:
        return None if value is None else similarity.own(value, unit)

    runs = (
        replace(run, frequency=hertz(run.frequency), spring_stiffness=known(run.spring_stiffness, "N m/rad"))
        for run in maps.runs
    )
    plane, grid = maps.phase_plane, maps.grid
    return replace(
        maps,
        runs=tuple(runs),
        time=_own_profile(maps.time, similarity.own(1.0, "s")),
        frequency=_own_profile(maps.frequency, similarity.own(1.0, "Hz")),
        resonance=(hertz(maps.resonance[0]), hertz(maps.resonance[1])),
        lines=tuple(replace(line, frequency=hertz(line.frequency)) for line in maps.lines),
        backbones=tuple(_own_backbone(curve, similarity) for curve in maps.backbones),
        phase_plane=None if plane is None else _own_plane(plane, similarity.own(1.0, plane.unit)),
        grid=replace(grid, time=None if grid.time is None else _times(grid.time, similarity)),
        traces=tuple(trace_in_own_units(trace, similarity) for trace in maps.traces),
    )


def _times(values: Array, similarity: Similarity) -> Array:
    return values * similarity.own(1.0, "s")


def trace_in_own_units(trace: Trace, similarity: Similarity) -> Trace:
    """A trace with the times and readings of the measured rig.

    Args:
        trace: of the similar campaign.
        similarity: how that was made.
    """
    factor = similarity.own(1.0, similarity.reading)
    return replace(
        trace,
        time=_times(trace.time, similarity),
        reading=trace.reading * factor + similarity.rest,
        before=trace.before * factor,
        after=None if trace.after is None else trace.after * factor,
        noise_std=trace.noise_std * factor,
        differ=(similarity.own(trace.differ[0], "s"), similarity.own(trace.differ[1], "s")),
    )


def _own_profile(given: Profile, factor: float) -> Profile:
    return replace(given, edges=given.edges * factor)


def _own_backbone(curve: Backbone, similarity: Similarity) -> Backbone:
    hertz = similarity.own(1.0, "Hz")
    alone = curve.alone_frequency
    return replace(
        curve,
        time=_times(curve.time, similarity),
        frequency=curve.frequency * hertz,
        frequency_std=curve.frequency_std * hertz,
        nominal_frequency=curve.nominal_frequency * hertz,
        alone_frequency=None if alone is None else alone * hertz,
    )


def _own_plane(plane: PhasePlane, factor: float) -> PhasePlane:
    return replace(
        plane,
        moment=plane.moment * factor,
        std=plane.std * factor,
        by_angle=plane.by_angle * factor,
        by_angle_std=plane.by_angle_std * factor,
        by_rate=plane.by_rate * factor,
        by_rate_std=plane.by_rate_std * factor,
    )
