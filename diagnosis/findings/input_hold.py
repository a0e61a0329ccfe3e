"""A delay of the input that a wrong hold between samples would explain as well.

An input held between samples acts like an input that is linear between them and half a sample late, except for
terms of second order in the sample interval. A fit with the other hold and without a delay tests whether the
records distinguish the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from diagnosis.findings.finding import NextStep, SecondReading
from diagnosis.likelihood.least_squares import try_fit
from diagnosis.model.parameters import Point
from diagnosis.search.study import Study
from tunnel_sim.effects.capabilities import InputClock
from tunnel_sim.effects.registry import the_effect

DELAY = the_effect(InputClock)


def other_hold(study: Study) -> SecondReading | None:
    """The wrong hold that explains the records as well as the delay of an answer; None if there is none."""
    from scipy.special import chdtri  # imported here because it is slow to load

    fit, problem = study.chosen, study.chosen.problem
    inputs = {drive.held for drive in problem.data.inputs}
    if DELAY.name not in study.causes or DELAY not in problem.effects or len(inputs) != 1:
        return None
    (held,) = inputs
    effects = tuple(kind for kind in problem.effects if kind is not DELAY)
    tried = replace(problem, data=problem.data.with_inputs(held=not held), effects=effects)
    whole = dict(zip(problem.names, fit.point.common.tolist(), strict=True))
    start = Point(np.array([whole[name] for name in tried.names]), fit.point.per_run)
    fitted = try_fit(tried, start)
    if fitted is None:
        return None
    # without a delay the fit has one parameter less, so its χ² is larger even where it is right
    chance = chdtri(1.0, study.settings.words.hold_rate) * (1.0 + max(fit.excess, 0.0))
    if fitted.unlikelihood - fit.unlikelihood > chance:
        return None
    delay, own = f"{DELAY.name}.{DELAY.parameters()[0].name}", study.similarity.own
    half = 0.5 * float(np.median([run.record.sample_interval for run in study.campaign.driven_runs]))
    figures = {
        "delay_s": own(fit.value(delay), "s"),
        "half_sample_s": own(half, "s"),
        "taken": "zero" if held else "linear",
        "stated": all(drive.hold is not None for drive in study.campaign.inputs),
        "better": bool(fit.unlikelihood - fitted.unlikelihood > chance),
    }
    return SecondReading(DELAY.name, "wrong hold", _words(figures), _step(held=held), figures)


def _words(found: Mapping[str, Any]) -> str:
    held = "keeps its value between samples, as a controller's command does"
    linear = "is linear between samples"
    other, taken = (held, "linear") if found["taken"] == "linear" else (linear, "held")
    why = "as the campaign states" if found["stated"] else "since drive_hold is not stated"
    alike = "better" if found["better"] else "as well"
    when = "later" if found["delay_s"] > 0.0 else "earlier"
    delay = 1e3 * abs(found["delay_s"])
    return (
        f"One cause has two interpretations. Either the input acts {delay:.3g} ms {when} than recorded, about half "
        f"a sample ({1e3 * found['half_sample_s']:.3g} ms); or it {other} and was assumed to be {taken}, {why}. "
        f"The second interpretation explains the records {alike}, without a delay."
    )


def _step(*, held: bool) -> NextStep:
    other, how = ("linear", "is linear") if held else ("zero", "is held")
    what = (
        f'If the input {how} between samples, state drive_hold = "{other}" for the runs, and diagnose again'
    )
    return NextStep(what, "no delay is then needed")
