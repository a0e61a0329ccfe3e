"""How far a diagnosis has come, and which run may be proposed. Truth: lines and documents written here."""

from __future__ import annotations

import json
import os
import re
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from nicegui import Client, ui
from starlette.requests import Request

from diagnosis.findings.next_steps import next_steps, run_to_make
from identification.show.blocks import TextTable
from tests.support.diagnosis_document import document, findings_of
from tests.support.import_files import decay
from tunnel_lab.bench import diagnosis, parts, work
from tunnel_lab.bench.parts import Frame
from tunnel_lab.bench.workspace import Session
from tunnel_lab.terminal import progress
from tunnel_lab.terminal.time_left import Reached
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

NORMALISED = {
    "before": {
        name: {"value": 1.0, "std": 0.1, "unit": unit} for name, unit in (("omega_n", "rad/s"), ("zeta", "1"))
    },
    "after": {},
    "note": "",
}


def test_the_stage_and_the_set_are_read_from_what_is_printed() -> None:
    lines = ["Note: a run was cut", "0.1 s: estimating the noise", "2.5 s: fitting sets of effects"]
    found = diagnosis.progress_of(lines)
    assert found.stages == (("0.1", "estimating the noise"), ("2.5", "fitting sets of effects"))
    assert (found.tried, found.reached, found.seconds) == ("", Reached("effects", 2.5), 2.5)
    lines += ["4.0 s: fitting sets of effects: coulomb_friction + free_play"]
    found = diagnosis.progress_of(lines)
    assert found.tried == "coulomb friction + free play"
    assert (found.reached, found.seconds) == (Reached("effects", 2.5), 4.0)
    lines += ["9.0 s: predicting held-out runs"]
    assert diagnosis.progress_of(lines).tried == ""
    assert diagnosis.progress_of(lines).reached == Reached("explained share", 9.0)
    assert (
        diagnosis.progress_of(["tunnel: no such folder", "1.0 s: what: else"])
        == diagnosis.DiagnosisProgress()
    )


@pytest.mark.parametrize(("every", "sets"), [(None, 0), (0.0, 3), (1e6, 0)])
def test_sets_are_printed_where_they_are_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], every: float | None, sets: int
) -> None:
    monkeypatch.setattr(progress, "_sets_every", None)
    if every is not None:
        progress.print_sets(every)
    long = " + ".join(["coulomb_friction", "quadratic_damping", "nonlinear_yaw_moment", "vortex_shedding"])
    with progress.step_display() as show:
        show("effects")
        for name in ("free_play", "mains_hum", long):
            show(name)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 + sets
    assert re.fullmatch(r"\d+\.\d s: fitting sets of effects", lines[0])
    if sets:
        assert diagnosis.progress_of(lines).tried == long.replace("_", " ")


