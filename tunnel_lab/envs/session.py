"""A campaign in progress: the rig with its hidden truth, and the results of the runs so far.

`CampaignSession` has the truth and makes runs; operators, policies and observations may use only `Knowledge`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp, inf, log
from typing import Any

import numpy as np

from diagnosis.search.investigate import investigate
from diagnosis.search.study import Study
from identification.campaign.belief import (
    Belief,
    LinearRun,
    linear_belief,
    linear_run,
    prior_belief,
    run_link,
    shared_parameters,
    shows_a_decay,
    update_belief,
)
from identification.estimate import PARAMETERS, UNITS
from identification.signal.decay_fit import Reading
from identification.signal.free_decay import Decay, free_decay
from identification.signal.noise import stated_noise
from identification.signal.run_fit import identify_run
from identification.signal.run_unknowns import RunFit
from tunnel_lab.envs.menu import WHERE, Costs, Menu, RunChoice, refusal
from tunnel_sim.effects import Effect, effect_class, effect_from
from tunnel_sim.engine.simulate import simulate
from tunnel_sim.engine.virtual_campaign import run_settings, stated_run
from tunnel_sim.vocabulary.arguments import Number, checked_names, env_errors
from tunnel_sim.vocabulary.between_runs import Scatter, between_runs
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel, Truth
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Rig

LARGE = 1e4
"""Bound of estimates and covariances in the observation, in their units."""
_EMPTY = Record(np.arange(2.0), np.zeros(2))  # for a planned run
MEAN = {"cn_beta": 0.45, "cn_r": -0.12, "yaw_inertia": 0.1014, "mechanical_damping": 0.016}
"""Means of the coefficients that an episode draws, in their units."""
STD = {"cn_beta": 0.08, "cn_r": 0.03, "yaw_inertia": 0.004, "mechanical_damping": 0.004}
"""Their standard deviations: normal, independent, cut at `CUT` standard deviations. Also the estimate's prior."""
CUT = 2.5
OPTIONS = ("truth", "effects")


@dataclass(frozen=True)
class EpisodeConditions:
    """The fixed conditions of all episodes of an environment.

    Args:
        sensor: sensor; its zero is not used, because each episode draws a zero.
        effects: the vocabulary of the diagnosis; empty if the campaign only identifies.
        linear: whether runs come from linear theory instead of MuJoCo and a fit; only without effects.
        scatter: differences between the runs, unknown to the operator.
        max_runs: number of the run at which the drift of the runs is complete.
    """

    rig: Rig
    sensor: SensorModel
    menu: Menu
    costs: Costs
    effects: tuple[str, ...] = ()
    linear: bool = False
    scatter: Scatter = field(default_factory=Scatter)
    max_runs: int = 1

    @property
    def rig_properties(self) -> RigProperties:
        """The rig properties that a campaign states."""
        return RigProperties.of(self.rig)

    @property
    def sensor_properties(self) -> SensorProperties:
        """The sensor properties that a campaign states."""
        return SensorProperties.of(self.sensor)

    @property
    def noise_std(self) -> float:
        """Standard deviation of the reading's noise, quantisation included, rad."""
        noise = stated_noise(self.sensor_properties)
        assert noise is not None
        return noise

    def sample_times(self, duration: float) -> Array:
        """Sample times of a run of a duration in s, shape (n,), s."""
        rate = self.sensor.sample_rate
        return np.arange(max(2, round(duration * rate))) / rate

    def link(self, choice: RunChoice) -> Array:
        """Dependence of the run's decay on the shared parameters, shape (2, 4); see `run_link`."""
        condition = choice.condition("next", self.rig.air.density)
        return run_link(stated_run(condition, _EMPTY), self.rig_properties)


