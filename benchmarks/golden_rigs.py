"""Campaigns of the golden set with unusual rigs, simulated from a fixed seed without the diagnosis's code."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from tests.reference import free_decays
from tests.reference.robot_joints import LEVEL, robot, robot_campaign
from tests.support.driven_runs import Planted, driven
from tests.support.robots import RUBS, TRUE
from tunnel_sim.vocabulary.campaign import Campaign, Quantity, RigProperties
from tunnel_sim.vocabulary.record import Record

SEED = 71


def simulated() -> Iterator[tuple[str, Campaign, str]]:
    """Unusual rigs: name, campaign, and MJCF of a user's model or nothing."""
    for name, joint, axis in (
        ("joint", TRUE, "0 0 1"),
        ("joint-rubs", RUBS, "0 0 1"),
        ("hangs", TRUE, LEVEL),
    ):
        xml = robot(joint, axis=axis)
        yield name, robot_campaign(xml), xml
    for kind, planted in (
        ("loose", Planted(friction=0.004)), ("loose, stated gain", Planted()), ("root", Planted(cubic=4.0)),
        ("turning base", Planted()), ("rates", Planted(friction=0.01)), ("moment", Planted(delay=0.02)),
        ("unknown gain", Planted(cubic=6.0)), ("no spring stated", Planted()), ("uneven", Planted()),
        ("moment, then released", Planted()),
    ):  # fmt: skip
        yield kind.replace(",", "").replace(" ", "-"), driven(kind, planted, seed=SEED), ""
    settings = free_decays.SIX
    still = [replace(one, speed=0.0) for one in settings]
    normal = [replace(one, spring=None) for one in settings if one.spring == 16.12]
    for name, chosen in (("still-air", still), ("normalised", normal), ("no-sizes", settings)):
        yield name, replace(decays(chosen), rig=RigProperties()), ""
    yield "gyro", reads(decays(settings), "rate", 2e-3), ""
    yield "accelerometer", reads(decays(settings), "acceleration", 5e-2), ""
    yield "limit-cycle", limit_cycles(decays(settings)), ""


def decays(settings: Any) -> Campaign:
    """Free decays of the nominal model in closed form, with noise."""
    rng = np.random.default_rng(SEED)
    made: Campaign = free_decays.campaign(settings, noise=4e-4, duration=8.0, rate=500.0, rng=rng)
    return made


def reads(campaign: Campaign, quantity: Quantity, noise: float) -> Campaign:
    """The same motions without their noise, read by another sensor with noise."""
    order, rng, runs = ("rate", "acceleration").index(quantity) + 1, np.random.default_rng(SEED), []
    for run in free_decays.campaign(free_decays.SIX, duration=8.0, rate=500.0).runs:
        clock = run.record.time_s
        values = CubicSpline(clock, run.record.yaw_rad).derivative(order)(clock)
        runs.append(replace(run, record=Record(clock, values + rng.normal(0.0, noise, clock.size))))
    sensor = replace(campaign.sensor, quantity=quantity, noise_std=noise, resolution=None)
    return replace(campaign, sensor=sensor, runs=tuple(runs))


def limit_cycles(campaign: Campaign) -> Campaign:
    """Growth to a limit cycle of 0.3 rad in every run with wind: β̈ − 2a(1 − (2β/A)²)β̇ + ω²β = 0."""

    def slope(_: float, state: Any, omega: float) -> list[float]:
        angle, rate = state
        return [rate, 0.8 * (1.0 - (2.0 * angle / 0.3) ** 2) * rate - omega**2 * angle]

    runs, rng, clock = [], np.random.default_rng(SEED), np.arange(15000) / 500.0
    for run in (run for run in campaign.runs if run.wind_on):
        omega = np.sqrt((run.spring_stiffness or 0.0) / free_decays.Truth().yaw_inertia)
        solved = solve_ivp(slope, (0.0, 30.0), (0.01, 0.0), "DOP853", clock, args=(omega,), rtol=1e-8)
        runs.append(replace(run, record=Record(clock, solved.y[0] + rng.normal(0.0, 2e-4, clock.size))))
    return replace(campaign, runs=tuple(runs))
