"""Policies for ``Campaign-v0``: a rig engineer's plan, and optimal design.

A policy is a function from `Knowledge`, which has the results of the runs but not the truth, to an action. Policies
do not draw random numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from diagnosis.findings.next_run import planned_run, separation
from diagnosis.likelihood.least_squares import Fit
from diagnosis.search.study import Study
from identification.campaign.belief import expected_belief, information_gain
from tunnel_lab.envs.menu import RunChoice
from tunnel_lab.envs.session import Knowledge

Action = tuple[int, int, int, int]
Policy = Callable[[Knowledge], Action]


def scripted(known: Knowledge) -> Action:
    """A rig engineer's plan: every spring in turn, first with the wind off and then at each speed.

    Every run has the largest release and the longest record. After its last run the plan starts again.
    """
    springs, speeds, _, _ = known.conditions.menu.shape
    by_speed = np.argsort(known.conditions.menu.wind_speeds, kind="stable")
    place = len(known.choices) % (springs * speeds)
    return (
        place // speeds,
        int(by_speed[place % speeds]),
        int(np.argmax(known.conditions.menu.release_angles)),
        int(np.argmax(known.conditions.menu.durations)),
    )


def greedy(known: Knowledge) -> Action:
    """The run with the largest expected information on (Cnβ, Cnr) per rig time.

    It maximises, over the whole menu, the expected information gain (exact Fisher information at the present
    estimate; Izz, Cr, the sensor's zero and every release unknown) divided by the run's cost. Runs that might
    diverge are left out; if all might, the result is the scripted run.
    """
    return _best(known, lambda choice: expected_gain(known, choice))


def _best(known: Knowledge, gain: Callable[[RunChoice], float]) -> Action:
    """The action with the largest gain per rig time; the scripted action if no action has a gain."""
    best, chosen = 0.0, None
    for action in known.conditions.menu.actions():
        choice = known.conditions.menu.choice(action)
        value = gain(choice) / known.cost(choice)
        if value > best:
            best, chosen = value, action
    return scripted(known) if chosen is None else chosen


def expected_gain(known: Knowledge, choice: RunChoice) -> float:
    """Expected information of a run on (Cnβ, Cnr), nats; 0 if the run might diverge."""
    conditions = known.conditions
    after = expected_belief(
        known.belief,
        conditions.link(choice),
        conditions.sample_times(choice.duration),
        choice.release_angle,
        conditions.noise_std,
    )
    return 0.0 if after is None else information_gain(known.belief, after)


def separating(known: Knowledge) -> Action:
    """The run that best distinguishes the two most probable answers per rig time.

    It maximises, over the whole menu, half the squared separation of the two fitted models (the expected
    log-likelihood ratio, nats; see `diagnosis.findings.next_run.separation`) divided by the run's cost. If only
    one effect is named, its rival is the nominal model. Without a detected gap, or without a run with wind, the
    fitted models cannot predict other runs, and the result is the scripted run.
    """
    rivals = None if known.study is None else best_rivals(known.study)
    if rivals is None or not rivals[0].problem.data.wind_on:
        return scripted(known)

    def gain(choice: RunChoice) -> float:
        run = planned_run(
            rivals[0],
            spring_stiffness=choice.spring_stiffness,
            wind_speed=choice.wind_speed,
            air_density=known.conditions.rig.air.density,
            duration=choice.duration,
        )
        distance = separation(*rivals, run, choice.release_angle)
        apart = 0.0 if distance is None or not np.isfinite(distance) else distance
        return 0.5 * apart**2

    return _best(known, gain)


def best_rivals(study: Study) -> tuple[Fit, Fit] | None:
    """The fits of the two most probable answers; the second is nominal if only one effect is fitted.

    None if no effect is fitted.
    """
    fits = [answer.hypothesis.fit for answer in study.answers if answer.hypothesis is not None]
    if not fits:
        return None
    return (fits[0], fits[1]) if len(fits) > 1 else (fits[0], study.nominal)


def run_campaign(
    env: Any, policy: Policy, *, seed: int, options: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Play one episode of a ``tunnel_sim/Campaign-v0``, wrapped or not.

    Returns:
        The last ``info``, whose ``campaign`` goes to `identify` and `diagnose`.
    """
    _, info = env.reset(seed=seed, options=options)
    over = False
    while not over:
        known: Knowledge = env.unwrapped.known
        _, _, terminated, truncated, info = env.step(np.array(policy(known)))
        over = terminated or truncated
    return dict(info)


POLICIES: dict[str, Policy] = {one.__name__: one for one in (scripted, greedy, separating)}
"""By name."""
