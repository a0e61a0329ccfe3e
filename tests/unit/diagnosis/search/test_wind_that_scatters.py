"""Wind speeds that differ from run to run: fits find what acts between runs, and vortices keep their phase."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis.likelihood import least_squares
from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model import chance
from diagnosis.model.parameters import Point
from diagnosis.search import one_more
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.investigate import investigate, nominal_study
from diagnosis.search.one_more import LEAST_DROP, sets_with_one_more
from diagnosis.search.scatter import scattered, with_likeliest_widths
from tunnel_sim.effects import effect_class, known_effects
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.between_runs import Repeatability
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

INERTIA, DAMPING, NOISE, RATE, DENSITY = 0.1, 0.02, 3e-4, 100.0, 1.2
CN_BETA, CN_R, STROUHAL = 0.45, -0.1, 0.06
SPEEDS = (0.0, 0.0, 12.0, 16.0, 16.0, 20.0, 20.0, 24.0)
SPRINGS = (16.0, 30.0) * 4
SCATTER = 3e-3  # of the speed, relative, one standard deviation
BODY = load_rig().body


@cache
def blown(
    *, offset: float = 0.0, shedding: float = 0.0, lead: float = 0.0, sensor_error: float = 0.0
) -> Campaign:
    """Decays by SciPy's integrator in winds that differ from what is stated.

    Args:
        offset: by which the true wind is faster, m/s.
        shedding: coefficient of the moment of vortices.
        lead: time constant by which the moment leads the angle, in l/V.
        sensor_error: cubic error of the readings, 1/rad².
    """
    rng, time = np.random.default_rng(7), np.arange(0.0, 8.0, 1.0 / RATE)
    stated, count = np.array(SPEEDS), len(SPEEDS)
    differences, phase, noise = np.zeros(count), np.zeros(count), np.zeros((count, time.size))
    for number, speed in enumerate(SPEEDS):
        differences[number] = rng.standard_normal() if speed else 0.0
        phase[number] = rng.uniform(0.0, 2.0 * np.pi)
        noise[number] = rng.normal(0.0, NOISE, time.size)
    wind = np.where(stated > 0.0, (stated + offset) * (1.0 + SCATTER * differences), 0.0)
    pressure = 0.5 * DENSITY * wind**2 * BODY.frontal_area * BODY.length
    lever = np.where(wind > 0.0, BODY.length / np.maximum(wind, 1e-9), 0.0)
    turn, constant = 2.0 * np.pi * STROUHAL * wind / BODY.width, lead * lever
    stiffness, damping = np.array(SPRINGS) - pressure * CN_BETA, DAMPING - pressure * lever * CN_R

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        angle, rate, late = y.reshape(3, count)
        behind = np.where(constant > 0.0, angle - late, 0.0)
        moment = -stiffness * angle - damping * rate + pressure * CN_BETA * behind
        moment += pressure * shedding * np.sin(turn * t + phase)
        return np.concatenate([rate, moment / INERTIA, behind / np.where(constant > 0.0, constant, 1.0)])

    start = np.repeat([0.3, 0.0, 0.3], count)
    solved = solve_ivp(rates, (0.0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-12).y
    runs = [
        Run(
            f"r{number}",
            Record(time, swing + sensor_error * swing**3 + noise[number]),
            speed,
            air_density=DENSITY if speed else None,
            spring_stiffness=spring,
        )
        for number, (speed, spring, swing) in enumerate(zip(SPEEDS, SPRINGS, solved[:count], strict=True))
    ]
    rig = RigProperties(frontal_area=BODY.frontal_area, reference_length=BODY.length, width=BODY.width)
    return Campaign("blown", rig, SensorProperties(RATE), tuple(runs))


def beside_scatter(found: Campaign, effect: str) -> tuple[Fit, Fit]:
    """The nominal model and one effect, fitted beside speeds that scatter; the effect from nearly none of it."""
    nominal = nominal_study(found, known_effects()).prepared.nominal
    base = scattered(nominal, known_effects())
    assert base is not None
    start = starting_points(base, effect_class(effect))[0]
    assert start.scaled is not None
    common = start.point.common.copy()
    common[start.scaled] *= 0.1
    fitted = try_fit(start.problem, Point(common, start.point.per_run))
    assert fitted is not None
    return base, fitted


@cache
def off() -> tuple[Fit, Fit]:
    """Beside a speed that is 2 m/s off."""
    return beside_scatter(blown(offset=2.0), "wind_speed_offset")


def away(fitted: Fit) -> float:
    """How far linear theory still moves the last parameter, in standard deviations."""
    here = fitted.columns.at(fitted.widths)
    return float(abs(here.likeliest.common[-1]) / fitted.std(fitted.problem.names[-1]))


def test_a_fit_beside_scatter_reaches_its_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deviations absorb a speed that is off nearly as well: the valley of χ² is long and bent."""
    base, fitted = off()
    assert away(fitted) < 0.1
    assert abs(fitted.value("wind_speed_offset.offset") - 2.0) < 3.0 * fitted.std("wind_speed_offset.offset")
    assert base.unlikelihood - fitted.unlikelihood > 14.0
    monkeypatch.setattr(least_squares, "_CORRECTIONS", 0)
    assert away(beside_scatter(blown(offset=2.0), "wind_speed_offset")[1]) > 2.0


