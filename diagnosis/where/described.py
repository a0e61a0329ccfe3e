"""The place of a gap as facts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from diagnosis.model.fact import Fact
from diagnosis.settings import WhereSettings
from diagnosis.where.excess import bands_beyond_chance
from diagnosis.where.place import Place
from diagnosis.where.survey import Survey
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import AtRandom, SecondOscillation

PLACE_OVERRULED: Final = 0.99
"""Minimum share of the gap on held-out readings that the causes must explain for the place of the gap not to
contradict them. Judgement. Causes that predict all but a hundredth of the gap act at its place. Residuals of a
grossly wrong model may point to another place."""

INTERVAL_LOCATED: Final = 0.8
"""Maximum length of an interval, as a share of the range, for it to locate the gap. Judgement."""
BAND_LISTED: Final = 0.05
"""Minimum share of the excess in a band to be listed. Judgement."""


@dataclass(frozen=True)
class Where:
    """The place of the gap.

    Args:
        channel: ``stiffness``, ``damping``, ``forcing``, ``sensor`` or ``calibration``; None: nowhere.
        condition: ``always`` or ``wind_on``; None: nowhere.
        time_s: time in the runs at which most of it occurs, s.
        amplitude_rad: amplitudes at which most of it lies, rad.
        frequency_hz: frequencies at which most of it lies, Hz.
    """

    channel: str | None
    condition: str | None
    runs: tuple[str, ...] = ()
    time_s: tuple[float, float] | None = None
    amplitude_rad: tuple[float, float] | None = None
    frequency_hz: tuple[float, float] | None = None
    words: str = ""


BETWEEN_RUNS = ("frequency between runs", "damping between runs")
"""Kinds of reasons by which most of a gap is between the runs."""


@dataclass(frozen=True)
class PlaceFound:
    """The reasons for the place of a gap.

    Args:
        runs: number of the runs compared.
        share: share of the gap in the runs that show it, a fraction.
        false_alarm_rate: false-alarm rate of a gap in any run, all runs together, a fraction.
        wind: excess by state of the wind, ``on`` and ``off``, a ratio; empty without runs of both.
        narrow: the intervals that locate the gap: ``time_s``, ``amplitude_rad``, ``frequency_hz``.
        bands: share of the gap by band beyond chance, fractions.
        channel: the reason for the channel.
        condition: the reason for the condition.
        compared: all causes of the answer, to compare their channels with the place.
        agrees: whether any of them acts at the place, or its residual points there.
        alike: whether the residual of one points there, although none acts there.
        elsewhere: whether the place contradicts the causes: none of them acts there. Such an answer is not decided.
    """

    runs: int
    share: float
    false_alarm_rate: float
    wind: Mapping[str, float]
    narrow: tuple[str, ...]
    bands: Mapping[str, float]
    channel: Fact
    condition: Fact
    compared: tuple[str, ...] = ()
    agrees: bool = False
    alike: bool = False
    elsewhere: bool = False


@dataclass(frozen=True)
class Nowhere:
    """Residuals without a gap.

    Args:
        runs: number of the runs compared.
        p_value: p-value of the run that differs most, corrected for the number of runs.
        within_step: whether the residual is not white, but within the steps of the readings.
    """

    runs: int
    p_value: float
    within_step: bool


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
    chosen: WhereSettings,
    *,
    scattering: bool = False,
    explained: float = 0.0,
) -> PlaceFound:
    """The facts about a place.

    Args:
        compared: causes that should agree with the place.
        scattering: whether the runs differ from each other by chance in the answer.
        explained: share of the gap that the causes explain on held-out readings.
    """
    maps = place.survey.maps
    length, greatest = float(maps.time.edges_s[-1]), float(maps.amplitude.edges_rad[-1])
    wide = {"time_s": INTERVAL_LOCATED * length, "amplitude_rad": INTERVAL_LOCATED * greatest}
    intervals = {
        "time_s": where.time_s, "amplitude_rad": where.amplitude_rad, "frequency_hz": where.frequency_hz,
    }  # fmt: skip
    beyond = bands_beyond_chance(maps.bands, chosen)
    whole = sum(max(band.excess, 0.0) for band in maps.bands)
    shown = [b for b in maps.bands if b.band in beyond and b.excess > BAND_LISTED * whole]
    against = judged(where.channel, place.channel.reason.kind, compared, scattering=scattering)
    predicted = explained >= PLACE_OVERRULED and not any(issubclass(kind, AtRandom) for kind in compared)
    against = replace(against, elsewhere=against.elsewhere and not predicted)
    return PlaceFound(
        runs=len(maps.runs),
        share=sum(run.share for run in maps.runs if run.id in where.runs),
        false_alarm_rate=chosen.run_rate,
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
    """Comparison of the place with the causes; the verdict, the decision and the sentences on the place follow it.

    Args:
        agrees: whether any cause acts at the place, or its residual points there.
        alike: whether the residual of one points there, although none acts there.
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
        channel: the channel on which the gap acts; None: not known.
        reason: kind of the reason for the channel.
        compared: the causes; empty if none is named.
        scattering: whether the runs differ from each other by chance in the answer.
    """
    acting = {kind.channel for kind in compared}
    agrees = channel in acting | {
        one for kind in compared if issubclass(kind, SecondOscillation) for one in kind.resembles
    }
    by_chance = any(issubclass(kind, AtRandom) for kind in compared) and reason.endswith("along the decay")
    between = scattering and reason in BETWEEN_RUNS
    open_to_any = channel is None or "calibration" in acting or by_chance or between
    elsewhere = bool(compared) and not agrees and not open_to_any
    return Judgement(agrees, agrees and channel not in acting, elsewhere)
