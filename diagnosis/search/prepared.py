"""A campaign prepared for the search: similar, without hum, its noise measured, its nominal model fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from diagnosis.diagnosable import refuse_indefinite
from diagnosis.likelihood.compression import compressed
from diagnosis.likelihood.least_squares import Fit, FitError, fit, scaled_residuals
from diagnosis.likelihood.mains_lines import fastest, mains_interval
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import CHANNELS, misfit
from diagnosis.likelihood.starting_points import loses_phase, misses_motion, nominal_starts
from diagnosis.model.blocks import prepare, without_rest, without_start
from diagnosis.model.data import Data
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similar import similar_campaign
from diagnosis.model.similarity import Similarity
from diagnosis.noise.gap import GapTest, gap_or_colour
from diagnosis.noise.kinds import Noise
from diagnosis.noise.mains import Hum, find_hum, refine_frequency, remove_hum
from diagnosis.noise.rounding import Rounding
from diagnosis.noise.sensor_noise import (
    NoiseTrend,
    campaign_noise,
    noise_trend,
    reading_levels,
    reading_step,
    typical_step,
)
from diagnosis.search.clock import StepClock
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.one_more import second_mode_alone
from diagnosis.search.scatter import as_stated
from diagnosis.settings import Settings
from diagnosis.where.place import Place, locate
from tunnel_sim.effects import Effect, the_effect
from tunnel_sim.effects.capabilities import CoarseSteps, MainsPickup
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

HUM_LEFT: Final = 0.02
"""Maximum share of a removed hum that may remain without a cause. Judgement."""

COARSE_FROM: Final = 1.5
"""Minimum ratio of the step of the readings to the stated resolution for a coarse sensor. Judgement."""

#: The effects detected in the records before any effect is fitted.
HUM, COARSE_STEP = the_effect(MainsPickup), the_effect(CoarseSteps)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A campaign before any effect is fitted, in the units of the similar campaign.

    Args:
        campaign: the similar campaign (`diagnosis.model.similarity`).
        similarity: the conversion from the measured campaign.
        kinds: the effects that may be named.
        noise: noise of the records without the hum.
        trend: change of the noise with the motion.
        step: of the lattice on which the readings lie, rad; 0 where they are continuous.
        coarse: whether that step is coarser than the stated resolution.
        hum: the hum that was removed, or None.
        nominal: the nominal fit, to the runs that the answers are fitted to.
        cut: whether the start of every run and the time after its motion were left out, because the nominal model
            misses the motion grossly.
        rested: runs with a long rest at their end, which the fits leave out.
        tested: the nominal fit in the blocks used to test noise and gap, if the blocks of ``nominal`` are
            wider.
        uncut: the nominal fit to whole runs, if these were cut.
    """

    campaign: Campaign
    similarity: Similarity
    kinds: tuple[type[Effect], ...]
    noise: Noise
    trend: NoiseTrend
    step: float
    coarse: bool
    hum: Hum | None
    nominal: Fit
    cut: bool = False
    rested: tuple[str, ...] = ()
    tested: Fit | None = None
    uncut: Fit | None = None

    @property
    def read_off(self) -> tuple[str, ...]:
        """Causes detected in the records before fitting."""
        found = {HUM.name: self.hum is not None, COARSE_STEP.name: self.coarse}
        return tuple(name for name, present in found.items() if present)

    @property
    def settings(self) -> Settings:
        """The settings of the diagnosis."""
        return self.nominal.settings

    @property
    def able(self) -> tuple[type[Effect], ...]:
        """The effects that can be found by a fit."""
        return tuple(kind for kind in self.kinds if kind.fitted)

    @cached_property
    def ringing(self) -> Hypothesis | None:
        """The second mode, where it alone corrects a motion that the nominal model misses."""
        return second_mode_alone(self.nominal, self.able) if misses_motion(self.nominal) else None

    def left_by_read_off(self, base: Fit) -> Array:
        """χ² by channel that needs no effect, shape (6,), dimensionless.

        The error of a coarse step is not white, and follows a slow motion. If a hum is not a pure line, its
        removal leaves a small residual.

        Args:
            base: fit of the nominal model to the runs on which sets are compared.
        """
        left = self.hum_power(base, HUM_LEFT)
        if not self.coarse:
            return left
        levels, stated = reading_levels(self.campaign), self.campaign.sensor.noise_std
        white = self.noise.white(typical_step(levels))
        # a coarse step hides the noise, so the stated noise is the better estimate
        white = dict.fromkeys(white, stated) if stated else white
        rounding = Rounding.of(base, white, self.step, levels)
        tries = [misfit(base, residuals).excess for residuals in rounding.residuals(base.problem.data)]
        return np.asarray(left + np.maximum(np.mean(tries, axis=0), 0.0), np.float64) if tries else left

    def hum_power(self, base: Fit, share: float = 1.0) -> Array:
        """χ² by channel of the removed hum, in the readings of a fit, shape (6,), dimensionless.

        Args:
            share: share of the hum's power, a fraction.
        """
        size = 0.0 if self.hum is None else share * self.hum.excess * base.count
        return np.array([size * (name == "harmonics") for name in CHANNELS])

    def in_wider_blocks(self) -> Prepared:
        """The campaign with its runs in blocks for fits, unless a hum would remain in them."""
        if self.hum is not None:
            return self
        return replace(self, nominal=compressed(self.nominal), tested=self.nominal)

    def place(self) -> Place:
        """The place of the gap, from the residuals of the nominal model alone."""
        stated = self.noise.stated_variance if self.coarse else None
        nominal = self.tested or self.nominal
        level = float(np.mean([run.noise.variance * run.block for run in nominal.problem.data.runs]))
        ratio = level / stated if stated else 1.0
        return locate(self.campaign, nominal, hum_removed=self.hum is not None, noise_ratio=ratio)


