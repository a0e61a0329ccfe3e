"""An installed package adds an estimator by an entry point; it is planted here."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from importlib.metadata import EntryPoint, EntryPoints
from typing import ClassVar

import pytest

from identification import Estimate, Quantity, RunEstimate, identify
from identification.datasets import measured_campaign
from identification.estimators import ENTRY_POINTS, SUMMARIES, known_estimators, make_estimator
from identification.returned import WrongReturn
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


def one_run(omega: object, **whole: object) -> Callable[[Campaign], object]:
    """An answer whose first run has this frequency."""

    def answer(campaign: Campaign) -> Estimate:
        first, *others = campaign.runs
        runs = (RunEstimate(first.id, omega_n=omega), *(RunEstimate(run.id) for run in others))  # type: ignore[arg-type]
        return Estimate(campaign.name, "idle", runs, **whole)  # type: ignore[arg-type]

    return answer


ANSWERS: dict[str, tuple[Callable[[Campaign], object], str]] = {
    "another kind": (lambda _: {"cn_beta": 0.5}, "estimator idle: returns dict with .*; return an ident"),
    "no runs": (
        lambda campaign: Estimate(campaign.name, "idle", ()),
        r"returns the runs \[\] with campaign .*, and not \['swing-1', 'swing-2', 'swing-3'\]",
    ),
    "not a number": (one_run(Quantity(float("nan"), 0.1, "rad/s")), "omega_n of run swing-1 .* is nan ± 0.1"),
    "no deviation": (one_run(Quantity(5.0, float("inf"), "rad/s")), "omega_n of run swing-1 .* is 5.0 ± inf"),
    "hertz": (one_run(Quantity(0.8, 0.1, "Hz")), "the unit of omega_n of run swing-1 .* is 'Hz'"),
    "a bare number": (one_run(5.0), r"omega_n of run swing-1 .* is 5.0; give Quantity\(value, std"),
    "no status": (one_run(None, statuses=()), r"the statuses of the campaign .* are \(\)"),
    "a covariance of nothing": (
        one_run(None, covariance=((1.0,),)),
        r"the covariance .* has rows of \[1\] for 0 parameters",
    ),
}


@pytest.mark.parametrize("answer", ANSWERS)
def test_a_wrong_answer_is_one_line(monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    given, said = ANSWERS[answer]
    monkeypatch.setattr(Idle, "estimate", lambda _, campaign: given(campaign))
    with pytest.raises(WrongReturn, match=f"{said}.*check_estimator"):
        identify(measured_campaign("rotary-pendulum"), Idle())
