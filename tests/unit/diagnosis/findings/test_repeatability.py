"""How the runs repeat: drifts, and zeros of the runs' own. Truth: the numbers with which the runs are made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.answer.run_deviations import ScatterLimits, Spread
from diagnosis.findings.cautions import CAUTIONS, sentence_of
from diagnosis.findings.judgements import zeros_apart
from diagnosis.findings.repeatability import RunRepeatability
from diagnosis.findings.run_patterns import trend_words
from diagnosis.findings.units import own_repeatability
from diagnosis.likelihood.least_squares import fit_at
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import Similarity
from diagnosis.search.investigate import nominal_study
from diagnosis.search.patterns import Trend
from diagnosis.search.scatter import evident, scattered, shown_by
from tests.support.gap_campaigns import campaign, nominal, studied
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.campaign import Campaign, Repeatability

CONDITIONS = tuple(
    (spring, speed) for _ in range(2) for spring in (16.12, 44.84) for speed in (0.0, 15.0, 25.0)
)
WINDY = CONDITIONS[1]  # beside a run, so that the nominal model of the small campaigns has wind
SPEED = "wind_speed_scatter"


def with_speeds(errors: np.ndarray) -> Campaign:
    """Twelve runs, the wind of each of which is faster than stated by a share of its own."""
    runs = []
    for number, ((spring, speed), error) in enumerate(zip(CONDITIONS, errors, strict=True)):
        one = campaign(conditions=((spring, speed * (1.0 + error)), WINDY), duration=6.0, seed=number).runs[0]
        runs.append(replace(one, id=f"r{number + 1:02d}", wind_speed=speed))
    return replace(campaign(duration=1.0), runs=tuple(runs))


def found(errors: np.ndarray) -> RunRepeatability:
    base = nominal(with_speeds(errors))
    layered = scattered(base, ALL_EFFECTS)
    assert layered is not None
    given = RunRepeatability.find(evident(layered))
    assert given is not None
    return given


@pytest.fixture(scope="module")
def by_chance() -> tuple[np.ndarray, RunRepeatability]:
    """Relative errors of the wind, and what is found of runs in it."""
    errors = np.random.default_rng(3).normal(0.0, 0.006, len(CONDITIONS))
    return errors, found(errors)


def test_a_wind_that_drifts_over_the_campaign_is_no_chance() -> None:
    rng, order = np.random.default_rng(1), np.linspace(-0.5, 0.5, len(CONDITIONS))
    given = found(0.02 * order + rng.normal(0.0, 0.0005, order.size))
    (trend,) = given.trends
    assert trend.effect == SPEED
    assert trend.change == pytest.approx(0.02, abs=4.0 * trend.std)
    assert trend.std < 0.002
    assert trend.left < 0.002
    assert trend.p_value < 1e-3


@pytest.mark.parametrize("windy", [1, 2])
def test_stated_scatter_of_few_runs_with_the_wind_on_counts_and_is_not_shown(windy: int) -> None:
    still = [(16.12, 0.0), (16.12, 0.0), (44.84, 0.0), (44.84, 0.0)]
    data = campaign(conditions=[*still, *[(16.12, 20.0), (44.84, 20.0)][:windy]], duration=6.0)
    stated = replace(data, repeatability=Repeatability(wind_speed=0.01, spring_stiffness=1e-4))
    fitted = nominal_study(stated, ALL_EFFECTS).nominal
    given = RunRepeatability.find(fitted)
    assert given is not None
    assert {one.effect: one.width for one in given.spreads} == {SPEED: 0.01, "stiffness_scatter": 1e-4}
    assert set(given.spreads[0].deviations) == {run.id for run in data.runs if run.wind_speed}
    layered = scattered(fitted, ALL_EFFECTS)
    assert layered is None or SPEED not in shown_by(layered)


def test_a_wind_that_follows_the_spring_is_no_chance() -> None:
    rng = np.random.default_rng(2)
    stiff = np.array([spring > 20.0 for spring, _ in CONDITIONS], float)
    (trend,) = found(0.03 * (stiff - 0.5) + rng.normal(0.0, 0.0005, stiff.size)).trends
    assert (trend.effect, trend.along, trend.only) == (SPEED, "spring_stiffness", False)
    assert trend.change == pytest.approx(0.03, abs=4.0 * trend.std)
    assert trend.left < 0.003


def test_scatter_that_follows_a_pattern_is_not_answered_with_the_remedy_of_chance() -> None:
    spread = Spread(SPEED, 0.01, (0.005, 0.02), None, True, {})
    trend = Trend(SPEED, 0.02, 1e-4, 1e-6, 1e-4, along="spring_stiffness")
    step = RunRepeatability((spread,), trends=(trend,)).pattern_step(SPEED)
    assert step is not None
    assert step.words.startswith("Look for what makes the wind speed differ with the stiffness of the spring")
    by_order = RunRepeatability((spread,), trends=(replace(trend, along="order"),)).pattern_step(SPEED)
    assert by_order is not None
    assert "from the first run to the last" in by_order.words
    for others in ((), (replace(trend, left=0.008),), (replace(trend, effect="stiffness_scatter"),)):
        assert RunRepeatability((spread,), trends=others).pattern_step(SPEED) is None


@pytest.mark.parametrize(
    ("along", "only", "said", "sought"),
    [
        (
            "order",
            True,
            "The runs drift but do not scatter: the spring falls by 0.300(10) % from the first to the last run",
            "from the first run to the last",
        ),
        (
            "wind",
            True,
            "The runs differ but do not scatter: the spring is 0.300(10) % lower with the wind on than with the",
            "with the wind on",
        ),
        (
            "groups",
            True,
            "the spring is 0.300(10) % lower in r2 and r5 than in the other runs (another logger, day or clamp",
            "in r2 and r5",
        ),
        (
            "spring_stiffness",
            True,
            "lower in r2 and r5 than in the other runs, which have another stiffness of the spring",
            "with the stiffness of the spring",
        ),
        (
            "amplitude",
            False,
            "Part of this is not by chance: the spring is 0.300(10) % lower at the greatest amplitude than at the "
            "least. The remaining scatter is 0.010 %",
            "with the amplitude",
        ),
    ],
)
def test_a_pattern_is_said_and_its_cause_is_sought(along: str, only: bool, said: str, sought: str) -> None:
    named = ("r2", "r5") if along in ("groups", "spring_stiffness") else ()
    trend = Trend("stiffness_scatter", -3e-3, 1e-4, 1e-6, 1e-4, only, along, named)
    assert said in trend_words(trend).replace(" ± 0.010", "(10)")
    (step,) = RunRepeatability((), trends=(trend,)).pattern_steps
    assert step.words.startswith(f"Look for what makes the spring differ {sought}")
    by_chance = replace(trend, along="order", only=False)
    assert RunRepeatability((), trends=(by_chance,)).pattern_steps == []


def test_a_wind_that_differs_by_chance_does_not_drift(
    by_chance: tuple[np.ndarray, RunRepeatability],
) -> None:
    errors, given = by_chance
    assert given.trends == ()
    assert given.limits is None  # of a scatter that is not found
    spread = next(one for one in given.spreads if one.effect == SPEED)
    assert spread.shown
    assert spread.interval[0] < 0.006 < spread.interval[1]
    windy = [k for k, (_, speed) in enumerate(CONDITIONS) if speed > 0.0]
    own = np.array([spread.deviations[f"r{k + 1:02d}"] for k in windy])
    # the mean of the deviations is that of Cnβ and Cnr
    assert np.corrcoef(own, errors[windy])[0, 1] > 0.95


def test_frequencies_of_the_runs_are_those_of_the_measured_rig(
    by_chance: tuple[np.ndarray, RunRepeatability],
) -> None:
    _, given = by_chance
    still = given.runs[0]  # without wind: √(Kr/Izz) by the numbers of the small campaigns
    assert still.frequency_hz == pytest.approx(np.sqrt(16.12 / 0.11) / (2.0 * np.pi), rel=1e-3)
    slower = Similarity(time=2.0)
    assert own_repeatability(given, slower).runs[0].frequency_hz == pytest.approx(
        slower.own(still.frequency_hz, "Hz")
    )


@pytest.mark.parametrize("apart", [0.005, 0.0])
def test_zeros_that_would_close_an_unexplained_gap_are_mentioned(apart: float) -> None:
    data = campaign(duration=6.0)
    zeros = apart * np.random.default_rng(2).normal(0.0, 1.0, len(data.runs))
    runs = tuple(
        replace(run, record=replace(run.record, yaw_rad=run.record.yaw_rad + zero))
        for run, zero in zip(data.runs, zeros, strict=True)
    )
    data = replace(data, runs=runs)
    facts = zeros_apart(studied(data, nominal(data)))
    assert bool(facts) == (apart > 0.0)
    for fact in facts:
        assert fact.figures["share"] > 0.9
        assert 'State zero = "per_run" under [sensor]' in sentence_of(CAUTIONS, fact)
        stated = replace(data, sensor=replace(data.sensor, zero="common"))
        assert zeros_apart(studied(stated, nominal(data))) == ()


def with_damping(errors: np.ndarray, seed: int = 0) -> Campaign:
    """Six or more runs, the damping of each of which is off by a share of its own."""
    conditions = (CONDITIONS * 2)[: errors.size]
    runs = []
    for number, (condition, error) in enumerate(zip(conditions, errors, strict=True)):
        one = campaign(
            conditions=(condition, WINDY),
            duration=6.0,
            seed=seed + number,
            damping=0.008 * (1.0 + error),
        ).runs[0]
        runs.append(replace(one, id=f"r{number + 1:02d}"))
    return replace(campaign(duration=1.0), runs=tuple(runs))


def limits(data: Campaign) -> ScatterLimits:
    given = RunRepeatability.find(nominal(data))
    assert given is not None
    assert given.limits is not None
    return given.limits


@pytest.mark.parametrize("width", [0.0, 0.002, 0.004])
def test_a_limit_is_not_below_the_scatter_that_is_there(width: float) -> None:
    """Scatter too small for the test, of the mechanical damping: most of the whole with the wind off."""
    rng = np.random.default_rng(11)
    found = [limits(with_damping(width * rng.standard_normal(12), 100 * i)) for i in range(4)]
    assert all(one.damping is not None and one.frequency is not None for one in found)
    # the mean share of the mechanical damping in the whole is above one third
    assert sum(one.damping < width / 3.0 for one in found) == 0
    assert max(one.frequency for one in found) < 2e-4
    assert max(one.damping for one in found) < 0.02


def test_few_noisy_runs_say_nothing_about_scatter() -> None:
    data = campaign(conditions=CONDITIONS[:3], duration=2.0)
    rng = np.random.default_rng(2)
    runs = tuple(
        replace(run, record=replace(run.record, yaw_rad=run.record.yaw_rad + rng.normal(0.0, 0.05, 500)))
        for run in data.runs
    )
    sensor = replace(data.sensor, noise_std=0.05)
    assert limits(replace(data, runs=runs, sensor=sensor)) == ScatterLimits(None, None)


def test_runs_without_damping_have_no_relative_deviation_of_it() -> None:
    base = nominal(campaign(duration=6.0))
    common = base.point.common.copy()
    common[base.problem.names.index("mechanical_damping")] = 0.0
    point = Point(common, base.point.per_run)
    assert RunRepeatability.find(fit_at(base.problem, point)) is None
    assert RunRepeatability.find(base) is not None
