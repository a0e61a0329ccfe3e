"""The place of a gap as facts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from diagnosis.facts.found import BETWEEN_RUNS, Nowhere, PlaceFound
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


def described(
    where: Where,
    place: Place,
    compared: Sequence[type[Effect]],
    settings: Settings,
    *,
    scattering: bool = False,
    explained: float = 0.0,
) -> PlaceFound:
    """The facts about a place.

    Args:
        compared: causes that have to agree with it.
        scattering: whether the runs differ from each other by chance in the answer.
        explained: share of the gap that they explain on held-out readings.
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
    against = judged(where.channel, place.channel.reason.kind, compared, scattering=scattering)
    predicted = explained >= settings.answer.place_overruled and not any(kind.random for kind in compared)
    against = replace(against, elsewhere=against.elsewhere and not predicted)
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
        **vars(against),
    )


@dataclass(frozen=True)
class Judgement:
    """The place against the causes: the verdict, the decision and the sentences on the place follow it.

    Args:
        agrees: whether any cause acts there, or its residual points there.
        alike: whether the residual of one points there, though none acts there.
        elsewhere: whether the place contradicts the causes.
    """

    agrees: bool
    alike: bool
    elsewhere: bool


def judged(
    channel: str | None, reason: str, compared: Sequence[type[Effect]], *, scattering: bool
) -> Judgement:
    """Judge causes by the place that the residuals show.

    A wrong stated value changes stiffness and damping alike, so no place contradicts it. Neither does a gap
    between runs contradict runs that differ from each other. A random moment shifts frequency and damping along the
    decay of every run by chance.

    Args:
        channel: on which the gap acts; None: not known.
        reason: its kind.
        compared: the causes; empty where none is named.
        scattering: whether the runs differ from each other by chance in the answer.
    """
    acting = {kind.channel for kind in compared}
    agrees = channel in acting | {one for kind in compared for one in kind.resembles}
    by_chance = any(kind.random for kind in compared) and reason.endswith("along the decay")
    between = scattering and reason in BETWEEN_RUNS
    open_to_any = channel is None or "calibration" in acting or by_chance or between
    elsewhere = bool(compared) and not agrees and not open_to_any
    return Judgement(agrees, agrees and channel not in acting, elsewhere)
