"""Integrates all runs of many campaigns at once: RK4 with a small step, dry friction by events within the step.

The effects of a campaign are *terms*: laws with parameters for the rows (runs) to which they apply. A law reads and
changes the moments of one RK4 stage. A friction law only gives the friction level; the sign of friction is
constant in a step. Where the rate crosses zero within the step, the state after the crossing is corrected: the
body slips the other way, or sticks until the other moments exceed the level. The local error of the correction
is of third order in the step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tunnel_reference.driven_inputs import Inputs
from tunnel_reference.true_conditions import Array, TrueConditions

Params = Mapping[str, Array]
Places = NDArray[np.intp]
Rows = Places | slice


class Phase(IntEnum):
    """The part of a stage in which a law acts."""

    WIND = 0  # changes the speed ratio
    ANGLE = 1  # changes the angle on which air or spring acts
    MOMENT = 2  # adds a moment
    FRICTION = 3  # adds a friction level


@dataclass(eq=False)
class RungeKuttaStage:
    """One RK4 stage of a batch; arrays have shape (rows,). Laws may change the marked arrays.

    Args:
        time: time of the stage, s.
        beta: body angle, rad.
        rate: body rate, rad/s.
        theta: angle of the rod's upper end, rad (the body's where the rod is rigid).
        omega: rate of the upper end, rad/s.
        stiffness: true Kr, N m/rad.
        air_stiffness: Ka at the run's true speed, N m/rad.
        air_damping: Ca at the run's true speed, N m s/rad.
        speed_ratio: V(t)/V; changed by laws.
        air_angle: the angle on which Ka acts, rad; changed by laws.
        spring_angle: the angle on which Kr acts, rad; changed by laws.
        deflection: deflection of the spring, i.e. θ less the angle of its root, rad.
        top: moment on the upper end, N m; changed by laws.
        body: moment on the body, N m; changed by laws.
        level: friction level at the upper end, N m; changed by laws.
        hung: moment of gravity, N m; changed by laws.
        driven: moment of the input on the body, N m.
    """

    time: float
    beta: Array
    rate: Array
    theta: Array
    omega: Array
    stiffness: Array
    air_stiffness: Array
    air_damping: Array
    speed_ratio: Array
    air_angle: Array
    spring_angle: Array
    deflection: Array
    top: Array
    body: Array
    level: Array
    hung: Array
    driven: Array


Law = Callable[[RungeKuttaStage, Rows, Params, Array, Array], None]
"""law(stage, rows, parameters, states, derivative of the states); states have shape (states, rows)."""


@dataclass(frozen=True, eq=False)
class BoundLaw:
    """A law bound to the runs of one campaign.

    Args:
        params: arrays with the campaign's runs as first axis.
        memory: initial states of the law, shape (states, runs); None for a law without states.
    """

    law: Law
    phase: Phase
    params: dict[str, Array]
    memory: Array | None = None


@dataclass(frozen=True, eq=False)
class RodMotion:
    """The motion of the rod's upper end in one campaign.

    Args:
        angle: shape (samples, runs), rad.
        rate: shape (samples, runs), rad/s.
    """

    angle: Array
    rate: Array


@dataclass(eq=False)
class _Group:
    """One law for all rows of the batch to which it applies, with its block of the state vector."""

    law: Law
    phase: Phase
    rows: Rows
    params: dict[str, Array]
    memory: Array
    start: int = 0


def _group_terms(
    terms: Sequence[Sequence[BoundLaw]], offsets: Sequence[int], runs: Sequence[int]
) -> list[_Group]:
    """Merge equal laws of all campaigns into groups, ordered by phase, then by first appearance.

    A law that occurs twice in a campaign is in two groups: a law adds to each row of its group once.
    """
    found: dict[tuple[int, Law, int, int], list[tuple[BoundLaw, Places]]] = {}
    for number, campaign_terms in enumerate(terms):
        rows = np.arange(offsets[number], offsets[number] + runs[number])
        before: Counter[tuple[int, Law, int]] = Counter()
        for term in campaign_terms:
            key = (int(term.phase), term.law, 0 if term.memory is None else term.memory.shape[0])
            found.setdefault((*key, before[key]), []).append((term, rows))
            before[key] += 1
    groups = []
    for (phase, law, states, _), members in sorted(found.items(), key=lambda item: item[0][0]):
        rows = np.concatenate([r for _, r in members])
        params = {}
        for name in members[0][0].params:
            arrays = [t.params[name] for t, _ in members]
            if arrays[0].ndim > 1:  # shorter time series are extended with their last value
                longest = max(a.shape[1] for a in arrays)
                arrays = [np.pad(a, ((0, 0), (0, longest - a.shape[1])), mode="edge") for a in arrays]
            params[name] = np.concatenate(arrays)
        memory = np.concatenate(
            [t.memory if t.memory is not None else np.zeros((0, r.size)) for t, r in members], axis=1
        )
        assert memory.shape[0] == states
        first, last = int(rows[0]), int(rows[-1])
        consecutive = last - first + 1 == rows.size  # a view is faster than indexing
        places = slice(first, last + 1) if consecutive else rows
        groups.append(_Group(law, Phase(phase), places, params, memory))
    return groups


class _Batch:
    """The rows of several campaigns, all with a rigid or all with a flexible rod."""

    def __init__(self, conditions: Sequence[TrueConditions], terms: Sequence[Sequence[BoundLaw]]) -> None:
        runs = [c.runs for c in conditions]
        self.offsets = np.concatenate([[0], np.cumsum(runs)]).astype(int)
        self.size = int(self.offsets[-1])
        self.flexible = conditions[0].rod is not None
        self.groups = _group_terms(terms, [int(o) for o in self.offsets[:-1]], runs)
        self.early = [group for group in self.groups if group.phase in (Phase.WIND, Phase.ANGLE)]
        self.late = [group for group in self.groups if group.phase in (Phase.MOMENT, Phase.FRICTION)]
        self.stiffness = np.concatenate([c.true_stiffness * np.ones(c.runs) for c in conditions])
        self.air_stiffness = np.concatenate([c.air_stiffness for c in conditions])
        self.air_damping = np.concatenate([c.air_damping for c in conditions])
        self.inertia = np.repeat([c.yaw_inertia for c in conditions], runs)
        self.damping = np.concatenate([c.true_damping for c in conditions])
        self.release = np.concatenate([c.start_angle for c in conditions])
        self.rate = np.concatenate([np.broadcast_to(c.start_rate, (c.runs,)) for c in conditions])
        self.inputs = Inputs.of(conditions)
        self.middle = 0.0  # of the step
        self.ones = np.ones(self.size)
        self.sign = np.sign(self.rate)
        self.moving = np.ones(self.size)
        dry = [np.arange(self.size)[g.rows] for g in self.groups if g.phase is Phase.FRICTION]
        self.dry = np.unique(np.concatenate(dry)) if dry else np.zeros(0, dtype=np.intp)
        # The state: body angle and rate, (angle and rate of the upper end,) and the states of the laws.
        blocks = [self.release.copy(), self.rate.copy()]
        self.top_inertia, self.body_inertia = self.inertia, self.inertia
        if self.flexible:
            rods = [c.rod for c in conditions if c.rod is not None]
            share = np.repeat([r.share for r in rods], runs)
            self.rod_stiffness = np.repeat([1.0 / r.compliance for r in rods], runs)
            self.rod_hardening = np.repeat([r.hardening for r in rods], runs)
            held_body = np.repeat([r.held_body for r in rods], runs)
            self.top_inertia, self.body_inertia = share * self.inertia, (1.0 - share) * self.inertia
            ratio = np.repeat([r.damping_ratio for r in rods], runs)
            self.rod_damping = 2.0 * ratio * np.sqrt(self.rod_stiffness * self.top_inertia)
            series = self.stiffness / (self.stiffness + self.rod_stiffness)
            body_if_top_is_held = (
                self.release * self.rod_stiffness / (self.rod_stiffness - self.air_stiffness)
            )
            blocks[0] = np.where(held_body, self.release, body_if_top_is_held)
            blocks += [np.where(held_body, self.release * (1.0 - series), self.release), self.rate.copy()]
        position = len(blocks) * self.size
        for group in self.groups:
            group.start = position
            position += group.memory.size
            blocks.append(group.memory.ravel())
        self.state = np.concatenate(blocks)
        self.stage = self._new_stage(0.0, self.state)

    def _new_stage(self, time: float, state: Array) -> RungeKuttaStage:
        """A stage to which no law has been applied yet."""
        n = self.size
        beta, rate = state[:n], state[n : 2 * n]
        theta, omega = (state[2 * n : 3 * n], state[3 * n : 4 * n]) if self.flexible else (beta, rate)
        deflection = theta if self.inputs is None else theta - self.inputs.root(time, self.middle)
        changed = (self.ones, beta, deflection)
        if self.early:
            changed = (self.ones.copy(), beta.copy(), deflection.copy())
        level, hung, driven = np.zeros((3, n))
        return RungeKuttaStage(
            time, beta, rate, theta, omega, self.stiffness, self.air_stiffness, self.air_damping,
            *changed, deflection, self.ones, self.ones, level, hung, driven,
        )  # fmt: skip

    def derivative(self, time: float, state: Array) -> Array:
        """Time derivative of the state vector with the present sign of friction."""
        n = self.size
        stage = self._new_stage(time, state)
        out = np.zeros(state.size)
        self._apply(stage, state, out, self.early)
        stage.top = -self.stiffness * stage.spring_angle - self.damping * stage.omega
        if self.early:
            stage.body = stage.speed_ratio * (
                stage.speed_ratio * self.air_stiffness * stage.air_angle + self.air_damping * stage.rate
            )
        else:
            stage.body = self.air_stiffness * stage.beta + self.air_damping * stage.rate
        if self.inputs is not None:
            stage.driven = self.inputs.moment(time, self.middle)
            stage.body = stage.body + stage.driven
        if self.flexible:
            twist = stage.theta - stage.beta
            rod = self.rod_stiffness * twist * (1.0 + self.rod_hardening * twist * twist)
            rod += self.rod_damping * (stage.omega - stage.rate)
            stage.top -= rod
            stage.body += rod
        self._apply(stage, state, out, self.late)
        if not self.flexible:
            stage.top = stage.top + stage.body
        self.stage = stage
        if self.flexible:
            out[:n], out[n : 2 * n] = stage.rate, stage.body / self.body_inertia
        top = out[2 * n : 4 * n] if self.flexible else out[: 2 * n]
        if self.dry.size:
            top[:n] = stage.omega * self.moving
            top[n:] = (stage.top - self.sign * stage.level) / self.top_inertia * self.moving
        else:
            top[:n], top[n:] = stage.omega, stage.top / self.top_inertia
        return out

    def _apply(self, stage: RungeKuttaStage, state: Array, out: Array, groups: Sequence[_Group]) -> None:
        """Apply the laws of these groups."""
        for group in groups:
            present = change = group.memory
            if group.memory.size:
                block = slice(group.start, group.start + group.memory.size)
                present, change = (whole[block].reshape(group.memory.shape) for whole in (state, out))
            group.law(stage, group.rows, group.params, present, change)

    def step(self, time: float, h: float) -> None:
        """Advance by one RK4 step, then correct the rows with friction whose rate changed sign.

        Rows at rest start to slip or remain at rest.
        """
        self.middle = time + h / 2
        before = self.state
        k1 = self.derivative(time, before)
        k2 = self.derivative(time + h / 2, before + (h / 2) * k1)
        k3 = self.derivative(time + h / 2, before + (h / 2) * k2)
        k4 = self.derivative(time + h, before + h * k3)
        self.state = before + (h / 6) * (k1 + 2.0 * (k2 + k3) + k4)
        rows = self.dry
        if not rows.size:
            return
        at = rows + (3 if self.flexible else 1) * self.size
        crossed = rows[self.state[at] * self.sign[rows] < 0.0]
        if crossed.size:  # after the crossing, friction acts the other way, or sticks
            angle_at = crossed + (2 if self.flexible else 0) * self.size
            rate_at = angle_at + self.size
            v0, v1, a0 = before[rate_at], self.state[rate_at], k1[rate_at]
            bend = v1 - v0 - a0 * h
            # v(u) = v0 + a0 h u + bend u²; its root by two Newton steps, starting from the root of the chord.
            u = np.clip(v0 / np.where(v0 == v1, 1.0, v0 - v1), 0.0, 1.0)
            for _ in range(2):
                gradient = a0 * h + 2.0 * bend * u
                gradient = np.where(np.abs(gradient) < 1e-300, 1.0, gradient)
                u = np.clip(u - (v0 + a0 * h * u + bend * u * u) / gradient, 0.0, 1.0)
            left = (1.0 - u) * h
            level, net = self.stage.level[crossed], self.stage.top[crossed]
            stick = np.abs(net) <= level
            turned = np.where(stick, 0.0, np.sign(net))
            push = (self.sign[crossed] - turned) * level / self.top_inertia[crossed]
            at_rest = before[angle_at] + h * (v0 * u + a0 * h * u**2 / 2.0 + bend * u**3 / 3.0)
            slid_angle = self.state[angle_at] + push * left**2 / 2.0
            slid_rate = v1 + push * left
            self.state[angle_at] = np.where(stick, at_rest, slid_angle)
            self.state[rate_at] = np.where(stick, 0.0, slid_rate)
            self.sign[crossed] = turned
            self.moving[crossed] = np.where(stick, 0.0, 1.0)
        resting = rows[self.moving[rows] == 0.0]
        if resting.size:
            self.leave_rest(resting)

    def leave_rest(self, rows: Places) -> None:
        """Rows at rest slip once the other moments exceed the level."""
        net = self.stage.top[rows]
        go = np.abs(net) > self.stage.level[rows]
        self.sign[rows] = np.where(go, np.sign(net), 0.0)
        self.moving[rows] = np.where(go, 1.0, 0.0)


def integrate(
    conditions: Sequence[TrueConditions], terms: Sequence[Sequence[BoundLaw]], *, substeps: int = 10
) -> list[RodMotion]:
    """Integrate campaigns together from their start angles and rates.

    Args:
        conditions: one per campaign; all with or all without a flexible rod, equal sample rates.
        substeps: RK4 steps per sample.

    Returns:
        One motion per campaign; not finite where it diverges.

    Raises:
        ValueError: when rigid and flexible rods, or sample rates, are mixed.
    """
    if len({c.rod is None for c in conditions}) != 1 or len({c.sample_rate for c in conditions}) != 1:
        raise ValueError("a batch needs one kind of rod and one sample rate")
    batch = _Batch(conditions, terms)
    resting = batch.dry[batch.rate[batch.dry] == 0.0]
    if resting.size:  # at rest, friction is opposed to the other moments, or sticks
        batch.derivative(0.0, batch.state)
        batch.leave_rest(resting)
    samples = max(c.samples for c in conditions)
    interval = 1.0 / conditions[0].sample_rate
    h, n = interval / substeps, batch.size
    first = 2 * n if batch.flexible else 0
    angle, rate = np.empty((samples, n)), np.empty((samples, n))
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging motion is infinite, or not a number
        for k in range(samples):
            angle[k], rate[k] = batch.state[first : first + n], batch.state[first + n : first + 2 * n]
            if k < samples - 1:
                for j in range(substeps):
                    batch.step(k * interval + j * h, h)
    spans = [slice(int(a), int(b)) for a, b in zip(batch.offsets[:-1], batch.offsets[1:], strict=True)]
    return [
        RodMotion(angle[: c.samples, s], rate[: c.samples, s]) for c, s in zip(conditions, spans, strict=True)
    ]