@dataclass(frozen=True, eq=False)
class Knowledge:
    """The knowledge at a point of an episode, without the truth.

    Args:
        beliefs: belief before the first run and after each informative run.
        choices: the runs requested so far, including lost ones.
        costs: rig time of each run, s.
        fits: reading and fit of the runs in the belief, with their links; empty if ``linear``.
        learnt: results of these runs if ``linear``.
        study: the last diagnosis; None before the first, or without a vocabulary.
        status: status of the last run, ``ok`` or the fault.
    """

    conditions: EpisodeConditions
    beliefs: tuple[Belief, ...]
    choices: tuple[RunChoice, ...] = ()
    costs: tuple[float, ...] = ()
    runs: tuple[Run, ...] = ()
    fits: tuple[tuple[Array, Reading, RunFit], ...] = ()
    learnt: tuple[LinearRun, ...] = ()
    study: Study | None = None
    status: str = "ok"

    @property
    def prior(self) -> Belief:
        """The belief before the first run."""
        return self.beliefs[0]

    @property
    def belief(self) -> Belief:
        """The present belief."""
        return self.beliefs[-1]

    @property
    def last(self) -> RunChoice | None:
        """The last run; None before the first."""
        return self.choices[-1] if self.choices else None

    @property
    def rig_time(self) -> float:
        """Rig time spent so far, s."""
        return float(sum(self.costs))

    @property
    def campaign(self) -> Campaign:
        """The runs made, for `identify` and `diagnose`."""
        rig, sensor = self.conditions.rig_properties, self.conditions.sensor_properties
        return Campaign("campaign-v0", rig, sensor, self.runs)

    def cost(self, choice: RunChoice) -> float:
        """Cost of a further run, s."""
        return self.conditions.costs.of(choice, self.last)

    def observation(self) -> dict[str, Array]:
        """The observation of the environment; docs/reference/envs/campaign.md lists the keys."""
        last = self.last or RunChoice(0, 0.0, 0.0, 0.0, 0.0)
        run = [last.spring_stiffness, last.wind_speed, last.release_angle, last.duration]
        observed = {
            "estimate": np.clip(self.belief.values, -LARGE, LARGE),
            "covariance": np.clip(self.belief.covariance.ravel(), -LARGE, LARGE),
            "last_run": np.array(run),
            "progress": np.array([float(len(self.choices)), self.rig_time]),
        }
        if self.conditions.effects:
            observed["probabilities"] = probabilities(self)
        return observed


def first_knowledge(conditions: EpisodeConditions) -> Knowledge:
    """The knowledge before the first run: the prior is the distribution from which the truth is drawn."""
    return Knowledge(conditions, (prior_belief(MEAN, STD),))


