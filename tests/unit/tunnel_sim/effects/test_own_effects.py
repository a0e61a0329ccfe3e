"""Effects of one's own: from a file, registered, in a plan, in a diagnosis."""

from __future__ import annotations

import dataclasses
import importlib.metadata
from collections.abc import Sequence
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Self

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.model.similarity import Similarity
from diagnosis.result import Diagnosis
from identification.show.quantity import Quantity
from tests.support.acting import acting
from tests.support.gap_campaigns import campaign
from tests.support.own_effects import CUBIC, DETENT, EFFECTS_FILE, OwnCubic
from tunnel_sim.effects import (
    ALL_EFFECTS,
    effect_class,
    effect_from,
    known_effects,
    register_effect,
    registry,
)
from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.between_runs import WindSpeedScatter
from tunnel_sim.effects.capabilities import AtRandom, Periodic
from tunnel_sim.effects.evidence import Residuals, Sought
from tunnel_sim.effects.expression_effect import read_effects
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.engine.effect_laws import WIND_ON
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import SettingsTable
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.fixture
def effects_file(tmp_path: Path) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(EFFECTS_FILE, encoding="utf-8")
    return path


@pytest.fixture
def clean_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registered", {})


def test_a_file_states_classes(effects_file: Path) -> None:
    detent, gain = read_effects(effects_file)
    assert (detent.name, detent.channel, detent.condition) == ("detent", "stiffness", "always")
    assert [info.default for info in detent.parameters()] == [0.0, 0.06]
    assert gain(s=0.1).on_angle(np.array([0.2]), np.zeros(1), WIND_ON, None) == pytest.approx([0.2008])
    assert detent not in known_effects()


@pytest.mark.usefixtures("clean_registry")
def test_a_registered_effect_is_known_by_name() -> None:
    assert register_effect(OwnCubic) is OwnCubic
    assert effect_class("own_cubic") is OwnCubic
    assert effect_from("own_cubic", {"hardening": 2.0}) == OwnCubic(2.0)
    assert known_effects() == (*ALL_EFFECTS, OwnCubic)


def changed(bases: tuple[type, ...] = (OwnCubic,), **traits: object) -> type:
    return dataclasses.dataclass(frozen=True)(type("Changed", bases, traits))


OF_VOLTS = {
    "__annotations__": {"hardening": float},
    "hardening": parameter("κ", "V", "of the spring", scale=1.0),
}


@pytest.mark.usefixtures("clean_registry")
@pytest.mark.parametrize(
    ("kind", "part"),
    [
        (changed(name="coulomb_friction"), "is the name of a built-in effect"),
        (changed(name="unknown"), "is not a name"),
        (changed(channel="gear"), "unknown channel 'gear'"),
        (changed((Periodic, OwnCubic)), "does not state its sought"),
        (changed(on_angle=lambda *_: None), "derive it from ReadingEffect"),
        (changed(on_run=lambda *_: None), "has on_run, which nothing asks it for"),
        (changed((WindSpeedScatter,), name="own_scatter"), "are built in"),
        (changed((AtRandom, OwnCubic), random="broad_band"), "is a random moment"),
        (changed(**OF_VOLTS), "parameter hardening: unknown unit 'V'"),
        (int, "is not a dataclass derived from Effect"),
    ],
)
def test_what_cannot_be_an_effect_is_not_registered(kind: type, part: str) -> None:
    with pytest.raises(TunnelError, match=part):
        register_effect(kind)
    with pytest.raises(TunnelError, match=part), answering_with([kind]):
        pass
    assert known_effects() == ALL_EFFECTS


@dataclasses.dataclass(frozen=True)
class Wake(Periodic):
    """The wake of a strut: a periodic moment whose frequency follows the wind."""

    name = "wake"
    channel = "forcing"
    condition = "wind_on"
    equation = "c ½ρV²Al sin(2π n V t/width + φ)"
    signature = "A line whose frequency follows the wind."
    references = ("one's own",)
    example = (0.1, 0.2)
    amplitude: float = parameter(
        "c", "1", "of the moment", scale=0.01, lower=0.0, upper=5.0, per_pressure=True
    )
    number: float = parameter("n", "1", "of the wake", scale=0.15, lower=0.001, upper=2.0, default=0.15)

    @classmethod
    def sought(cls, residuals: Residuals) -> tuple[Sought | None, ...]:
        return (residuals.wind_line(0.1, 0.4, "width"),)

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        del stated
        for place, (effect, own) in enumerate(zip(effects, drawn, strict=True)):
            if effect.amplitude:
                runs["shedding_amplitude"][place] = effect.amplitude
                runs["strouhal_number"][place] = effect.number
                runs["shedding_phase"][place] = effect.drawn_number(own)


@pytest.mark.slow
@pytest.mark.usefixtures("causes_alone_throughout")
def test_a_line_of_ones_own_is_found_with_a_phase_in_every_run() -> None:
    built_in = [effect_class(name) for name in ("coulomb_friction", "quadratic_damping", "second_mode")]
    found = diagnose(campaign(Wake(0.5, 0.23)), kinds=[*built_in, Wake], rivals=())
    assert found.causes == ("wake",)
    number = found.candidates[0].parameters["number"]
    assert number.std is not None
    assert abs(number.value - 0.23) < 4.0 * number.std


