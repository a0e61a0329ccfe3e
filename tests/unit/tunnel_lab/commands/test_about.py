"""``tunnel doctor`` finds what is missing, and ``tunnel schema`` describes what the project reads and writes."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest

from diagnosis import diagnose
from identification import identify
from tests.support.command import Tunnel
from tests.support.small_sweep import SMALL
from tunnel_lab.commands import about
from tunnel_lab.commands.about import SCHEMAS, schema_of
from tunnel_sim.effects import effect_class
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import EXTRAS, TunnelError, installing, library

ROOT = Path(__file__).parents[4]


def check(name: str, value: object) -> None:
    jsonschema.Draft202012Validator(schema_of(name)).validate(value)


def test_the_doctor_finds_that_all_works(tunnel: Tunnel) -> None:
    status, out, err = tunnel("doctor", "--format", "json")
    installation, checks = ({row[head]: row for row in one["rows"] for head in list(row)[:1]}
                            for one in map(json.loads, out.splitlines()))  # fmt: skip
    assert (status, err) == (0, "")
    assert installation["mujoco"]["version or state"].startswith("4.0")
    assert {f"extra {name}" for name in EXTRAS} < set(installation)
    assert checks["cn_beta"]["result"].endswith("standard deviations from the truth")


def test_a_failure_is_named_and_ends_with_status_one(tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise TunnelError("the plugin is missing", remedy="install again")

    monkeypatch.setattr("tunnel_sim.engine.virtual_campaign.simulate_campaign", refuse)
    monkeypatch.setattr("tunnel_sim.simulate_campaign", refuse, raising=False)
    status, out, _ = tunnel("doctor")
    assert status == 1
    assert "FAILED: TunnelError: the plugin is missing; install again" in out


def test_an_estimate_far_from_the_truth_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(about, "LARGEST_ERROR", 1e-6)
    assert [fine for name, _, fine in about.self_check() if name.startswith("cn_")] == [False, False]


def test_a_missing_extra_is_said_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EXTRAS, "film", ("imageio", "no_such_module"))
    found = dict(about.extras())
    assert found["extra film"] == f"lacks no_such_module: run {installing('film')}"
    with pytest.raises(
        TunnelError, match=r"a film needs the package no_such_module; run .venv/bin/pip install '\.\[film\]'"
    ):
        library("no_such_module", "a film", "film")


@pytest.mark.parametrize(
    ("module", "arguments", "extra"),
    [
        ("imageio_ffmpeg", ("render", "--out", "film.mp4"), "film"),
        ("distributed", ("sweep", "sweep.toml", "--out", "s", "--scheduler", "local"), "cluster"),
    ],
)
def test_a_command_that_lacks_its_extra_says_which(
    tunnel: Tunnel,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    module: str,
    arguments: tuple[str, ...],
    extra: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.toml").write_text(SMALL)
    monkeypatch.setitem(sys.modules, module, None)
    status, out, err = tunnel(*arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert installing(extra) in err


def test_the_extras_are_those_of_the_installation() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(EXTRAS) == set(declared["optional-dependencies"]) - {
        "dev",
        "mutation",
        "benchmark",
    }  # of the source tree
    own = {module.replace("_", "-").lower() for names in EXTRAS.values() for module in names}
    assert not own & {text.split(">")[0].split("[")[0].strip().lower() for text in declared["dependencies"]}


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_one_and_is_printed(tunnel: Tunnel, tmp_path: Path, name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(schema_of(name))
    status, out, _ = tunnel("schema", name)
    assert (status, json.loads(out)) == (0, schema_of(name))
    assert tunnel("schema", name, "--out", tmp_path / "s.json")[0] == 0
    assert json.loads((tmp_path / "s.json").read_text()) == schema_of(name)


def test_documents_of_the_project_obey_their_schemas(tiny_campaign: Path) -> None:
    check("campaign", tomllib.loads((tiny_campaign / "campaign.toml").read_text()))
    for plan in (ROOT / "tests/data/tiny-plan.toml", ROOT / "tunnel_sim/data/paper-campaign.toml"):
        check("plan", tomllib.loads(plan.read_text(encoding="utf-8")))
    estimate = identify(read_campaign(tiny_campaign)).to_json_dict()
    check("estimate", estimate)
    with pytest.raises(jsonschema.ValidationError, match="is not valid under any"):
        check("estimate", estimate | {"cn_beta": "large"})
    with pytest.raises(jsonschema.ValidationError, match="Additional properties"):
        check("campaign", {"schema_version": 1, "campaign": {"name": "x"}, "runs": [{}], "rigg": {}})


def test_the_schema_of_a_diagnosis_has_its_fields_and_no_others(tiny_campaign: Path) -> None:
    found = diagnose(read_campaign(tiny_campaign), kinds=(effect_class("quadratic_damping"),)).to_json_dict()
    check("diagnosis", found)
    of_displacements = {"motion", "motion_scale"}
    assert set(schema_of("diagnosis")["properties"]) == set(found) | of_displacements


def test_an_unknown_document_is_refused(tunnel: Tunnel) -> None:
    assert tunnel("schema", "campain") == (
        2,
        "",
        "tunnel: tunnel schema: there is no schema 'campain'; did you mean 'campaign'?\n",
    )
