"""Which stages are open. Truth: the files of a session, made one after another."""

from __future__ import annotations

import asyncio
import json
import os
from collections import Counter
from pathlib import Path

import pytest

from tests.support.diagnosis_document import document
from tests.support.import_files import decay
from tunnel_lab.bench import work
from tunnel_lab.bench.workspace import STAGES, Session, closed
from tunnel_lab.terminal.arguments import file_hashes
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record


def open_stages(session: Session) -> list[str]:
    return [stage.key for stage in STAGES if not closed(session, stage.key)]


def test_each_stage_opens_the_next(tmp_path: Path) -> None:
    session = Session(tmp_path, "rig")
    assert open_stages(session) == ["records"]
    run = Run("a", Record(*decay()), 0.0)
    write_campaign(Campaign("rig", RigProperties(), SensorProperties(), (run,)), session.campaign)
    assert open_stages(session) == ["records", "conditions", "identify"]
    session.draft.write_text("{}")
    assert closed(session, "identify").startswith("Correct the conditions")
    session.draft.unlink()
    session.estimate("output_error").write_text("{}")
    assert open_stages(session)[-1] == "diagnose"
    document = {"provenance": {"sha256": file_hashes(session.campaign)}}
    session.diagnosis.write_text(json.dumps(document))
    assert open_stages(session) == [stage.key for stage in STAGES]
    # The campaign changes: what was found is of another one.
    text = (session.campaign / "campaign.toml").read_text()
    (session.campaign / "campaign.toml").write_text(
        text.replace("wind_speed = 0.0", "wind_speed = 0.0, spring_stiffness = 16.0")
    )
    later = session.estimate("output_error").stat().st_mtime_ns + 1_000_000
    os.utime(session.campaign / "campaign.toml", ns=(later, later))
    assert open_stages(session)[-1] == "identify"
    os.utime(session.estimate("output_error"), ns=(later + 1, later + 1))
    assert open_stages(session)[-1] == "diagnose"
    assert closed(session, "report") == "Diagnose the campaign first."


def test_an_estimate_that_failed_does_not_open_the_diagnosis(tmp_path: Path) -> None:
    session = Session(tmp_path, "rig")
    run = Run("a", Record(*decay()), 0.0)
    write_campaign(Campaign("rig", RigProperties(), SensorProperties(), (run,)), session.campaign)
    session.estimate("output_error").write_text("{}")
    words = "$ tunnel identify rig (process 1, started 2026-01-01T00:00:00+00:00)"
    session.log("output_error").write_text(f"{words}\nexit status 1\n")
    assert "could not be identified" in closed(session, "diagnose")


@pytest.mark.parametrize("changed", [False, True])
def test_an_answer_is_shown_unless_the_campaign_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: bool
) -> None:
    from nicegui import Client, ui
    from starlette.requests import Request

    from tunnel_lab.bench import diagnosis
    from tunnel_lab.bench.parts import Frame

    session = Session(tmp_path, "rig")
    run = Run("a", Record(*decay()), 0.0)
    write_campaign(Campaign("rig", RigProperties(), SensorProperties(), (run,)), session.campaign)
    hashes = {} if changed else file_hashes(session.campaign)
    session.diagnosis.write_text(
        json.dumps(document() | {"verdict": "A gap.", "provenance": {"sha256": hashes}})
    )
    monkeypatch.setattr(diagnosis, "ShownAnswer", lambda _, answer: ui.label(answer.verdict))
    with Client(ui.page("/"), request=Request({"type": "http", "path": "/", "headers": []})) as client:
        diagnosis.DiagnosePage(session, Frame("Diagnose", session, "diagnose"))
    shown = [one.text for one in client.elements.values() if isinstance(one, ui.label)]
    assert ("A gap." in shown) is not changed
    assert any("has changed since it was diagnosed" in text for text in shown) is changed


@pytest.mark.parametrize("processors", [1, 3])
def test_as_many_estimators_run_at_a_time_as_there_are_processors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processors: int
) -> None:
    from tunnel_lab.bench import identify

    looks: Counter[Path] = Counter()
    started: list[tuple[str, ...]] = []
    ended: list[Path] = []
    at_a_time: list[int] = []

    def start(words: tuple[str, ...], _: Path) -> None:
        started.append(words)

    def look(log: Path) -> work.Work:
        """Every command ends at the third look."""
        at_a_time.append(len(started) - len(ended))
        looks[log] += 1
        if looks[log] == 3:
            ended.append(log)
        return work.Work(running=looks[log] < 3)

    monkeypatch.setattr(work, "start", start)
    monkeypatch.setattr(work, "work_of", look)
    monkeypatch.setattr(os, "cpu_count", lambda: processors)
    monkeypatch.setattr(identify, "_POLL_S", 0.01)
    session = Session(tmp_path, "rig")
    orders = [(name, ("-e", name)) for name in ("a", "b", "c", "d", "e")]
    asyncio.run(identify.run_commands(session, orders))
    assert max(at_a_time) == processors
    assert sorted(started) == [("identify", str(session.campaign), "-e", name) for name, _ in orders]
    assert len(ended) == 5
