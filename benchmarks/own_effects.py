"""Speed of one law in three forms, built in, as a class and as an expression, and of a law with an exponential.

Run as ``python -m benchmarks.own_effects`` from the root; see README.md beside it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.throughput import interleaved, row, stepping
from diagnosis import diagnose
from tests.support.acting import acting
from tests.support.own_effects import CUBIC, DETENT
from tunnel_sim.effects import Effect, effect_class
from tunnel_sim.effects.mechanics import CubicStiffness
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives, CampaignPlan, Condition, EffectSetting, Truth

RUN = RunSettings(
    16.12, AeroDerivatives(0.35, -0.7), 0.1014, 0.018,
    wind_speed=20.0, air_density=1.204, release_angle=0.3, duration=20.0,
)  # fmt: skip


@dataclass(frozen=True)
class OwnCubic(CubicStiffness):
    """The same law as a user's class."""

    name = "own_cubic"


def integrating(effect: Effect) -> Callable[[], float]:
    """A repetition of the fits' integrator on one thread: CPU time of a run of 20,000 steps, s."""
    run, rig = acting(effect, RUN), load_rig()

    def repetition() -> float:
        begin = time.thread_time()
        forward_motion(rig, run, 1000.0)
        return time.thread_time() - begin

    return repetition


def speeds(repetitions: int) -> Table:
    """Steps per second of each form relative to the built-in form."""
    heads = ("subject", "baseline", "subject", "ratio (median)", "ratio (best)", "target")
    table = Table(
        *heads, title="Cubic stiffness built in (baseline) against other forms, RK4 steps per second"
    )
    built_in = effect_class("cubic_stiffness")(1.0)
    model = {e: build_model(load_rig(), acting(e, RUN)).mj for e in (built_in, CUBIC(1.0), DETENT(1.0))}
    for name, effect in (("class", OwnCubic(1.0)), ("expression", CUBIC(1.0)), ("detent", DETENT(1.0))):
        times = interleaved(integrating(built_in), integrating(effect), repetitions)
        row(table, f"{name}, fits' integrator", 20_000, *times, "≥ 0.33")
        if effect in model:
            engine = interleaved(
                stepping(model[built_in], 20_000), stepping(model[effect], 20_000), repetitions
            )
            row(table, f"{name}, MuJoCo", 20_000, *engine, "≥ 0.33")
    return table


def answers() -> Table:
    """The same campaign diagnosed with each form in a vocabulary with three other effects."""
    conditions = tuple(
        Condition(f"s{spring:g}-v{speed:g}", spring, speed, 1.204, np.radians(20.0), 10.0)
        for spring in (16.12, 44.84)
        for speed in (0.0, 20.0)
    )
    truth = Truth(0.47, -0.12, 0.1014, 0.018)
    plan = CampaignPlan(
        "cubic", 1, truth, conditions, effects=(EffectSetting("cubic_stiffness", {"coefficient": 0.3}),)
    )
    campaign = simulate_campaign(plan)
    others = tuple(effect_class(name) for name in ("coulomb_friction", "quadratic_damping", "sensor_drift"))
    heads = ("form", "answer", "probability", "κ, 1/rad²", "closed", "seconds (CPU)")
    table = Table(*heads, title="One campaign with cubic stiffness of 0.3 /rad², diagnosed with each form")
    for form, kind in (("built in", CubicStiffness), ("class", OwnCubic), ("expression", CUBIC)):
        begin = time.process_time()
        found = diagnose(campaign, kinds=(kind, *others))
        seconds = time.process_time() - begin
        best = next(c for c in found.candidates if c.effect == " + ".join(found.causes))
        value = next(iter(best.parameters.values()))
        estimate = f"{value.value:.5f} ± {value.std or 0.0:.5f}"
        closed = f"{100.0 * found.gap.closed:.2f} %"
        table.add_row(form, best.effect, f"{best.probability:.3f}", estimate, closed, f"{seconds:.1f}")
    return table


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.own_effects", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--repetitions", type=int, default=25, help="repetitions of each side")
    options = parser.parse_args()
    for table in (speeds(options.repetitions), answers()):
        Console(width=110).print(table)


if __name__ == "__main__":
    main()