def test_two_random_moments_of_one_spectrum_are_not_answers() -> None:
    own = dataclasses.dataclass(frozen=True)(type("Gusts", (effect_class("buffeting"),), {"name": "gusts"}))
    with pytest.raises(TunnelError, match="spectrum of buffeting"), answering_with([*ALL_EFFECTS, own]):
        pass
    others = [kind for kind in ALL_EFFECTS if kind.name != "buffeting"]
    with answering_with([*others, own]):  # one that acts with the wind off as well is told from it
        assert effect_class("gusts") is own


@pytest.mark.usefixtures("clean_registry")
def test_installed_packages_add_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    good = EntryPoint("cubic", "tests.support.own_effects:OwnCubic", registry.ENTRY_POINTS)
    bad = EntryPoint("gone", "tests.support.own_effects:Gone", registry.ENTRY_POINTS)
    for points, fails in (((good,), False), ((bad,), True)):
        monkeypatch.setattr(
            importlib.metadata, "entry_points", lambda points=points, **_: EntryPoints(points)
        )
        registry._load_entry_points.cache_clear()
        if fails:
            with pytest.raises(TunnelError, match="gone: cannot be loaded"):
                known_effects()
        else:
            assert effect_class("own_cubic").__name__ == "OwnCubic"
    monkeypatch.undo()
    registry._load_entry_points.cache_clear()


@pytest.mark.parametrize("simulated", [False, True], ids=["forward", "mujoco"])
def test_the_law_is_the_built_in_one_to_the_bit(simulated: bool) -> None:
    def angle(effect: object) -> np.ndarray:
        run = acting(effect, WIND_ON)
        motion = (
            simulate_motion(build_model(load_rig(), run), 100.0)
            if simulated
            else forward_motion(load_rig(), run, 100.0)
        )
        return np.asarray(motion.angle)

    built_in = angle(effect_class("cubic_stiffness")(2.0))
    assert np.array_equal(angle(OwnCubic(2.0)), built_in)
    assert np.max(np.abs(angle(CUBIC(2.0)) - built_in)) < 1e-12
    assert np.max(np.abs(angle(CUBIC(0.0)) - built_in)) > 1e-3


def test_two_expressions_add() -> None:
    both = acting(CUBIC(1.0), acting(CUBIC(1.0), WIND_ON))
    angle = forward_motion(load_rig(), both, 100.0).angle
    np.testing.assert_allclose(
        angle, forward_motion(load_rig(), acting(CUBIC(2.0), WIND_ON), 100.0).angle, atol=1e-12
    )


@pytest.mark.parametrize("change", [Similarity(30.0, 0.01), Similarity(0.2, 7.0)], ids=["slow", "fast"])
def test_a_similar_rig_moves_through_the_same_angles(change: Similarity) -> None:
    """Parameters are scaled by their units, whatever these are."""
    still = dataclasses.replace(WIND_ON, wind_speed=0.0)
    effect = DETENT(k=2.0)
    similar = dataclasses.replace(
        still,
        spring_stiffness=change.similar(still.spring_stiffness, "N m/rad"),
        yaw_inertia=change.similar(still.yaw_inertia, "kg m2"),
        mechanical_damping=change.similar(still.mechanical_damping, "N m s/rad"),
        duration=change.similar(still.duration, "s"),
        timestep=change.similar(still.timestep, "s"),
    )
    values = {i.name: change.similar(getattr(effect, i.name), i.unit) for i in DETENT.parameters()}
    own = forward_motion(load_rig(), acting(effect, still), 100.0)
    other = forward_motion(load_rig(), acting(DETENT(**values), similar), change.similar(100.0, "Hz"))
    np.testing.assert_allclose(other.angle, own.angle, atol=1e-9)


@pytest.fixture(scope="module")
def hardened(causes_alone_throughout: None) -> dict[str, Diagnosis]:
    """The same campaign diagnosed with the built-in effect, a class and an expression."""
    del causes_alone_throughout
    data = campaign(effect_from("cubic_stiffness", {"coefficient": 0.3}), duration=6.0)
    data = dataclasses.replace(data, runs=data.runs[::2])
    others = tuple(effect_class(name) for name in ("coulomb_friction", "sensor_drift"))
    return {
        kind.name: diagnose(data, kinds=(kind, *others), rivals=())
        for kind in (effect_class("cubic_stiffness"), OwnCubic, CUBIC)
    }


def estimate(found: Diagnosis) -> Quantity:
    (candidate,) = [c for c in found.candidates if c.effect == " + ".join(found.causes)]
    return next(iter(candidate.parameters.values()))


def test_built_in_class_and_expression_give_the_same_answer(hardened: dict[str, Diagnosis]) -> None:
    for name, found in hardened.items():
        assert found.causes == (name,)
        assert found.inclusion[name] > 0.9
        assert found.gap.closed == pytest.approx(1.0, abs=0.01)
        assert estimate(found).unit == "1/rad2"
    built_in, of_class, stated = (estimate(found) for found in hardened.values())
    # an expression keeps the short steps of a fit
    assert of_class.value == pytest.approx(stated.value, rel=2e-5)
    assert of_class.std == pytest.approx(stated.std, rel=1e-3)
    assert built_in.value == pytest.approx(
        stated.value, abs=2.0 * (built_in.std or 0.0)
    )  # its exponent is free too
    assert "own_cubic" not in [kind.name for kind in known_effects()]
