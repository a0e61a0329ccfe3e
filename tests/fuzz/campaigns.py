"""Campaigns that no rig gives: small free decays, and what can be wrong with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.fuzz.values import Rng
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

IDS = (
    "$\\foo$",
    "[/x]",
    "$",
    "_",
    "a b",
    "%",
    "{0}",
    "<b>",
    "\\",
    "é" * 200,
    "..",
    "nan",
    "[bold]",
    "^2",
    "😀",
)
_INERTIA, _DAMPING, _DENSITY = 0.1, 0.01, 1.2
_AREA, _LENGTH = 0.036, 0.625


def free_decays(rng: Rng) -> Campaign:
    """A small campaign that is right: two springs or one, the wind off and on, five to fifteen cycles.

    Args:
        rng: decides springs, damping, sampling and noise.
    """
    springs = ((16.12, 44.84), (16.12,), (8.0, 20.0))[rng.integers(3)]
    speeds = ((0.0, 15.0), (0.0, 10.0, 20.0), (0.0,))[rng.choice(3, p=(0.7, 0.2, 0.1))]
    damping = _DAMPING * float(10.0 ** rng.uniform(-1.0, 1.0))
    noise = float(10.0 ** rng.uniform(-6.0, -2.0))
    runs = [
        _run(f"r{number}", spring, speed, damping, noise, rng)
        for number, (spring, speed) in enumerate([(k, v) for k in springs for v in speeds], 1)
    ]
    stated = None if rng.random() < 0.4 else noise
    resolution = None if rng.random() < 0.5 else float((0.0, 1e-4, 2e-3)[rng.integers(3)])
    return Campaign(
        "fuzz",
        RigProperties(_INERTIA, _AREA, _LENGTH, 0.225),
        SensorProperties(resolution=resolution, noise_std=stated),
        tuple(runs),
    )


def _run(name: str, spring: float, speed: float, damping: float, noise: float, rng: Rng) -> Run:
    load = 0.5 * _DENSITY * speed * _AREA * _LENGTH
    stiffness, loss = spring - load * speed * 0.45, damping + load * _LENGTH * 0.2
    decay = 0.5 * loss / _INERTIA
    omega = float(np.sqrt(stiffness / _INERTIA - decay**2))
    rate = omega / (2.0 * np.pi) * float(rng.uniform(15.0, 30.0))
    time = np.arange(int(rate * rng.uniform(5.0, 15.0) * 2.0 * np.pi / omega)) / rate
    swing = 0.35 * np.exp(-decay * time) * np.cos(omega * time)
    reading = swing + float(rng.normal(0.0, 0.01)) + rng.normal(0.0, noise, time.size)
    return Run(name, Record(time, reading), speed, spring, _DENSITY if speed else None, 0.35)


def degenerate(rng: Rng) -> Campaign:
    """A campaign with up to three things wrong, mostly one.

    Args:
        rng: decides what.
    """
    campaign = free_decays(rng)
    for _ in range(int(rng.choice(4, p=(0.1, 0.5, 0.3, 0.1)))):
        kind = rng.random()
        if kind < 0.55:
            campaign = _readings(campaign, rng)
        elif kind < 0.85:
            campaign = _conditions(campaign, rng)
        else:
            campaign = CAMPAIGNS[rng.integers(len(CAMPAIGNS))](campaign, rng)
    return campaign


def _readings(campaign: Campaign, rng: Rng) -> Campaign:
    """One run, or every run, with its readings changed in one way."""
    change = READINGS[rng.integers(len(READINGS))]
    chosen = set(range(len(campaign.runs))) if rng.random() < 0.5 else {int(rng.integers(len(campaign.runs)))}
    runs = []
    for number, run in enumerate(campaign.runs):
        time, yaw = run.record.time_s, run.record.yaw_rad
        if number in chosen:
            time, yaw = change(time.copy(), yaw.copy(), rng)
        runs.append(replace(run, record=Record(time, yaw)))
    return replace(campaign, runs=tuple(runs))


Pair = tuple[Array, Array]


def _scaled(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, yaw * float(10.0 ** rng.choice((-310, -200, -160, -80, -20, -9, -4, 1, 2, 4, 9, 100)))


def _constant(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, np.full_like(yaw, (0.0, 1.0, -1e-300, 0.35, 3.0, 5e-324)[rng.integers(6)])


def _spiked(time: Array, yaw: Array, rng: Rng) -> Pair:
    yaw[rng.integers(yaw.size, size=rng.integers(1, 6))] = float(rng.choice((1.0, -3.0, 1e3, 1e9, 1e-300)))
    return time, yaw


def _garbage(time: Array, yaw: Array, rng: Rng) -> Pair:
    kinds = (rng.normal(size=yaw.size), rng.standard_cauchy(yaw.size), np.cumsum(rng.normal(size=yaw.size)))
    return time, kinds[rng.integers(3)] * 0.1


def _damped(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, yaw * np.exp(-time / time[-1] * float(rng.choice((5.0, 30.0, 300.0))))


def _growing(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, yaw * np.exp(time / time[-1] * float(rng.choice((0.5, 3.0, 30.0))))


def _ramped(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, (0.0 if rng.random() < 0.5 else 1.0) * yaw + time / time[-1] * float(
        rng.choice((0.01, 1.0, 3.0))
    )


def _saturated(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, np.clip(yaw, -(level := 0.35 * float(rng.choice((0.9, 0.5, 0.1, 1e-3)))), level)


def _stepped(time: Array, yaw: Array, rng: Rng) -> Pair:
    step = float(rng.choice((1e-3, 0.05, 0.3, 1.0)))
    return time, np.round(yaw / step) * step


def _shortened(time: Array, yaw: Array, rng: Rng) -> Pair:
    count = int(rng.choice((8, 12, 20, 40, yaw.size)))
    return time[:count], yaw[:count]


def _thinned(time: Array, yaw: Array, rng: Rng) -> Pair:
    step = min(int(rng.integers(2, 9)), yaw.size - 1)  # a record has two samples or more
    return time[::step], yaw[::step]


def _reversed(time: Array, yaw: Array, _rng: Rng) -> Pair:
    return time, yaw[::-1].copy()


def _waited(time: Array, yaw: Array, rng: Rng) -> Pair:
    count = int(rng.integers(1, yaw.size))
    return np.arange(yaw.size + count) * (time[1] - time[0]), np.concatenate([np.full(count, yaw[0]), yaw])


def _stretched(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time * float(10.0 ** rng.choice((-9, -3, 3, 9))), yaw


def _pure(time: Array, yaw: Array, rng: Rng) -> Pair:
    cycles = float(rng.choice((3.0, 10.0, yaw.size / 2.0, yaw.size / 4.0)))
    return time, 0.35 * np.cos(2.0 * np.pi * cycles * np.arange(yaw.size) / yaw.size)


def _offset(time: Array, yaw: Array, rng: Rng) -> Pair:
    return time, yaw + float(rng.choice((np.pi, -np.pi, 1e3, 1e9, 1e15)))


READINGS: tuple[Callable[[Array, Array, Rng], Pair], ...] = (
    _scaled, _constant, _spiked, _garbage, _damped, _growing, _ramped, _saturated, _stepped, _shortened, _thinned,
    _reversed, _waited, _stretched, _pure, _offset,
)  # fmt: skip


def _conditions(campaign: Campaign, rng: Rng) -> Campaign:
    """One stated number of the rig, the sensor or a run changed, or left out."""
    owners = ("rig", "sensor", "run")
    owner = owners[rng.choice(3, p=(0.25, 0.25, 0.5))]
    if owner == "run":
        chosen = None if rng.random() < 0.3 else int(rng.integers(len(campaign.runs)))
        name = ("spring_stiffness", "wind_speed", "air_density", "release_angle")[rng.integers(4)]
        scale = _scale(rng)
        if name == "wind_speed" and scale is None:
            scale = 0.0
        runs = [
            replace(run, **{name: _moved(getattr(run, name), scale)}) if chosen in (None, number) else run
            for number, run in enumerate(campaign.runs)
        ]
        return replace(campaign, runs=tuple(runs))
    table = getattr(campaign, owner)
    names = ("yaw_inertia", "frontal_area", "reference_length", "width") if owner == "rig" else _SENSOR
    name = names[rng.integers(len(names))]
    value = getattr(table, name)
    base = 1e-3 if value is None and owner == "sensor" else value
    return replace(campaign, **{owner: replace(table, **{name: _moved(base, _scale(rng))})})


_SENSOR = ("resolution", "noise_std")


def _scale(rng: Rng) -> float | None:
    """A factor; None leaves the value out."""
    if rng.random() < 0.2:
        return None
    return float(
        rng.choice((0.0, 5e-324, 1e-150, 1e-9, 1e-3, 0.5, 1.0 + 1e-9, 1.1, 2.0, 1e3, 1e9, 1e150, 1e300))
    )


def _moved(value: float | None, scale: float | None) -> float | None:
    if scale is None:
        return None if value is None or value != 0.0 else value
    return value if value is None else value * scale


def _identical(campaign: Campaign, _rng: Rng) -> Campaign:
    first = campaign.runs[0]
    return replace(campaign, runs=tuple(replace(run, record=first.record) for run in campaign.runs))


def _copied(campaign: Campaign, rng: Rng) -> Campaign:
    """One run alone, perhaps under several names."""
    run = campaign.runs[rng.integers(len(campaign.runs))]
    return replace(campaign, runs=tuple(replace(run, id=f"c{n}") for n in range(int(rng.integers(1, 4)))))


def _close_springs(campaign: Campaign, rng: Rng) -> Campaign:
    """All springs alike but for little, whatever the records say."""
    little = float(rng.choice((0.0, 1e-15, 1e-9, 1e-4)))
    runs = [replace(run, spring_stiffness=16.12 * (1.0 + n * little)) for n, run in enumerate(campaign.runs)]
    return replace(campaign, runs=tuple(runs))


def _swapped(campaign: Campaign, rng: Rng) -> Campaign:
    """Records that stand under one another's conditions."""
    order = rng.permutation(len(campaign.runs))
    records = [campaign.runs[i].record for i in order]
    return replace(
        campaign, runs=tuple(replace(run, record=r) for run, r in zip(campaign.runs, records, strict=True))
    )


def _named(campaign: Campaign, rng: Rng) -> Campaign:
    """Names that markup, mathematics or paths take for something else."""
    names = [IDS[i] for i in rng.permutation(len(IDS))]
    runs = [replace(run, id=name) for run, name in zip(campaign.runs, names, strict=False)]
    return replace(campaign, name=names[-1], runs=tuple(runs))


def _windy(campaign: Campaign, rng: Rng) -> Campaign:
    """The wind always on, never, or labelled the wrong way round."""
    kind = rng.integers(3)
    speeds = [(15.0, 0.0, 0.0 if run.wind_on else 15.0)[kind] for run in campaign.runs]
    runs = [
        replace(run, wind_speed=v, air_density=_DENSITY if v else None)
        for run, v in zip(campaign.runs, speeds, strict=True)
    ]
    return replace(campaign, runs=tuple(runs))


CAMPAIGNS: tuple[Callable[[Campaign, Rng], Campaign], ...] = (
    _identical, _copied, _close_springs, _swapped, _named, _windy
)  # fmt: skip
