"""``tunnel effects`` and ``tunnel simulate --effect``, and the reference page written by the former."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from tests.reference.effect_cases import VOCABULARY
from tests.support.command import Tunnel
from tunnel_lab.commands.effects import example, reference_page
from tunnel_lab.terminal.arguments import parse_effect
from tunnel_sim.effects import ALL_EFFECTS, Effect, effect_class, effect_from
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import EffectSetting

ROOT = Path(__file__).parents[4]
PLAN = ROOT / "tests" / "data" / "tiny-plan.toml"
FRICTION = "coulomb_friction:friction_moment=0.02"


def test_the_list_names_every_effect(tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    status, out, err = tunnel("effects")
    assert (status, err) == (0, "")
    listed = {line.split()[0]: tuple(line.split()[1:3]) for line in out.splitlines() if line.split()[1:]}
    assert {name: listed[name] for name in VOCABULARY} == VOCABULARY
    for kind in ALL_EFFECTS:
        for info in kind.parameters():
            assert info.name in out


@pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
def test_one_effect_is_shown_whole(
    tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch, kind: type[Effect]
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    status, out, err = tunnel("effects", kind.name)
    assert (status, err) == (0, "")
    for text in (kind.channel, kind.condition, kind.equation, kind.signature, *kind.references):
        assert text in out
    for info in kind.parameters():
        assert f"{info.scale:g}" in out
        assert info.meaning in out


def test_json_holds_what_the_registry_holds(tunnel: Tunnel, tmp_path: Path) -> None:
    assert tunnel("effects", "--json", tmp_path / "e.json")[0] == 0
    written = json.loads((tmp_path / "e.json").read_text(encoding="utf-8"))
    assert written["schema_version"] == 1
    found = {effect["name"]: (effect["channel"], effect["condition"]) for effect in written["effects"]}
    assert found == VOCABULARY
    for effect in written["effects"]:
        kind = effect_class(effect["name"])
        assert [p["name"] for p in effect["parameters"]] == [info.name for info in kind.parameters()]
        assert all(p["unit"] and p["symbol"] for p in effect["parameters"])
        assert (effect["equation"], effect["signature"]) == (kind.equation, kind.signature)
    assert tunnel("effects", "free_play", "--json", tmp_path / "one.json")[0] == 0
    (one,) = json.loads((tmp_path / "one.json").read_text(encoding="utf-8"))["effects"]
    assert one in written["effects"]


def test_the_reference_page_is_the_registrys(tunnel: Tunnel, tmp_path: Path) -> None:
    page = ROOT / "docs" / "reference" / "effects.md"
    command = "tunnel effects --markdown docs/reference/effects.md"
    assert tunnel("effects", "--markdown", tmp_path / "effects.md")[0] == 0
    current = (tmp_path / "effects.md").read_text(encoding="utf-8")
    assert current == page.read_text(encoding="utf-8"), (
        f"out of date: python -m tunnel_lab {command.removeprefix('tunnel ')}"
    )
    assert command in current  # it says how it was written
    assert (page.parent / "../theory/what-no-free-decay-can-show.md").is_file()


def test_a_page_of_other_effects_is_another_page() -> None:
    assert reference_page(ALL_EFFECTS) != reference_page(ALL_EFFECTS[:-1])


@pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
def test_the_example_of_each_effect_can_be_given(kind: type[Effect]) -> None:
    option, text = shlex.split(example(kind))
    setting = parse_effect(text)
    assert option == "--effect"
    effect = effect_from(setting.name, setting.parameters)
    assert isinstance(effect, kind)
    assert not effect.is_null


def test_an_effect_is_read_from_one_word() -> None:
    assert parse_effect(FRICTION) == EffectSetting("coulomb_friction", {"friction_moment": 0.02})
    assert parse_effect("rod_flexibility: compliance = 1e-3, inertia_share=.2") == EffectSetting(
        "rod_flexibility", {"compliance": 1e-3, "inertia_share": 0.2}
    )


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("coulomb_friction:friction_moment", "'friction_moment' is not PARAMETER=VALUE"),
        ("coulomb_friction:friction_moment=", "is not PARAMETER=VALUE"),
        ("coulomb_friction:friction_moment=0.1,", "'' is not PARAMETER=VALUE"),
        ("coulomb_friction:friction_moment=much", "'much' is not a number"),
        ("free_play:half_width=0.1,half_width=0.2", "half_width is given twice"),
        (":friction_moment=0.1", "no effect is named"),
        ("", "no effect is named"),
    ],
)
def test_a_word_of_another_form_is_refused(text: str, part: str) -> None:
    with pytest.raises(TunnelError) as refusal:
        parse_effect(text)
    assert part in str(refusal.value)
    assert str(refusal.value).startswith(f"--effect {text}".rstrip() + ": ")


def test_effects_are_added_to_the_plans(tunnel: Tunnel, tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    text = PLAN.read_text(encoding="utf-8")
    plan.write_text(
        text + '\n[[effects]]\nname = "sensor_drift"\nparameters = { drift = 0.01 }\n', encoding="utf-8"
    )
    hum = "mains_hum:amplitude=0.002,frequency=60"
    assert tunnel("simulate", plan, "--out", tmp_path / "c", "--effect", FRICTION, "--effect", hum)[0] == 0
    truth = json.loads((tmp_path / "c" / "truth.json").read_text(encoding="utf-8"))
    assert truth["effects"] == ["coulomb_friction", "mains_hum", "sensor_drift"]
    assert truth["parameters"]["mains_hum"] == {"amplitude": 0.002, "frequency": 60.0}
    assert tunnel("simulate", plan, "--out", tmp_path / "d")[0] == 0
    for run in (tmp_path / "c" / "runs").iterdir():
        assert run.read_bytes() != (tmp_path / "d" / "runs" / run.name).read_bytes()


@pytest.mark.parametrize(
    "kind", [kind for kind in ALL_EFFECTS if not kind.fitted], ids=lambda kind: kind.name
)
def test_a_check_does_not_compare_the_motion_of_an_effect_that_no_fit_finds(
    kind: type[Effect], tunnel
) -> None:
    status, out, err = tunnel("effects", "check", kind.name)
    assert (status, err) == (0, "")
    assert "violated" not in out
    assert "Not compared with other effects" in " ".join(out.split())
