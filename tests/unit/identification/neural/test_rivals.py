"""Windows and rivals against closed forms: the nominal fit, a known effect, and what must not matter."""

import numpy as np
import pytest

from identification.campaign.derivatives import build_design
from identification.neural.demodulated import Demodulated, RivalWindows, demodulate
from identification.neural.posterior import distribution, quantiles
from identification.neural.rivals import (
    OWN,
    RivalConditions,
    best_step,
    campaign_columns,
    fit_rivals,
    forward_selection,
    record_features,
)
from identification.signal.free_decay import Decay, free_decay
from identification.status import Status
from identification.uncertainty.cramer_rao import damped_sinusoid_bound
from tests.reference.free_decays import AREA, DENSITY, LENGTH, Setting, campaign
from tunnel_sim.vocabulary.record import Record

ZETA, OMEGA, NOISE = 0.01, 12.0, 1e-3
TIME = np.arange(10_000) / 1000.0


def record(rng=None, *, noise=NOISE, change=None, time=TIME):
    yaw = free_decay(time, Decay.from_modal(OMEGA, ZETA), 0.3, 0.2) if change is None else change(time)
    return Record(time, yaw + 0.02 + (0.0 if rng is None else noise * rng.standard_normal(time.size)))


def features(one):
    found = record_features([demodulate(one)])[0]
    assert found is not None
    return found


def test_a_decay_without_noise_is_found_exactly():
    found, _ = features(record())
    assert found.values == pytest.approx([ZETA, OMEGA], rel=1e-6)


def test_windows_near_the_noise_depart_by_as_much_as_their_information_says():
    found = demodulate(record(np.random.default_rng(0), noise=0.1, time=np.arange(30_000) / 1000.0))
    assert isinstance(found, Demodulated)
    faint = found.information < 50.0
    assert faint.sum() == 12
    for departure in (found.logarithm, found.phase):
        # χ² of 12 values: outside this range once in ten thousand
        assert 1.2 < np.sum(departure[faint] ** 2 * found.information[faint]) < 41.0


def test_the_nominal_fit_is_at_the_bound():
    rng = np.random.default_rng(1)
    bound = damped_sinusoid_bound(
        TIME,
        amplitude=float(np.hypot(0.3, (0.2 + ZETA * OMEGA * 0.3) / OMEGA)),
        phase=0.0,
        frequency=OMEGA / (2.0 * np.pi),
        zeta=ZETA,
        noise_std=NOISE,
    )
    away, stds = [], []
    for _ in range(60):
        found, _ = features(record(rng))
        stds.append(found.stds)
        away.append((found.values - [ZETA, OMEGA]) / found.stds)
    # Nineteen windows of a record of 19.1 cycles, and the noise is not stated.
    assert np.mean(stds, axis=0) == pytest.approx([bound.zeta, bound.omega_n], rel=0.08)
    # 60 records know the root mean square to 9 %; four of their deviations.
    assert np.sqrt(np.mean(np.square(away), axis=0)) == pytest.approx([1.0, 1.0], abs=0.37)


def test_scale_and_time_do_not_matter():
    one, _ = features(record(np.random.default_rng(2)))
    plain = record(np.random.default_rng(2))
    slower = Record(plain.time_s * 7.0 + 3.0, plain.yaw_rad * 0.1)
    other, _ = features(slower)
    assert other.values == pytest.approx([one.values[0], one.values[1] / 7.0], rel=1e-9)
    assert other.rivals == pytest.approx(one.rivals, abs=1e-5)
    assert other.runs == pytest.approx(one.runs, abs=1e-5)


def test_a_gap_costs_no_accuracy():
    kept = (TIME < 3.0) | (TIME > 3.4)
    found, _ = features(record(np.random.default_rng(3), time=TIME[kept]))
    assert np.all(np.abs(found.values - [ZETA, OMEGA]) < 5.0 * found.stds)


def test_a_softening_spring_is_found_by_its_own_column():
    amplitude = 0.3 * np.exp(-ZETA * OMEGA * TIME)

    def softening(time):  # the phase falls behind by the integral of the amplitude's square
        lost = 0.05 * np.concatenate(([0.0], np.cumsum(amplitude[:-1] ** 2 * np.diff(time))))
        return amplitude * np.cos(OMEGA * np.sqrt(1.0 - ZETA**2) * time - lost)

    found, _ = features(record(np.random.default_rng(4), change=softening))
    nominal = (found.values[1] - OMEGA) / found.stds[1]
    square = 1 + 6 + 4  # nominal, six powers of damping, the fifth power of stiffness
    assert abs(nominal) > 40.0
    width = float(np.sqrt(found.covariances[square, 1, 1]))
    assert abs(nominal + found.shifts[square, 1]) < 4.0 * width < 0.5 * abs(nominal)