def prepared_and_tested(
    measured: Campaign,
    model: NominalModel,
    kinds: Sequence[type[Effect]],
    clock: StepClock,
    settings: Settings,
) -> tuple[Prepared, GapTest]:
    """Measure the noise, remove the hum, fit the nominal model and test for a gap.

    Args:
        measured: the campaign in its own units.
        model: its nominal model, in the same units.
        kinds: the effects that may be named, and detected in the records.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    campaign, similarity = similar_campaign(measured, model)
    model = model.similar(similarity)
    allowed = {kind.name for kind in kinds}
    with clock.step("noise"):
        noise = campaign_noise(campaign, settings.noise)
        trend, step = noise_trend(campaign), reading_step(campaign)
        stated = campaign.sensor.resolution
        coarse = COARSE_STEP.name in allowed and stated is not None and step > COARSE_FROM * stated
    with clock.step("nominal fit"):
        nominal = fit_nominal(prepare(campaign, noise.variance, similarity, model=model, settings=settings))
        hum = None
        if HUM.name in allowed:
            nominal, noise, hum = _without_hum(campaign, similarity, nominal, noise)
        # a second mode is missing from the start on, and its decay is counted from there
        missed = loses_phase(nominal)
        cut = missed and second_mode_alone(nominal, kinds) is None
        uncut = nominal if cut else None
        if cut:
            nominal = fit_nominal(without_rest(without_start(nominal.problem.data)))
        nominal = as_stated(nominal, kinds)
        nominal, noise, test = gap_or_colour(nominal, noise, trend, step=step, coarse_step=coarse)
    known = (noise, trend, step, coarse, hum, nominal, cut)
    return Prepared(campaign, similarity, tuple(kinds), *known, uncut=uncut), test


def _without_hum(
    campaign: Campaign, similarity: Similarity, nominal: Fit, noise: Noise
) -> tuple[Fit, Noise, Hum | None]:
    """The nominal fit to records without their hum, their noise, and the hum; unchanged without a hum."""
    model, settings = nominal.problem.data.model, nominal.settings
    # block means short enough to show every mains line that the samples show
    interval = mains_interval(similarity)
    problem = Problem(prepare(campaign, noise.variance, similarity, interval, model, settings))
    residuals = scaled_residuals(problem, nominal.point)
    line = find_hum(replace(nominal, problem=problem, residuals=residuals))
    if line is None:
        return nominal, noise, None
    motion = fastest(nominal)
    frequency = refine_frequency(campaign, line, motion)
    for _ in range(2):  # a hum may count as noise at first
        variance = float(np.mean(list(noise.variance.values())))
        cleaned, hum = remove_hum(campaign, frequency, variance, settings.read_off, motion)
        noise = campaign_noise(cleaned, settings.noise)
    data = prepare(cleaned, noise.variance, similarity, model=model, settings=settings)
    return fit_nominal(data), noise, hum


def fit_nominal(data: Data) -> Fit:
    """Fit the nominal model; where it misses the motion, start from the runs' decays as well.

    Raises:
        TunnelError: when the nominal model cannot be fitted.
    """
    try:
        starts = nominal_starts(data)
        found = fit(Problem(data), next(starts))
        nearer = next(starts, None) if misses_motion(found) else None
        if nearer is not None:
            found = min(found, fit(Problem(data), nearer), key=lambda one: one.total)
    except (FitError, np.linalg.LinAlgError) as error:
        raise TunnelError(
            "the nominal model cannot be fitted",
            remedy="check spring stiffness, wind speed and that the runs are free decays of three cycles or more",
        ) from error
    refuse_indefinite(found)
    return found
