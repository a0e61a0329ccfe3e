"""Samples missing in driven runs, with the input's or beside a complete input. The truth is the linear response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.likelihood.per_run import skip
from identification.signal.forcing import driven_rows
from tests.support.gap_campaigns import nominal
from tunnel_sim.effects import EffectChain, effect_class, effect_from
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Hold, Input
from tunnel_sim.vocabulary.plan import AeroDerivatives, SensorModel
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, INERTIA, DAMPING, NOISE = 200.0, 0.1, 0.05, 3e-4
SPRINGS, LOST, SHARES = (16.0, 30.0), 0.02, (0.4, 0.62)
A = 0.5 * DAMPING / INERTIA
COUNT, GONE = 2400, round(LOST * RATE)
LONG = np.arange(COUNT + GONE) / RATE  # the logger's own samples, before some are lost


def given(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    lines = np.arange(0.5, 5.0, 2.0 / LONG[-1])
    phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    return np.asarray(0.15 * np.cos(2.0 * np.pi * np.outer(LONG, lines) + phases).sum(axis=1))


def record(number: int, hold: Hold, *, kept: bool, known: bool = True) -> tuple[Array, Array]:
    """Input and angle as written: whole samples left out, of both columns or of the angle's.

    Args:
        known: whether the samples left out tell nothing of the input, which is linear or constant there.
    """
    values = given(number)
    first = round(SHARES[number] * COUNT)
    if known and not kept:
        end = values[first - 1] if hold == "zero" else values[first + GONE]
        values[first : first + GONE] = np.linspace(values[first - 1], end, GONE + 2)[1:-1]
    angle = driven_rows(LONG, values, A, SPRINGS[number] / INERTIA, held=hold == "zero")[0] / INERTIA
    lost = slice(first, first + GONE)
    return (values[:COUNT] if kept else np.delete(values, lost)), np.delete(angle, lost)


def campaign(*, kept: bool, hold: Hold = "linear", known: bool = True) -> Campaign:
    runs = []
    for number, spring in enumerate(SPRINGS):
        values, angle = record(number, hold, kept=kept, known=known)
        reading = angle + NOISE * np.random.default_rng([number, 1]).standard_normal(COUNT)
        time = np.arange(COUNT) / RATE
        drive = Input("moment_nm", values, hold)
        runs.append(Run(f"r{number}", Record(time, reading), 0.0, spring_stiffness=spring, drive=drive))
    return Campaign("driven", RigProperties(), SensorProperties(sample_rate=RATE), tuple(runs))


@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_the_effect_leaves_out_what_a_logger_leaves_out(hold: Hold, kept: bool) -> None:
    values, expected = record(0, hold, kept=kept)
    stamps = np.arange(COUNT) / RATE
    run = RunSettings(
        SPRINGS[0],
        AeroDerivatives(0.0, 0.0),
        INERTIA,
        DAMPING,
        duration=COUNT / RATE,
        drive=InputMoment(stamps, values, held=hold == "zero"),
    )
    effect = effect_from("dropped_samples", {"lost_time": LOST, "input_kept": float(kept)})
    # at the first sample that is late half of an interval of the transition has passed
    chain = EffectChain(run, (effect,), ((SHARES[0] * COUNT - 0.5) / COUNT,))
    motion = forward_motion(load_rig(), replace(chain.physics(), timestep=1.0 / (10.0 * RATE)), RATE)
    sensor = SensorModel(sample_rate=RATE, resolution=0.0, noise_std=0.0, zero=0.0)
    found = read_motion(motion, sensor, np.random.default_rng(0), chain).yaw_rad
    # a complete input goes on beyond the record, where the effect knows nothing of it
    seen = slice(0, COUNT - GONE if kept else COUNT)
    assert np.max(np.abs(found - expected)[seen]) < 2e-4 * np.max(np.abs(expected))


@pytest.mark.parametrize("kept", [False, True])
def test_the_instants_are_found_by_linear_theory_and_the_right_kind_of_skip_explains_more(kept: bool) -> None:
    base = nominal(campaign(kept=kept))
    together, alone = skip(base, with_input=True), skip(base)
    assert together is not None
    assert alone is not None
    assert (together.of_input, alone.of_input) == (0.0, 1.0)
    right, wrong = (alone, together) if kept else (together, alone)
    assert right.drop > 1.5 * wrong.drop
    assert right.values[0] / right.numbers.shape[1] == pytest.approx(LOST, rel=0.2)
    assert np.min(np.abs(right.numbers - np.array(SHARES)[:, None]), axis=1) == pytest.approx(0.0, abs=0.01)


def test_a_free_decay_has_no_skip_of_an_input() -> None:
    bare = campaign(kept=True)
    free = replace(bare, runs=tuple(replace(run, drive=None) for run in bare.runs))
    base = nominal(free)
    found = skip(base)
    assert skip(base, with_input=True) is None
    assert found is not None
    assert found.of_input == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kept", "hold", "known"),
    [(False, "linear", True), (False, "zero", True), (False, "linear", False), (True, "zero", True)],
)
def test_lost_samples_are_named(hold: Hold, kept: bool, known: bool) -> None:
    names = "dropped_samples", "second_mode", "input_delay", "cubic_stiffness", "coulomb_friction"
    found = diagnose(
        campaign(kept=kept, hold=hold, known=known), kinds=[effect_class(name) for name in names]
    )
    assert found.causes == ("dropped_samples",)
    parameters = found.candidates[0].parameters
    assert parameters["input_kept"].value == float(kept)
    if known:  # else what the input did meanwhile looks like further instants
        assert parameters["lost_time"].value == pytest.approx(LOST, rel=0.02)
