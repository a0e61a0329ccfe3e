"""Where the gap is, in fields and in words, and whether the causes act there."""

from __future__ import annotations

from dataclasses import replace

from diagnosis.attribution.decide import main_effect
from diagnosis.localisation.excess import bands_beyond_chance
from diagnosis.localisation.inference import blow_interval
from diagnosis.localisation.mapping import with_answer
from diagnosis.localisation.maps import Maps
from diagnosis.localisation.words import agreement, describe, nowhere
from diagnosis.policy import INTERVAL_SHARE
from diagnosis.result import Where
from diagnosis.study import Study, located
from tunnel_sim.effects import Effect, effect_class


def localise(study: Study) -> tuple[Where, Maps]:
    """Say where the nominal model departs from the runs.

    The place is that of the residuals alone. The causes only have to agree with it.

    Returns:
        The answer in fields and in words, and the maps it is read from.
    """
    place = located(study)
    found = place.survey
    answer = None if study.chosen is study.nominal else study.chosen
    maps = found.maps if answer is None else with_answer(found, study.campaign, study.nominal, answer)
    if not study.causes:
        return Where(None, None, words=nowhere(found)), maps
    where = Where(
        channel=place.channel.value,
        condition=place.condition.value,
        runs=place.runs,
        time_s=blow_interval(found, INTERVAL_SHARE) or found.maps.time.interval(),
        amplitude_rad=found.maps.amplitude.interval(),
        frequency_hz=found.frequency_interval,
    )
    bands = bands_beyond_chance(found.maps.bands)
    words = describe(where, found, bands, place.channel, place.condition)
    return replace(where, words=f"{words} {agreement(where, _compared(study))}".rstrip()), maps


def _compared(study: Study) -> list[type[Effect]]:
    """The causes that have to agree with the place: the main one, and those read off the records."""
    if not study.named:
        return []
    shares = {answer.effects: answer.share for answer in study.weighed}
    main = [main_effect(study.fitted, shares)] if study.fitted else []
    return [effect_class(name) for name in (*main, *study.read_off)]
