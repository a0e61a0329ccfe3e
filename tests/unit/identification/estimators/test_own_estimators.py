"""An installed package adds an estimator by an entry point; it is planted here."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from importlib.metadata import EntryPoint, EntryPoints
from typing import ClassVar

import numpy as np
import pytest

from identification import Estimate, Quantity, RunEstimate, Status, identify
from identification.datasets import measured_campaign
from identification.estimate import WindowEstimate
from identification.estimators import ENTRY_POINTS, SUMMARIES, known_estimators, make_estimator
from identification.returned import WrongReturn
from tunnel_lab.terminal.arguments import chosen_estimator
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


def with_covariance(covariance: object, **more: Quantity) -> Callable[[Campaign], object]:
    """An answer that gives Cnβ = 0.5 ± 0.1 and more coefficients, with this covariance."""
    values = {"cn_beta": Quantity(0.5, 0.1, "1/rad"), **more}
    return one_run(None, **values, parameters=tuple(values), covariance=covariance)


WINDOW = WindowEstimate(
    0.0,
    1.0,
    Quantity(0.3, 0.01, "rad"),
    Quantity(5.0, 0.1, "rad/s"),
    Quantity(np.zeros(2), 0.1, "1"),  # type: ignore[arg-type]
)
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
    "an array": (
        one_run(Quantity(np.array([5.0, 5.1]), 0.1, "rad/s")),  # type: ignore[arg-type]
        r"the value of omega_n of run swing-1 .* is ndarray array\(\[5\. , 5\.1\]\); give one number",
    ),
    "an array of one": (
        one_run(Quantity(5.0, np.array(0.1), "rad/s")),  # type: ignore[arg-type]
        r"the standard deviation of omega_n of run swing-1 .* is ndarray array\(0\.1\); give one number",
    ),
    "no standard deviation": (
        one_run(Quantity(5.0, None, "rad/s")),  # type: ignore[arg-type]
        "the standard deviation of omega_n of run swing-1 .* is None; give one number",
    ),
    "words": (
        one_run(Quantity("5", 0.1, "rad/s")),  # type: ignore[arg-type]
        "the value of omega_n of run swing-1 .* is str '5'; give one number",
    ),
    "an interval of arrays": (
        one_run(Quantity(5.0, 0.1, "rad/s", (np.array([4.0, 4.1]), 6.0))),  # type: ignore[arg-type]
        "the interval of omega_n of run swing-1 .* give a tuple of two numbers",
    ),
    "one status": (one_run(None, statuses=Status.OK), "the statuses of the campaign .* give a tuple"),
    "a list of runs": (
        lambda campaign: Estimate(campaign.name, "idle", [RunEstimate(run.id) for run in campaign.runs]),  # type: ignore[arg-type]
        "the runs with campaign .* are list .* give a tuple of RunEstimate",
    ),
    "an array in a window": (
        lambda campaign: Estimate(
            campaign.name, "idle", tuple(RunEstimate(run.id, windows=(WINDOW,)) for run in campaign.runs)
        ),
        "cannot be written as JSON .*; use plain floats",
    ),
    "no covariance": (
        one_run(None, cn_beta=Quantity(0.5, 0.1, "1/rad")),
        r"gives cn_beta with campaign .*, and parameters is \(\)",
    ),
    "a negative variance": (
        with_covariance(((-0.01,),)),
        r"the variance of cn_beta in the covariance .* is negative \(-0\.01\)",
    ),
    "a variance too large": (
        with_covariance(((1.0,),)),
        "does not have the standard deviations of the values: 1 for cn_beta, whose std is 0.1",
    ),
    "a covariance as an array": (
        with_covariance(np.array([[0.01]])),
        r"the covariance .* is ndarray .*; give a tuple of rows",
    ),
    "a covariance of one number": (with_covariance(0.01), "the covariance .* is float 0.01; give a tuple"),
    "a variance in words": (
        with_covariance((("0.01",),)),
        "the covariance .* holds str '0.01'; give numbers",
    ),
    "a correlation above one": (
        with_covariance(((0.01, 0.03), (0.03, 0.04)), cn_r=Quantity(0.1, 0.2, "1/rad")),
        "is not positive semidefinite",
    ),
    "half a covariance": (
        with_covariance(((0.01, 0.01), (0.0, 0.04)), cn_r=Quantity(0.1, 0.2, "1/rad")),
        "is not symmetric",
    ),
    "no status": (one_run(None, statuses=()), r"the statuses of the campaign .* are \(\)"),
    "a covariance of nothing": (
        one_run(None, covariance=((1.0,),)),
        r"the covariance .* has rows of \[1\] for 0 parameters",
    ),
}


@pytest.fixture(scope="module")
def pendulum() -> Campaign:
    return measured_campaign("rotary-pendulum")


@pytest.mark.usefixtures("unexamined")
@pytest.mark.parametrize("answer", ANSWERS)
def test_a_wrong_answer_is_one_line(monkeypatch: pytest.MonkeyPatch, pendulum: Campaign, answer: str) -> None:
    given, said = ANSWERS[answer]
    monkeypatch.setattr(Idle, "estimate", lambda _, campaign: given(campaign))
    with pytest.raises(WrongReturn, match=f"{said}.*check_estimator"):
        identify(pendulum, Idle())


def test_the_covariance_of_coefficients_with_an_exact_one_is_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A standard deviation of zero, whose row of the covariance is zero, and one rounded to four digits."""
    exact, rounded = Quantity(0.3, 0.0, "1/rad"), Quantity(0.1, 0.3333, "kg m2")
    given = with_covariance(
        ((0.01, 0.0, 0.02), (0.0, 0.0, 0.0), (0.02, 0.0, 1.0 / 9.0)), cn_r=exact, yaw_inertia=rounded
    )
    monkeypatch.setattr(Idle, "estimate", lambda _, campaign: given(campaign))
    assert identify(measured_campaign("rotary-pendulum"), Idle()).cn_r == exact
