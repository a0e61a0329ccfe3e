"""The noise of a run: each kind is made white and restored, and one of one's own is one class."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

from diagnosis.likelihood.least_squares import fit
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import AutoregressiveNoise, NoiseWithMoment, RunNoise, WhiteNoise
from diagnosis.search.views.stretches import in_stretches
from tests.support.gap_campaigns import CN_BETA, CN_R, DAMPING, INERTIA, NOISE, campaign, nominal
from tunnel_sim.vocabulary.record import Array

FILTERS = (np.array([1.0, -0.9]), np.array([1.0, -1.2, 0.6]), np.array([1.0, 0.5, 0.0, -0.3]))
SENSORS = (WhiteNoise(1e-6), *(AutoregressiveNoise(1e-6, whitening) for whitening in FILTERS))
#: Of a random moment: the filter that makes the response to it white.
MOMENT = (np.array([1.0, -1.9, 0.95]), np.array([1.0, -1.2, 0.4]))
KINDS = (*SENSORS, *(NoiseWithMoment(1e-6, sensor, *MOMENT) for sensor in SENSORS))


@dataclass(frozen=True, eq=False)
class ChangingNoise(RunNoise):
    """A kind of one's own: white noise whose strength changes along the run by a known factor, shape (n,)."""

    factor: Array

    def white(self, values):
        return (values.T / self.factor).T

    def coloured(self, values):
        return values * self.factor

    def response(self, cycles):
        return np.full(np.shape(cycles), 1.0 / self.over_white, np.complex128)

    @property
    def over_white(self):
        return float(np.sqrt(np.mean(self.factor**2)))

    def transposed(self, values):
        return self.white(values)

    def powers_onward(self, values):
        return np.cumsum(self.white(values)[::-1] ** 2)[::-1]

    def part(self, first, last):
        return replace(self, factor=self.factor[first:last])


CHANGING = ChangingNoise(1e-6, 1.0 + (np.arange(4000) >= 2000))


def run_with(noise, reading):
    return RunData("r1", reading, 4, 4e-3, noise, None, 0.0, 0.0, 16.0)


def autocovariance(whitening, count):
    """Of the noise whose innovations have unit variance, from its impulse response."""
    impulse = lfilter([1.0], whitening, np.eye(1, 5000)[0])
    return np.array([impulse[: 5000 - k] @ impulse[k:] for k in range(count)])


@pytest.mark.parametrize("whitening", FILTERS)
def test_whitening_is_the_inverse_of_the_cholesky_factor(whitening):
    """Truth: the triangular factor of the covariance matrix, from scipy's own factorisation."""
    covariance, noise = autocovariance(whitening, 12), AutoregressiveNoise(1e-6, whitening)
    values = np.random.default_rng(1).normal(size=12)
    expected = solve_triangular(cholesky(toeplitz(covariance), lower=True), values, lower=True)
    assert noise.white(values) == pytest.approx(expected, abs=1e-9)
    # a record shorter than the filter is whitened by the same predictors
    assert noise.white(values[:2]) == pytest.approx(expected[:2], abs=1e-9)
    assert noise.coloured(expected[:2]) == pytest.approx(values[:2], abs=1e-9)
    assert run_with(noise, values).noise_std == pytest.approx(1e-3 * np.sqrt(covariance[0]), rel=1e-9)


@pytest.mark.parametrize("noise", [*KINDS, CHANGING])
def test_every_kind_is_inverted_and_takes_columns(noise):
    values = np.random.default_rng(2).normal(size=(4000, 2))
    run = run_with(noise, np.zeros(4000))
    one, other = (run.scaled(column) for column in values.T)
    assert run.scaled(values) == pytest.approx(np.column_stack([one, other]), rel=1e-9, abs=1e-6)
    assert run.unscaled(one) == pytest.approx(values[:, 0], abs=1e-9)


@pytest.mark.parametrize("noise", KINDS)
def test_a_run_scales_a_sinusoid_by_its_response(noise):
    run = run_with(noise, np.zeros(4000))
    wave = np.exp(2j * np.pi * 3.0 * run.interval * np.arange(4000))
    scaled = run.scaled(wave.real) + 1j * run.scaled(wave.imag)
    assert scaled[200:] / wave[200:] == pytest.approx(complex(run.response(3.0)) / 1e-3, rel=1e-6)
    assert run.noise_at(3.0) == pytest.approx(1e-3 / abs(run.response(3.0)))


@pytest.mark.parametrize("noise", [*KINDS, CHANGING.part(1800, 2200)])
def test_the_transpose_and_the_powers_of_what_is_made_white(noise):
    """Truth: the matrix of `white`, for values well inside the run."""
    values = np.zeros((400, 2))
    values[100:300] = np.random.default_rng(3).normal(size=(200, 2))
    matrix = noise.white(np.eye(400))
    assert noise.transposed(values)[100:] == pytest.approx((matrix.T @ values)[100:], abs=1e-9)
    powers = [float(np.sum((matrix[:, k:] @ values[k:, 0]) ** 2)) for k in range(100, 300)]
    assert noise.powers_onward(values[:, 0])[100:300] == pytest.approx(np.array(powers), rel=1e-6)


def test_the_response_to_a_random_moment_is_made_white_from_the_start_of_a_run():
    """Truth: the filter is the inverse of the one that made the response out of white noise, at rest before."""
    white = np.random.default_rng(3).standard_normal(500)
    moved = 1e-3 * lfilter(*reversed(MOMENT), white)
    noise = NoiseWithMoment(1e-6, WhiteNoise(1.0), *MOMENT)
    assert run_with(noise, moved).scaled(moved) == pytest.approx(white, abs=1e-9)


@pytest.mark.slow
def test_estimates_in_noise_of_ones_own_kind_scatter_as_stated():
    """Noise twice as strong in the second half of every run; truth: the parameters of the readings without it."""
    problem, rng, trials = nominal(campaign(duration=5.0)).problem, np.random.default_rng(4), 40
    truth = Point(np.array([INERTIA, DAMPING, CN_BETA, CN_R, 0.001]), np.array([[0.35, 0.0]] * 6))
    factor = 1.0 + (np.arange(problem.data.runs[0].reading.size) >= 625)
    runs, pulls, powers = [], [], []
    for run, motion in zip(problem.data.runs, problem.predict([truth])[0], strict=True):
        runs.append(replace(run, reading=motion, noise=ChangingNoise(NOISE**2, factor)))
    for _ in range(trials):
        noisy = [replace(r, reading=r.reading + NOISE * factor * rng.normal(size=factor.size)) for r in runs]
        found = fit(replace(problem, data=problem.data.with_runs(tuple(noisy))), truth)
        named = zip(problem.names, truth.common, strict=True)
        pulls.append([(found.value(name) - value) / found.std(name) for name, value in named])
        powers.append(
            [np.mean(np.stack(found.residuals)[:, half] ** 2) for half in np.split(np.arange(1250), 2)]
        )
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], trials) / trials
    squares = np.mean(np.square(pulls), axis=0)
    assert np.all((low < squares) & (squares < high)), squares
    assert np.mean(powers, axis=0) == pytest.approx(np.ones(2), abs=0.01)
    part = in_stretches(found.problem.data, 625).data.runs[1]
    assert np.array_equal(part.noise.factor, factor[625:])
