"""Campaigns that no rig gives: small free decays, and what can be wrong with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from tests.fuzz.values import Draw, place_in
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.limits import LARGEST_NUMBER
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
_SCALES = (None, 0.0, 5e-324, 1e-150, 1e-9, 1e-3, 0.5, 1.0 + 1e-9, 1.1, 2.0, 1e3, 1e9, 1e150, 1e300)
"""Factors of a stated number; None leaves it out."""
_STATED = {
    "rig": ("yaw_inertia", "frontal_area", "reference_length", "width"),
    "sensor": ("resolution", "noise_std"),
    "run": ("spring_stiffness", "wind_speed", "air_density", "release_angle"),
}
generators = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def free_decays(rng: np.random.Generator) -> Campaign:
    """A small campaign that is right: two springs or one, the wind off and on, five to fifteen cycles."""
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
    sensor = SensorProperties(resolution=resolution, noise_std=stated)
    return Campaign("fuzz", RigProperties(_INERTIA, _AREA, _LENGTH, 0.225), sensor, tuple(runs))


def _run(
    name: str, spring: float, speed: float, damping: float, noise: float, rng: np.random.Generator
) -> Run:
    load = 0.5 * _DENSITY * speed * _AREA * _LENGTH
    stiffness, loss = spring - load * speed * 0.45, damping + load * _LENGTH * 0.2
    decay = 0.5 * loss / _INERTIA
    omega = float(np.sqrt(stiffness / _INERTIA - decay**2))
    rate = omega / (2.0 * np.pi) * float(rng.uniform(15.0, 30.0))
    time = np.arange(int(rate * rng.uniform(5.0, 15.0) * 2.0 * np.pi / omega)) / rate
    swing = 0.35 * np.exp(-decay * time) * np.cos(omega * time)
    reading = swing + float(rng.normal(0.0, 0.01)) + rng.normal(0.0, noise, time.size)
    return Run(name, Record(time, reading), speed, spring, _DENSITY if speed else None, 0.35)


@st.composite
def degenerate(draw: Draw) -> Campaign:
    """A campaign with up to three things wrong, mostly one or two."""
    campaign = free_decays(draw(generators))
    kinds = (_with_readings,) * 4 + (_with_conditions,) * 2 + (_with_fault,)
    for change in draw(st.lists(st.sampled_from(kinds), max_size=3)):
        campaign = change(draw, campaign)
    return campaign


def _with_readings(draw: Draw, campaign: Campaign) -> Campaign:
    """One run, or every run, with its readings changed in one way."""
    change = draw(st.sampled_from(READINGS))
    chosen = draw(st.none() | place_in(len(campaign.runs)))
    runs = []
    for number, run in enumerate(campaign.runs):
        record = run.record
        if chosen in (None, number):
            time, yaw = change(draw, record.time_s.copy(), record.yaw_rad.copy())
            # two changes may exceed what a record takes, which is refused where it is made
            record = Record(time, np.clip(yaw, -LARGEST_NUMBER, LARGEST_NUMBER))
        runs.append(replace(run, record=record))
    return replace(campaign, runs=tuple(runs))


Pair = tuple[Array, Array]


def _scaled(draw: Draw, time: Array, yaw: Array) -> Pair:
    return time, yaw * 10.0 ** draw(st.sampled_from((-310, -200, -160, -80, -20, -9, -4, 1, 2, 4, 9, 100)))


def _constant(draw: Draw, time: Array, yaw: Array) -> Pair:
    return time, np.full_like(yaw, draw(st.sampled_from((0.0, 1.0, -1e-300, 0.35, 3.0, 5e-324))))


def _spiked(draw: Draw, time: Array, yaw: Array) -> Pair:
    places = draw(st.lists(place_in(yaw.size), min_size=1, max_size=5))
    yaw[places] = draw(st.sampled_from((1.0, -3.0, 1e3, 1e9, 1e-300)))
    return time, yaw


def _garbage(draw: Draw, time: Array, yaw: Array) -> Pair:
    rng = draw(generators)
    kinds = (rng.normal(size=yaw.size), rng.standard_cauchy(yaw.size), np.cumsum(rng.normal(size=yaw.size)))
    return time, kinds[draw(place_in(3))] * 0.1


def _grown(draw: Draw, time: Array, yaw: Array) -> Pair:
    return time, yaw * np.exp(time / time[-1] * draw(st.sampled_from((-300.0, -30.0, -5.0, 0.5, 3.0, 30.0))))


def _ramped(draw: Draw, time: Array, yaw: Array) -> Pair:
    return time, draw(st.sampled_from((0.0, 1.0))) * yaw + time / time[-1] * draw(
        st.sampled_from((0.01, 1.0, 3.0))
    )


def _saturated(draw: Draw, time: Array, yaw: Array) -> Pair:
    level = 0.35 * draw(st.sampled_from((0.9, 0.5, 0.1, 1e-3)))
    return time, np.clip(yaw, -level, level)


def _stepped(draw: Draw, time: Array, yaw: Array) -> Pair:
    step = draw(st.sampled_from((1e-3, 0.05, 0.3, 1.0)))
    return time, np.round(yaw / step) * step


def _shortened(draw: Draw, time: Array, yaw: Array) -> Pair:
    count = draw(st.sampled_from((8, 12, 20, 40)))
    return time[:count], yaw[:count]


def _thinned(draw: Draw, time: Array, yaw: Array) -> Pair:
    step = min(draw(st.integers(2, 8)), yaw.size - 1)  # a record has two samples or more
    return time[::step], yaw[::step]


def _reversed(_draw: Draw, time: Array, yaw: Array) -> Pair:
    return time, yaw[::-1].copy()


def _waited(draw: Draw, time: Array, yaw: Array) -> Pair:
    count = draw(st.integers(1, max(1, yaw.size - 1)))
    return np.arange(yaw.size + count) * (time[1] - time[0]), np.concatenate([np.full(count, yaw[0]), yaw])


def _stretched(draw: Draw, time: Array, yaw: Array) -> Pair:
    return time * 10.0 ** draw(st.sampled_from((-9, -3, 3, 9))), yaw


def _pure(draw: Draw, time: Array, yaw: Array) -> Pair:
    cycles = draw(st.sampled_from((3.0, 10.0, yaw.size / 2.0, yaw.size / 4.0)))
    return time, 0.35 * np.cos(2.0 * np.pi * cycles * np.arange(yaw.size) / yaw.size)


def _offset(draw: Draw, time: Array, yaw: Array) -> Pair:
    return time, yaw + draw(st.sampled_from((np.pi, -np.pi, 1e3, 1e9, 1e15)))


READINGS: tuple[Callable[[Draw, Array, Array], Pair], ...] = (
    _scaled, _constant, _spiked, _garbage, _grown, _ramped, _saturated, _stepped, _shortened, _thinned, _reversed,
    _waited, _stretched, _pure, _offset,
)  # fmt: skip


def _with_conditions(draw: Draw, campaign: Campaign) -> Campaign:
    """One stated number of the rig, the sensor or one or all runs changed, or left out."""
    owner = draw(st.sampled_from(("run", "run", "rig", "sensor")))
    name, scale = draw(st.sampled_from(_STATED[owner])), draw(st.sampled_from(_SCALES))
    if owner != "run":
        table = getattr(campaign, owner)
        changed = replace(
            table, **{name: _moved(getattr(table, name), scale, 1e-3 if owner == "sensor" else None)}
        )
        return replace(campaign, **{owner: changed})
    scale = 0.0 if name == "wind_speed" and scale is None else scale
    chosen = draw(st.none() | place_in(len(campaign.runs)))
    runs = [
        replace(run, **{name: _moved(getattr(run, name), scale)}) if chosen in (None, number) else run
        for number, run in enumerate(campaign.runs)
    ]
    return replace(campaign, runs=tuple(runs))


def _moved(value: float | None, scale: float | None, missing: float | None = None) -> float | None:
    value = missing if value is None else value
    if scale is None or value is None:
        return value if value == 0.0 else None
    return value * scale


def _with_fault(draw: Draw, campaign: Campaign) -> Campaign:
    """Records, springs, wind labels or names that belong to other runs, to all runs, or to none."""
    runs = campaign.runs
    fault = draw(st.sampled_from(("one record", "copies", "springs", "swapped", "names", "wind")))
    if fault == "one record":
        changed = [replace(run, record=runs[0].record) for run in runs]
    elif fault == "copies":
        run = draw(st.sampled_from(runs))
        changed = [replace(run, id=f"c{number}") for number in range(draw(st.integers(1, 3)))]
    elif fault == "springs":
        little = draw(st.sampled_from((0.0, 1e-15, 1e-9, 1e-4)))
        changed = [replace(run, spring_stiffness=16.12 * (1.0 + n * little)) for n, run in enumerate(runs)]
    elif fault == "swapped":
        records = draw(st.permutations([run.record for run in runs]))
        changed = [replace(run, record=record) for run, record in zip(runs, records, strict=True)]
    elif fault == "names":  # that markup, mathematics or paths take for something else
        names = draw(st.permutations(IDS))
        campaign = replace(campaign, name=names[-1])
        changed = [replace(run, id=name) for run, name in zip(runs, names, strict=False)]
    else:  # always on, never, or labelled the wrong way round
        kind = draw(place_in(3))
        speeds = [(15.0, 0.0, 0.0 if run.wind_on else 15.0)[kind] for run in runs]
        changed = [
            replace(run, wind_speed=speed, air_density=_DENSITY if speed else None)
            for run, speed in zip(runs, speeds, strict=True)
        ]
    return replace(campaign, runs=tuple(changed))
