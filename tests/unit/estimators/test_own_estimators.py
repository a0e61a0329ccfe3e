"""An installed package adds an estimator by an entry point; it is planted here."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from importlib.metadata import EntryPoint, EntryPoints
from typing import ClassVar

import pytest

from identification import Estimate, RunEstimate, identify
from identification.datasets import measured_campaign
from identification.estimators import ENTRY_POINTS, SUMMARIES, known_estimators, make_estimator
from tunnel_lab.terminal.inputs import chosen_estimator
from tunnel_sim import Campaign, TunnelError


class Idle:
    """An estimator that gives no values."""

    name: ClassVar[str] = "idle"

    def estimate(self, campaign: Campaign) -> Estimate:
        return Estimate(campaign.name, self.name, tuple(RunEstimate(run.id) for run in campaign.runs))


@pytest.fixture
def _plugged_in(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints(
        EntryPoint(name, f"{__name__}:{place}", ENTRY_POINTS)
        for name, place in (("idle", "Idle"), ("gone", "Gone"), ("misnamed", "Idle"))
    )
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: points.select(group=group))


@pytest.mark.usefixtures("_plugged_in")
def test_it_is_known_and_used_by_name() -> None:
    assert known_estimators() == (*SUMMARIES, "idle", "gone", "misnamed")
    assert chosen_estimator("idle") == "idle"
    found = identify(measured_campaign("rotary-pendulum"), "idle")
    assert (found.estimator, found.cn_beta) == ("idle", None)


@pytest.mark.usefixtures("_plugged_in")
@pytest.mark.parametrize(
    ("name", "why"), [("gone", "AttributeError"), ("misnamed", "not an estimator named misnamed")]
)
def test_what_is_not_an_estimator_is_one_line(name: str, why: str) -> None:
    with pytest.raises(
        TunnelError, match=rf"entry point tunnel\.estimators: {name}: cannot be loaded \(.*{why}"
    ):
        make_estimator(name)


@pytest.mark.usefixtures("_plugged_in")
def test_an_unknown_name_suggests_it() -> None:
    with pytest.raises(TunnelError, match="did you mean 'idle'"):
        make_estimator("idel")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda _: {"cn_beta": 0.5}, "estimator idle: returned dict and not an Estimate"),
        (
            lambda campaign: Estimate(campaign.name, "idle", ()),
            r"returned runs \(none\), not swing-1, swing-2",
        ),
    ],
)
def test_an_answer_of_another_kind_is_one_line(
    monkeypatch: pytest.MonkeyPatch, answer: Callable[[Campaign], object], said: str
) -> None:
    monkeypatch.setattr(Idle, "estimate", lambda _, campaign: answer(campaign))
    with pytest.raises(TunnelError, match=f"{said}.*check_estimator"):
        identify(measured_campaign("rotary-pendulum"), Idle())
