"""Every run-by-run claim over the rig's range: RMSE against the bound, intervals against their stated coverage.

Records are closed forms with white noise over ζ 0.002–0.05, 0.8–4 Hz and S/A 0.1–1 %, 20 s at 1 kHz. Buffeted
runs are driven by the effect's moment or by the reference simulator's spectra, and integrated by SciPy with
the moment linear between samples: neither the filter's model nor its discretisation.
"""

import itertools
from functools import cache

import numpy as np
import pytest
from scipy.signal import StateSpace, lfilter
from scipy.stats import binom, chi2

from identification.estimators import make_estimator
from identification.estimators.output_error import OutputError
from identification.signal.run_fit import NO_WINDOWS
from identification.uncertainty.cramer_rao import damped_sinusoid_bound
from tests.support.acting import acting
from tunnel_reference.moments import turbulence
from tunnel_reference.true_conditions import TrueConditions
from tunnel_sim.effects.random_moments import Buffeting
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.slow

AMPLITUDE, RATE, DURATION = 0.35, 1000.0, 20.0
CELLS = tuple(itertools.product((0.002, 0.01, 0.05), (0.8, 2.0, 4.0)))
SHARES = (0.001, 0.003, 0.01)
PER_CELL = 30
FALSE_ALARM = 1e-3
EFFICIENT = ("output_error", "filter_error", "matrix_pencil")
HONEST = (*EFFICIENT, "hilbert", "log_decrement", "bayesian")


def estimator(name):
    return OutputError(cycles_per_window=NO_WINDOWS) if name == "output_error" else make_estimator(name)


def single(clock, yaw, noise, *, wind=0.0, rate=RATE):
    run = Run("r", Record(clock, yaw), wind, None, 1.2)
    return Campaign("one", RigProperties(), SensorProperties(rate, None, noise), (run,))


@cache
def trials(name):
    """Errors of (ζ, ωn) over the bound and claimed deviations over the bound, shape (records, 2) each."""
    rng, method = np.random.default_rng(20), estimator(name)
    clock = np.arange(round(RATE * DURATION)) / RATE
    errors, deviations = [], []
    for (zeta, frequency), number in itertools.product(CELLS, range(PER_CELL)):
        share, phase = SHARES[number % 3], rng.uniform(0.0, 2.0 * np.pi)
        omega = 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2)
        yaw = AMPLITUDE * np.exp(-zeta * omega * clock) * np.cos(2.0 * np.pi * frequency * clock + phase)
        yaw = yaw + 0.004 + share * AMPLITUDE * rng.standard_normal(clock.size)
        run = method.estimate(single(clock, yaw, share * AMPLITUDE)).runs[0]
        bound = damped_sinusoid_bound(
            clock,
            amplitude=AMPLITUDE,
            phase=phase,
            frequency=frequency,
            zeta=zeta,
            noise_std=share * AMPLITUDE,
        )
        errors.append([(run.zeta.value - zeta) / bound.zeta, (run.omega_n.value - omega) / bound.omega_n])
        deviations.append([run.zeta.std / bound.zeta, run.omega_n.std / bound.omega_n])
    return np.array(errors), np.array(deviations)


def coverage_objections(errors, deviations):
    """What is wrong with 95 % intervals, at the false-alarm rate; nothing, if nothing is."""
    held = np.abs(errors) <= 1.959964 * deviations
    count = held.shape[0]
    tail = FALSE_ALARM / (2 * held.shape[1])
    low, high = binom.ppf(tail, count, 0.95) / count, binom.isf(tail, count, 0.95) / count
    shares = held.mean(axis=0)
    return [
        f"{name}: intervals cover {100 * s:.1f} %"
        for name, s in zip("ζω", shares, strict=True)
        if not low <= s <= high
    ]


def report(record_property, name, errors, deviations):
    rms = np.sqrt(np.mean(errors**2, axis=0))
    held = np.mean(np.abs(errors) <= 1.959964 * deviations, axis=0)
    text = (
        f"{name}, {errors.shape[0]} records: RMSE/bound ζ {rms[0]:.3f} ωn {rms[1]:.3f}; "
        f"95 % intervals cover ζ {100 * held[0]:.1f} % ωn {100 * held[1]:.1f} %"
    )
    print(text)
    record_property("summary", text)
    return rms


@pytest.mark.parametrize("name", EFFICIENT)
def test_efficient_estimators_stay_within_a_tenth_of_the_bound(name, record_property):
    errors, deviations = trials(name)
    rms = report(record_property, name, errors, deviations)
    best = np.sqrt(np.mean(trials("output_error")[0] ** 2, axis=0))
    count = errors.shape[0]
    # The bound's companion on the same records takes the chance of the draw out of the comparison.
    assert np.all(best < np.sqrt(chi2.isf(FALSE_ALARM / 2, count) / count))
    assert np.all(rms / best < 1.1)


@pytest.mark.parametrize("name", HONEST)
def test_intervals_hold_over_the_range(name, record_property):
    errors, deviations = trials(name)
    report(record_property, name, errors, deviations)
    assert coverage_objections(errors, deviations) == []


def test_planted_overconfidence_is_caught():
    errors, deviations = trials("output_error")
    assert len(coverage_objections(errors, 0.75 * deviations)) == 2


