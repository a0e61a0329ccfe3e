"""Every effect against its equation, solved by SciPy: far below the sensor's noise of 5e-4 rad.

Truth here: `tests/reference/effect_oracle.py`, which shares no code with the effects, or else the textbook's form
of the reference simulator, which shares none either.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from _pytest.mark import ParameterSet

from tests.reference import effect_oracle as oracle
from tests.reference.effect_cases import ON_DRIVEN_RUNS, VALUES, VOCABULARY, settings
from tests.reference.effect_oracle import (
    NOTHING,
    RANDOM,
    SOLVED,
    Setting,
    fitted_phase,
    pressure,
    reading,
    under_moment,
)
from tests.support.acting import acting
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.forms import forms_of
from tunnel_reference.readings import ReadingTerm
from tunnel_reference.readings import read_motion as read_reference
from tunnel_reference.severity import bind_effects, simulate_motions
from tunnel_reference.true_conditions import TrueConditions
from tunnel_sim.effects import BetweenRuns, Effect, EffectChain, effect_class, effect_from
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.effects.sensor import InputDelay
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.plan import SensorModel

RIG = load_rig()
QUIET = SensorModel(noise_std=0.0, resolution=0.0)
RUN = Setting(duration=2.0)

# Largest error allowed, rad. RK4 with steps of 1 ms leaves less than 1e-8 of a smooth motion of 2 Hz.
SMOOTH = 1e-7
# A kink or jump inside a step leaves (ω h)² A, some 1e-4, times the share of the law that jumps; 4 % of the noise.
KINKED = 2e-5
# Backlash is one: the slider turns at the extreme sample, up to ω² A h²/8 = 6e-6 short of the true extreme.
OTHERS = {
    # the rod rings at up to 0.5 rad per step, where RK4 turns its phase by 5e-4 of itself per radian
    "rod_flexibility": KINKED,
}


def tolerance_of(name: str) -> float:
    """What an effect may be off, rad, by what its class states of its law."""
    return OTHERS.get(name, KINKED if effect_class(name).jumps else SMOOTH)


VARIANTS: list[tuple[str, dict[str, float], Setting]] = [
    *(
        (name, values, RUN)
        for name, values in VALUES.items()
        if name in SOLVED - {*RANDOM, "sensor_quantisation"}
    ),
    ("coulomb_friction", {"friction_moment": 0.4}, RUN),  # comes to rest within the run
    ("coulomb_friction", {"friction_moment": 0.02}, replace(RUN, spring=67.98, speed=0.0, release=-0.2)),
    ("coulomb_friction", {"friction_moment": 0.03, "presliding": 0.005}, RUN),
    ("coulomb_friction", {"friction_moment": 0.5, "presliding": 1e-4}, RUN),  # needs steps below 1 ms
    ("coulomb_friction", {"friction_moment": 0.02, "exponent": 0.3}, RUN),
    ("coulomb_friction", {"friction_moment": 0.02, "saturation": 0.1}, RUN),
    ("coulomb_friction", {"friction_moment": 0.05, "saturation": 0.005}, RUN),  # needs steps below 1 ms
    ("coulomb_friction", {"friction_moment": 0.02, "peak": 1.0, "peak_rate": 0.3}, RUN),
    ("quadratic_damping", {"coefficient": -0.002}, RUN),
    ("cubic_stiffness", {"coefficient": -2.0}, replace(RUN, release=-0.3)),
    ("asymmetric_stiffness", {"coefficient": -0.5}, replace(RUN, release=-0.3)),
    ("free_play", {"half_width": 0.002}, replace(RUN, spring=44.84, speed=0.0)),
    ("gravity_stiffness", {"stiffness": -1.0, "rest_angle": -0.4}, RUN),
    ("rod_flexibility", {"compliance": 5e-4, "inertia_share": 0.1}, RUN),
    ("rod_flexibility", {"compliance": 5e-4, "inertia_share": 0.01}, RUN),  # needs steps below 1 ms
    ("rod_flexibility", {"compliance": 1e-5, "inertia_share": 0.1}, replace(RUN, spring=44.84)),
    ("nonlinear_yaw_moment", {"coefficient": -3.0}, RUN),
    ("wind_speed_drift", {"drift": -0.2}, RUN),
    ("nonlinear_yaw_damping", {"coefficient": -20.0}, RUN),
    ("unsteady_aero_lag", {"lag": 0.01}, RUN),  # a third of a step
    ("unsteady_aero_lag", {"lag": 15.0}, RUN),
    ("unsteady_aero_lag", {"lag": -1.5}, RUN),
    ("vortex_shedding", {"amplitude": 0.1, "strouhal_number": 0.15}, RUN),
    ("sensor_nonlinearity", {"coefficient": -0.2}, RUN),
    ("sensor_hysteresis", {"half_width": 0.01}, replace(RUN, release=-0.1)),
    ("sensor_drift", {"drift": -0.01}, RUN),
    ("spring_miscalibration", {"error": -0.1, "spring_stiffness": 16.12}, RUN),
    ("wind_speed_offset", {"offset": -1.5}, RUN),
    ("reynolds_dependence", {"per_e_fold": -0.3}, replace(RUN, speed=8.0)),
    ("stiffness_scatter", {"spread": 0.05}, replace(RUN, speed=0.0)),
    ("damping_scatter", {"spread": 0.1}, replace(RUN, speed=0.0)),
]
SHORT_STEPS = {"coulomb_friction-0.5", "rod_flexibility-0.0005", "rod_flexibility-1e-05"}  # take long
SIBLINGS = {  # of the other sign, which the same line of the law gives
    "quadratic_damping--0.002", "asymmetric_stiffness--0.5", "nonlinear_yaw_moment--3", "wind_speed_drift--0.2",
    "nonlinear_yaw_damping--20", "sensor_nonlinearity--0.2", "sensor_drift--0.01", "wind_speed_offset--1.5",
}  # fmt: skip


def _variant(name: str, values: dict[str, float], run: Setting) -> ParameterSet:
    case = f"{name}-{next(iter(values.values())):g}"
    return pytest.param(
        name, values, run, id=case, marks=[pytest.mark.slow] * (case in SHORT_STEPS | SIBLINGS)
    )


each_variant = pytest.mark.parametrize(("name", "values", "run"), [_variant(*one) for one in VARIANTS])


def simulated(effects: list[Effect], run: Setting, *, forward: bool = False, seed: int = 3) -> np.ndarray:
    """The reading by MuJoCo, or by the compiled forward integrator."""
    rng = np.random.default_rng(seed)
    chain = EffectChain.draw(settings(run), effects, rng)
    physics = chain.physics()
    if forward:
        motion = forward_motion(RIG, physics, run.sample_rate)
    else:
        motion = simulate_motion(build_model(RIG, physics), run.sample_rate)
    return read_motion(motion, QUIET, rng, chain).yaw_rad


def drawn_chain(effect: Effect, run: Setting) -> EffectChain:
    return EffectChain.draw(settings(run), [effect], np.random.default_rng(3))


@cache
def nominal_reading(run: Setting) -> np.ndarray:
    return reading("", NOTHING, run)


def drawn_by(name: str, effect: Effect, values: dict[str, float], found: np.ndarray, run: Setting) -> float:
    """What the run has drawn: the phase of shedding, from the run, and of hum, from the reading; a deviation."""
    if isinstance(effect, BetweenRuns):
        return effect.drawn_number(drawn_chain(effect, run).drawn[0])
    if name == "vortex_shedding":
        return drawn_chain(effect, run).physics().parameters["shedding_phase"]
    if name == "mains_hum":
        return fitted_phase(found - nominal_reading(run), values["frequency"], run)[1]
    return 0.0


def test_no_effect_matches_the_nominal_equation() -> None:
    assert np.max(np.abs(simulated([], RUN) - nominal_reading(RUN))) < SMOOTH


@each_variant
def test_effect_matches_its_equation(name: str, values: dict[str, float], run: Setting) -> None:
    effect, tolerance = effect_from(name, values), tolerance_of(name)
    solved = cache(lambda own: reading(name, values, run, own=own))  # takes longer than both simulations
    for forward in (False, True):
        found = simulated([effect], run, forward=forward)
        expected = solved(drawn_by(name, effect, values, found, run))
        assert np.max(np.abs(found - expected)) < tolerance
    # what both sides leave out would pass: the effect must be seen
    assert np.max(np.abs(expected - nominal_reading(run))) > max(2e-4, 20.0 * tolerance)


# with one that jumps, so that the tolerance of such laws is tried
REFERRED = [name for name in VOCABULARY if name not in SOLVED | ON_DRIVEN_RUNS or name == "coulomb_friction"]
# rad, or share of the run: halfway between two samples
OWN = 1.4995 / RUN.duration


@cache
def by_the_reference_simulator() -> dict[str, np.ndarray]:
    """The textbook's forms: their severity parameters are the effects', and so are the names of the others."""
    run = RUN
    conditions = TrueConditions(
        np.array([run.spring]), np.array([run.speed]), np.array([run.release]), np.array([run.release]),
        oracle.DENSITY, run.duration, oracle.INERTIA, oracle.DAMPING, oracle.CN_BETA, oracle.CN_R,
        noise_std=0.0, resolution=1e-12,
    )  # fmt: skip
    draws = []
    for name in REFERRED:
        extra = {**VALUES[name], "own": OWN, "duration": run.duration}
        effect = EffectDraw(forms_of(name)[0], extra, 1, 1.0, next(iter(VALUES[name].values())))
        draws.append(CampaignDraw("single", conditions, (effect,), 0))
    readings = {}
    for name, draw, motion in zip(REFERRED, draws, simulate_motions(draws), strict=True):
        bound, terms = bind_effects(draw)
        laws = [term for term in terms if isinstance(term, ReadingTerm)]
        found = read_reference(bound, motion, laws, np.random.default_rng(0))
        readings[name] = np.asarray(found[: conditions.samples, 0])
    return readings


@pytest.mark.parametrize("name", REFERRED)
def test_effect_matches_the_reference_simulator(name: str) -> None:
    effect, tolerance = effect_from(name, VALUES[name]), tolerance_of(name)
    chain = EffectChain(settings(RUN), (effect,), (OWN,))
    expected = by_the_reference_simulator()[name]
    for motion in (
        forward_motion(RIG, chain.physics(), RUN.sample_rate),
        simulate_motion(build_model(RIG, chain.physics()), RUN.sample_rate),
    ):
        found = read_motion(motion, QUIET, np.random.default_rng(3), chain).yaw_rad
        assert np.max(np.abs(found - expected)) < tolerance
    assert np.max(np.abs(expected - nominal_reading(RUN))) > max(2e-4, 20.0 * tolerance)


def test_a_law_that_jumps_needs_the_tolerance_that_its_class_states() -> None:
    """Otherwise the trait would be stated without need, and would hide an error."""
    name = "coulomb_friction"
    physics = EffectChain(settings(RUN), (effect_from(name, VALUES[name]),), (OWN,)).physics()
    found = simulate_motion(build_model(RIG, physics), RUN.sample_rate).angle
    error = found - by_the_reference_simulator()[name]
    assert SMOOTH < np.max(np.abs(error)) < tolerance_of(name) == KINKED


def test_every_effect_is_compared() -> None:
    compared = {name for name, _, _ in VARIANTS} | {*RANDOM, "sensor_quantisation"}
    assert compared == SOLVED
    # those of actuators in tests/unit/tunnel_sim/physics/test_actuator.py
    assert compared | set(REFERRED) | ON_DRIVEN_RUNS == set(VOCABULARY)


@pytest.mark.parametrize("held", [False, True], ids=["linear", "zero"])
@pytest.mark.parametrize("delay", [0.02, 0.0137, 0.0004, -0.0137])
def test_a_delayed_input_matches_the_equation_between_its_kinks(delay: float, held: bool) -> None:
    run, time = replace(RUN, duration=1.5), np.arange(150) / 100.0
    values = np.random.default_rng(5).standard_normal(time.size)  # a kink or jump at every sample
    driven = replace(settings(run), drive=InputMoment(time, values, held=held))
    found = []
    for late in (delay, 0.0):
        chain = EffectChain(driven, (InputDelay(late),), (None,))
        found.append(forward_motion(RIG, chain.physics(), run.sample_rate).angle)
        expected = oracle.driven_reading(time, values, late, run, held=held)
        assert np.max(np.abs(found[-1] - expected)) < SMOOTH
    assert np.max(np.abs(found[0] - found[1])) > 2e-4


def test_a_motion_is_continuous_in_the_delay_of_its_input() -> None:
    time = np.arange(150) / 100.0
    values = np.random.default_rng(6).standard_normal(time.size)
    driven = replace(settings(replace(RUN, duration=1.5)), drive=InputMoment(time, values, held=True))

    def moved(delay: float) -> np.ndarray:
        chain = EffectChain(driven, (InputDelay(delay),), (None,))
        return forward_motion(RIG, chain.physics(), RUN.sample_rate).angle

    # around one sample, where every jump passes from one step of the integrator to the next
    steps = np.diff([moved(0.01 + shift) for shift in np.arange(-4, 5) * 1e-6], axis=0)
    assert np.max(np.abs(np.diff(steps, axis=0))) < 1e-3 * np.max(np.abs(steps))


def test_a_coarse_reading_is_the_rounded_angle() -> None:
    values = VALUES["sensor_quantisation"]
    found = simulated([effect_from("sensor_quantisation", values)], RUN)
    exact = nominal_reading(RUN)
    place = exact / values["step"]
    clear = np.abs(place - np.floor(place) - 0.5) * values["step"] > SMOOTH  # not on the edge of two steps
    assert np.mean(clear) > 0.99
    assert np.max(np.abs(found - reading("sensor_quantisation", values, RUN))[clear]) < 1e-12
    assert np.max(np.abs(found - exact)) <= 0.5 * values["step"] + SMOOTH


def test_a_resolution_finer_than_stated_changes_nothing() -> None:
    effect = effect_from("sensor_quantisation", {"step": 0.001})
    assert effect.on_sensor(SensorModel(resolution=0.002)) == SensorModel(resolution=0.002)
    assert effect.on_sensor(SensorModel(resolution=0.0)).resolution == 0.001


@pytest.mark.parametrize(
    ("name", "speed"), [("buffeting", 20.0), ("ambient_vibration", 20.0), ("ambient_vibration", 0.0)]
)
def test_a_random_moment_moves_the_rig_as_the_linear_rig_under_the_same_moment(
    name: str, speed: float
) -> None:
    effect, run = effect_from(name, VALUES[name]), replace(RUN, speed=speed)
    ((source, series),) = drawn_chain(effect, run).physics().series.items()
    of_one = pressure(speed) if source == "forcing" else 1.0  # a moment coefficient, or a moment in N m
    expected = under_moment(of_one * np.array(series.values), series.interval, run)
    for forward in (False, True):
        assert np.max(np.abs(simulated([effect], run, forward=forward) - expected)) < SMOOTH
    assert np.max(np.abs(expected - nominal_reading(run))) > 1e-3


def test_a_random_moment_of_the_surroundings_does_not_depend_on_the_wind() -> None:
    effect = effect_from("ambient_vibration", VALUES["ambient_vibration"])
    still, blown, faster = (
        drawn_chain(effect, replace(RUN, speed=speed)).physics().series["ambient"]
        for speed in (0.0, 15.0, 25.0)
    )
    assert still == blown == faster
    assert (
        not drawn_chain(effect_from("buffeting", VALUES["buffeting"]), replace(RUN, speed=0.0))
        .physics()
        .series
    )


def test_both_random_moments_act_at_once() -> None:
    effects = [effect_from(name, VALUES[name]) for name in RANDOM]
    series = EffectChain.draw(settings(RUN), effects, np.random.default_rng(3)).physics().series
    both = pressure(RUN.speed) * np.array(series["forcing"].values) + np.array(series["ambient"].values)
    expected = under_moment(both, series["ambient"].interval, RUN)
    for forward in (False, True):
        assert np.max(np.abs(simulated(effects, RUN, forward=forward) - expected)) < SMOOTH


def random_moment(intensity: float, bandwidth: float, duration: float, seed: int) -> np.ndarray:
    effect = effect_from("buffeting", {"intensity": intensity, "bandwidth": bandwidth})
    run = replace(settings(RUN), duration=duration)
    drawn = effect.draw(run, np.random.default_rng(seed))
    (series,) = acting(effect, run, drawn).series.values()
    assert series.interval == 1e-3
    return np.array(series.values)


def test_buffeting_has_its_spread_and_spectrum() -> None:
    intensity, bandwidth, interval = 0.02, 8.0, 1e-3
    moment = random_moment(intensity, bandwidth, 200.0, seed=1)
    frequency = np.fft.rfftfreq(moment.size, interval)
    found = interval / moment.size * np.abs(np.fft.rfft(moment)) ** 2  # two-sided
    decay = np.exp(-2.0 * np.pi * bandwidth * interval)  # of the sampled process with R = s² exp(−2π fb |τ|)
    turn = np.exp(-2j * np.pi * frequency * interval)
    expected = intensity**2 * interval * (1.0 - decay**2) / np.abs(1.0 - decay * turn) ** 2
    edges = [0.02, 1.0, 3.0, 8.0, 20.0, 60.0, 200.0, 499.0]
    for low, high in pairwise(edges):
        band = (frequency >= low) & (frequency < high)
        ratio = np.mean(found[band] / expected[band])  # mean of exponential variates
        assert abs(ratio - 1.0) < 5.0 / np.sqrt(np.count_nonzero(band))
    # variance of the mean square of a correlated series: 2 Σ R²/N
    spread = np.sqrt(2.0 * (1.0 + decay**2) / (1.0 - decay**2) / moment.size)
    assert abs(np.mean(moment**2) / intensity**2 - 1.0) < 5.0 * spread


def test_buffeting_is_steady_from_the_first_sample_on() -> None:
    first = np.array([random_moment(1.0, 2.0, 0.01, seed)[0] for seed in range(400)])
    assert abs(np.mean(first**2) - 1.0) < 5.0 * np.sqrt(2.0 / first.size)
    assert abs(np.mean(first)) < 5.0 / np.sqrt(first.size)


def test_an_offset_shifts_a_drifting_wind_in_either_order() -> None:
    drift, offset = (
        effect_from("wind_speed_drift", {"drift": 0.1}),
        effect_from("wind_speed_offset", {"offset": 1.0}),
    )
    after = simulated([drift, offset], RUN)
    expected = reading(
        "wind_speed_drift", {"drift": 0.1 * RUN.speed / (RUN.speed + 1.0)}, replace(RUN, speed=21.0)
    )
    assert np.max(np.abs(after - expected)) < SMOOTH
    before = simulated([offset, drift], RUN)
    ahead = reading("wind_speed_drift", {"drift": 0.1}, replace(RUN, speed=21.0))
    assert np.max(np.abs(before - ahead)) < SMOOTH


def test_a_drifting_wind_scatters_throughout_the_run() -> None:
    effects = [
        effect_from("wind_speed_drift", {"drift": 0.1}),
        effect_from("wind_speed_scatter", {"spread": 0.05}),
    ]
    chain = EffectChain.draw(settings(RUN), effects, np.random.default_rng(3))
    factor = 1.0 + 0.05 * effects[1].drawn_number(chain.drawn[1])
    expected = reading("wind_speed_drift", {"drift": 0.1}, replace(RUN, speed=RUN.speed * factor))
    assert np.max(np.abs(simulated(effects, RUN) - expected)) < SMOOTH
    assert abs(factor - 1.0) > 1e-3


@pytest.mark.parametrize("name", oracle.BETWEEN_RUNS)
def test_a_number_of_the_run_scatters_normally_with_its_width(name: str) -> None:
    """Truth: mean, variance and kurtosis of normal deviates, within five standard errors of each."""
    effect, run, count = effect_from(name, {"spread": 0.01}), settings(RUN), 4000
    number = effect.scatters
    chains = (EffectChain.draw(run, [effect], np.random.default_rng([5, i])) for i in range(count))
    found = (
        np.array([getattr(chain.physics(), number) / getattr(run, number) - 1.0 for chain in chains]) / 0.01
    )
    assert abs(np.mean(found)) < 5.0 / np.sqrt(count)
    assert abs(np.mean(found**2) - 1.0) < 5.0 * np.sqrt(2.0 / count)
    assert abs(np.mean(found**4) - 3.0) < 5.0 * np.sqrt(96.0 / count)


def test_mains_hum_has_a_phase_of_its_own_in_every_run() -> None:
    effect = effect_from("mains_hum", {"amplitude": 0.002})
    found = [
        fitted_phase(simulated([effect], RUN, seed=seed) - nominal_reading(RUN), 50.0, RUN) for seed in (3, 4)
    ]
    assert [amplitude for amplitude, _ in found] == pytest.approx([0.002, 0.002], abs=SMOOTH)
    assert abs(found[0][1] - found[1][1]) > 1e-3
