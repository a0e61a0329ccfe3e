"""Waveforms of drives. Truth: their frequencies and phases by definition, and their discrete spectra."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tunnel_sim.vocabulary.plan import band_noise, chirp, lines_in_band, multisine, square, stepped_sine

RATE = 50.0
TIME = np.arange(501) / RATE  # odd, so that the last line has no partner at half the rate
LENGTH = TIME.size / RATE


def test_a_stepped_sine_dwells_equally_long_and_does_not_jump() -> None:
    found = stepped_sine(TIME, [1.0, 2.5])
    half = 0.5 * LENGTH
    first = half >= TIME
    assert np.allclose(found[first], np.sin(2.0 * pi * TIME[first]))
    assert np.allclose(found[~first], np.sin(2.0 * pi * (half + 2.5 * (TIME[~first] - half))))
    assert np.allclose(stepped_sine(TIME, [1.3]), np.sin(2.0 * pi * 1.3 * TIME))


def test_the_frequency_of_a_chirp_changes_linearly() -> None:
    fine = np.arange(100_001) / 10_000.0
    found = chirp(fine, 0.5, 3.0)
    crossings = fine[1:][np.diff(np.sign(found[1:]), prepend=1.0) != 0]
    # the phase, 0.5 t + 0.125 t² cycles, is a whole number of half cycles at every crossing, and all of them occur
    halves = crossings + 0.25 * crossings**2
    assert np.allclose(halves, np.arange(1, halves.size + 1), atol=2e-3)
    assert halves.size == 34  # of 35 half cycles in 10 s the last ends with the record


def test_a_square_wave_begins_with_one_and_turns_every_half_cycle() -> None:
    found = square(TIME, 0.5)
    assert set(found) == {-1.0, 1.0}
    assert np.array_equal(np.flatnonzero(np.diff(found)) + 1, np.arange(50, 501, 50))


@pytest.mark.parametrize("rng", [None, np.random.default_rng(1)])
def test_a_multisine_has_equal_lines_in_its_band_only(rng: np.random.Generator | None) -> None:
    found = multisine(TIME, 0.5, 5.0, rng)
    lines = lines_in_band(TIME.size, 1.0 / RATE, 0.5, 5.0).astype(int)
    assert lines[0] / LENGTH >= 0.5 > (lines[0] - 1) / LENGTH
    assert lines[-1] / LENGTH <= 5.0 < (lines[-1] + 1) / LENGTH
    size = np.abs(np.fft.rfft(found))
    assert np.allclose(size[lines], size[lines[0]])
    assert np.max(np.delete(size, lines)) < 1e-10 * size[lines[0]]
    assert np.max(np.abs(found)) == pytest.approx(1.0)


def test_schroeders_phases_keep_the_peak_low() -> None:
    drawn = [multisine(TIME, 0.5, 5.0, np.random.default_rng(seed)) for seed in range(20)]
    assert np.std(multisine(TIME, 0.5, 5.0)) > max(np.std(one) for one in drawn)  # all have the peak 1


def test_band_noise_is_drawn_and_lies_in_its_band() -> None:
    one, again, other = (band_noise(TIME, 1.0, 4.0, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    lines = lines_in_band(TIME.size, 1.0 / RATE, 1.0, 4.0).astype(int)
    size = np.abs(np.fft.rfft(one))
    assert np.max(np.delete(size, lines)) < 1e-10 * np.max(size)
    assert np.max(np.abs(one)) == pytest.approx(1.0)
