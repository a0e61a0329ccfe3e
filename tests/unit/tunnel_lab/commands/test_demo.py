"""``tunnel demo``: what it plants is what it finds, its output is two screens, and a failed check is seen."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from identification.estimate import Estimate, Status
from identification.show.quantity import Quantity
from tests.support.command import Tunnel
from tests.support.diagnosis_document import findings_of
from tests.support.rendered import consequence
from tunnel_lab.bench.workspace import open_session
from tunnel_lab.commands.demo import (
    PLAN,
    SHOWN,
    found_table,
    missed_faults,
    misses,
    show_next,
    show_simulated,
    simulated_part,
)
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.vocabulary.plan import CampaignPlan

TINY = Path(__file__).parents[3] / "data" / "tiny-plan.toml"
TWO_SCREENS = 60
"""Lines: two terminals of the usual 30 lines or so."""


@pytest.fixture
def plan() -> CampaignPlan:
    return load_plan(TINY)


@pytest.fixture
def faulty() -> CampaignPlan:
    """The plan of the demo."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / PLAN) as path:
        return load_plan(path)


def found_document(spring: float = 21.02, friction: float = 0.01, cn_beta: float = 0.4719) -> dict[str, Any]:
    """What a diagnosis of the demo's records could say: the parts that are checked."""
    sizes = {
        "coulomb_friction.friction_moment": {"value": friction, "std": 0.0001, "unit": "N m"},
        "spring_miscalibration.error": {"value": -0.03, "std": 0.0001, "unit": "1"},
        "spring_miscalibration.spring_stiffness": {"value": spring, "std": 0.0, "unit": "N m/rad"},
    }
    answer = "coulomb_friction + spring_miscalibration"
    return {
        "causes": answer.split(" + "),
        "candidates": [{"effect": answer, "probability": 0.99, "parameters": sizes}],
        "coefficients": {"after": {"cn_beta": {"value": cn_beta, "std": 0.001, "unit": "1/rad"}}},
    }


def test_what_was_planted_is_not_missed(faulty: CampaignPlan) -> None:
    assert missed_faults(faulty, findings_of(found_document())) == []
    assert missed_faults(faulty, findings_of(found_document(friction=0.01039, cn_beta=0.4758))) == []


@pytest.mark.parametrize(
    ("found", "missed"),
    [
        (found_document(spring=44.84), "spring_miscalibration spring_stiffness"),
        (found_document(friction=0.0105), "coulomb_friction friction_moment"),
        (found_document(cn_beta=0.48), "cn_beta"),
    ],
)
def test_a_fault_found_elsewhere_or_too_far_off_is_missed(
    faulty: CampaignPlan, found: dict[str, Any], missed: str
) -> None:
    assert missed_faults(faulty, findings_of(found)) == [f"{missed} misses the truth by more than 4 std"]


def test_other_causes_are_said(faulty: CampaignPlan) -> None:
    (said,) = missed_faults(faulty, findings_of({**found_document(), "causes": ["unknown"]}))
    assert said == "planted coulomb_friction and spring_miscalibration, found unknown"
    (said,) = missed_faults(faulty, findings_of({**found_document(), "causes": []}))
    assert said.endswith("found none")


def test_no_two_springs_could_tell_which_is_off(faulty: CampaignPlan) -> None:
    assert len({condition.spring_stiffness for condition in faulty.conditions}) >= 3


def test_the_values_before_are_those_of_the_verdict(faulty: CampaignPlan) -> None:
    found = found_document()
    before = {"cn_beta": {"value": 0.4897, "std": 0.018, "unit": "1/rad"}}
    found["coefficients"]["before"] = before
    table = found_table(faulty, findings_of(found))
    assert dict(zip(table.columns, table.rows[0], strict=True)) == {
        "quantity": "Cnβ [1/rad]", "planted": "0.4719", "nominal model": "0.490 ± 0.018",
        "with the causes": "0.4719 ± 0.0010", "error": "+0.0 σ",
    }  # fmt: skip
    assert "(0.490 → 0.472)" in consequence(findings_of(found))


