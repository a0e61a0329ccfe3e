"""Maps of the similar campaign in the units of the campaign that was measured."""

from __future__ import annotations

from dataclasses import replace

from diagnosis.fitting.similarity import Similarity
from diagnosis.localisation.backbone import Backbone
from diagnosis.localisation.excess import Profile
from diagnosis.localisation.maps import Maps, Trace
from diagnosis.localisation.phase_plane import PhasePlane
from tunnel_sim.vocabulary.record import Array


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
        time=_profile(maps.time, similarity.own(1.0, "s")),
        frequency=_profile(maps.frequency, similarity.own(1.0, "Hz")),
        resonance=(hertz(maps.resonance[0]), hertz(maps.resonance[1])),
        lines=tuple(replace(line, frequency=hertz(line.frequency)) for line in maps.lines),
        backbones=tuple(_backbone(curve, similarity) for curve in maps.backbones),
        phase_plane=None if plane is None else _plane(plane, similarity.own(1.0, plane.unit)),
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


def _profile(given: Profile, factor: float) -> Profile:
    return replace(given, edges=given.edges * factor)


def _backbone(curve: Backbone, similarity: Similarity) -> Backbone:
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


def _plane(plane: PhasePlane, factor: float) -> PhasePlane:
    return replace(
        plane,
        moment=plane.moment * factor,
        std=plane.std * factor,
        by_angle=plane.by_angle * factor,
        by_angle_std=plane.by_angle_std * factor,
        by_rate=plane.by_rate * factor,
        by_rate_std=plane.by_rate_std * factor,
    )
