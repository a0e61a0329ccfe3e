"""The bench offers the estimators that installed packages add, beside the packaged ones."""

from __future__ import annotations

import importlib.metadata
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest
from nicegui import Client, ui
from starlette.requests import Request

from identification.estimators import ALL_ESTIMATORS, ENTRY_POINTS
from tunnel_lab.bench.identify import IdentifyPage
from tunnel_lab.bench.parts import Frame
from tunnel_lab.bench.workspace import Session


class Added:
    """Counts half cycles.

    Slowly.
    """

    name = "added"

    def estimate(self, campaign: object) -> None:
        raise NotImplementedError


def test_an_estimator_of_a_package_has_its_box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints(
        EntryPoint(name, f"{__name__}:{place}", ENTRY_POINTS)
        for name, place in (("added", "Added"), ("gone", "Gone"))
    )
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: points.select(group=group))
    session = Session(tmp_path, "rig")
    with Client(ui.page("/"), request=Request({"type": "http", "path": "/", "headers": []})) as client:
        IdentifyPage(session, Frame("identify", session, "identify"))
        boxes = [one.text for one in client.elements.values() if isinstance(one, ui.checkbox)]
    assert [text.partition(":")[0] for text in boxes] == [*ALL_ESTIMATORS, "added", "gone"]
    assert boxes[-2:] == ["added: Counts half cycles", "gone: cannot be loaded"]
