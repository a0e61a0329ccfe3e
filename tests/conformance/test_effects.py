"""One suite over every effect of the registry: the laws an effect obeys, whatever it is."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import fit_at
from diagnosis.model.parameters import Point
from tests.reference.effect_cases import VALUES, VOCABULARY, settings
from tests.reference.effect_oracle import Setting
from tests.support.gap_campaigns import added, campaign, nominal
from tunnel_sim.effects import ALL_EFFECTS, Effect, EffectChain, effect_class, effect_from
from tunnel_sim.effects.chain import with_effects
from tunnel_sim.engine import effect_laws
from tunnel_sim.engine.simulate import simulate
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Record

RIG = load_rig()
SENSOR = SensorModel(zero=0.003)
WIND_ON = settings(Setting(duration=1.0))
WIND_OFF = replace(WIND_ON, wind_speed=0.0)

EXAMPLE_FREQUENCY = VALUES["second_mode"]["frequency"]

each_effect = pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)


def example(kind: type[Effect]) -> Effect:
    return effect_from(kind.name, VALUES[kind.name])


def record(effects: tuple[Effect, ...] = (), run: RunSettings = WIND_ON, seed: int | list[int] = 1) -> Record:
    return simulate(RIG, run, SENSOR, np.random.default_rng(seed), effects=effects)


def same(one: Record, other: Record) -> bool:
    return np.array_equal(one.yaw_rad, other.yaw_rad) and np.array_equal(one.time_s, other.time_s)


def test_the_vocabulary_is_whole_and_in_its_order() -> None:
    written = (
        "docs/reference/effects.md differs: python -m tunnel_lab effects --markdown docs/reference/effects.md"
    )
    assert [kind.name for kind in ALL_EFFECTS] == list(VOCABULARY), written
    assert [kind.place for kind in ALL_EFFECTS] == list(range(1, len(ALL_EFFECTS) + 1))


@each_effect
def test_channel_and_condition_are_the_vocabularys(kind: type[Effect]) -> None:
    assert (kind.channel, kind.condition) == VOCABULARY[kind.name]
    assert effect_class(kind.name) is kind


@each_effect
def test_metadata_is_complete(kind: type[Effect]) -> None:
    infos = kind.parameters()
    assert kind.equation
    assert kind.signature.endswith(".")
    assert kind.references
    assert all(kind.references)
    assert (kind.__doc__ or "").splitlines()[0].endswith(".")
    assert infos[0].default == 0.0  # the severity, whose null is zero
    assert len({info.name for info in infos}) == len({info.symbol for info in infos}) == len(infos)
    for info in infos:
        assert info.meaning
        dimension(info.unit)  # refuses what is no unit
        assert info.symbol.removeprefix("1/") in kind.equation
        assert math.isfinite(info.lower)
        assert math.isfinite(info.upper)
        assert info.lower <= info.default <= info.upper
        assert 0.0 < info.scale < math.inf
        # only a mains frequency lies so far from zero that its typical size is no value of it
        assert info.lower <= info.scale <= info.upper or info.lower > info.scale == 0.05


@each_effect
def test_it_obeys_the_laws(kind: type[Effect]) -> None:
    said = {name: law(kind) for name, law in effect_laws.LAWS.items()}
    assert {name: words for name, words in said.items() if words} == {}


@each_effect
def test_unknown_names_get_did_you_mean(kind: type[Effect]) -> None:
    misspelt = kind.name.replace("i", "j", 1) if "i" in kind.name else kind.name[:-1]
    with pytest.raises(TunnelError, match=f"did you mean '{kind.name}'"):
        effect_from(misspelt, {})
    known = kind.parameters()[0].name
    with pytest.raises(TunnelError, match=f"effect {kind.name}: .*did you mean '{known}'"):
        effect_from(kind.name, {known[:-1]: 0.0})


@each_effect
def test_no_number_is_refused_in_one_line(kind: type[Effect]) -> None:
    wrong_values = (math.nan, math.inf, -math.inf, True, 10**400, "0.1", None)
    for info, wrong in itertools.product(kind.parameters(), wrong_values):
        with pytest.raises(TunnelError) as refusal:
            effect_from(kind.name, {info.name: wrong})  # type: ignore[dict-item]
        text = str(refusal.value)
        assert "\n" not in text
        assert f"effect {kind.name}: {info.name} = " in text
        unit = "" if info.unit == "1" else f" in {info.unit}"
        assert text.endswith(f"give a number from {info.lower:g} to {info.upper:g}{unit}")


@each_effect
def test_the_bounds_are_allowed(kind: type[Effect]) -> None:
    for info in kind.parameters():
        for bound in (info.lower, info.upper):
            assert getattr(effect_from(kind.name, {info.name: bound}), info.name) == bound


@each_effect
def test_without_its_random_part_an_effect_is_refused_rather_than_left_out(kind: type[Effect]) -> None:
    times = np.arange(100) / 100.0

    def applied(effect: Effect) -> None:
        chain = EffectChain(effect_laws.stated(kind, WIND_ON), (effect,), (None,))
        chain.physics()
        chain.angle(np.zeros(100), chain.true_times(times))

    applied(kind())  # the null does nothing, drawn or not
    if example(kind).draw(WIND_ON, np.random.default_rng(1)) is None:
        applied(example(kind))
        return
    with pytest.raises(
        TunnelError, match=f"effect {kind.name}: the random part of the run is missing"
    ) as caught:
        applied(example(kind))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "kind",
    [kind for kind in ALL_EFFECTS if kind.shown_forms(load_varies=False) and not kind.driven],
    ids=lambda kind: kind.name,
)
def test_a_fit_sees_every_form_from_where_it_frees_it(kind: type[Effect]) -> None:
    """Where a form changes no reading, its slope is zero, and a fit stays at the textbook form."""
    fitted = added(nominal(campaign(kind(*kind.example))), kind.name)
    starts = {f"{kind.name}.{info.name}": info.form_start for info in kind.parameters()}
    known = dict(zip(fitted.problem.names, fitted.point.common.tolist(), strict=True))
    for form in kind.shown_forms(load_varies=False):
        freed = replace(fitted.problem, free_forms=tuple(f"{kind.name}.{name}" for name in form))
        start = np.array([known.get(name, starts.get(name)) for name in freed.names])
        sensitivities = fit_at(freed, Point(start, fitted.point.per_run)).jacobian
        for name in freed.free_forms:
            place = freed.names.index(name)
            assert sum(float(common[:, place] @ common[:, place]) for common, _ in sensitivities) > 0.0, name


@each_effect
def test_another_seed_gives_another_draw_only_where_one_is_drawn(kind: type[Effect]) -> None:
    quiet = SensorModel(noise_std=0.0, resolution=0.0)
    one, other = (
        effect_laws.record(
            (example(kind),), effect_laws.stated(kind, WIND_ON), np.random.default_rng(seed), quiet
        )
        for seed in (1, 2)
    )
    draws = example(kind).draw(WIND_ON, np.random.default_rng(1)) is not None
    assert same(one, other) == (not draws)


def test_a_rod_too_stiff_for_any_step_is_refused_in_one_line() -> None:
    stiff = effect_from("rod_flexibility", {"compliance": 1e-9, "inertia_share": 0.001})
    with pytest.raises(TunnelError, match="too fast for steps") as refusal:
        record((stiff,))
    assert "\n" not in str(refusal.value)
    assert "larger compliance" in str(refusal.value)


@pytest.mark.parametrize("compliance", [1e-2, 1e-3, 5e-4, 1e-4, 1e-5])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.95])
def test_a_rod_gets_steps_short_enough_for_its_own_oscillation(compliance: float, share: float) -> None:
    effect = effect_from("rod_flexibility", {"compliance": compliance, "inertia_share": share})
    run = EffectChain.draw(WIND_ON, [effect], np.random.default_rng(0)).physics()
    own = np.sqrt(
        1.0 / (compliance * WIND_ON.yaw_inertia * share * (1.0 - share))
    )  # of two free masses, rad/s
    assert own * run.timestep <= 0.5
    shorter = WIND_ON.timestep / run.timestep
    assert shorter == pytest.approx(round(shorter), abs=1e-12)  # a sample is a whole number of steps
    assert shorter < 2.5 * max(1.0, own * WIND_ON.timestep / 0.5)  # and no more of them than it needs


@each_effect
def test_mechanical_damping_takes_energy_in_every_fit(kind: type[Effect]) -> None:
    """A simulated rig may be driven; what a fit finds in a real one cannot drive it."""
    severity = kind.parameters()[0]
    passive = kind.channel == "damping" and kind.condition == "always"
    assert severity.lower <= severity.fit_lower <= 0.0 <= severity.fit_upper <= severity.upper
    assert not passive or severity.fit_lower == 0.0


@each_effect
def test_only_a_second_mode_may_be_the_motion_itself(kind: type[Effect]) -> None:
    implausible = [ratio for ratio in (0.5, 0.9, 1.0, 1.2, 1.5, 1.9, 2.2, 3.1, 3.5, 6.0)
                   if not example(kind).plausible(EXAMPLE_FREQUENCY / ratio, 60.0, (-0.3, 0.3))]  # fmt: skip
    assert implausible == ([1.0] if kind.name == "second_mode" else [])


@each_effect
def test_a_run_changes_beside_others_as_alone(kind: type[Effect]) -> None:
    """The others have other values of the effect, none among them, no wind, and other speeds and springs."""
    null = effect_from(kind.name, {kind.parameters()[0].name: 0.0})
    effects = [
        example(kind),
        replace(example(kind), **{kind.parameters()[0].name: 0.02}),
        null,
        example(kind),
    ]
    runs = [replace(WIND_ON, wind_speed=10.0 * n, spring_stiffness=16.0 + n) for n in range(len(effects))]
    runs[3] = effect_laws.stated(kind, runs[3])
    if (spring := kind.chosen_spring()) is not None:
        effects[1] = replace(effects[1], **{spring: 17.0})
    draws = [effect.draw(run, np.random.default_rng(7)) for effect, run in zip(effects, runs, strict=True)]
    together = with_effects(SettingsTable.of(runs), [(one,) for one in effects], [(one,) for one in draws])
    alone = [
        with_effects(run.table, [(effect,)], [(own,)]).row(0)
        for run, effect, own in zip(runs, effects, draws, strict=True)
    ]
    for n, run in enumerate(alone):
        drives = run.drive, together.drive[n]
        assert replace(together.row(n), drive=None) == replace(run, drive=None)
        assert drives == (None, None) or vars(drives[0]) == vars(drives[1])


def test_a_table_gives_back_the_runs_it_was_made_of() -> None:
    runs = [WIND_ON, replace(WIND_OFF, parameters={"friction_moment": 0.02}, release_rate=-0.3)]
    table = SettingsTable.of(runs)
    assert [table.row(n) for n in range(len(runs))] == runs