def test_a_reading_with_a_square_shows_in_the_second_harmonic_and_not_in_the_third():
    plain = record(np.random.default_rng(10))
    squared = Record(plain.time_s, plain.yaw_rad + 0.05 * plain.yaw_rad**2)
    before, after = (features(one)[0].runs[0][-OWN:][3:9].reshape(2, 3) for one in (plain, squared))
    assert np.all(after[0] > before[0] + 0.5)
    assert np.all(after[1] < before[1] + 0.5)
    assert before[:, 2] == pytest.approx(0.0, abs=0.9)  # the power of white noise is one
    assert np.all(np.abs(before[:, :2]) < np.arcsinh(5.0))  # and of variance one are its projections
    # 0.05 A² cos²: the second harmonic is 0.025 A of the amplitude, in its phase.
    seen = demodulate(squared)
    pattern = np.sqrt(seen.information) * seen.amplitude / seen.amplitude[0]
    expected = 0.025 * seen.amplitude[0] * np.sqrt(pattern @ pattern)
    assert np.sinh(after[0][0]) == pytest.approx(expected, abs=5.0 + 0.01 * expected)


@pytest.mark.parametrize("power", [0.0, -0.35])
def test_an_error_of_the_wind_speed_that_is_a_power_of_it_is_a_rival(power):
    """Truth: the exact rates and frequencies at the stated speeds and at speeds off by a millionth of the power."""
    speed, inertia, stiffness, cn_beta, cn_r = np.array([0.0, 10.0, 17.0, 25.0]), 0.1, 16.0, 0.5, -0.3

    def loads(v):
        return 0.5 * 1.2 * v**2 * 0.036 * 0.625, 0.5 * 1.2 * v * 0.036 * 0.625**2

    def motion(v):
        stiff, damped = loads(v)
        return (0.02 - cn_r * damped) / (2.0 * inertia), np.sqrt((stiffness - cn_beta * stiff) / inertia)

    (rate, omega), share = motion(speed), speed / 25.0
    away = np.where(speed > 0.0, 1e-6 * np.where(speed > 0.0, share, 1.0) ** (power - 1.0), 0.0)
    slower, faster = (np.array(motion(speed * (1.0 + sign * away))) for sign in (-1.0, 1.0))
    change = (faster - slower) / 2e-6
    decays = [Decay.from_modal(o, r / o) for r, o in zip(rate, omega, strict=True)]
    seen = [demodulate(Record(TIME, free_decay(TIME, decay, 0.3, 0.0))) for decay in decays]
    w = RivalWindows.of(seen)
    given = RivalConditions(np.full(4, stiffness), *loads(speed), share, np.zeros(4, int), (cn_beta, cn_r))
    expected = w.joined([(-change[0][w.run] * w.time, change[1][w.run] * w.time)])
    distances = np.abs(campaign_columns(w, given) / inertia - expected).max(axis=0)
    assert distances.min() < 0.01 * np.abs(expected).max()


def test_conditions_of_the_runs_are_shares_of_the_fastest_and_places_of_the_springs():
    plan = ((44.84, 12.0), (16.12, 0.0), (16.12, 24.0), (21.02, 18.0))
    data = campaign(tuple(Setting(*of) for of in plan), duration=1.0)
    found = RivalConditions.of(data.runs, build_design(data.runs, data.rig), (0.5, -0.3))
    assert found.speed == pytest.approx([0.5, 0.0, 1.0, 0.75])
    assert found.spring.tolist() == [2, 0, 0, 1]
    assert found.stiffness.tolist() == [spring for spring, _ in plan]
    speed = np.array([speed for _, speed in plan])
    assert found.stiffness_load == pytest.approx(0.5 * DENSITY * speed**2 * AREA * LENGTH)
    assert found.damping_load == pytest.approx(0.5 * DENSITY * speed * AREA * LENGTH**2)
    still = data.runs[1:2]
    assert RivalConditions.of(still, build_design(still, data.rig), (0.0, 0.0)).speed.tolist() == [0.0]


@pytest.mark.parametrize(("zeta", "noise"), [(0.07, 5e-3), (0.1, 1e-3), (0.1, 5e-3)])
def test_a_decay_is_used_until_it_falls_to_half_the_noise_of_a_window(zeta, noise):
    """A window is two unknowns of so many block means; the end is known to one window."""
    decay = Decay.from_modal(OMEGA, zeta)
    found = demodulate(
        record(np.random.default_rng(0), noise=noise, change=lambda time: free_decay(time, decay, 0.3, 0.0))
    )
    window = found.time[1] - found.time[0]
    least = 0.5 * found.noise * np.sqrt(2.0 / found.samples.mean())
    end = np.log(0.3 / least) / (zeta * OMEGA)
    assert end < TIME[-1]
    assert end - window < found.time[-1] + 0.5 * window < end


