"""Laws that every effect obeys; the conformance tests and ``tunnel effects check`` use them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tunnel_sim.effects import Effect, EffectChain
from tunnel_sim.effects.base import make_effect
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate, simulate_motion, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import Motion, RunSettings
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.plan import (
    AeroDerivatives,
    SensorModel,
    aerodynamic_damping,
    aerodynamic_stiffness,
)
from tunnel_sim.vocabulary.record import Array, Record

INTEGRATION_TOLERANCE = 2e-5
"""Greatest error of the integration, rad: a twenty-fifth of the sensor's noise, as stated in decision 0006."""

SENSOR = SensorModel(zero=0.003)
WIND_ON = RunSettings(
    16.12, AeroDerivatives(0.47, -0.3), 0.1014, 0.018,
    wind_speed=20.0, air_density=1.204, mean_speed=15.0, release_angle=0.35, duration=1.0,
)  # fmt: skip
WIND_OFF = replace(WIND_ON, wind_speed=0.0)
_TIME = np.arange(0.0, WIND_ON.duration, 1.0 / SENSOR.sample_rate)
DRIVE = InputMoment(_TIME, np.sin(2.0 * np.pi * (1.0 + 2.0 * _TIME) * _TIME))
"""Input for an effect that acts on driven runs only: a chirp over the resonance, N m."""


@dataclass(frozen=True)
class Verdict:
    """Whether an effect obeys a law; ``fault`` describes the violation, and is empty where it obeys."""

    law: str
    fault: str = ""


def example(kind: type[Effect], **changed: float) -> Effect:
    """The effect with the values at which it is visible, as stated by its class, with some of them changed."""
    values = dict(zip((info.name for info in kind.parameters()), kind.example, strict=False))
    return make_effect(kind, values | changed)


def stated(kind: type[Effect], run: RunSettings = WIND_ON) -> RunSettings:
    """The run, with an input if the effect acts on driven runs only."""
    return replace(run, drive=DRIVE) if kind.driven else run


def record(
    effects: tuple[Effect, ...], run: RunSettings, rng: np.random.Generator, sensor: SensorModel = SENSOR
) -> Record:
    """Simulate a free decay in MuJoCo, or a driven run by the forward integrator."""
    if run.drive is None:
        return simulate(load_rig(), run, sensor, rng, effects=effects)
    chain = EffectChain.draw(run, effects, rng)
    return read_motion(_driven(chain.physics(), sensor.sample_rate), sensor, rng, chain)


def _driven(run: RunSettings, sample_rate: float = SENSOR.sample_rate) -> Motion:
    return forward_motion(load_rig(), follow_fastest(load_rig(), run), sample_rate)


def _record(effects: tuple[Effect, ...], run: RunSettings) -> Record:
    return record(effects, run, np.random.default_rng(1))


@cache
def _bare(*, windy: bool, driven: bool) -> Record:
    run = WIND_ON if windy else WIND_OFF
    return _record((), replace(run, drive=DRIVE) if driven else run)


def _same(one: Record, other: Record) -> bool:
    return np.array_equal(one.yaw_rad, other.yaw_rad) and np.array_equal(one.time_s, other.time_s)


def null(kind: type[Effect]) -> str:
    """At zero severity the record is bit-identical to a record without the effect."""
    elsewhere = example(kind, **{kind.parameters()[0].name: 0.0})
    bare = _bare(windy=True, driven=kind.driven)
    changed = [not _same(_record((effect,), stated(kind)), bare) for effect in (kind(), elsewhere)]
    return "the record changes although the severity is 0" if any(changed) else ""


def seen(kind: type[Effect]) -> str:
    """Beyond its null the effect changes the record."""
    effect = example(kind)
    if effect.is_null:
        return "its example has a severity of 0"
    unchanged = _same(_record((effect,), stated(kind)), _bare(windy=True, driven=kind.driven))
    return "its example changes nothing" if unchanged else ""


def condition(kind: type[Effect]) -> str:
    """The effect acts with the wind off if its condition is always, and only then."""
    unchanged = _same(
        _record((example(kind),), stated(kind, WIND_OFF)), _bare(windy=False, driven=kind.driven)
    )
    if unchanged == (kind.condition == "wind_on"):
        return ""
    return f"its condition is {kind.condition}, but it {'does nothing' if unchanged else 'acts'} with the wind off"


def free(kind: type[Effect]) -> str:
    """The effect leaves a free decay bit-identical if it acts on driven runs only."""
    acts = kind.driven and not _same(_record((example(kind),), WIND_ON), _bare(windy=True, driven=False))
    return "it acts on a free decay" if acts else ""


def round_trip(kind: type[Effect]) -> str:
    """An effect written to JSON and read back by name is unchanged."""
    for effect in (example(kind), kind()):
        document = json.loads(json.dumps(effect.to_json_dict(), allow_nan=False))
        if document.get("name") != kind.name or make_effect(kind, document.get("parameters", {})) != effect:
            return "the effect read back is another"
    return ""


