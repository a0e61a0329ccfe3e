"""Coloured noise: its power at the motion, and what is not taken for it. Truth: the formula of a filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from identification import Status, identify
from identification.campaign.derivatives import noise_statuses
from identification.signal.colour import Autoregression, Periodogram, levinson
from identification.signal.noise import PeakNoise, ReadingNoise, Residual, noise_of
from identification.statistics import inverse, sandwich_covariance
from tests.marks import slow
from tests.reference.free_decays import SIX, campaign, with_records
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Array

pytestmark = pytest.mark.usefixtures("unexamined")

COUNT, CYCLE = 5000, 125.0
SILENT = SensorProperties(500.0, None, None)
POLES = (0.5, 0.9, 0.97)


def red(pole: float, rng: np.random.Generator, count: int = COUNT) -> Array:
    """Noise of first order and unit variance."""
    white = rng.standard_normal(count + 500)
    return np.asarray(lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[500:])


def density(pole: float, frequency: Array | float) -> Array:
    """Its power at multiples of the motion's frequency; white noise of unit variance has 1."""
    turn = np.exp(-2j * np.pi * np.asarray(frequency) / CYCLE)
    return np.asarray((1.0 - pole**2) / np.abs(1.0 - pole * turn) ** 2)


def judged(values: Array, sensor: SensorProperties = SILENT) -> ReadingNoise:
    return noise_of([Residual(values, CYCLE, 5, 300.0)], sensor)


@pytest.mark.parametrize("pole", POLES)
def test_the_power_and_its_degrees_of_freedom_are_those_of_the_noise(pole: float) -> None:
    rng = np.random.default_rng(1)
    found = [Autoregression.of(red(pole, rng), CYCLE) for _ in range(60)]
    powers = np.array([one.power(1.0) for one in found if one is not None]) / density(pole, 1.0)
    assert powers.size == 60
    assert powers.mean() == pytest.approx(1.0, abs=0.1)
    claimed = np.mean([np.sqrt(2.0 / one.freedom) for one in found if one is not None])
    assert 0.6 < powers.std(ddof=1) / claimed < 1.7


@pytest.mark.parametrize("pole", POLES)
def test_coloured_noise_is_no_departure_and_agrees_with_its_stated_size(pole: float) -> None:
    rng, trials = np.random.default_rng(2), 60
    found = [judged(red(pole, rng), SensorProperties(500.0, None, 1.0)) for _ in range(trials)]
    departing = sum(one.level.departs for one in found)
    disagreeing = sum(one.level.disagrees for one in found)
    assert max(departing, disagreeing) <= binom.isf(1e-3, trials, 0.01)
    assert {one.level.source for one in found if not one.level.disagrees} == {"stated"}
    assert np.mean([one.variance for one in found]) == pytest.approx(float(density(pole, 1.0)), rel=0.15)


def test_noise_beyond_its_stated_level_is_a_misfit() -> None:
    """As the beat of vortices in the wind beside the white noise of the sensor, which agrees with the statement."""
    rng = np.random.default_rng(12)
    values = rng.standard_normal(COUNT) + red(0.97, rng)
    assert judged(values, SensorProperties(500.0, None, 1.0)).level.departs
    assert not judged(values, SensorProperties(500.0, None, np.sqrt(2.0))).level.departs


def test_white_noise_has_no_colour() -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        found = judged(rng.standard_normal(COUNT))
        assert (found.colours, found.level.slow_ratio) == ((), 1.0)


def swing() -> Array:
    return np.asarray(np.sin(2.0 * np.pi * np.arange(COUNT) / CYCLE))


MISFITS = {
    "of the motion": swing() * np.linspace(1.0, -1.0, COUNT),
    "early": 8.0 * swing() * np.exp(-np.arange(COUNT) / 300.0),
    "third harmonic": np.sin(6.0 * np.pi * np.arange(COUNT) / CYCLE),
    "first samples": 30.0 * (np.arange(COUNT) < 4),
    "drift": np.linspace(-2.0, 2.0, COUNT),
    "step": 2.0 * (np.arange(COUNT) > 0.4 * COUNT),
}


@pytest.mark.parametrize("misfit", MISFITS.values(), ids=MISFITS)
def test_a_misfit_is_no_noise_even_beneath_coloured_noise(misfit: Array) -> None:
    rng = np.random.default_rng(4)
    assert judged(rng.standard_normal(COUNT) + misfit).level.departs
    assert judged(0.1 * red(0.9, rng) + misfit).level.departs


@pytest.mark.parametrize("damping", [0.002, 0.01])
def test_the_response_to_a_random_moment_is_no_noise(damping: float) -> None:
    rng, trials, taken = np.random.default_rng(5), 20, 0
    pole = np.exp((-damping + 1j) * 2.0 * np.pi / CYCLE)
    for _ in range(trials):
        moved = lfilter([1.0], np.real(np.poly([pole, np.conj(pole)])), rng.standard_normal(2 * COUNT))[
            COUNT:
        ]
        taken += not judged(rng.standard_normal(COUNT) + 10.0 * moved / moved.std()).level.departs
    assert taken <= 0.1 * trials


