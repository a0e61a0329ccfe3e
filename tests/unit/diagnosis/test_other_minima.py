"""The other minima of a flexible rod's ringing. The truth is simulated by `tunnel_reference`."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.other_minima import deepest
from diagnosis.likelihood.prepare import prepare
from diagnosis.likelihood.problem import Point, Problem
from diagnosis.likelihood.starting_points import nominal_start
from tests.reference.rigs import rig
from tunnel_reference.conditions import Conditions, Input, Rod
from tunnel_reference.integrator import integrate
from tunnel_reference.make import as_campaign
from tunnel_reference.draw import CampaignDraw
from tunnel_reference.readings import read_motion
from tunnel_reference.severity import Simulated
from tunnel_sim.effects import effect_class

ROD = effect_class("rod_flexibility")
COMPLIANCE, SHARE = "rod_flexibility.compliance", "rod_flexibility.inertia_share"


def conditions(compliance: float, share: float, *, driven: bool, noise: float) -> Conditions:
    """Three springs in still air, released, or driven by a moment of sines that is held between its samples."""
    rod = Rod(compliance, share, held_body=True)
    free = rig((16.12, 35.02, 67.98), (0.0, 0.0, 0.0), (0.35, 0.35, 0.35), 3.0, rod=rod, noise_std=noise)
    if not driven:
        return free
    time = np.arange(free.samples) / free.sample_rate
    waves = sum(np.cos(2.0 * np.pi * f * time + f**2) for f in (1.0, 2.1, 3.3, 5.2))
    values = np.round(np.outer(waves, [1.0, 1.5, 2.0]), 1)
    no = np.zeros(3)
    drive = Input("moment_nm", values, np.ones(3, np.bool_), np.full(3, 0.3), 1.0, stated=True)
    return replace(free, drive=drive, start_angle=no, start_rate=no)


@lru_cache
def problem(compliance: float, share: float, *, driven: bool, noise: float = 4e-4) -> Problem:
    """The nominal model and a rod, to be fitted to what the independent simulator gives."""
    given = conditions(compliance, share, driven=driven, noise=noise)
    (motion,) = integrate([given], [[]], substeps=20)
    readings = read_motion(given, motion, [], np.random.default_rng(3))
    simulated = Simulated(CampaignDraw("single", given, (), 0), readings, 0.0, np.zeros(3), readings.T)
    campaign = as_campaign(simulated, "rod")
    return Problem(prepare(campaign, {run.id: noise**2 for run in campaign.runs}), (ROD,), rod_followed=True)


def fitted_from(problem: Problem, compliance: float, share: float) -> Fit:
    start = nominal_start(problem.data)
    return fit(problem, Point(np.append(start.common, [compliance, share]), start.release))
