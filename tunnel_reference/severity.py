"""Simulates drawn campaigns and scales their effects to a target excess; draws again until each is relevant.

The excess of an effect is mean(residual²)/noise² − 1 over all runs after refitting the nominal model, where noise²
is the variance of the sensor's noise and stated quantisation.

An effect's signature is its contribution to the residuals of the nominal model. No change of the other effects'
sizes imitates its part orthogonal to their signatures.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tunnel_reference.catalogue import Bound
from tunnel_reference.draw import CampaignDraw, redraw, with_defaults
from tunnel_reference.integrator import BoundLaw, RodMotion, integrate
from tunnel_reference.nominal_fit import fit_driven, fit_nominal
from tunnel_reference.readings import ReadingTerm, SensorSignal, read_motion
from tunnel_reference.true_conditions import Array, TrueConditions

PASSES = 6
TOLERANCE = 0.1
_SUBSTEPS = 10
_ROD_SUBSTEPS = 20
_COARSE, _ROD_COARSE = 1, 10
_SHORT = 10.0
_RATE = 1000.0  # Hz, for the numbers of steps above


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated campaign.

    Args:
        readings: shape (samples, runs), rad.
        excess: excess after refitting the nominal model.
        run_excess: excess by run, shape (runs,).
        residual: residual of the nominal model, shape (runs, samples), rad.
    """

    draw: CampaignDraw
    readings: Array
    excess: float
    run_excess: Array
    residual: Array


def bind_effects(draw: CampaignDraw) -> tuple[TrueConditions, list[Bound]]:
    """Conditions and terms of a campaign with all effects; calibration comes first because others depend on it."""
    conditions, terms = with_defaults(draw.conditions), []
    for effect in draw.effects:
        conditions, _ = effect.form.bind(effect.sign * effect.value, effect.extra, conditions)
    for effect in draw.effects:
        _, term = effect.form.bind(effect.sign * effect.value, effect.extra, conditions)
        if term is not None:
            terms.append(term)
    return conditions, terms


def simulate_motions(draws: Sequence[CampaignDraw], *, fine: bool = True) -> list[RodMotion]:
    """Integrate campaigns in as few batches as possible.

    Args:
        fine: whether to use 10 steps per sample (20 with a flexible rod); otherwise 1 (10), for scaling
            effects.
    """
    bound = [bind_effects(d) for d in draws]
    motions: list[RodMotion | None] = [None] * len(draws)
    # by rod, by short or long runs, which are efficient together, and by sample rate
    batches: dict[tuple[bool, bool, float], list[int]] = {}
    for number, (c, _) in enumerate(bound):
        batches.setdefault((c.rod is not None, c.duration > _SHORT, c.sample_rate), []).append(number)
    for (flexible, _, rate), numbers in batches.items():
        substeps = (
            (_ROD_SUBSTEPS if flexible else _SUBSTEPS) if fine else (_ROD_COARSE if flexible else _COARSE)
        )
        substeps = max(1, round(substeps * _RATE / rate))  # steps of equal length
        terms = [[t for t in bound[i][1] if isinstance(t, BoundLaw)] for i in numbers]
        for i, motion in zip(
            numbers, integrate([bound[i][0] for i in numbers], terms, substeps=substeps), strict=True
        ):
            motions[i] = motion
    return [m for m in motions if m is not None]


def read_and_fit(draw: CampaignDraw, motion: RodMotion) -> Simulated:
    """Convert a motion to readings and refit the nominal model."""
    conditions, terms = bind_effects(draw)
    sensor = [t for t in terms if isinstance(t, ReadingTerm)]
    readings = read_motion(conditions, motion, sensor, np.random.default_rng(draw.seed))
    readings = readings[: draw.conditions.samples]  # a motion may outlast the record
    for term in sensor:
        drive = draw.conditions.drive
        if not term.of_input or drive is None:
            continue
        # the input as written by the logger
        values = np.pad(
            drive.values, ((0, conditions.samples - draw.conditions.samples), (0, 0)), mode="edge"
        )
        read = term.law(SensorSignal(values, motion, conditions, np.random.default_rng(0)), term.params)
        drive = replace(drive, values=read[: draw.conditions.samples])
        draw = replace(draw, conditions=replace(draw.conditions, drive=drive))
    about_one_zero = readings - conditions.zero_shift
    fit = (fit_nominal if conditions.drive is None else fit_driven)(draw.conditions, about_one_zero)
    power = fit.residual_power / conditions.noise_power
    return Simulated(draw, readings, float(np.mean(power)) - 1.0, power - 1.0, fit.residual)


