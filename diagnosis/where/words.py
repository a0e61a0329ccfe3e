"""Where a gap is, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from diagnosis.printing import part, plain
from diagnosis.result import Where
from diagnosis.settings import Settings
from diagnosis.where.place import Finding
from diagnosis.where.survey import Survey
from identification.printing import p_text
from tunnel_sim.effects import Effect

_BAND_WORDS = {
    "0": "slower than the oscillation",
    "f0": "at the oscillation itself",
    "2f0": "at twice its frequency",
    "3f0": "at three times its frequency",
    "above": "faster than its third harmonic",
}
_CHANNEL_WORDS = {
    "stiffness": "the restoring moment (stiffness)",
    "damping": "the damping",
    "forcing": "the rig as a moment that does not depend on its motion (forcing)",
    "sensor": "the reading of the sensor",
    "calibration": "a value stated for the runs (calibration)",
}
_CONDITION_WORDS = {"always": "with the wind on and off", "wind_on": "only with the wind on"}


def nowhere(found: Survey, *, within_step: bool) -> str:
    """The sentence for a campaign without a gap.

    Args:
        within_step: whether the residual is not white, but within the steps of the readings.
    """
    count = len(found.maps.runs)
    least = min(1.0, count * min(run.p_value for run in found.maps.runs))
    runs = f"Nowhere: in {count} {'run' if count == 1 else 'runs'} the residual is"
    chance = f"p {p_text(least)} for the run that differs most, corrected for their number"
    if within_step:
        return f"{runs} not white noise ({chance}), but within the steps of the readings."
    return f"{runs} consistent with the noise ({chance})."


def describe(
    where: Where,
    found: Survey,
    bands: tuple[str, ...],
    channel: Finding,
    condition: Finding,
    settings: Settings,
) -> str:
    """Where the gap is, in sentences; the bands are those that show it."""
    # which runs show the gap, and how much more of it is with the wind on or off
    count, rate, chosen = len(found.maps.runs), 100.0 * settings.where.run_rate, settings.words
    share = sum(run.share for run in found.maps.runs if run.id in where.runs)
    named = f" ({', '.join(where.runs)})" if len(where.runs) <= chosen.runs_listed else ""
    if not where.runs:
        text = (
            f"No single run is beyond chance (false-alarm rate {rate:.0f} % over all runs); "
            "the gap shows only in all of them together"
        )
    elif len(where.runs) == count:
        text = f"All {count} runs show the gap" if count > 1 else "The run shows the gap"
    elif len(where.runs) == 1:
        text = f"{100.0 * share:.0f} % of the gap is in one run of {count}{named}"
    else:
        text = f"{100.0 * share:.0f} % of the gap is in {len(where.runs)} of {count} runs{named}"
    groups = {group.label: group.excess for group in found.maps.groups if group.by == "wind"}
    if where.runs and len(groups) == 2:
        more, less = sorted(("on", "off"), key=lambda wind: -groups[wind])
        if groups[less] < chosen.one_wind * groups[more]:
            text += f"; nearly all of it with the wind {more}"
        else:
            ratio = groups[more] / groups[less]
            text += f"; {ratio:.2g} times as much power with the wind {more} as with it {less}"
    parts, places = [f"{text}."], []
    length, greatest = float(found.maps.time.edges[-1]), float(found.maps.amplitude.edges[-1])
    if where.time_s is not None and where.time_s[1] - where.time_s[0] < chosen.interval_located * length:
        places.append(f"between {where.time_s[0]:.1f} and {where.time_s[1]:.1f} s of the record")
    amplitude = where.amplitude_rad
    if amplitude is not None and amplitude[1] - amplitude[0] < chosen.interval_located * greatest:
        places.append(f"at amplitudes from {degrees(amplitude[0]):.2g}° to {degrees(amplitude[1]):.2g}°")
    if where.frequency_hz is not None:
        places.append(f"at {where.frequency_hz[0]:.2f} to {where.frequency_hz[1]:.2f} Hz")
    if places:
        parts.append(f"{part(settings.where.interval_share).capitalize()} of it lie {', '.join(places)}.")
    whole = sum(max(band.excess, 0.0) for band in found.maps.bands)
    shown = [b for b in found.maps.bands if b.band in bands and b.excess > chosen.band_listed * whole]
    if shown and whole > 0.0:
        shown.sort(key=lambda band: -band.excess)
        listed = (f"{100.0 * band.excess / whole:.0f} % {_BAND_WORDS[band.band]}" for band in shown)
        parts.append(f"By frequency: {', '.join(listed)}.")
    # without runs of both winds the condition goes unsaid
    both = any(group.by == "wind" for group in found.maps.groups)
    words = _CHANNEL_WORDS.get(channel.value or "")
    acts = f"It acts on {words}" if words else "What it acts on cannot be determined"
    if condition.value is None:
        parts.append(f"{acts}: {channel.reason}; {condition.reason}.")
    elif channel.reason == condition.reason:
        when = f", {_CONDITION_WORDS[condition.value]}" if both else ""
        parts.append(f"{acts}{when}, {channel.reason}.")
    else:
        parts.append(f"{acts}: {channel.reason}.")
        if both:
            parts.append(f"It is there {_CONDITION_WORDS[condition.value]}: {condition.reason}.")
    return " ".join(parts)


def agreement(where: Where, kinds: Sequence[type[Effect]]) -> str:
    """Whether causes act where the residuals say that the gap is; empty where there is nothing to compare."""
    if not kinds or where.channel is None:
        return ""
    names = plain(*(kind.name for kind in kinds))
    if any(where.channel in (kind.channel, *kind.resembles) for kind in kinds):
        return f"That agrees with {names}."
    acts = " and ".join(dict.fromkeys(_CHANNEL_WORDS[kind.channel] for kind in kinds))
    return f"That does not agree with {names}: {'they act' if len(kinds) > 1 else 'it acts'} on {acts}."