class CampaignSession:
    """The rig in one episode.

    Args:
        rng: parent of the generators of the runs; the noise of a run depends only on its number.
    """

    def __init__(self, conditions: EpisodeConditions, truth: RigTruth, rng: np.random.Generator) -> None:
        self._conditions = conditions
        self.truth = truth
        self._rng = rng
        seed = rng.bit_generator.seed_seq
        assert isinstance(seed, np.random.SeedSequence)
        self._between = between_runs(seed)

    def perform(self, known: Knowledge, choice: RunChoice) -> Knowledge:
        """Make a run and update the knowledge.

        A run that diverges is lost: it takes time and gives no result.
        """
        conditions, truth = self._conditions, self.truth
        costs = (*known.costs, known.cost(choice))
        known = replace(known, choices=(*known.choices, choice), costs=costs, status="ok")
        rng, deviations = self._rng.spawn(1)[0], self._deviations(len(known.choices) - 1)
        zero = truth.sensor_zero + deviations.pop("zero", 0.0)
        condition = choice.condition(f"r{len(known.choices):02d}", conditions.rig.air.density)
        if conditions.linear:
            # closed form of the linear model; the belief is updated to first order
            link, time = conditions.link(choice), conditions.sample_times(choice.duration)
            true, values = _deviating(choice, truth.values, deviations)
            decay = Decay(*map(float, conditions.link(true) @ shared_parameters(values)))
            if decay.stiffness <= 0.0 or decay.rate <= 0.0:
                return replace(known, status="lost: the motion grows without bound")
            motion = free_decay(time, decay, choice.release_angle, 0.0)
            noise = conditions.noise_std * rng.standard_normal(time.size)
            run = stated_run(condition, Record(time, motion + zero + noise))
            known = replace(known, runs=(*known.runs, run))
            learnt = linear_run(link, time, decay, choice.release_angle, zero, noise)
            if learnt is None or not shows_a_decay(motion, conditions.noise_std):
                return replace(known, status="no information: no oscillation exceeds the noise")
            runs = (*known.learnt, learnt)
            belief = linear_belief(known.prior, runs, conditions.noise_std)
            return replace(known, learnt=runs, beliefs=(*known.beliefs, belief))
        settings = run_settings(truth.coefficients, condition)
        sensor = replace(conditions.sensor, zero=zero)
        try:
            record = simulate(
                conditions.rig, settings, sensor, rng, effects=truth.effects, deviations=deviations
            )
            known = replace(known, runs=(*known.runs, stated_run(condition, record)))
        except TunnelError as error:
            return replace(known, status=f"lost: {error.what}")
        fitted = identify_run(known.runs[-1], conditions.sensor_properties)
        if fitted.fit is None:
            known = replace(known, status=f"no information: {fitted.estimate.status.value.partition(':')[0]}")
        else:
            fits = (*known.fits, (conditions.link(choice), fitted.reading, fitted.fit))
            links, pairs = [link for link, _, _ in fits], [(reading, fit) for _, reading, fit in fits]
            try:
                belief = update_belief(known.prior, links, pairs, conditions.noise_std)
                known = replace(known, fits=fits, beliefs=(*known.beliefs, belief))
            except ValueError as error:
                known = replace(known, status=f"no information: {error}")
        if not conditions.effects:
            return known
        try:
            kinds = [effect_class(name) for name in conditions.effects]
            return replace(known, study=investigate(known.campaign, kinds))
        except TunnelError as error:
            return replace(known, status=f"not diagnosed: {error.what}")

    def _deviations(self, number: int) -> dict[str, float]:
        """Draw the deviations of the next run, numbered from 0: relative, and rad for ``zero``."""
        share = np.array([number / max(1, self._conditions.max_runs - 1)])
        (own,) = self._conditions.scatter.deviations(self._between, share)
        if own:
            self.truth = replace(self.truth, runs=(*self.truth.runs, dict(own)))
        return own


def _deviating(
    choice: RunChoice, values: Mapping[str, float], own: Mapping[str, float]
) -> tuple[RunChoice, dict[str, float]]:
    """The conditions and coefficients of a run that deviates from the chosen run."""

    def true(name: str, stated: float) -> float:
        return stated * max(0.0, 1.0 + own.get(name, 0.0))

    spring, speed = (true(name, getattr(choice, name)) for name in ("spring_stiffness", "wind_speed"))
    damping = {name: true(name, value) for name, value in values.items()}
    return replace(choice, spring_stiffness=spring, wind_speed=speed), damping


def answers(effects: Sequence[str]) -> tuple[str, ...]:
    """The answers that have a probability: ``none``, each effect alone, ``several`` (two at once), ``unknown``."""
    return ("none", *effects, "several", "unknown")


def probabilities(known: Knowledge) -> Array:
    """The diagnosis' probabilities of `answers`, shape (effects + 3,).

    They are equal before the first diagnosis. While no gap is detected, ``none`` has the probability 1 minus
    the false-alarm rate.
    """
    names = answers(known.conditions.effects)
    shares = np.zeros(len(names))
    if known.study is None:
        return np.full(len(names), 1.0 / len(names))
    if not known.study.answers:
        rate = known.study.settings.gap.detection_rate
        shares[0], shares[-1] = 1.0 - rate, rate
        return shares
    for answer in known.study.answers:
        name = answer.effects[0] if len(answer.effects) == 1 else "several"
        shares[names.index(name)] += answer.probability
    return np.asarray(shares / shares.sum())


