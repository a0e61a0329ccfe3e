"""The exact bound against its closed-form long-record limit and against plain numerical information."""

import numpy as np
import pytest

from identification import identify
from identification.uncertainty.cramer_rao import campaign_bound, damped_sinusoid_bound
from tests.reference.free_decays import RESOLUTION, TWELVE, Setting, Truth, angle_of, campaign
from tunnel_sim.vocabulary.between_runs import Repeatability
from tunnel_sim.vocabulary.errors import TunnelError

NAMES = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")


@pytest.mark.parametrize("zeta", [0.001, 0.003, 0.01])
@pytest.mark.parametrize("frequency", [0.8, 2.0, 4.0])
def test_long_record_limit(zeta, frequency):
    amplitude, noise, rate = 0.35, 5e-4, 200.0
    omega_n = 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2)
    sigma = zeta * omega_n
    time = np.arange(round(9.0 / sigma * rate)) / rate
    bound = damped_sinusoid_bound(
        time, amplitude=amplitude, phase=0.4, frequency=frequency, zeta=zeta, noise_std=noise
    )
    relative = 4.0 * noise / amplitude * np.sqrt(sigma / rate)
    # The limit leaves out terms of order ζ (the double frequency, the offset) and e^(−2·9)·9².
    assert bound.zeta / zeta == pytest.approx(relative, rel=3.0 * zeta + 1e-4)
    assert bound.frequency / frequency == pytest.approx(zeta * relative, rel=3.0 * zeta + 1e-4)


def test_sinusoid_bound_matches_numerical_information():
    truth = np.array([0.3, 0.7, 2.1, 0.02, 0.01])
    time = np.arange(2000) / 500.0

    def model(p):
        sigma = p[3] * 2.0 * np.pi * p[2] / np.sqrt(1.0 - p[3] ** 2)
        return p[0] * np.exp(-sigma * time) * np.cos(2.0 * np.pi * p[2] * time + p[1]) + p[4]

    columns = []
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-6
        columns.append((model(truth + step) - model(truth - step)) / 2e-6)
    jacobian = np.array(columns).T
    deviations = 1e-3 * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    bound = damped_sinusoid_bound(time, amplitude=0.3, phase=0.7, frequency=2.1, zeta=0.02, noise_std=1e-3)
    got = [bound.amplitude, bound.phase, bound.frequency, bound.zeta, bound.offset]
    np.testing.assert_allclose(got, deviations, rtol=1e-6)


def test_campaign_bound_matches_numerical_information():
    settings = (Setting(16.12, 0.0), Setting(44.84, 12.0, 0.2), Setting(21.02, 24.0, 0.3))
    data = campaign(settings, duration=4.0, rate=200.0)
    time = data.runs[0].record.time_s
    base = np.array([0.49, -0.11, 0.1014, 0.012])

    def model(p):
        truth = Truth(*p[:4])
        parts = []
        for i, setting in enumerate(settings):
            moved = Setting(setting.spring, setting.speed, p[5 + 2 * i], p[6 + 2 * i])
            parts.append(angle_of(moved, truth, time) + p[4])
        return np.concatenate(parts)

    states = [value for setting in settings for value in (setting.release, setting.rate)]
    point = np.array([*base, 0.0, *states])
    jacobian = np.array(
        [(model(point + step) - model(point - step)) / 2e-6 for step in 1e-6 * np.eye(point.size)]
    ).T
    expected = 1e-6 * np.linalg.inv(jacobian.T @ jacobian)[:4, :4]
    bound = campaign_bound(data, Truth(*base), noise_std=1e-3)
    assert bound.parameters == NAMES
    np.testing.assert_allclose(np.array(bound.covariance), expected, rtol=1e-4)


def test_the_bound_of_runs_that_scatter_is_that_of_their_marginal_distribution():
    """Truth: the readings' own covariance, with every run's deviations as errors that its readings share."""
    settings = (
        *(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 20.0)),
        Setting(21.02, 24.0),
    )
    data = campaign(settings, duration=2.0, rate=100.0)
    time, base, widths = (
        data.runs[0].record.time_s,
        np.array([0.49, -0.11, 0.1014, 0.012]),
        (4e-3, 7e-4, 0.02),
    )

    def reading(setting, d):
        """By changes d of the coefficients and the zero, of the release, and of the run's own deviations."""
        p, state, own = np.array([*base, 0.0]) + d[:5], np.array([setting.release, 0.0]) + d[5:7], d[7:]
        truth = Truth(*p[:3], mechanical_damping=p[3] * (1.0 + own[2]))
        spring, speed = setting.spring * (1.0 + own[1]), setting.speed * (1.0 + own[0])
        return angle_of(Setting(spring, speed, *state), truth, time) + p[4]

    information = np.zeros((5 + 2 * len(settings),) * 2)
    for place, setting in enumerate(settings):
        steps = 1e-6 * np.eye(10)
        slopes = np.array([(reading(setting, step) - reading(setting, -step)) / 2e-6 for step in steps]).T
        columns, own = np.zeros((time.size, len(information))), slopes[:, 7:] * np.array(widths)
        columns[:, :5], columns[:, 5 + 2 * place : 7 + 2 * place] = slopes[:, :5], slopes[:, 5:7]
        information += columns.T @ np.linalg.solve(1e-6 * np.eye(time.size) + own @ own.T, columns)
    expected = np.linalg.inv(information)[:4, :4]
    truth = Truth(*base)
    found = campaign_bound(data, truth, noise_std=1e-3, repeatability=Repeatability(*widths))
    np.testing.assert_allclose(np.array(found.covariance), expected, rtol=1e-3)
    without = campaign_bound(data, truth, noise_std=1e-3, repeatability=Repeatability())
    assert without == campaign_bound(data, truth, noise_std=1e-3)
    assert found.std("cn_beta") > 3.0 * without.std("cn_beta")


def test_estimate_claims_the_bound_when_the_model_is_right():
    truth = Truth()
    data = campaign(noise=5e-4, resolution=RESOLUTION, rng=np.random.default_rng(3))
    estimate = identify(data)
    noise = float(np.hypot(5e-4, RESOLUTION / np.sqrt(12.0)))
    bound = campaign_bound(
        data,
        truth,
        noise_std=noise,
        initial_states=[(setting.release, setting.rate) for setting in TWELVE],
    )
    for name in NAMES:
        assert getattr(estimate, name).std == pytest.approx(bound.std(name), rel=0.01)


def test_bound_refuses_what_it_lacks():
    data = campaign((Setting(None, 0.0),))
    values = Truth(0.1, 0.1, 0.1, 0.1)
    with pytest.raises(TunnelError, match="spring_stiffness"):
        campaign_bound(data, values, noise_std=1e-3)
    with pytest.raises(TunnelError, match="frontal_area"):
        campaign_bound(campaign((Setting(16.0, 10.0),), has_size=False), values, noise_std=1e-3)
    with pytest.raises(ValueError, match="positive"):
        damped_sinusoid_bound(
            np.arange(9.0), amplitude=0.0, phase=0.0, frequency=1.0, zeta=0.1, noise_std=1.0
        )
    wind_off = campaign_bound(campaign((Setting(16.0, 0.0),)), values, noise_std=1e-3)
    assert wind_off.parameters == ("yaw_inertia", "mechanical_damping")
    with pytest.raises(KeyError):
        wind_off.std("cn_beta")
