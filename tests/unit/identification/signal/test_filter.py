"""The filter of a driven decay: against the Riccati equation, and output error as its limit."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from identification import Estimate, Status, identify
from identification.signal.decay_fit import Reading, projected_cost
from identification.signal.filter import Driven, fit_driven, innovations
from identification.signal.free_decay import Decay, free_decay
from tests.reference.free_decays import TWELVE, Setting, campaign, with_records

pytestmark = pytest.mark.usefixtures("unexamined")

DECAY, INTERVAL, VARIANCE = Decay.from_modal(12.5, 0.015), 0.02, 1e-8


def kalman_innovations(yaw, model, start):
    """Plain predictions with the gain of the Riccati equation, one sample after the other."""
    corner = model.corner
    if corner is None:
        dynamics = np.array([[0.0, 1.0], [-model.decay.stiffness, -2.0 * model.decay.rate]])
        gain_in, size = np.array([[0.0], [1.0]]), 2
    else:
        c = 2.0 * np.pi * corner
        dynamics = np.array(
            [[0.0, 1.0, 0.0], [-model.decay.stiffness, -2.0 * model.decay.rate, 1.0], [0.0, 0.0, -c]]
        )
        gain_in, size = np.array([[0.0], [0.0], [c]]), 3
    transition, fine = expm(dynamics * INTERVAL), np.linspace(0.0, INTERVAL, 2001)
    steps = np.array([expm(dynamics * t) @ gain_in for t in fine])[:, :, 0]
    disturbance = model.intensity * np.trapezoid(steps[:, :, None] * steps[:, None, :], fine, axis=0)
    observe = np.eye(size)[:1]
    spread = solve_discrete_are(transition.T, observe.T, disturbance, np.array([[VARIANCE]]))
    variance = float(spread[0, 0]) + VARIANCE
    gain = (transition @ spread @ observe.T / variance)[:, 0]
    state, left = start, []
    for value in yaw:
        left.append(value - state[0])
        state = transition @ state + gain * left[-1]
    return np.array(left), variance


@pytest.mark.parametrize("corner", [None, 2.0])
def test_innovations_are_the_kalman_filters_own(corner):
    rng = np.random.default_rng(1)
    model = Driven(DECAY, 8.5e-4, corner)
    yaw = free_decay(INTERVAL * np.arange(300), DECAY, 0.3, 0.0) + 1e-3 * rng.standard_normal(300)
    found = innovations(yaw, INTERVAL, model, VARIANCE)
    size = 2 if corner is None else 3
    plain, variance = kalman_innovations(yaw, model, np.zeros(size))
    assert found.variance == pytest.approx(variance, rel=1e-6)
    # The least squares over start and zero leave what no start and no zero can explain of the plain ones.
    columns = [kalman_innovations(0.0 * yaw, model, -start)[0] for start in np.eye(size)]
    columns.append(kalman_innovations(np.ones_like(yaw), model, np.zeros(size))[0])
    basis = np.array(columns).T
    rest = plain - basis @ np.linalg.lstsq(basis, plain, rcond=None)[0]
    np.testing.assert_allclose(found.values, rest, atol=1e-6 * np.abs(rest).max())


def test_a_moment_is_half_as_strong_at_its_corner_as_at_low_frequency():
    assert Driven(DECAY, 8e-4).intensity_at_resonance == 8e-4
    at_corner = Driven(DECAY, 8e-4, DECAY.omega_n / (2.0 * np.pi))
    assert at_corner.intensity_at_resonance == pytest.approx(4e-4)


def test_a_driven_fit_is_at_the_maximum_of_its_likelihood():
    rng = np.random.default_rng(8)
    clock = INTERVAL * np.arange(600)
    kicks = np.sqrt(1e-3 * INTERVAL) * rng.standard_normal(600)
    shaken = np.convolve(kicks, free_decay(clock, DECAY, 0.0, 1.0))[:600]
    yaw = free_decay(clock, DECAY, 0.3, 0.0) + shaken + 1e-4 * rng.standard_normal(600)
    start = Decay(1.2 * DECAY.rate, 1.01 * DECAY.stiffness)
    found = fit_driven(yaw, INTERVAL, start, np.array([0.005, 0.1]), VARIANCE)
    stds, best = np.sqrt(np.diag(found.covariance)), found.model
    assert abs(np.log(best.intensity / 1e-3)) < 4.0 * stds[2]
    for away in 0.3 * np.vstack((np.diag(stds), -np.diag(stds))):
        decay = Decay(best.decay.rate + away[0], best.decay.stiffness + away[1])
        moved = Driven(decay, best.intensity * np.exp(away[2]))
        assert innovations(yaw, INTERVAL, moved, VARIANCE).cost > found.innovations.cost


def test_without_a_moment_innovations_are_output_errors_residual():
    rng = np.random.default_rng(2)
    clock = INTERVAL * np.arange(400)
    yaw = 0.01 + free_decay(clock, DECAY, 0.3, -0.2) + 1e-3 * rng.standard_normal(400)
    found = innovations(yaw, INTERVAL, Driven(DECAY, 0.0), VARIANCE)
    assert float(found.values @ found.values) == pytest.approx(
        projected_cost(Reading(clock, yaw), DECAY), rel=1e-9
    )
    assert found.variance == VARIANCE


def test_a_tiny_moment_changes_nothing_much():
    yaw = free_decay(INTERVAL * np.arange(400), DECAY, 0.3, 0.0)
    yaw = yaw + 1e-4 * np.random.default_rng(3).standard_normal(400)
    none = innovations(yaw, INTERVAL, Driven(DECAY, 0.0), VARIANCE)
    tiny = innovations(yaw, INTERVAL, Driven(DECAY, 1e-14), VARIANCE)
    assert tiny.cost == pytest.approx(none.cost, abs=0.05)


def test_filter_error_is_output_error_where_nothing_drives_the_rig():
    data = campaign(TWELVE[:6], noise=5e-4, rng=np.random.default_rng(6))
    ours, theirs = identify(data, "filter_error"), identify(data, "output_error")
    undriven = [run for run in ours.runs if run.process_noise is None]
    assert len(undriven) >= 4  # one in six shows a moment by chance, at a likelihood gain of one
    for run in undriven:
        other = next(o for o in theirs.runs if o.id == run.id)
        assert (run.omega_n, run.zeta) == (other.omega_n, other.zeta)
    for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping"):
        one, other = getattr(ours, name), getattr(theirs, name)
        assert abs(one.value - other.value) < 0.3 * other.std
        assert one.std == pytest.approx(other.std, rel=0.1)


def shaken(clock, yaw, rng):
    """A moment that is white, of q = 1e-3 rad²/s³: each step of 1 ms kicks the rate by √(q · 1 ms)."""
    kicks = 1e-3 * rng.standard_normal(clock.size)
    path = np.convolve(kicks, np.exp(-0.15 * clock) * np.sin(12.5 * clock) / 12.5)[: clock.size]
    return yaw + path


def test_a_random_moment_is_seen_and_written_down():
    rng = np.random.default_rng(7)
    plain = campaign((Setting(16.12, 0.0), Setting(15.5, 0.0)), noise=5e-4, rng=rng)
    data = with_records(plain, lambda clock, yaw: shaken(clock, yaw, rng))
    estimate = identify(data, "filter_error")
    for run in estimate.runs:
        assert run.process_noise.value == pytest.approx(1e-3, rel=0.6)
        assert run.process_noise.unit == "rad2/s3"
        assert (run.noise.departs, run.noise.slow_ratio) == (False, 1.0)
    assert Estimate.from_json_dict(estimate.to_json_dict()) == estimate


def test_innovations_that_are_not_white_widen_what_the_filter_finds():
    """A steady vibration of four times the noise beside the random moment: no white moment explains both."""
    rng = np.random.default_rng(7)
    plain = campaign((Setting(16.12, 0.0),), noise=5e-4, rng=rng)
    data = with_records(
        plain, lambda clock, yaw: shaken(clock, yaw, rng) + 2e-3 * np.sin(16.0 * np.pi * clock)
    )
    (run,) = identify(data, "filter_error").runs
    assert run.process_noise is not None
    assert Status.MODEL_DEPARTS in run.statuses
    assert run.noise.slow_ratio > 1.0
