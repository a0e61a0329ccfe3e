"""The place of a gap as facts."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.facts.found import Nowhere, PlaceFound
from diagnosis.result import Where
from diagnosis.settings import Settings
from diagnosis.where.excess import bands_beyond_chance
from diagnosis.where.place import Place
from diagnosis.where.survey import Survey
from tunnel_sim.effects import Effect


def nowhere(found: Survey, *, within_step: bool) -> Nowhere:
    """The residuals of a campaign without a gap.

    Args:
        within_step: whether the residual is not white, but within the steps of the readings.
    """
    count = len(found.maps.runs)
    return Nowhere(count, min(1.0, count * min(run.p_value for run in found.maps.runs)), within_step)


def described(where: Where, place: Place, compared: Sequence[type[Effect]], settings: Settings) -> PlaceFound:
    """The facts about a place.

    Args:
        compared: causes that have to agree with it.
    """
    maps, chosen = place.survey.maps, settings.words
    length, greatest = float(maps.time.edges[-1]), float(maps.amplitude.edges[-1])
    wide = {"time_s": chosen.interval_located * length, "amplitude_rad": chosen.interval_located * greatest}
    intervals = {
        "time_s": where.time_s, "amplitude_rad": where.amplitude_rad, "frequency_hz": where.frequency_hz,
    }  # fmt: skip
    beyond = bands_beyond_chance(maps.bands, settings.where)
    whole = sum(max(band.excess, 0.0) for band in maps.bands)
    shown = [b for b in maps.bands if b.band in beyond and b.excess > chosen.band_listed * whole]
    return PlaceFound(
        runs=len(maps.runs),
        share=sum(run.share for run in maps.runs if run.id in where.runs),
        false_alarm_rate=settings.where.run_rate,
        wind={group.label: group.excess for group in maps.groups if group.by == "wind"},
        narrow=tuple(
            name
            for name, ends in intervals.items()
            if ends is not None and (name not in wide or ends[1] - ends[0] < wide[name])
        ),
        bands={band.band: band.excess / whole for band in shown} if whole > 0.0 else {},
        channel=place.channel.reason,
        condition=place.condition.reason,
        compared=tuple(kind.name for kind in compared),
        agrees=any(where.channel in (kind.channel, *kind.resembles) for kind in compared),
    )