def diagnostic_information(known: Knowledge) -> float:
    """ln(answers) minus the entropy of the probabilities, nats.

    Without a detected gap it is 0: this does not show which effect acts.
    """
    if known.study is None or not known.study.answers:
        return 0.0
    shares = probabilities(known)
    positive = shares[shares > 0.0]
    return float(np.log(shares.size) + np.sum(positive * np.log(positive)))


@dataclass(frozen=True)
class RigTruth:
    """The truth of an episode, which no observation contains.

    Args:
        sensor_zero: zero of the sensor, rad.
        runs: deviations of the runs so far, relative, and rad for their zeros; empty if the runs repeat.
    """

    coefficients: Truth
    effects: tuple[Effect, ...] = ()
    sensor_zero: float = 0.0
    runs: tuple[Mapping[str, float], ...] = ()

    @property
    def values(self) -> dict[str, float]:
        """The coefficients by name, in the units of `identification.estimate.UNITS`."""
        return {name: float(getattr(self.coefficients, name)) for name in PARAMETERS}

    def to_json_dict(self) -> dict[str, Any]:
        """Coefficients by name, effects with their parameters, the sensor's zero; SI."""
        return {
            **self.values,
            "sensor_zero": self.sensor_zero,
            "effects": {effect.name: effect.to_json_dict()["parameters"] for effect in self.effects},
            **({"runs": [dict(run) for run in self.runs]} if self.runs else {}),
        }


def draw_truth(
    rng: np.random.Generator,
    severities: Mapping[str, tuple[float, float]],
    options: Mapping[str, Any] | None,
) -> RigTruth:
    """Draw an episode's truth; values from the options of a reset replace the drawn ones.

    Every number is always drawn, so that an option does not change the other numbers.

    Args:
        severities: the effects with the ranges of their severities (SI units). One effect acts, all being
            equally probable, with a severity that is log-uniform in its range; empty: no effect acts.

    Raises:
        TunnelError: for an unknown option, coefficient or effect, or a number that is out of range.
    """
    options = checked_names({} if options is None else options, OPTIONS, "reset options", WHERE)
    values = {name: _normal(rng, MEAN[name], STD[name]) for name in PARAMETERS}
    zero = _normal(rng, 0.0, 0.004)
    effects: tuple[Effect, ...] = ()
    if severities:
        name = list(severities)[int(rng.integers(len(severities)))]
        low, high = severities[name]
        severity = exp(rng.uniform(log(low), log(high)))
        effects = (effect_from(name, {effect_class(name).parameters()[0].name: severity}),)
    truth = checked_names(options.get("truth", {}), (*PARAMETERS, "sensor_zero"), "option truth", WHERE)
    given = {}
    for name, value in truth.items():
        positive = name in ("yaw_inertia", "mechanical_damping")
        kind = Number(0.0 if positive else -inf, above=positive, unit=UNITS.get(name, "rad"))
        given[name] = kind.checked(value, f"truth: {name}", WHERE)
    zero = given.pop("sensor_zero", zero)
    stated = options.get("effects")
    if stated is not None:
        if not isinstance(stated, Mapping):
            remedy = "give parameters by effect, as {'coulomb_friction': {'friction_moment': 0.004}}"
            raise refusal(f"option effects = {stated!r} is not a mapping", remedy)
        with env_errors(WHERE, "option effects"):
            effects = tuple(effect_from(name, dict(parameters)) for name, parameters in stated.items())
    return RigTruth(Truth(**(values | given)), effects, zero)


def _normal(rng: np.random.Generator, mean: float, std: float) -> float:
    while True:
        step = float(rng.standard_normal())
        if abs(step) <= CUT:
            return mean + std * step