class _Search:
    """The search for one effect's severity parameter."""

    def __init__(self, campaign: int, slot: int, alone: CampaignDraw) -> None:
        self.campaign, self.slot, self.alone = campaign, slot, alone
        effect = alone.effects[0]
        term = effect.form.bind(effect.value, effect.extra, with_defaults(alone.conditions))[1]
        self.sensor = isinstance(term, ReadingTerm)  # the motion is the same without the effect
        self.motion: RodMotion | None = None
        self.tried: list[tuple[float, float]] = []
        self.done = False

    def try_out(self) -> None:
        """Compute the excess at the present value and choose the next; only sensor effects can reuse the motion."""
        assert self.motion is not None
        excess = np.inf  # where its motion diverges or does not resemble a free decay
        if np.all(np.isfinite(self.motion.angle)):
            with suppress(np.linalg.LinAlgError, ValueError):
                excess = read_and_fit(self.alone, self.motion).excess
        self.learn(excess)
        if not self.sensor:
            self.motion = None

    def learn(self, excess: float) -> None:
        """Record the excess at the present value and choose the next value."""
        effect = self.alone.effects[0]
        excess = max(excess, 2e-3) if np.isfinite(excess) else 1e6
        self.tried.append((np.log(effect.value), np.log(excess)))
        target = np.log(effect.target)
        if abs(self.tried[-1][1] - target) < TOLERANCE:
            self.done = True
            return
        slope = 2.0
        if len(self.tried) > 1:
            (x0, y0), (x1, y1) = sorted(self.tried, key=lambda pair: abs(pair[1] - target))[:2]
            slope = float(np.clip((y1 - y0) / (x1 - x0), 0.7, 5.0)) if x0 != x1 else 2.0
        nearest = min(self.tried, key=lambda pair: abs(pair[1] - target))
        step = float(np.clip((target - nearest[1]) / slope, -4.0, 4.0))
        value = float(np.clip(np.exp(nearest[0] + step), *effect.form.limits))
        if value == effect.value:
            self.done = True
        self.alone = replace(self.alone, effects=(replace(effect, value=value),))

    def settle(self) -> None:
        """Select the value whose excess was closest to the target."""
        effect = self.alone.effects[0]
        target = np.log(effect.target)
        nearest = min(self.tried, key=lambda pair: abs(pair[1] - target))
        value = float(np.exp(nearest[0]))
        self.alone = replace(self.alone, effects=(replace(effect, value=value),))


def size_effects(draws: Sequence[CampaignDraw], *, progress: bool = False) -> list[CampaignDraw]:
    """Scale every effect to its target excess, each alone in the conditions of its campaign.

    Args:
        progress: whether to report progress on standard error.
    """
    searches = [
        _Search(number, slot, replace(draw, effects=(effect,)))
        for number, draw in enumerate(draws)
        for slot, effect in enumerate(draw.effects)
    ]
    for turn in range(PASSES):
        active = [s for s in searches if not s.done]
        stale = [s for s in active if s.motion is None]
        for search, motion in zip(stale, simulate_motions([s.alone for s in stale], fine=False), strict=True):
            search.motion = motion
        for search in active:
            search.try_out()
        if progress:
            left = sum(not s.done for s in searches)
            print(f"scaling, pass {turn + 1}: {left} of {len(searches)} effects left", file=sys.stderr)
        if all(s.done for s in searches):
            break
    out = list(draws)
    for search in searches:
        search.settle()
        effects = list(out[search.campaign].effects)
        effects[search.slot] = search.alone.effects[0]
        out[search.campaign] = replace(out[search.campaign], effects=tuple(effects))
    return out


OWN_EXCESS = 0.5
"""Least excess of an effect that the others cannot imitate, noise variances: 100 deviations in 10⁵ samples."""
OWN_SHARE = 0.1
"""Least excess of its own, as a share of all: signatures of large effects are not quite proportional to size."""
ATTEMPTS = 4
_STRIDE = 7  # of the stored samples of the signatures


def size_separably(draws: Sequence[CampaignDraw], *, progress: bool = False) -> list[CampaignDraw]:
    """Scale the effects of campaigns; draw again where an effect is irrelevant or cannot be distinguished.

    Args:
        progress: whether to report progress on standard error.

    Returns:
        The campaigns with severity parameters and own excesses set. After four attempts a campaign is kept
        unchanged.
    """
    found = list(draws)
    left = list(range(len(found)))
    for attempt in range(ATTEMPTS):
        sized = own_excesses(size_effects([found[i] for i in left], progress=progress))
        for number, draw in zip(left, sized, strict=True):
            found[number] = draw
        # campaigns with a relevant effect without an excess of its own
        left = [
            i
            for i in left
            if not all(
                e.own is None or e.own >= max(OWN_EXCESS, OWN_SHARE * e.target) for e in found[i].effects
            )
        ]
        if not left or attempt == ATTEMPTS - 1:
            break
        for number in left:
            found[number] = redraw(found[number])
    return found


def own_excesses(draws: Sequence[CampaignDraw]) -> list[CampaignDraw]:
    """Set the own excess of every relevant effect.

    Returns:
        The campaigns; unchanged without effects.
    """
    alone: list[CampaignDraw] = []
    places: list[tuple[int, int]] = []
    for number, draw in enumerate(draws):
        slots = [i for i, e in enumerate(draw.effects) if not e.small]
        for slot in [-1, *slots] if slots else []:
            alone.append(replace(draw, effects=(draw.effects[slot],) if slot >= 0 else ()))
            places.append((number, slot))
    residuals: dict[int, dict[int, Array]] = {}
    motions = simulate_motions(alone, fine=False) if alone else []
    for draw, (number, slot), motion in zip(alone, places, motions, strict=True):
        residual = read_and_fit(draw, motion).residual[:, ::_STRIDE].ravel()
        residuals.setdefault(number, {})[slot] = residual.astype(np.float32)
    found = list(draws)
    for number, by_slot in residuals.items():
        nothing = by_slot.pop(-1)
        power = found[number].conditions.noise_power
        signatures = np.stack([r - nothing for r in by_slot.values()]).astype(np.float64)
        effects = list(found[number].effects)
        for row, (slot, rest) in enumerate(zip(by_slot, signatures, strict=True)):
            others = np.delete(signatures, row, axis=0).T
            if others.size:  # only the part that is orthogonal to the others counts
                rest = rest - others @ np.linalg.lstsq(others, rest, rcond=None)[0]
            effects[slot] = replace(effects[slot], own=float(np.mean(rest**2) / power))
        found[number] = replace(found[number], effects=tuple(effects))
    return found
