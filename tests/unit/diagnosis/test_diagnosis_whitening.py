"""Whitening: exact for autoregressive noise from the first value on, and nothing at all for white noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter

from diagnosis.likelihood.run_data import RunData
from diagnosis.likelihood.whitening import WHITE, colour, colouring, correlate, response, whiten

FILTERS = (np.array([1.0, -0.9]), np.array([1.0, -1.2, 0.6]), np.array([1.0, 0.5, 0.0, -0.3]))


def autocovariance(whitening, count):
    """Of the noise whose innovations have unit variance, from its impulse response."""
    impulse = lfilter([1.0], whitening, np.eye(1, 5000)[0])
    return np.array([impulse[: 5000 - k] @ impulse[k:] for k in range(count)])


@pytest.mark.parametrize("whitening", FILTERS)
def test_whitening_is_the_inverse_of_the_cholesky_factor(whitening):
    """Truth: the triangular factor of the covariance matrix, from scipy's own factorisation."""
    covariance = autocovariance(whitening, 12)
    values = np.random.default_rng(1).normal(size=12)
    expected = solve_triangular(cholesky(toeplitz(covariance), lower=True), values, lower=True)
    assert whiten(values, whitening) == pytest.approx(expected, abs=1e-9)
    assert colour(whiten(values, whitening), whitening) == pytest.approx(values, abs=1e-9)
    # a record shorter than the filter is whitened by the same predictors
    assert whiten(values[:2], whitening) == pytest.approx(expected[:2], abs=1e-9)
    assert colour(expected[:2], whitening) == pytest.approx(values[:2], abs=1e-9)
    assert colouring(whitening) == pytest.approx(np.sqrt(covariance[0]), rel=1e-9)


def test_white_noise_is_left_as_it_is():
    values = np.random.default_rng(2).normal(size=50)
    assert whiten(values, WHITE) is values
    assert colour(values, WHITE) is values
    assert colouring(WHITE) == 1.0
    assert np.array_equal(response(WHITE, np.array([0.0, 0.3])), [1.0, 1.0])


def test_a_run_scales_a_sinusoid_by_its_response():
    run = RunData("r1", np.zeros(4000), 4, 4e-3, 1e-6, None, 0.0, 0.0, 16.0, whitening=FILTERS[1])
    wave = np.exp(2j * np.pi * 3.0 * run.interval * np.arange(4000))
    scaled = run.scaled(wave.real) + 1j * run.scaled(wave.imag)
    assert scaled[100:] / wave[100:] == pytest.approx(run.response(3.0) / 1e-3, rel=1e-9)
    assert run.noise_at(3.0) == pytest.approx(1e-3 / abs(run.response(3.0)))
    assert run.unscaled(run.scaled(wave.real)) == pytest.approx(wave.real, abs=1e-9)
    assert run.noise_std == pytest.approx(1e-3 * np.sqrt(autocovariance(FILTERS[1], 1)[0]), rel=1e-9)


def test_a_run_whitens_the_response_to_a_random_moment_from_its_start():
    """Truth: the filter is the inverse of the one that made the response out of white noise, at rest before."""
    innovations = (np.array([1.0, -1.9, 0.95]), np.array([1.0, -1.2, 0.4]))
    white = np.random.default_rng(3).standard_normal(500)
    moved = 1e-3 * lfilter(*reversed(innovations), white)
    for whitening in (WHITE, FILTERS[1]):
        run = RunData(
            "r1", moved, 4, 4e-3, 1e-6, None, 0.0, 0.0, 16.0, whitening=whitening, innovations=innovations
        )
        assert run.unscaled(run.scaled(moved)) == pytest.approx(moved, abs=1e-12)
        late = np.zeros(500)
        late[200:] = moved[:300]
        taps = np.convolve(run.taps, late)[:500]
        assert run.white(late)[200:] == pytest.approx(taps[200:], abs=1e-12)
        wave = np.exp(2j * np.pi * 3.0 * run.interval * np.arange(500))
        seen = run.white(wave.real) + 1j * run.white(wave.imag)
        assert np.max(np.abs(seen[200:] / wave[200:] - run.response(3.0))) < 1e-6
    assert replace(run, whitening=WHITE).scaled(moved) == pytest.approx(white, abs=1e-9)


@pytest.mark.parametrize("whitening", [WHITE, *FILTERS])
def test_correlation_is_the_transpose_of_the_filter(whitening):
    matrix = toeplitz(np.append(whitening, np.zeros(30 - whitening.size)), np.zeros(30))
    values = np.random.default_rng(3).normal(size=(30, 2))
    assert correlate(values, whitening) == pytest.approx(matrix.T @ values, abs=1e-12)
    assert correlate(values[:, 0], whitening) == pytest.approx(matrix.T @ values[:, 0], abs=1e-12)
