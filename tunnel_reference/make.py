"""Makes sets of campaigns with known truth; ``tunnel blind make`` writes them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from tunnel_reference.draw import DEFAULT_SHARES, KINDS, NUMBERS, CampaignDraw, Mixture, draw_campaign
from tunnel_reference.scatter_draws import scattered
from tunnel_reference.severity import Simulated, read_and_fit, simulate_motions, size_separably
from tunnel_reference.true_conditions import (
    FRONTAL_AREA,
    NOMINAL_INERTIA,
    REFERENCE_LENGTH,
    WIDTH,
)
from tunnel_sim.vocabulary.campaign import Campaign, Repeatability, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.input_kinds import InputColumn
from tunnel_sim.vocabulary.inputs import Hold, Input
from tunnel_sim.vocabulary.record import Record

SCHEMA_VERSION = 1
FEW_RUNS = 6
"""Least number of runs of the ordinary plans."""


def plan_kinds(count: int, shares: dict[str, float]) -> list[str]:
    """The kind of every campaign: numbers by largest remainder, in the order of the shares."""
    total = sum(shares.values())
    exact = {kind: count * share / total for kind, share in shares.items()}
    numbers = {kind: int(value) for kind, value in exact.items()}
    left = count - sum(numbers.values())
    for kind in sorted(exact, key=lambda k: numbers[k] - exact[k])[:left]:
        numbers[kind] += 1
    return [kind for kind, number in numbers.items() for _ in range(number)]


def draw_set(count: int, seed: int, shares: dict[str, float], mixture: Mixture) -> list[CampaignDraw]:
    """Draw a set in which all families occur about equally often.

    Args:
        seed: seed of all random numbers; the same arguments give the same set.
        shares: relative frequency of each kind.
    """
    root = np.random.SeedSequence(seed)
    order_seed, *seeds = root.spawn(count + 1)
    order = np.random.default_rng(order_seed)
    kinds = plan_kinds(count, shares)
    firsts = {
        kind: _in_turn(order, kinds.count(kind), mixture.families) for kind in NUMBERS if kind != "none"
    }
    draws = []
    for kind, child in zip(kinds, seeds, strict=True):
        rng = np.random.default_rng(child)
        families = (firsts[kind].pop(),) if kind in firsts else ()
        draws.append(draw_campaign(rng, kind=kind, mixture=mixture, families=families))
    return [draws[i] for i in order.permutation(count)]


def _in_turn(rng: np.random.Generator, number: int, families: Sequence[str]) -> list[str]:
    """Families in random order; their frequencies differ by at most one."""
    rounds = -(-number // len(families))
    names = [str(name) for _ in range(rounds) for name in rng.permutation(np.array(families))]
    return names[:number]


def simulate_set(draws: Sequence[CampaignDraw], *, progress: bool = False) -> list[Simulated]:
    """Scale the effects of drawn campaigns and simulate them."""
    sized = [
        replace(one, conditions=scattered(one.conditions, one.scatter))
        for one in size_separably(draws, progress=progress)  # with the excess due to the effects alone
    ]
    if progress:
        print(f"simulating {len(sized)} campaigns", file=sys.stderr)
    return [read_and_fit(d, motion) for d, motion in zip(sized, simulate_motions(sized), strict=True)]


def as_campaign(simulated: Simulated, name: str) -> Campaign:
    """The campaign without its truth: stated conditions and readings, in the scales of its rig."""
    c = simulated.draw.conditions
    stamps = np.round(c.time, 9) if c.stamp_step == 0.0 else np.round(c.time / c.stamp_step) * c.stamp_step
    density, start = (np.broadcast_to(value, (c.runs,)) for value in (c.air_density, c.time_start))
    length, speed = c.length_scale, c.length_scale / c.time_scale
    drives: list[Input | None] = [None] * c.runs
    if c.drive is not None:
        column = cast(InputColumn, c.drive.column)
        scale = {
            "moment_nm": c.moment_scale,
            "base_acceleration_rad_s2": c.time_scale**-2,
        }.get(column, 1.0)
        gain = c.drive.gain * c.moment_scale if column == "drive" and c.drive.stated else None
        for run in np.flatnonzero(c.drive.driven).tolist():
            hold: Hold = "zero" if c.drive.held[run] else "linear"
            drives[run] = Input(column, c.drive.values[c.written(run), run] * scale, hold, gain)
    runs = tuple(
        Run(
            id=f"r{number + 1:02d}",
            record=Record(
                np.round((start[number] + stamps[c.written(number)]) * c.time_scale, 11),
                np.round(simulated.readings[c.written(number), number] - c.offset, 7),
            ),
            wind_speed=float(c.wind_speed[number]) * speed,
            spring_stiffness=float(c.spring_stiffness[number]) * c.moment_scale,
            air_density=round(float(density[number]), 4),
            release_angle=float(c.release_angle[number]) if drives[number] is None else None,
            drive=drives[number],
        )
        for number in range(c.runs)
    )
    return Campaign(
        name=name,
        rig=RigProperties(
            NOMINAL_INERTIA * c.moment_scale * c.time_scale**2,
            FRONTAL_AREA * length**2,
            REFERENCE_LENGTH * length,
            WIDTH * length,
        ),
        sensor=SensorProperties(
            c.sample_rate / c.time_scale if np.all(c.every == 1) else None,
            c.resolution,
            c.stated_noise,
            zero="per_run" if np.any(c.zero_shift) else None,
        ),
        runs=runs,
        repeatability=Repeatability(**known) if (known := _stated(simulated.draw)) else None,
    )


def _stated(draw: CampaignDraw) -> dict[str, float]:
    return {} if draw.scatter is None else dict(draw.scatter.stated)


def truth_of(simulated: Simulated) -> dict[str, Any]:
    """The truth of a campaign, for ``truth.json``.

    ``effects`` is the sorted list of families (``["unknown"]`` for an effect outside the known ones, ``[]`` for
    none). ``small`` lists small effects, which need not be found. ``severity`` is the excess after
    refitting the nominal model. ``parameters`` gives each effect's form, severity parameter with its symbol,
    secondary parameters, and the excess to which it was scaled alone; its times and moments are values before
    ``scale`` was applied. Where the runs differ, ``scatter`` has the standard deviations between them, ``runs``
    every run's own deviations, and ``repeatability`` the campaign's statement; ``severity`` includes them.
    """
    draw, c = simulated.draw, simulated.draw.conditions
    mattering = [e for e in draw.effects if not e.small]
    return {
        "schema_version": SCHEMA_VERSION,
        "yaw_inertia": c.yaw_inertia * c.moment_scale * c.time_scale**2,
        "mechanical_damping": c.mechanical_damping * c.moment_scale * c.time_scale,
        "air_density": np.asarray(c.air_density).tolist(),
        "cn_beta": c.cn_beta,
        "cn_r": c.cn_r,
        "noise_std": c.noise_std,
        "sensor_zero": c.zero,
        "effects": sorted({e.form.family for e in mattering}),
        "small": sorted({e.form.family for e in draw.effects if e.small}),
        "kind": draw.kind,
        "form": [e.form.name for e in sorted(mattering, key=lambda e: e.form.family)],
        "scale": {"time": c.time_scale, "moment": c.moment_scale},
        "few_runs": c.runs < FEW_RUNS,
        "coloured_share": c.coloured_share,
        "driven": None
        if c.drive is None
        else {
            "column": c.drive.column,
            "runs": int(np.sum(c.drive.driven)),
            "gain": c.drive.gain * c.moment_scale,
        },
        "stamps": "jittered" if c.clock_jitter else "rounded" if c.stamp_step else "even",
        "severity": simulated.excess,
        "run_severity": [float(v) for v in simulated.run_excess],
        "parameters": {
            (e.form.family if e.form.family != "unknown" else e.form.name): {
                "form": e.form.name,
                "group": str(e.form.group),
                "symbol": e.form.symbol,
                "value": e.sign * e.value,
                "target_severity": e.target,
                "own_severity": e.own,
                **e.extra,
            }
            for e in draw.effects
        },
        **({} if draw.scatter is None else draw.scatter.truth(c.runs)),
    }


def parse_shares(text: str) -> dict[str, float]:
    """Parse kinds with optional weights, such as ``single:3,none``.

    The default weights are `DEFAULT_SHARES`, and 1 for any other kind.
    """
    shares: dict[str, float] = {}
    for item in text.split(","):
        kind, _, weight = item.strip().partition(":")
        if kind not in KINDS:
            raise TunnelError(f"unknown kind {kind!r}", where="--kinds", remedy=did_you_mean(kind, KINDS))
        try:
            shares[kind] = float(weight) if weight else DEFAULT_SHARES.get(kind, 1.0)
        except ValueError:
            shares[kind] = -1.0
        if not 0.0 < shares[kind] < np.inf:
            raise TunnelError(f"bad weight {weight!r}", where="--kinds", remedy="give a number above zero")
    return shares
