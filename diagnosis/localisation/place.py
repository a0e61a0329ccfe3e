"""Where the nominal model departs from the runs, from its residuals alone: no effect is known here."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.prepare import prepare
from diagnosis.localisation.excess import RunExcess, run_excesses
from diagnosis.localisation.inference import Finding, infer_channel, infer_condition
from diagnosis.localisation.mapping import Survey, survey
from diagnosis.policy import NAMED_RUN_SHARE, PLACE_FALSE_ALARM_RATE
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class Place:
    """Where a gap is.

    Args:
        survey: maps of the residuals.
        runs: ids of the runs beyond chance.
        channel: what it acts on.
        condition: when it acts.
    """

    survey: Survey
    runs: tuple[str, ...]
    channel: Finding
    condition: Finding


def locate(campaign: Campaign, nominal: Fit, *, hum_removed: bool = False, noise_ratio: float = 1.0) -> Place:
    """Find where the nominal model departs from the runs.

    Args:
        campaign: as measured, of the units of the fit.
        nominal: fit of the nominal model.
        hum_removed: whether a hum was removed before the fit. It is part of the gap: the residuals get it back.
        noise_ratio: of the noise variance of the fit to the one that counts: where the readings' step is coarser
            than stated, it raises the noise found in the records, and the stated noise is the measure.
    """
    residuals = _with_hum(campaign, nominal) if hum_removed else nominal.residuals
    scaled = dataclasses.replace(nominal, residuals=[r * np.sqrt(noise_ratio) for r in residuals])
    excesses = run_excesses(campaign, scaled)
    runs = runs_beyond_chance(excesses)
    found = survey(nominal, scaled, excesses, runs)
    condition = infer_condition(campaign, nominal, found)
    return Place(found, runs, infer_channel(nominal, found, condition.value), condition)


def runs_beyond_chance(excesses: Sequence[RunExcess]) -> tuple[str, ...]:
    """The runs that show the gap.

    Args:
        excesses: of all runs, from the nominal model.

    Returns:
        Ids of the runs beyond chance (false-alarm rate 1 % over all of them) that have a tenth or more of the
        largest excess among them, in the campaign's order.
    """
    clear = {run.id: run.excess for run in excesses if run.p_value() * len(excesses) < PLACE_FALSE_ALARM_RATE}
    least = NAMED_RUN_SHARE * max(clear.values(), default=0.0)
    return tuple(name for name, excess in clear.items() if excess > least)


def _with_hum(campaign: Campaign, nominal: Fit) -> list[Array]:
    """The nominal fit's scaled residuals by run, with the hum that was removed before it."""
    data = nominal.problem.data
    given = prepare(campaign, {run.id: run.noise_variance for run in data.runs}, data.similarity)
    readings = {run.id: run.reading for run in given.runs}
    # the fit may leave a record's start out; both end together
    return [
        r + run.scaled(readings[run.id][-run.reading.size :] - run.reading)
        for r, run in zip(nominal.residuals, data.runs, strict=True)
    ]
