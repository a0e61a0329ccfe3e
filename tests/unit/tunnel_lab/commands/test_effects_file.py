"""``--effects-file``: what is known during a command, and files that are refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from diagnosis.result import Diagnosis
from tests.support.command import Tunnel
from tests.support.diagnosis_document import findings_of
from tests.support.own_effects import EFFECTS_FILE
from tunnel_lab.experiments.blind import answers as answer
from tunnel_sim.effects import Effect, effect_class
from tunnel_sim.vocabulary.campaign import Campaign

PLAN = Path(__file__).parents[3] / "data" / "tiny-plan.toml"


@pytest.fixture
def effects_file(tmp_path: Path) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(EFFECTS_FILE, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (("-(b/w)^2", "-(b/w)^2*r"), "effect 'detent': exp of a quantity in 1/s"),
        (("-k*b*", "-k*r*"), "is in kg m2/s3, not in N m"),
        (("-k*b*", "-k*beta*"), "unknown name 'beta'; use one of Kr, V, b"),
        (('name = "gain"', 'name = "detent"'), "effect 'detent': is given twice"),
        (('channel = "sensor"', 'channel = "damping"'), "effect 'gain': channel 'damping' is not for a reading"),
        (("y + s*y^3", "y + s*y^3 + 0.1*y"), "is not y at s = 0"),
        (("y + s*y^3", "y*(1 + s*sqrt(y)^4)"), "no finite value"),
        (("y + s*y^3", "y + 0*s*y^3"), "does nothing"),
        (('unit = "1/rad2"', 'unit = "1/deg2"'), "unknown unit '1/deg2'"),
        (('unit = "1/rad2", ', ""), "'unit' is missing"),
        (("scale = 0.05, lower = -1", "scale = 0.05, lower = 0.5"), "s: the default 0 or the scale 0.05 is not"),
        (("parameters.s", "parameters.on_angle"), "cannot be named 'on_angle'"),
        (('"gain"', '"Gain!"'), "'name' = 'Gain!'"),
        (("unit = \"1/rad2\", scale = 0.05", "unit = \"1/rad2\", scale = 0.0"), "parameter s: the scale is 0"),
        (("default = 0.06", "default = 0.6"), "effect 'detent': parameter w: the default 0.6 or the scale"),
        (("upper = 50.0", "upper = 50.0, default = 0.1"), "the first parameter is not a severity"),
        (("lower = -1, upper = 1", "lower = -1, upper = 0"), "the default 0 or the scale 0.05 is not from -1 to 0"),
        (("reading =", 'moment = "0"\nreading ='), "exactly one of moment and reading"),
        (("reading", "readings"), "unknown key 'readings'; did you mean 'reading'?"),
        (("y + s*y^3", "y + s*y^3" + "+0*y" * 200), "'reading'"),
    ],
)  # fmt: skip
def test_a_bad_file_is_one_line_and_leaves_nothing(
    tunnel: Tunnel, effects_file: Path, tmp_path: Path, change: tuple[str, str], part: str
) -> None:
    text = effects_file.read_text(encoding="utf-8")
    assert change[0] in text
    effects_file.write_text(text.replace(change[0], change[1]), encoding="utf-8")
    status, out, err = tunnel("simulate", PLAN, "--out", tmp_path / "c", "--effects-file", effects_file)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert part in err
    assert str(effects_file) in err
    assert not (tmp_path / "c").exists()


def test_what_is_known_ends_with_the_command(tunnel: Tunnel, effects_file: Path, tmp_path: Path) -> None:
    options = ("--effects-file", effects_file, "--effect", "detent:k=0.5")
    assert tunnel("simulate", PLAN, "--out", tmp_path / "c", *options)[0] == 0
    truth = json.loads((tmp_path / "c" / "truth.json").read_text(encoding="utf-8"))
    assert truth["parameters"] == {"detent": {"k": 0.5, "w": 0.06}}
    assert "moment -k*b*exp(-(b/w)^2)" in tunnel("effects", "detent", "--effects-file", effects_file)[1]
    assert tunnel("effects", "detent")[0] == 2


def test_a_blind_set_is_answered_and_scored_with_them(
    tunnel: Tunnel, effects_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An open set of one campaign: the fits are replaced, the truth is what was planted."""
    known: list[set[str]] = []

    def diagnose(_: Campaign, kinds: Sequence[type[Effect]]) -> Diagnosis:
        known.append({kind.name for kind in kinds})
        found = {"causes": [effect_class("detent").name], "gap": {"closed": 0.99}}
        return findings_of({**found, "candidates": [{"effect": "detent", "probability": 0.9}]})

    monkeypatch.setattr(answer, "diagnose", diagnose)
    given = ("--effects-file", effects_file)
    planted = tunnel("simulate", PLAN, "--out", tmp_path / "set" / "c1", *given, "--effect", "detent:k=0.5")
    assert planted[0] == 0
    status, _, err = tunnel("blind", "score", tmp_path / "set", *given)
    assert status == 2
    assert err.rstrip().endswith(f"tunnel blind diagnose {tmp_path / 'set'} --effects-file {effects_file}")
    for excluded in ((), ("--exclude", "gain")):
        assert tunnel("blind", "diagnose", tmp_path / "set", *given, *excluded)[0] == 0
    assert [names & {"detent", "gain"} for names in known] == [{"detent", "gain"}, {"detent"}]
    out = tmp_path / "score.json"
    assert tunnel("blind", "score", tmp_path / "set", *given, "--json", out)[0] == 0
    (case,) = json.loads(out.read_text(encoding="utf-8"))["cases"]
    assert case["truth"] == case["causes"] == ["detent"]
    assert tunnel("blind", "diagnose", tmp_path / "set", "--exclude", "detent")[0] == 2


@pytest.mark.slow
def test_a_check_states_every_law_and_fails_where_one_is_violated(
    tunnel: Tunnel, effects_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    status, out, _ = tunnel("effects", "check", "detent", "--effects-file", effects_file)
    assert (status, out.count("obeyed: "), out.count("violated: ")) == (0, 9, 0)
    assert "Cosine of this part with the nearest effects: free_play 0." in out
    status, out, _ = tunnel("effects", "check", "unsteady_aero_lag")
    assert (status, out.count("violated: ")) == (1, 1)
    for words in (("check",), ("detent", "gain"), ("check", "nothing")):
        assert tunnel("effects", *words)[0] == 2