def test_vortices_keep_time_with_the_true_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the stated speed their phase is lost within some cycles."""
    nominal = nominal_study(blown(shedding=0.05), known_effects()).prepared.nominal
    base = scattered(nominal, known_effects())
    assert base is not None
    (start,) = starting_points(base, effect_class("vortex_shedding"))
    followed = try_fit(start.problem, start.point)
    assert followed is not None
    assert followed.value("vortex_shedding.strouhal_number") == pytest.approx(STROUHAL, rel=3.0 * SCATTER)
    monkeypatch.setattr(chance, "_KEEPING_TIME", ())
    stated = try_fit(start.problem, start.point)
    assert stated is not None
    assert followed.excess < 0.1 * stated.excess


def test_a_lead_is_tried_beside_another_effect_though_linear_theory_predicts_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Cnr absorbs its first order, and the deviations of the runs most of a prediction from there."""
    _, base = beside_scatter(blown(lead=0.3, sensor_error=-0.07), "sensor_nonlinearity")
    lag = effect_class("unsteady_aero_lag")
    (start,) = starting_points(base, lag)
    assert start.predicted_drop < LEAST_DROP
    assert sets_with_one_more([Hypothesis(("sensor_nonlinearity",), base)], [lag]) == []
    monkeypatch.setattr(Hypothesis, "explains_runs", True)
    (child,) = sets_with_one_more([Hypothesis(("sensor_nonlinearity",), base)], [lag])
    assert base.unlikelihood - child.fit.unlikelihood > 1.2 * start.predicted_drop
    assert abs(child.fit.value("unsteady_aero_lag.lag") + 0.3) < 3.0 * child.fit.std("unsteady_aero_lag.lag")


def test_an_offset_of_the_wind_is_tried_beside_another_effect_though_linear_theory_predicts_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The deviations of the wind speed absorb most of it."""
    _, base = beside_scatter(blown(offset=0.5, sensor_error=-0.07), "sensor_nonlinearity")
    offset = effect_class("wind_speed_offset")
    (start,) = starting_points(base, offset)
    assert start.predicted_drop < LEAST_DROP
    assert sets_with_one_more([Hypothesis(("sensor_nonlinearity",), base)], [offset]) == []
    monkeypatch.setattr(Hypothesis, "explains_runs", True)
    (child,) = sets_with_one_more([Hypothesis(("sensor_nonlinearity",), base)], [offset])
    assert child.names == ("sensor_nonlinearity", "wind_speed_offset")


def test_a_fit_worse_than_without_the_effect_starts_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a lag the fit ends in wide deviations, beside which the lead remains invisible."""
    base = scattered(nominal_study(blown(lead=0.45), known_effects()).prepared.nominal, known_effects())
    assert base is not None
    lag = effect_class("unsteady_aero_lag")
    (good,) = starting_points(base, lag)
    bad = replace(good, point=Point(np.append(base.point.common, 0.4), base.point.per_run))
    fitted = try_fit(bad.problem, bad.point, base=base, max_iterations=12)
    assert fitted is not None
    assert with_likeliest_widths(fitted, rounds=1).unlikelihood > base.unlikelihood
    monkeypatch.setattr(one_more, "starting_points", lambda *_: [bad])
    (child,) = sets_with_one_more([Hypothesis((), base)], [lag])
    assert base.unlikelihood - child.fit.unlikelihood > 90.0
    assert abs(child.fit.value("unsteady_aero_lag.lag") + 0.45) < 3.0 * child.fit.std("unsteady_aero_lag.lag")


@pytest.mark.parametrize("stated", [0.4 * SCATTER, 2.0 * SCATTER])
def test_runs_that_differ_by_more_than_stated_are_not_noise(stated: float) -> None:
    """The stated deviations take up the mean square, though they are improbably large."""
    sensor = SensorProperties(RATE, noise_std=NOISE)
    campaign = replace(blown(), sensor=sensor, repeatability=Repeatability(wind_speed=stated))
    names = ("wind_speed_scatter", "stiffness_scatter", "damping_scatter", "sensor_drift")
    study = investigate(campaign, [effect_class(name) for name in names])
    beyond = stated < SCATTER
    assert study.gap.test.detected is beyond
    assert study.causes == ("wind_speed_scatter",) * beyond


def test_which_effects_only_the_comparison_of_runs_shows() -> None:
    """A speed that is off does to every run what a deviation does; the vortices' line is in each of them."""
    assert off()[1].shown_between_runs == 1
    assert not off()[1].shown.any()
    base, shed = beside_scatter(blown(shedding=0.05), "vortex_shedding")
    assert (base.shown_between_runs, shed.shown_between_runs) == (0, 0)
    of_effect = [name.startswith("vortex_shedding.") for name in shed.problem.names]
    assert any(of_effect)
    assert shed.shown.tolist() == of_effect
