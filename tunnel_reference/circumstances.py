"""Draws the scale of the rig, the number of runs, the colour of the noise and the time stamps."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from tunnel_reference.conditions import Conditions

_TIME_SCALE = 30.0  # periods from 1/30 of the standard rig's to 30 times as long
_MOMENT_SCALE = 100.0
_FASTER_AIR = 4.0  # at most 100 m/s, where the standard rig has 25 m/s
_MAINS_SCALES = (0.3, 9.0)  # between these the mains lie above the motion and below half the sample rate

CIRCUMSTANCES = ("few_runs", "coloured", "uneven_stamps", "scaled")


def draw_circumstances(
    rng: np.random.Generator,
    conditions: Conditions,
    *,
    probability: float,
    mains: bool = False,
    certain: Collection[str] = (),
) -> Conditions:
    """Change each circumstance with the same probability, independently of the others.

    Args:
        rng: source of all random numbers.
        conditions: of the standard rig.
        probability: of each change.
        mains: whether mains hum acts, so that the sample rate must resolve it.
        certain: the changes that are made whatever the probability, of ``CIRCUMSTANCES``.

    Returns:
        Conditions of a rig of another scale, with few springs and speeds, coloured noise, or uneven time stamps.
    """
    found = conditions
    for name, change in zip(CIRCUMSTANCES, (_few_runs, _coloured, _uneven_stamps), strict=False):
        if rng.random() < (1.0 if name in certain else probability):
            changed = change(rng, found)
            while changed is found and name in certain:  # a wind speed that the springs kept do not have
                changed = change(rng, found)
            found = changed
    return (
        _scaled(rng, found, mains) if rng.random() < (1.0 if "scaled" in certain else probability) else found
    )


def _few_runs(rng: np.random.Generator, c: Conditions) -> Conditions:
    """The runs of one or two springs, in still air and at one speed."""
    springs, speeds = np.unique(c.spring_stiffness), np.unique(c.wind_speed[c.wind_on])
    number = min(int(rng.integers(1, 3)), springs.size)
    keep = np.isin(c.spring_stiffness, rng.choice(springs, number, replace=False))
    if speeds.size:
        keep &= ~c.wind_on | (c.wind_speed == rng.choice(speeds))
    if np.all(c.wind_on[keep]) or not np.any(c.wind_on[keep]):
        return c
    by_run = {name: value[keep] for name, value in vars(c).items() if np.shape(value) == keep.shape}
    return replace(c, **by_run)


def _coloured(rng: np.random.Generator, c: Conditions) -> Conditions:
    """Half or more of the noise's power falls off above a corner frequency."""
    corner = float(np.exp(rng.uniform(np.log(3.0), np.log(100.0))))
    return replace(c, noise_corner=corner, coloured_share=float(rng.uniform(0.5, 0.95)))


def _uneven_stamps(rng: np.random.Generator, c: Conditions) -> Conditions:
    """Samples taken late by part of an interval and stamped when taken, or even samples with rounded stamps."""
    if rng.random() < 0.5:
        return replace(c, clock_jitter=float(rng.uniform(0.05, 0.5)), clock_seed=int(rng.integers(2**31)))
    return replace(c, stamp_step=float(rng.uniform(0.05, 0.5)) / c.sample_rate)


def _scaled(rng: np.random.Generator, c: Conditions, mains: bool) -> Conditions:
    """Another scale of time and of moments, such that the air is not faster than four times the drawn speed."""
    time = float(np.exp(rng.uniform(-1.0, 1.0) * np.log(_TIME_SCALE)))
    if mains:
        time = float(np.clip(time, *_MAINS_SCALES))
    # A moment scales as length⁵/time², a speed as length/time.
    top = min(_MOMENT_SCALE, _FASTER_AIR**5 * time**3)
    moment = float(np.exp(rng.uniform(-np.log(_MOMENT_SCALE), np.log(top))))
    return replace(c, time_scale=time, moment_scale=moment)
