"""The paper's Table II, and the rule that flags springs held to its stated false-alarm rate."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from identification import identify
from identification.campaign.springs import fit_springs, pair_remark, wind_off_line
from identification.datasets import paper_springs
from identification.estimate import RunEstimate
from identification.policy import DIFFERENCE_RATE, SPRING_AT_BEST, SPRING_FLAG_RATE
from identification.show.quantity import Quantity
from tests.support.gap_campaigns import campaign
from tunnel_sim.effects import effect_from
from tunnel_sim.vocabulary.errors import TunnelError

pytestmark = pytest.mark.usefixtures("unexamined")

ROWS = paper_springs()
STIFFNESS = np.array([row.stiffness_n_m_per_rad for row in ROWS])
FREQUENCY = np.array([row.frequency_hz for row in ROWS])
SQUARED = (2.0 * np.pi * FREQUENCY) ** 2


def test_table_two():
    fit = fit_springs(STIFFNESS, FREQUENCY)
    assert round(fit.inertia.value, 4) == 0.1014
    assert round(fit.intercept.value, 2) == -0.02
    assert [number for number, flag in enumerate(fit.flagged, 1) if flag] == [4, 7]
    assert round(fit.residual_percent[3]) == -12
    assert round(fit.residual_percent[6]) == 10
    assert fit.p_value < SPRING_FLAG_RATE


def test_line_agrees_with_polyfit():
    fit = fit_springs(STIFFNESS, FREQUENCY)
    line, covariance = np.polyfit(SQUARED, STIFFNESS, 1, cov=True)
    assert fit.inertia.value == pytest.approx(line[0])
    assert fit.intercept.value == pytest.approx(line[1])
    assert fit.inertia.std == pytest.approx(np.sqrt(covariance[0, 0]))


@pytest.mark.slow
@pytest.mark.parametrize("count", [5, 10])
def test_false_alarm_rate_holds(count):
    rng = np.random.default_rng(17)
    trials = 300
    alarms = sum(
        any(
            fit_springs(
                0.1 * SQUARED[:count] * (1.0 + 0.03 * rng.standard_normal(count)), FREQUENCY[:count]
            ).flagged
        )
        for _ in range(trials)
    )
    # Binomial: outside once in 1e4.
    spread = 3.9 * np.sqrt(SPRING_FLAG_RATE * (1.0 - SPRING_FLAG_RATE) / trials)
    assert abs(alarms / trials - SPRING_FLAG_RATE) < spread


def test_two_bad_springs_do_not_mask_each_other():
    rng = np.random.default_rng(5)
    springs = 0.1 * SQUARED * (1.0 + 0.01 * rng.standard_normal(10))
    springs[2] *= 1.15
    springs[8] *= 1.14
    assert np.flatnonzero(fit_springs(springs, FREQUENCY).flagged).tolist() == [2, 8]


def test_exact_springs_are_not_flagged():
    fit = fit_springs(0.1 * SQUARED, FREQUENCY)
    assert not any(fit.flagged)
    assert fit.inertia.value == pytest.approx(0.1)
    assert fit.inertia.std < 1e-12


def test_answer_is_repeatable():
    assert fit_springs(STIFFNESS, FREQUENCY) == fit_springs(STIFFNESS, FREQUENCY)


@pytest.mark.parametrize(
    ("stiffness", "frequency", "what"),
    [
        ([1.0, 2.0], [0.5, 0.7], "fewer than three"),
        ([1.0, 2.0, 3.0], [0.5, 0.7], "differ; pair them"),
        ([1.0, -2.0, 3.0], [0.5, 0.7, 0.9], "positive"),
        ([1.0, 2.0, float("nan")], [0.5, 0.7, 0.9], "positive"),
        ([1.0, 2.0, 3.0], [0.5, 0.5, 0.5], "the same"),
    ],
)
def test_bad_tables_are_refused(stiffness, frequency, what):
    with pytest.raises(TunnelError, match=what):
        fit_springs(stiffness, frequency)


def test_wind_off_line_needs_two_springs_for_an_intercept():
    omega = np.sqrt(np.array([16.0, 16.0]) / 0.1)
    inertia, intercept = wind_off_line(np.array([16.0, 16.0]), omega, np.full(2, 1e-4))
    assert intercept is None
    assert inertia.value == pytest.approx(0.1)
    assert inertia.std == pytest.approx(0.1 * 2e-4 / omega[0] / np.sqrt(2.0))
    springs = np.array([16.0, 21.0, 45.0])
    inertia, intercept = wind_off_line(springs, np.sqrt((springs + 0.5) / 0.1), np.full(3, 1e-4))
    assert inertia.value == pytest.approx(0.1)
    assert intercept.value == pytest.approx(-0.5)


WHOLE = campaign(duration=0.1)
STILL = replace(WHOLE, runs=tuple(run for run in WHOLE.runs if not run.wind_on))


def two_springs(errors, frequency_std, rng=None):
    """What is said of two wind-off runs whose springs are off by relative errors, and whose frequencies scatter."""
    found = []
    for run, error in zip(STILL.runs, errors, strict=True):
        chance = 0.0 if rng is None else frequency_std * rng.standard_normal()
        omega = float(np.sqrt(run.spring_stiffness * (1.0 + error) / 0.1) * (1.0 + chance))
        found.append(RunEstimate(run.id, omega_n=Quantity(omega, omega * frequency_std, "rad/s")))
    return pair_remark(STILL, found)


def test_a_spring_two_per_cent_off_is_named_where_friction_spreads_the_frequencies():
    assert two_springs((0.0, 0.02), 2e-3) is not None
    assert two_springs((0.02, 0.0), 2e-3) is not None
    assert two_springs((0.0, 0.0), 2e-3) is None


def test_springs_calibrated_with_care_disagree_at_the_stated_rate():
    rng, trials = np.random.default_rng(7), 1000
    errors = SPRING_AT_BEST * rng.standard_normal((trials, 2))
    alarms = sum(two_springs(error, 1e-3, rng) is not None for error in errors)
    low, high = binom.ppf([1e-3, 1.0 - 1e-3], trials, DIFFERENCE_RATE)
    assert low <= alarms <= high


@pytest.mark.parametrize(("error", "said"), [(0.02, True), (-0.02, True), (0.003, False)])
def test_two_springs_that_disagree_are_named(error, said):
    """Two springs cannot tell which of them is off; within a per cent no two springs are known."""
    off = effect_from("spring_miscalibration", {"spring_stiffness": 44.84, "error": error})
    words = [one.what for one in identify(campaign(off)).remarks if "give inertias that differ" in one.what]
    assert bool(words) == said
    if said:
        assert "springs of 16.12 and 44.84 N m/rad" in words[0]
        (differ,) = re.findall(r"differ by ([0-9.]+) ±", words[0])
        assert float(differ) == pytest.approx(abs(100.0 * error), rel=1e-3)