def response(moment, omega, zeta):
    """Angle under a moment per inertia that is linear between samples at 1 kHz, from rest."""
    system = StateSpace(
        [[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]
    )
    held = system.to_discrete(1.0 / RATE, method="foh").to_tf()
    return lfilter(held.num.ravel(), held.den, moment)


def random_moment(kind, seed):
    """Moment per inertia of standard deviation 0.25 rad/s² at 1 kHz."""
    count = round(RATE * DURATION)
    if kind == "effect":
        settings = RunSettings(
            16.12, AeroDerivatives(0.35, -0.7), 0.1014, 0.018, wind_speed=20.0, air_density=1.204,
            release_angle=AMPLITUDE, duration=DURATION,
        )  # fmt: skip
        effect = Buffeting(intensity=0.003, bandwidth=20.0)
        moved = acting(effect, settings, effect.draw(settings, np.random.default_rng(seed)))
        return 0.25 / 0.003 * np.array(moved.series["forcing"].values)[:count]
    one = np.ones(1)
    conditions = TrueConditions(
        16.12 * one,
        20.0 * one,
        AMPLITUDE * one,
        AMPLITUDE * one,
        1.204,
        DURATION,
        0.1014,
        0.018,
        0.35,
        -0.7,
        5e-4,
    )
    scale = {"band": 15.0, "dryden": 0.4, "von_karman": 0.6}[kind]
    return 0.25 * turbulence(kind, conditions, seed=seed, scale=scale)[0][:count]


@cache
def buffeted(name, kind, seeds=150):
    method = estimator(name)
    clock = np.arange(round(RATE * DURATION)) / RATE
    errors, deviations = [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        zeta, frequency = rng.choice([0.01, 0.02, 0.03]), rng.uniform(1.5, 3.5)
        omega = 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2)
        yaw = AMPLITUDE * np.exp(-zeta * omega * clock) * np.cos(2.0 * np.pi * frequency * clock)
        yaw = (
            yaw
            + response(random_moment(kind, 10_000 + seed), omega, zeta)
            + 5e-4 * rng.standard_normal(clock.size)
        )
        run = method.estimate(single(clock, yaw, 5e-4, wind=20.0)).runs[0]
        errors.append([run.zeta.value - zeta, run.omega_n.value - omega])
        deviations.append([run.zeta.std, run.omega_n.std])
    return np.array(errors), np.array(deviations)


KINDS = ("effect", "band", "dryden", "von_karman")


def test_filter_errors_intervals_hold_in_buffeted_runs(record_property):
    parts = [buffeted("filter_error", kind) for kind in KINDS]
    for kind, part in zip(KINDS, parts, strict=True):
        held = np.mean(np.abs(part[0]) <= 1.959964 * part[1], axis=0)
        print(f"{kind}: cover ζ {100 * held[0]:.1f} % ωn {100 * held[1]:.1f} %")
    errors, deviations = (np.concatenate(column) for column in zip(*parts, strict=True))
    report(record_property, "filter_error, buffeted (errors not over the bound)", errors, deviations)
    assert coverage_objections(errors, deviations) == []


def test_filter_error_is_nearer_than_output_error_in_buffeted_runs(record_property):
    ours, theirs = (buffeted(name, "effect")[0] for name in ("filter_error", "output_error"))
    ratio = np.sqrt(np.mean(ours**2, axis=0) / np.mean(theirs**2, axis=0))
    record_property("summary", f"RMSE of filter error over output error, buffeted: {ratio}")
    print(ratio)
    assert np.all(ratio < 0.95)
    # Output error says itself that its model departs; its intervals are no 95 % ones there.
    assert len(coverage_objections(*buffeted("output_error", "effect"))) == 2


SHORT = ((1.0, 25.0, 0.02), (1.0, 16.0, 0.05), (1.5, 12.0, 0.1))  # cycles, samples per 2 cycles, S/A


@cache
def short_records(name, seeds=250):
    method, held = estimator(name), []
    for cycles, rate, share in SHORT:
        clock = np.arange(round(cycles / 2.0 * rate)) / rate
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            omega = 4.0 * np.pi / np.sqrt(1.0 - 0.05**2)
            yaw = np.exp(-0.05 * omega * clock) * np.cos(4.0 * np.pi * clock + rng.uniform(0.0, 2.0 * np.pi))
            run = method.estimate(
                single(clock, yaw + share * rng.standard_normal(clock.size), None, rate=rate)
            ).runs[0]
            if run.zeta is not None:
                held.append([_holds(run.zeta, 0.05), _holds(run.omega_n, omega)])
    return np.array(held)


def _holds(quantity, truth):
    ends = quantity.interval or (quantity.value - 1.96 * quantity.std, quantity.value + 1.96 * quantity.std)
    return ends[0] <= truth <= ends[1]


def test_bayesian_intervals_survive_short_records(record_property):
    ours, theirs = short_records("bayesian"), short_records("output_error")
    text = (
        f"one to one and a half cycles, 8 to 12 samples: 95 % intervals of ζ, ωn cover {ours.mean(axis=0)} by "
        f"bayesian ({len(ours)} records given), {theirs.mean(axis=0)} by output_error ({len(theirs)})"
    )
    print(text)
    record_property("summary", text)
    count = len(ours)
    assert count > 0.9 * 250 * len(SHORT)
    assert np.all(ours.mean(axis=0) >= max(0.92, binom.ppf(FALSE_ALARM, count, 0.95) / count - 0.01))
    assert np.all(theirs.mean(axis=0) < ours.mean(axis=0) - 0.02)
