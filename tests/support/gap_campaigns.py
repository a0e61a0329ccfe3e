"""Small campaigns with a known gap, from the forward integrator: a few milliseconds each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start, starting_points
from diagnosis.model.blocks import prepare
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.model.rig import SpringModel
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import WhiteNoise
from diagnosis.model.similarity import Similarity
from diagnosis.noise.gap import GapTest, gap_or_colour
from diagnosis.noise.mains import Hum
from diagnosis.noise.sensor_noise import NoiseTrend, campaign_noise, noise_trend, reading_step
from diagnosis.search.answer import Answer
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.prepared import COARSE_STEP, HUM, Prepared, fit_nominal
from diagnosis.search.study import Gap, Study
from diagnosis.search.views.whole_runs import WholeRuns
from diagnosis.settings import Settings
from tunnel_sim.effects import ALL_EFFECTS, Effect, effect_class
from tunnel_sim.vocabulary.campaign import Campaign, Quantity, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

INTERVAL = 4e-3
DURATION = 7.0
NOISE = 4e-4
CONDITIONS = tuple((spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 15.0, 25.0))
FOUR = ((16.12, 0.0), (16.12, 25.0), (44.84, 0.0), (44.84, 15.0))
"""Two springs and two wind speeds, which tell turbulence from vortices and from the surroundings."""
INERTIA, DAMPING, CN_BETA, CN_R = 0.11, 0.008, 0.45, -0.25


def campaign(
    *effects: Effect,
    added: Array | None = None,
    seed: int = 3,
    duration: float = DURATION,
    quantity: Quantity | None = None,
    damping: float = DAMPING,
    conditions: Sequence[tuple[float, float]] = CONDITIONS,
) -> Campaign:
    """Six runs of two springs and three speeds, with effects, and something added to every reading."""
    count = round(duration / INTERVAL)
    sensor = SensorProperties(1.0 / INTERVAL, None, NOISE, quantity=quantity)
    if quantity == "rate":
        sensor = dataclasses.replace(sensor, noise_std=10.0 * NOISE)
    noise = sensor.noise_std or 0.0
    runs = tuple(
        RunData(
            f"r{i + 1}",
            np.zeros(count),
            1,
            INTERVAL,
            WhiteNoise(NOISE**2),
            spring,
            speed,
            1.2 * (speed > 0),
            duration,
            derivative=sensor.derivative,
        )
        for i, (spring, speed) in enumerate(conditions)
    )
    effects = tuple(effect for effect in effects if effect is not None)
    kinds = tuple(type(effect) for effect in effects)
    shaped = tuple(
        f"{e.name}.{name}"
        for e in effects
        for form in e.forms()
        if any(getattr(e, i.name) != i.default for i in e.parameters() if i.name in form)
        for name in form
    )
    problem = Problem(Data(runs, 0.036, 0.625, 0.225, SpringModel().among(runs)), kinds, free_forms=shaped)
    values = [
        getattr(e, i.name)
        for e in effects
        for i in e.parameters()
        if not i.of_input and (not i.form or f"{e.name}.{i.name}" in shaped)
    ]
    common = np.array([INERTIA, damping, CN_BETA, CN_R, 0.001, *values])
    # phases (rad) or instants (shares of the run)
    own = [np.linspace(0.2, 0.8, len(runs))] * problem.parameters.of_effects
    release = np.column_stack([np.array([[0.35, 0.0]] * len(runs)), *own])
    rng = np.random.default_rng(seed)
    time = INTERVAL * np.arange(count)
    readings = problem.predict([Point(common, release)])[0]
    return Campaign(
        "small",
        RigProperties(INERTIA, 0.036, 0.625, 0.225),
        sensor,
        tuple(
            Run(
                run.id,
                Record(time, values + (0.0 if added is None else added) + rng.normal(0.0, noise, count)),
                run.wind_speed,
                run.spring_stiffness,
                run.air_density or None,
                0.35,
            )
            for run, values in zip(runs, readings, strict=True)
        ),
    )


def precise(data: Campaign) -> Campaign:
    """The campaign with the air density to nine digits, so that its rounding adds nothing."""
    runs = (dataclasses.replace(run, air_density=1.20000001 if run.wind_on else None) for run in data.runs)
    return dataclasses.replace(data, runs=tuple(runs))


def with_blow(data: Campaign, impulse: float, when: float, only: str = "") -> Campaign:
    """The same campaign with a blow to every run, or to one: exact, since the nominal model is linear."""
    area = 0.5 * 1.2 * 0.036 * 0.625
    runs = []
    for run in data.runs:
        if only not in ("", run.id):
            runs.append(run)
            continue
        assert run.spring_stiffness is not None
        stiffness = run.spring_stiffness - area * run.wind_speed**2 * CN_BETA
        decay = 0.5 * (DAMPING - area * 0.625 * run.wind_speed * CN_R) / INERTIA
        omega = np.sqrt(stiffness / INERTIA - decay**2)
        since = np.maximum(run.record.time_s - when, 0.0)
        swing = impulse / (INERTIA * omega) * np.exp(-decay * since) * np.sin(omega * since)
        runs.append(dataclasses.replace(run, record=Record(run.record.time_s, run.record.yaw_rad + swing)))
    return dataclasses.replace(data, runs=tuple(runs))


def nominal(data: Campaign) -> Fit:
    """The nominal model fitted."""
    prepared = prepare(data, campaign_noise(data, Settings().noise).variance)
    return fit(Problem(prepared), nominal_start(prepared))


def added(base: Fit, *names: str) -> Fit:
    """The fit with these effects added one after another."""
    for name in names:
        start = starting_points(base, effect_class(name))[0]
        base = fit(start.problem, start.point, base=base)
    return base


def with_settings(fitted: Fit, values: dict[str, float]) -> Fit:
    """The fit with other settings, by name with their stage."""
    data = fitted.problem.data
    data = dataclasses.replace(data, settings=data.settings.changed(values))
    return dataclasses.replace(fitted, problem=dataclasses.replace(fitted.problem, data=data))


def studied(data: Campaign, nominal: Fit, causes: tuple[str, ...] = (), best: Fit | None = None) -> Study:
    """A study that ends in these causes, those that can be fitted answered by `best` where it is given."""
    fitted = tuple(sorted(name for name in causes if name not in (HUM.name, COARSE_STEP.name)))
    prepared = Prepared(
        data,
        Similarity(),
        (),
        campaign_noise(data, Settings().noise),
        NoiseTrend(0.0, 0.0, 0.0),
        step=0.0,
        coarse=COARSE_STEP.name in causes,
        hum=Hum(50.0, 1e-4, 1e-6, None, 0.1) if HUM.name in causes else None,
        nominal=nominal,
    )
    one = answer(fitted, 0.0, 1.0, best)
    return Study(prepared, Gap(GapTest(bool(causes), 0.0, {}, noisy=False)), (one,) if fitted else ())


def answer(effects: Sequence[str], share: float, probability: float, fitted: Fit | None = None) -> Answer:
    """An answer, whose fit to whole runs is the one stated."""
    known = None if fitted is None else Hypothesis(tuple(effects), fitted)
    return Answer(tuple(effects), share, probability, known, known)


def whole_runs(base: Fit, kinds: Sequence[type[Effect]] = ALL_EFFECTS) -> WholeRuns:
    """Whole runs, of which the fit of the nominal model is known."""
    none: Any = None
    return WholeRuns(Prepared(none, Similarity(), tuple(kinds), none, none, 0.0, False, None, base), base)


def judged(data: Campaign) -> GapTest:
    """Fit, noise and verdict."""
    noise = campaign_noise(data, Settings().noise)
    fitted = fit_nominal(prepare(data, noise.variance))
    return gap_or_colour(fitted, noise, noise_trend(data), step=reading_step(data), coarse_step=False)
