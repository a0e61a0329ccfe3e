"""An effect that only joins the two halves of a record is not named; one that acts is shown by a half alone.

Truth: decays in closed form, and a swing with dry friction or a cubic spring integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis.model.fact import Fact
from diagnosis.search.investigate import investigate
from diagnosis.search.resolved import unresolved
from tests.marks import slow
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

TIME = np.arange(2000) / 100.0


def campaign(*swings):
    """Runs of these angles (rad) at 100 Hz, with noise of 0.2 mrad."""
    rng = np.random.default_rng(5)
    runs = [
        Run(f"r{i}", Record(TIME, yaw + rng.normal(0.0, 2e-4, TIME.size)), 0.0)
        for i, yaw in enumerate(swings)
    ]
    return Campaign("halves", RigProperties(), SensorProperties(100.0), tuple(runs))


def integrated(moment, start=0.3):
    """A swing with a moment (1/s²) of angle and rate beside spring and damper, rad."""
    found = solve_ivp(
        lambda _, s: [s[1], -49.0 * s[0] - 0.15 * s[1] - moment(*s)],
        (0.0, TIME[-1]), [start, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-11,
    )  # fmt: skip
    return found.y[0]


def study(name, *swings):
    return investigate(campaign(*swings), [effect_class(name)])


@pytest.mark.parametrize(
    ("name", "moment"),
    [
        ("cubic_stiffness", lambda angle, _: 10.0 * angle**3),
        slow("coulomb_friction", lambda _, rate: 0.05 * np.tanh(rate / 1e-3)),
    ],
)
def test_an_effect_that_acts_is_resolved_by_a_half(name, moment):
    found = study(name, integrated(moment), integrated(moment, 0.2))
    assert found.fitted == (name,)
    assert unresolved(found.chosen) == ()
    assert not found.refused


def test_an_effect_that_only_joins_the_halves_is_not_resolved():
    """The frequency changes at half time, and not with the amplitude."""
    phase = np.cumsum(np.where(TIME < 10.0, 7.0, 7.002)) / 100.0
    found = study("cubic_stiffness", 0.3 * np.exp(-0.08 * TIME) * np.cos(phase))
    assert unresolved(found.of(["cubic_stiffness"]).hypothesis.fit) == ("cubic_stiffness",)


def test_an_answer_with_an_effect_that_is_not_resolved_is_refused(monkeypatch):
    monkeypatch.setattr("diagnosis.search.surviving.unresolved", lambda fit: (fit.problem.effects[0].name,))
    found = study("cubic_stiffness", integrated(lambda angle, _: 10.0 * angle**3))
    assert dict(found.refused) == {
        ("cubic_stiffness",): Fact("unresolved", {"effects": ("cubic_stiffness",)})
    }
    assert found.fitted == ("unknown",)
    assert found.of(["cubic_stiffness"]) is None