def test_a_step_that_is_taken_twice_is_printed_once(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.step_display() as show:
        for name in ("effects", "pruning", "coulomb_friction", "pruning", "polishing"):
            show(name)
    said = [line.partition(": ")[2] for line in capsys.readouterr().err.splitlines()]
    assert said == [progress.STEPS[name] for name in ("effects", "pruning", "polishing")]


def session(folder: Path) -> Session:
    found = Session(folder, "rig")
    run = Run("a", Record(*decay()), 0.0)
    write_campaign(Campaign("rig", RigProperties(), SensorProperties(), (run,)), found.campaign)
    return found


def texts(build: Any, given: Session) -> list[str]:
    with Client(ui.page("/"), request=Request({"type": "http", "path": "/", "headers": []})) as client:
        build(given, Frame("x", given, "diagnose"))
    return [
        str(one.content if isinstance(one, ui.html) else getattr(one, "text", ""))
        for one in client.elements.values()
    ]


def test_effects_are_words_on_the_page_and_runs_are_as_they_are_named(tmp_path: Path) -> None:
    rows = (("coulomb_friction", "run_1"),)
    (shown,) = [
        text
        for text in texts(
            lambda *_: parts.show_blocks([TextTable("", ("effect", "run"), rows, names=("effect",))]),
            session(tmp_path),
        )
        if "table" in text
    ]
    assert ">coulomb friction<" in shown
    assert ">run_1<" in shown


def test_the_page_shows_what_is_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = session(tmp_path)
    lines = ("2.5 s: fitting sets of effects", "3.0 s: fitting sets of effects: free_play + mains_hum")
    state = work.Work("tunnel diagnose rig", 1, "2026-01-01T00:00:00+00:00", lines, 1000.0, running=True)
    monkeypatch.setattr(work, "work_of", lambda _: state)
    monkeypatch.setattr(time, "time", lambda: 1007.0)
    left = Reached("effects", 2.5).words(10.0)  # 7 s after the line of 3.0 s
    assert re.fullmatch(r"about \d+ to \d+ s left", left)
    shown = texts(diagnosis.DiagnosePage, given)
    (clock,) = [text for text in shown if "so far" in text]
    assert f"s so far, {left}. Now with free play + mains hum." in clock
    assert "fitting sets of effects … since 2.5 s" in shown
    state = replace(state, pauses=1)
    (clock,) = [text for text in texts(diagnosis.DiagnosePage, given) if "so far" in text]
    assert "s so far, time left not known after a pause." in clock


@pytest.mark.parametrize(
    ("changes", "said", "offered"),
    [
        ({}, "81.5 N m/rad", True),
        (
            {"next_run": document()["next_run"] | {"separation": 0.4}},
            "differ by 0.4 standard deviations",
            True,
        ),
        ({"next_run": None}, "of this campaign do not distinguish them: add others", True),
        ({"next_run": None, "coefficients": NORMALISED}, "no spring is stated", False),
        ({"next_run": None, "coefficients": NORMALISED}, "cannot be computed: state every", False),
        (
            {"next_run": None, "coefficients": {"before": {}, "after": {}, "note": ""}},
            "of this campaign do not distinguish them: add others",
            True,
        ),
    ],
)
def test_only_a_run_that_can_be_planned_and_tells_is_proposed(
    tmp_path: Path, changes: dict[str, Any], said: str, offered: bool
) -> None:
    given = session(tmp_path)
    given.diagnosis.write_text(json.dumps(document() | changes))
    shown = texts(diagnosis.build_next_run, given)
    assert any(said in text for text in shown)
    assert ("Find the run" in shown) is offered
    proposed = "81.5 N m/rad" in " ".join(shown)
    assert proposed is (not changes)
    assert ("Download the plan" in shown) is proposed


@pytest.mark.parametrize(
    ("body", "seconds"),
    [("exit status 0", 34.0), ("paused\ngoes on\nexit status 0", None), ("exit status 1", None), ("", None)],
)
def test_the_time_of_a_diagnosis_is_that_of_its_log(tmp_path: Path, body: str, seconds: float | None) -> None:
    log = tmp_path / "rig.diagnosis.log"
    log.write_text(f"$ tunnel diagnose rig (process 1, started 2026-01-01T00:00:00+00:00)\n{body}\n")
    ended = datetime(2026, 1, 1, 0, 0, 34, tzinfo=UTC).timestamp()
    os.utime(log, (ended, ended))
    assert work.seconds_taken(log) == seconds


def test_effects_of_the_wind_are_offered_where_it_blew(tmp_path: Path) -> None:
    given, found = session(tmp_path), {}
    still = document()
    for run in still["maps"]["runs"]:
        run["wind_speed"] = 0.0
    for name, one in (("windy", document()), ("still", still)):
        given.diagnosis.write_text(json.dumps(one))
        with Client(ui.page("/"), request=Request({"type": "http", "path": "/", "headers": []})) as client:
            diagnosis.build_next_run(given, Frame("x", given, "next-run"))
        found[name] = [set(e.options) for e in client.elements.values() if isinstance(e, ui.select)]
    assert all("unsteady_aero_lag" in options for options in found["windy"])
    assert found["still"]
    assert all("unsteady_aero_lag" not in o and "coulomb_friction" in o for o in found["still"])


def test_other_runs_differ_in_what_can_be_chosen() -> None:
    undecided = {"decided": False, "common": {"effects": {}, "channels": {}}, "next_run": None}
    for changes, words in (
        ({}, "other springs, wind speeds and release angles:"),
        ({"coefficients": NORMALISED}, "other wind speeds and release angles:"),
        ({"model": {"file": "a.xml"}}, "other wind speeds and release angles:"),
    ):
        steps = next_steps(findings_of(document() | undecided | changes))
        assert any(words in step for step in steps), steps
    assert run_to_make(findings_of(document() | {"next_run": None})) is None