def bounds(kind: type[Effect]) -> str:
    """Values beyond the stated bounds are refused."""
    for info in kind.parameters():
        for bound, outward in ((info.lower, -math.inf), (info.upper, math.inf)):
            try:
                make_effect(kind, {info.name: math.nextafter(bound, outward)})
            except TunnelError:
                continue
            if math.isfinite(bound):
                return f"{info.name} beyond {bound:g}{beside(info.unit)} is accepted"
    return ""


def determinism(kind: type[Effect]) -> str:
    """The same seed gives the same bits, with any number of threads."""
    runs = [stated(kind, replace(run, duration=0.4)) for run in (WIND_ON, WIND_OFF)] * 2

    def records(threads: int) -> list[Record]:
        rngs = [np.random.default_rng([7, i]) for i in range(len(runs))]
        chains = [EffectChain.draw(run, (example(kind),), rng) for run, rng in zip(runs, rngs, strict=True)]
        true = [chain.physics() for chain in chains]
        if kind.driven:
            with ThreadPoolExecutor(threads) as pool:
                motions = list(pool.map(_driven, true))
        else:
            motions = simulate_motions(load_rig(), true, SENSOR.sample_rate, nthread=threads)
        return [read_motion(m, SENSOR, rng, c) for m, rng, c in zip(motions, rngs, chains, strict=True)]

    alone = [record((example(kind),), run, np.random.default_rng([7, i])) for i, run in enumerate(runs)]
    same = all(_same(a, b) for threads in (1, 3) for a, b in zip(alone, records(threads), strict=True))
    return "" if same else "the records differ"


def integration(kind: type[Effect]) -> str:
    """Half the integration step changes the motion by less than the integrators' tolerance, and MuJoCo agrees."""
    chain = EffectChain.draw(stated(kind), (example(kind),), np.random.default_rng(1))
    run = follow_fastest(load_rig(), chain.physics())
    usual = forward_motion(load_rig(), run, 100.0)
    finer = forward_motion(load_rig(), replace(run, timestep=0.5 * run.timestep), 100.0)
    # MuJoCo does not support the input of a driven run
    others = [finer] if kind.driven else [finer, simulate_motion(build_model(load_rig(), run), 100.0)]
    error = max(float(np.max(np.abs(other.angle - usual.angle))) for other in others)
    return "" if error < INTEGRATION_TOLERANCE else f"the angle changes by {error:.2g} rad"


def oracle(kind: type[Effect]) -> str:
    """The effect moves the rig as its independently stated moment does."""
    worst = 0.0
    for run in (WIND_ON, WIND_OFF):
        moment = example(kind).moment_oracle(run)
        if moment is None:
            return ""
        chain = EffectChain.draw(run, (example(kind),), np.random.default_rng(1))
        found = simulate_motion(build_model(load_rig(), follow_fastest(load_rig(), chain.physics())), 100.0)
        worst = max(worst, float(np.max(np.abs(found.angle - _by_scipy(run, moment, found.time_s)))))
    return "" if worst < INTEGRATION_TOLERANCE else f"the angle differs by {worst:.2g} rad"


def _by_scipy(run: RunSettings, moment: Callable[[float, float, float], float], time_s: Array) -> Array:
    from scipy.integrate import solve_ivp  # imported here because it is slow to load

    flow = load_rig().body.flow(run.air_density, run.wind_speed)
    stiffness = aerodynamic_stiffness(run.derivatives.cn_beta, **flow)
    damping = aerodynamic_damping(run.derivatives.cn_r, **flow)

    def derivative(t: float, state: Array) -> tuple[float, float]:
        angle, rate = state
        linear = (stiffness - run.spring_stiffness) * angle + (damping - run.mechanical_damping) * rate
        return rate, (linear + moment(t, angle, rate)) / run.yaw_inertia

    start, span = (run.release_angle, run.release_rate), (0.0, float(time_s[-1]))
    found = solve_ivp(derivative, span, start, "DOP853", time_s, rtol=1e-10, atol=1e-12, max_step=0.01)
    return np.asarray(found.y[0], np.float64)


LAWS: Mapping[str, Callable[[type[Effect]], str]] = {
    "null": null,
    "seen": seen,
    "condition": condition,
    "free": free,
    "round trip": round_trip,
    "bounds": bounds,
    "determinism": determinism,
    "integration": integration,
    "oracle": oracle,
}
"""Every law by name; a function returns the fault, or nothing if the effect obeys the law."""


def check(kind: type[Effect]) -> list[Verdict]:
    """Test an effect against every law that applies to it, in the order of `LAWS`; an exception is a fault."""
    unstated = kind.moment_oracle is Effect.moment_oracle
    left_out = [law for law, absent in ((oracle, unstated), (free, not kind.driven)) if absent]
    verdicts = []
    for law in (law for law in LAWS.values() if law not in left_out):
        try:
            fault = law(kind)
        except (Exception, SystemExit) as error:  # foreign code: any exception is a fault of the effect
            name = "" if isinstance(error, TunnelError) else f"{type(error).__name__}: "
            fault = one_line(f"{name}{error}")
        verdicts.append(Verdict(" ".join((law.__doc__ or "").split()).rstrip("."), fault))
    return verdicts