def test_a_record_of_few_cycles_shows_no_colour() -> None:
    assert Autoregression.of(red(0.9, np.random.default_rng(6), 600), CYCLE) is None
    assert Autoregression.of(red(0.9, np.random.default_rng(6)), 2.5) is None
    assert Autoregression.of(np.zeros(COUNT), CYCLE) is None


def test_the_recursion_whitens_the_noise_of_its_covariance() -> None:
    (first, one), (taps, variance), (more, _) = levinson(0.9 ** np.arange(3))
    assert (first.tolist(), one) == ([1.0], 1.0)
    assert taps == pytest.approx([1.0, -0.9])
    assert variance == pytest.approx(0.19)
    assert more == pytest.approx([1.0, -0.9, 0.0])


@pytest.mark.parametrize("pole", POLES)
def test_whitened_noise_has_unit_variance_from_its_first_value(pole: float) -> None:
    rng = np.random.default_rng(7)
    colour = Autoregression.of(red(pole, rng), CYCLE)
    assert colour is not None
    first = np.array([colour.whitened(red(pole, rng, 400))[:3] for _ in range(300)])
    assert np.mean(first**2, axis=0) == pytest.approx(1.0, abs=0.35)
    whole = colour.whitened(red(pole, rng))
    assert np.mean(whole**2) == pytest.approx(1.0, abs=0.1)
    assert abs(np.mean(whole[1:] * whole[:-1])) < 0.1


def test_ordinates_at_the_harmonics_are_those_of_their_neighbours() -> None:
    rng = np.random.default_rng(8)
    values = rng.standard_normal(COUNT)
    plain, lined = (Periodogram.of(v, 1.0, 1.0 / CYCLE) for v in (values, values + 30.0 * swing()))
    assert lined.power.max() > 1000.0 * plain.power.max()
    assert lined.bridged(1.0 / CYCLE).mean() == pytest.approx(plain.power.mean(), rel=0.1)


@pytest.mark.parametrize("pole", [None, 0.9])
def test_the_noise_of_a_parabola_is_that_of_repeated_fits(pole: float | None) -> None:
    """Truth: polynomials fitted by NumPy to draws of the noise, with the signs of the peaks' sides in turn."""
    rng, width = np.random.default_rng(9), int(CYCLE / 12.0)
    place = np.linspace(-1.0, 1.0, 2 * width + 1)
    sums = []
    for _ in range(300):
        noise = rng.standard_normal(COUNT) if pole is None else red(pole, rng)
        middles = np.arange(width, COUNT - width, CYCLE / 2.0).astype(int)[:40]
        fits = np.array([np.polyfit(place, noise[at - width : at + width + 1], 2) for at in middles])
        signs = (-1.0) ** np.arange(middles.size) / np.sqrt(middles.size)
        sums.append(signs @ fits[:, [2, 1]])
    colour = None if pole is None else Autoregression.of(red(pole, rng, 20 * COUNT), CYCLE)
    expected = PeakNoise.of(1.0, 2.0 * CYCLE / 12.0, colour)
    assert np.std(sums, axis=0) == pytest.approx([expected.height, expected.slope], rel=0.25)


def test_runs_of_different_noise_are_weighed_by_its_power() -> None:
    informations = np.array([np.diag([1.0, 4.0]), np.array([[2.0, 0.5], [0.5, 1.0]])])
    whole = inverse(informations.sum(axis=0))
    assert sandwich_covariance(informations, [3.0, 3.0]) == pytest.approx(3.0 * whole)
    mixed = sandwich_covariance(informations, [1.0, 5.0])
    assert mixed == pytest.approx(whole @ (informations[0] + 5.0 * informations[1]) @ whole)


@pytest.mark.parametrize("estimator", ["output_error", "conventional", slow("hilbert"), slow("filter_error")])
def test_estimates_in_coloured_noise_have_no_status_and_its_deviations(estimator: str) -> None:
    rng = np.random.default_rng(10)

    def coloured(time: Array, yaw: Array) -> Array:
        return np.asarray(yaw + 5e-4 * red(0.9, rng, time.size))

    plain = campaign(SIX, noise=5e-4, rng=rng, rate=250.0)
    data = with_records(campaign(SIX, rate=250.0), coloured)
    data = replace(data, sensor=replace(data.sensor, noise_std=5e-4))
    found, white = identify(data, estimator), identify(plain, estimator)
    assert found.statuses == (Status.OK,)
    assert noise_statuses([run.noise for run in found.runs]) == set()
    assert found.cn_r is not None
    assert white.cn_r is not None
    # the root of the power is 3.5 at 2 to 3 Hz, and less at the harmonics that peaks are also subject to
    assert 1.6 < found.cn_r.std / white.cn_r.std < 4.4