@pytest.mark.parametrize(
    ("typed", "on_path", "name"),
    [
        (".venv/bin/tunnel", None, ".venv/bin/tunnel"),
        (".venv/bin/tunnel", "/usr/bin/tunnel", "tunnel"),
        ("/x/cli.py", None, "tunnel"),
    ],
)
def test_the_next_commands_can_be_typed_as_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: Any, typed: str, on_path: str | None, name: str
) -> None:
    monkeypatch.setattr("sys.argv", [typed, "demo"])
    monkeypatch.setattr("shutil.which", lambda _: on_path)
    show_next(Path("my folder"))
    lines = capsys.readouterr().out.splitlines()
    commands = [shlex.split(line.split("  ")[1]) for line in lines[2:]]
    assert [command[:2] for command in commands] == [[name, c] for c in ("bench", "import", "diagnose")]
    assert commands[0] == [name, "bench", "my folder"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_the_faults_are_found_whatever_the_noise(tunnel: Tunnel, tmp_path: Path, seed: int) -> None:
    status, out, err = tunnel("demo", "--out", tmp_path, "--seed", str(seed))
    assert (status, "Check failed" in err) == (0, False)
    assert len(out.splitlines()) <= TWO_SCREENS
    assert f"Written: {tmp_path / 'report.html'}" in out
    assert "</html>" in (tmp_path / "report.html").read_text(encoding="utf-8")
    session = open_session(tmp_path, "demo")  # as the bench opens it
    assert json.loads(session.diagnosis.read_text("utf-8"))["decided"]
    assert json.loads(session.estimate("output_error").read_text("utf-8"))["cn_beta"]
    assert json.loads((session.campaign / "truth.json").read_text("utf-8"))["seed"] == seed
    assert (load_plan(tmp_path / PLAN).name, load_plan(tmp_path / PLAN).seed) == ("demo", seed)


def test_every_estimator_of_the_comparison_is_kept_and_shown(
    plan: CampaignPlan, tmp_path: Path, capsys: Any
) -> None:
    campaign, estimates = simulated_part(plan, tmp_path)
    assert sorted(path.stem for path in tmp_path.glob("*.json")) == sorted(f"estimate-{n}" for n in SHOWN)
    show_simulated(campaign, [replace(estimates[0], statuses=(Status.MODEL_DEPARTS,)), *estimates[1:]], plan)
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown if "against the injected truth" in line] == list(SHOWN)
    assert [line for line in shown if line.startswith("Note")] == [
        f"Note, {SHOWN[0]}: {Status.MODEL_DEPARTS.value}"
    ]


def exact(plan: CampaignPlan, name: str = "output_error") -> Estimate:
    values: dict[str, Any] = {
        key: Quantity(value, 0.01 * abs(value), "") for key, value in vars(plan.truth).items()
    }
    return Estimate("tiny", name, (), **values)


def test_the_comparison_misses_nothing_that_is_near(plan: CampaignPlan) -> None:
    assert misses([exact(plan), exact(plan, "conventional")], plan) == []


def test_the_comparison_sees_an_estimate_far_from_the_truth(plan: CampaignPlan) -> None:
    far = replace(exact(plan), cn_r=Quantity(plan.truth.cn_r * 1.05, 0.01 * abs(plan.truth.cn_r), "1/rad"))
    assert misses([far], plan) == ["output_error: cn_r misses the truth by more than 4 std"]


def test_the_comparison_sees_an_estimate_that_is_missing_or_failed(plan: CampaignPlan) -> None:
    failed = Estimate("tiny", "conventional", (), (Status.NO_RUN_IDENTIFIED,))
    (missing, reason) = misses([replace(exact(plan), yaw_inertia=None), failed], plan)[::-1]
    assert missing == "output_error: no yaw_inertia"
    assert reason.startswith("conventional: no run could be identified")


@pytest.mark.usefixtures("unrendered")
def test_a_failed_check_ends_the_comparison_with_status_one(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plan: CampaignPlan
) -> None:
    monkeypatch.setattr("tunnel_sim.files.plan_file.paper_plan", lambda: plan)
    monkeypatch.setattr("tunnel_lab.commands.demo.misses", lambda *_: ["planted"])
    status, _, err = tunnel("demo", "--estimators", "--out", tmp_path / "out")
    assert status == 1
    assert "Check failed: planted" in err
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"campaign", "traces.png", "spectrum.png", "estimates.pdf"} <= written
