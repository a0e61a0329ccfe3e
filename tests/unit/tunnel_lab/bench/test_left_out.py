"""Runs chosen to be left out: both pages, their commands, the report. Truth: the files of a session."""

from __future__ import annotations

import json
from pathlib import Path

from nicegui import Client, ui
from starlette.requests import Request

from tests.support.diagnosis_document import findings_of
from tests.support.import_files import decay
from tunnel_lab.bench import diagnosis, identify
from tunnel_lab.bench.left_out import left_out_of, options, runs_left_out
from tunnel_lab.bench.parts import Frame
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record


def made(folder: Path, *ids: str) -> Session:
    session = Session(folder, "rig")
    runs = tuple(Run(name, Record(*decay()), 0.0) for name in ids)
    write_campaign(Campaign("rig", RigProperties(), SensorProperties(), runs), session.campaign)
    return session


def test_a_choice_is_kept_and_is_part_of_both_commands(tmp_path: Path) -> None:
    session = made(tmp_path, "a", "b", "c")
    for page, stage in ((diagnosis.DiagnosePage, "diagnose"), (identify.IdentifyPage, "identify")):
        session.left_out.unlink(missing_ok=True)
        with Client(ui.page("/"), request=Request({"type": "http", "path": "/", "headers": []})) as client:
            page(session, Frame(stage, session, stage))
            (field,) = [one for one in client.elements.values() if isinstance(one, ui.select)]
            assert (field.options, field.value) == (["a", "b", "c"], [])
            field.set_value(["b"])
            assert json.loads(session.left_out.read_text()) == {"runs": ["b"]}
            code = [str(one.content) for one in client.elements.values() if isinstance(one, ui.html)]
            assert any("--leave-out b" in text for text in code)
            field.set_value(["a", "b", "c"])
        assert runs_left_out(session) == ("a", "b")  # one run remains
        assert options(session) == ("--leave-out", "a", "--leave-out", "b")


def test_runs_that_are_gone_are_not_left_out(tmp_path: Path) -> None:
    session = made(tmp_path, "a", "b")
    session.left_out.write_text(json.dumps({"runs": ["b", "gone"]}))
    assert runs_left_out(session) == ("b",)


def test_a_report_is_of_the_runs_that_were_diagnosed() -> None:
    assert left_out_of(findings_of({"provenance": {"left_out": ["b"]}})) == ("b",)
    assert left_out_of(findings_of({})) == ()
