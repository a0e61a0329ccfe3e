"""What all known effects together leave of a gap, and that the search ends where it is much."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import vocabulary
from diagnosis.findings.cautions import CAUTIONS
from diagnosis.search.investigate import investigate, nominal_study
from diagnosis.search.reach import unexplained_floor
from diagnosis.search.views.whole_runs import OUT_OF_REACH
from tunnel_sim.effects import known_effects
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, NOISE, INERTIA = 100.0, 3e-4, 0.1
SPRINGS = (16.0, 16.0, 30.0, 30.0)


@cache
def campaign(*, friction: float = 0.0, strange: float = 0.0) -> Campaign:
    """Decays by SciPy's integrator.

    Args:
        friction: dry friction, smoothed over a rate far below that of the motion, N m.
        strange: of a moment that no effect of the vocabulary has, N m: it comes and goes with the time.
    """
    rng, time = np.random.default_rng(3), np.arange(0.0, 8.0, 1.0 / RATE)
    runs = []
    for number, spring in enumerate(SPRINGS):

        def rates(t: float, y: np.ndarray, k: float = spring) -> list[float]:
            moment = -k * y[0] - 0.03 * y[1] - friction * np.tanh(y[1] / 1e-3)
            return [y[1], (moment + strange * np.sin(0.7 * t**1.5) * np.cos(3.0 * y[0] / 0.3)) / INERTIA]

        swing = solve_ivp(rates, (0.0, time[-1]), (0.3, 0.0), "DOP853", time, rtol=1e-9, atol=1e-12).y[0]
        record = Record(time, swing + rng.normal(0.0, NOISE, time.size))
        runs.append(Run(f"r{number}", record, 0.0, spring_stiffness=spring))
    return Campaign("reach", RigProperties(), SensorProperties(RATE), tuple(runs))


def left(found: Campaign) -> float:
    """The share of the gap that all effects together leave."""
    prepared = nominal_study(found, known_effects()).prepared
    return unexplained_floor(prepared.nominal, prepared.able, prepared.kinds)


def test_a_known_effect_is_within_reach_of_all() -> None:
    assert left(campaign(friction=0.02)) < 0.01


def test_a_moment_that_no_effect_has_is_not() -> None:
    assert left(campaign(strange=0.1)) > 0.2


def test_the_search_ends_there_and_says_so() -> None:
    few = vocabulary(
        ["coulomb_friction", "quadratic_damping", "cubic_stiffness", "sensor_drift", "free_play"]
    )
    study = investigate(campaign(strange=0.1), few)
    assert study.causes == ("unknown",)
    assert study.unexplained_floor is not None
    assert study.unexplained_floor > OUT_OF_REACH
    assert max(len(answer.effects) for answer in study.answers) <= 2
    words = CAUTIONS["beyond reach"]
    assert callable(words)
    assert "all known effects together would leave at least 20.0 % of the gap unexplained" in words(
        {"left": 0.2}
    )
