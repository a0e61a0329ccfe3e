"""The hum of the mains: found where it is, taken out whole, and not found in motions with corners."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.mains_lines import mains_line
from diagnosis.noise.mains import find_hum, refine_frequency, remove_hum
from diagnosis.search.investigate import nominal_study
from tests.reference import free_decays
from tests.reference.free_decays import Setting, angle_of, with_records
from tests.unit.gap_campaigns import nominal
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.physics.forward import backlash
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Record

NOISE = 4e-4
SETTINGS = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 15.0, 25.0))


def decays(seed=1, rate=1000.0, duration=6.0):
    return free_decays.campaign(
        SETTINGS, noise=NOISE, rate=rate, duration=duration, rng=np.random.default_rng(seed)
    )


def humming(data, amplitude, frequency=50.0, third=0.0):
    phases = iter(np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, 2 * len(data.runs)))

    def add(t, y):
        a, b = next(phases), next(phases)
        line = np.sin(2.0 * np.pi * frequency * t + a) + third * np.sin(6.0 * np.pi * frequency * t + b)
        return y + amplitude * line

    return with_records(data, add)


@pytest.mark.parametrize("frequency", [49.93, 50.0, 50.07])
def test_a_hum_is_found_and_taken_out_whole(frequency):
    clean = decays()
    amplitude = 5e-4
    data = humming(clean, amplitude, frequency, third=0.3)
    line = find_hum(nominal(data))
    assert line is not None
    refined = refine_frequency(data, line)
    assert abs(refined - frequency) < 3e-3
    cleaned, hum = remove_hum(data, refined, NOISE**2)
    assert abs(hum.amplitude - amplitude) < 4.0 * hum.std + 0.01 * amplitude
    assert hum.excess == pytest.approx(0.5 * amplitude**2 * (1.0 + 0.3**2) / NOISE**2, rel=0.1)
    left = [
        np.mean((a.record.yaw_rad - b.record.yaw_rad) ** 2)
        for a, b in zip(cleaned.runs, clean.runs, strict=True)
    ]
    # nine in a thousand of the hum at the most, where the frequency of a short record is off by its error
    assert np.mean(left) < 0.02 * hum.excess * NOISE**2
    assert find_hum(nominal(cleaned)) is None


@pytest.mark.slow
def test_the_amplitude_s_error_is_as_stated():
    pulls = []
    for seed in range(20):
        _, hum = remove_hum(humming(decays(seed), 3e-4), 50.0, NOISE**2)
        pulls.append((hum.amplitude - 3e-4) / hum.std)
    assert 0.25 < np.mean(np.square(pulls)) < 2.6  # of χ²(20)/20: one in 10 000 on either side


def test_the_line_s_amplitude_is_that_of_the_sine():
    line = mains_line(nominal(humming(decays(), 1e-3)))
    assert line is not None
    assert line.parameter == pytest.approx(50.0, abs=0.02)
    assert line.amplitude == pytest.approx(1e-3, rel=0.05)


def test_the_hum_of_a_slow_rig_is_found():
    """Its mains lie above what block means show, and count as noise at first."""
    rate = 250.0
    slow = [replace(run, record=Record(run.record.time_s * 4.0, run.record.yaw_rad)) for run in decays().runs]
    clean = replace(decays(), runs=tuple(slow), sensor=SensorProperties(rate, 1e-5))
    found = nominal_study(humming(clean, 1e-3), ALL_EFFECTS)
    assert found.hum is not None
    own = found.similarity.own
    assert own(found.hum.frequency, "Hz") == pytest.approx(50.0, abs=3e-3)
    assert found.hum.amplitude == pytest.approx(1e-3, rel=0.02)
    assert found.hum.excess == pytest.approx(0.5 * 1e-3**2 / NOISE**2, rel=0.1)
    assert not found.test.detected
    assert nominal_study(clean, ALL_EFFECTS).hum is None


def test_white_noise_has_no_hum():
    assert [find_hum(nominal(decays(seed))) for seed in range(6)] == [None] * 6


@pytest.mark.parametrize("rate", [112.0, 125.0])
def test_a_hum_is_found_with_little_more_than_two_samples_a_period(rate):
    assert find_hum(nominal(humming(decays(rate=rate, duration=8.0), 2e-3))) is not None
    assert find_hum(nominal(decays(rate=rate, duration=8.0))) is None


def test_slow_sampling_cannot_see_the_mains():
    assert find_hum(nominal(decays(rate=100.0, duration=8.0))) is None


def reread(change):
    """The motions in closed form, read through a sensor of another kind."""
    rng = np.random.default_rng(9)
    settings = iter(SETTINGS)
    truth = free_decays.Truth()

    def read(t, _y):
        return change(angle_of(next(settings), truth, t)) + rng.normal(0.0, NOISE, t.size)

    return with_records(decays(), read)


def test_clipped_motions_have_no_hum():
    assert find_hum(nominal(reread(lambda angle: np.clip(angle, -0.25, 0.25)))) is None


def test_backlash_has_no_hum():
    assert find_hum(nominal(reread(lambda angle: backlash(angle, 3e-3, angle[0])))) is None


def swelling(data, amplitude, depth):
    phases = iter(np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 2 * len(data.runs)))

    def add(t, y):
        a, b = next(phases), next(phases)
        return y + amplitude * (1.0 + depth * np.sin(2.0 * np.pi * 0.4 * t + b)) * np.sin(
            2.0 * np.pi * 50.0 * t + a
        )

    return with_records(data, add)


@pytest.mark.parametrize("depth", [0.0, 0.5])
def test_a_hum_that_swells_is_taken_out_too_and_a_steady_one_costs_no_more(depth):
    clean = decays()
    data = swelling(clean, 1e-3, depth)
    cleaned, hum = remove_hum(data, 50.0, NOISE**2)
    left = [
        np.mean((a.record.yaw_rad - b.record.yaw_rad) ** 2)
        for a, b in zip(cleaned.runs, clean.runs, strict=True)
    ]
    # what the removed columns take of the noise itself, and at most a hundredth of the hum
    columns = 2 * 5 + (2 * 7 if depth else 0)
    noise = columns / clean.runs[0].record.yaw_rad.size * NOISE**2
    assert np.mean(left) < 3.0 * noise + 0.01 * hum.excess * NOISE**2
