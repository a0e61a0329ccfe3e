"""Where the gap is: which runs, when, at which amplitudes and frequencies, on which channel, and when."""

from __future__ import annotations

import dataclasses

import numpy as np

from diagnosis.detection.sensor_noise import campaign_noise
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.run_data import prepare
from diagnosis.localisation.excess import FALSE_ALARM_RATE, run_excesses, telling_bands
from diagnosis.localisation.inference import Finding, blow_interval, infer_channel, infer_condition
from diagnosis.localisation.mapping import Survey, survey
from diagnosis.localisation.maps import Maps
from diagnosis.localisation.words import describe, nowhere
from diagnosis.names import plain
from diagnosis.result import Where
from tunnel_sim.effects import ALL_EFFECTS, effect_class
from tunnel_sim.vocabulary.campaign import Campaign

_LITTLE = 0.1  # of the largest excess: runs with less are not named
_NAMES = frozenset(kind.name for kind in ALL_EFFECTS)


def localise(
    campaign: Campaign, nominal: Fit, best: Fit | None, causes: tuple[str, ...]
) -> tuple[Where, Maps]:
    """Say where the nominal model departs from the runs.

    Args:
        campaign: the records.
        nominal: fit of the nominal model.
        best: fit with the causes added; None where none was added.
        causes: effect names; empty: no gap; ``unknown``: an unexplained gap.

    Returns:
        The answer in fields and in words, and the maps it is read from.
    """
    scaled, ratio = _as_measured(campaign, nominal, causes)
    runs = telling_runs(campaign, scaled) if causes else ()
    found = survey(campaign, nominal, scaled, best, runs)
    if not causes:
        return Where(None, None, words=nowhere(found)), found.maps
    lead = _leading(causes, nominal, best, _mean_excess(scaled), ratio)
    condition, channel = _nature(campaign, nominal, causes, found, lead)
    where = Where(
        channel=channel.value,
        condition=condition.value,
        runs=runs,
        time_s=blow_interval(found, 0.8) or found.maps.time.interval(),
        amplitude_rad=found.maps.amplitude.interval(),
        frequency_hz=found.frequency_interval,
    )
    bands = telling_bands(found.maps.bands)
    return dataclasses.replace(where, words=describe(where, found, bands, channel, condition)), found.maps


def telling_runs(campaign: Campaign, fit: Fit) -> tuple[str, ...]:
    """The runs that show the gap.

    Args:
        campaign: the records.
        fit: of the nominal model.

    Returns:
        Those beyond chance (false-alarm rate 1 % over all of them) that have a tenth or more of the largest
        excess among them, in the campaign's order.
    """
    excesses = run_excesses(campaign, fit)
    clear = {run.id: run.excess for run in excesses if run.p_value() * len(excesses) < FALSE_ALARM_RATE}
    least = _LITTLE * max(clear.values(), default=0.0)
    return tuple(name for name, excess in clear.items() if excess > least)


def _as_measured(campaign: Campaign, nominal: Fit, causes: tuple[str, ...]) -> tuple[Fit, float]:
    """The fit with the residuals of the records as given, in units of the noise that counts.

    The fit may be of records from which hum was taken: here that is part of the gap. And a resolution coarser
    than stated raises the whole floor: against the noise found in the records there is nothing to see, so then
    the stated noise is the measure. Returns the fit and the ratio of its noise variance to the one that counts.
    """
    data = nominal.problem.data
    level = float(np.mean([run.noise_variance * run.block for run in data.runs]))
    coarse = any(effect_class(name).lattice for name in causes if name in _NAMES)
    stated = campaign_noise(campaign).stated_variance if coarse else None
    ratio = level / stated if stated else 1.0
    given = prepare(campaign, {run.id: run.noise_variance * run.block / ratio for run in data.runs})
    readings = {run.id: run.reading for run in given.runs}
    # the fit may leave a record's start out; both end together
    readings = {run.id: readings[run.id][-run.reading.size :] for run in data.runs}
    residuals = [
        (r + (readings[run.id] - run.reading) / np.sqrt(run.noise_variance)) * np.sqrt(ratio)
        for r, run in zip(nominal.residuals, data.runs, strict=True)
    ]
    return dataclasses.replace(nominal, residuals=residuals), ratio


def _nature(
    campaign: Campaign, nominal: Fit, causes: tuple[str, ...], found: Survey, lead: str | None
) -> tuple[Finding, Finding]:
    """Condition and channel, from the cause where it is known and from the residuals where it is not."""
    if lead is None:
        condition = infer_condition(campaign, nominal, found)
        return condition, infer_channel(nominal, found, condition.value)
    kind = effect_class(lead)
    others = [name for name in causes if name != lead]
    reason = f"as {plain([lead])} does"
    if others:
        reason += f", the larger part of the gap; the rest is of {plain(others)}"
    return Finding(kind.condition, reason), Finding(kind.channel, reason)


def _leading(
    causes: tuple[str, ...], nominal: Fit, best: Fit | None, excess: float, ratio: float
) -> str | None:
    """Of several causes the one without which most of the gap would stay open; None where none is known."""
    known = [name for name in causes if name in _NAMES]
    if len(known) < 2 or best is None:
        return known[0] if known else None
    fitted = {kind.name: kind for kind in best.problem.effects if kind.name in known}
    loose = [name for name in known if name not in fitted]  # read off the records, or random
    closed = ratio * (nominal.excess - best.excess)
    if not fitted or (loose and excess - closed > closed):
        return (loose or known)[0]

    def strength(name: str) -> float:
        severity = f"{name}.{fitted[name].parameters()[0].name}"
        return abs(best.value(severity)) / max(best.std(severity), 1e-300)

    return max(fitted, key=strength)


def _mean_excess(fit: Fit) -> float:
    return sum(float(r @ r) for r in fit.residuals) / fit.count - 1.0