@pytest.mark.parametrize("lag", [-0.3, 0.2, 0.8])
def test_a_moment_of_the_air_that_lags_is_a_rival(lag):
    """Truth: the roots of (s²I + sC + K)(1 + sτ) = Ka less those without a lag, for a small Ka; τ is lag · l/V."""
    speed, inertia, stiffness, damping, cn_beta = np.array([0.0, 10.0, 25.0]), 0.1, 16.0, 0.03, 1e-6
    area, length = 0.036, 0.625
    moment, loss = 0.6 * speed**2 * area * length, 0.6 * speed * area * length**2
    change, decays = [], []
    for load, v in zip(moment, speed, strict=True):
        tau = lag * length / v if v else 0.0
        free, ka = np.array([inertia, damping, stiffness]), cn_beta * load
        lagging = np.polyadd(np.polymul(free, [tau, 1.0]), [-ka])
        plain = np.polyadd(free, [-ka])
        root = max(np.roots(plain), key=lambda s: s.imag)
        nearest = min(np.roots(np.trim_zeros(lagging, "f")), key=lambda s: abs(s - root))
        change.append(nearest - root)
        decays.append(Decay(-root.real, abs(root) ** 2))
    seen = [demodulate(Record(TIME, free_decay(TIME, decay, 0.3, 0.0))) for decay in decays]
    w = RivalWindows.of(seen)
    given = RivalConditions(
        np.full(3, stiffness), moment, loss, speed / 25.0, np.zeros(3, int), (cn_beta, -0.3)
    )
    shift = np.array(change)[w.run] * w.time
    expected = w.joined([(shift.real, shift.imag)])
    distances = np.abs(campaign_columns(w, given) / inertia - expected).max(axis=0)
    assert distances.min() < 0.01 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("seconds", "noise", "status"), [(1.0, 1e-3, Status.TOO_FEW_CYCLES), (10.0, 30.0, None)]
)
def test_what_shows_no_oscillation_has_a_status(seconds, noise, status):
    found = demodulate(record(np.random.default_rng(5), noise=noise, time=TIME[seconds > TIME]))
    assert isinstance(found, Status)
    assert status is None or found is status


def test_a_rival_shifts_the_parameters_as_least_squares_does():
    rng = np.random.default_rng(6)
    design, columns = rng.standard_normal((40, 2)), rng.standard_normal((40, 3))
    values, weights = rng.standard_normal(40), rng.uniform(0.5, 2.0, 40)
    found = fit_rivals(values, design, columns, weights, 0)
    root = np.sqrt(weights)[:, None]
    for place in range(3):
        both = np.column_stack((design, columns[:, place])) * root
        solution = np.linalg.lstsq(both, values * root[:, 0], rcond=None)[0]
        assert found.parameters + found.shifts[1 + place] == pytest.approx(solution[:2], rel=1e-4, abs=1e-6)
        rest = values * root[:, 0] - both @ solution
        assert found.remaining[1 + place] == pytest.approx(rest @ rest, rel=1e-4)
        assert found.covariances[1 + place] == pytest.approx(np.linalg.inv(both.T @ both)[:2, :2], rel=1e-4)


def test_forward_selection_takes_the_columns_that_matter():
    rng = np.random.default_rng(7)
    columns = rng.standard_normal((200, 8))
    values = 3.0 * columns[:, 5] - 2.0 * columns[:, 1] + 0.1 * rng.standard_normal(200)
    assert forward_selection(columns.T @ columns, columns.T @ values, 2) == [5, 1]


def test_the_best_step_is_where_it_is():
    seen = demodulate(record(np.random.default_rng(8)))
    assert isinstance(seen, Demodulated)
    jump = (np.arange(seen.time.size) > 6).astype(float)
    assert best_step(seen, 0.1 * seen.time + jump) == pytest.approx(jump)
    assert RivalWindows.of([seen, seen]).integrals[0.0][seen.time.size :] == pytest.approx(
        seen.time - seen.time[0]
    )


def test_quantiles_are_those_of_the_distribution():
    rng = np.random.default_rng(9)
    weights = rng.dirichlet(np.ones(4), size=3)
    means, stds = 5.0 * rng.standard_normal((3, 4, 2)), np.exp(rng.standard_normal((3, 4, 2)))
    found = quantiles(weights, means, stds)
    levels = np.broadcast_to(np.array([0.025, 0.5, 0.975])[None, :, None], found.shape)
    assert distribution(weights, means, stds, found) == pytest.approx(levels, abs=1e-9)
