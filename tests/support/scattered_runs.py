"""Runs that do not repeat, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.reference.free_decays import damped_cosine
from tests.support.gap_campaigns import CN_BETA, CN_R, DAMPING, INERTIA, NOISE, campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Record

SCATTERED = ("wind_speed_scatter", "stiffness_scatter", "damping_scatter")
"""Effects that act by chance between the runs."""


def scattered(seed: int = 5, stiffness_scatter: float = 5e-4) -> Campaign:
    """Twelve runs in closed form, with scatter of 0.3 % in speed, 1 % in damping, and a given one in stiffness."""
    rng, time, runs = np.random.default_rng(seed), np.arange(0.0, 7.0, 0.01), []
    base = campaign(duration=0.1)
    for number in range(12):
        like = base.runs[number % len(base.runs)]
        spring = like.spring_stiffness * (1.0 + stiffness_scatter * rng.standard_normal())
        speed = like.wind_speed * (1.0 + 3e-3 * rng.standard_normal())
        damper = DAMPING * (1.0 + 1e-2 * rng.standard_normal())
        area = 0.5 * 1.2 * 0.036 * 0.625
        stiffness = spring - area * speed**2 * CN_BETA
        rate = damper - area * 0.625 * speed * CN_R
        swing = damped_cosine(time, rate / INERTIA, stiffness / INERTIA, 0.35, 0.0)
        record = Record(time, swing + rng.normal(0.0, NOISE, time.size))
        runs.append(replace(like, id=f"r{number}", record=record))
    return replace(base, runs=tuple(runs), sensor=replace(base.sensor, sample_rate=100.0))
