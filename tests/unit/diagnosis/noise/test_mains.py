"""The hum of the mains: found where it is, taken out whole, and not found in motions with corners."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri
from scipy.stats import binom

from diagnosis.findings.cautions import remark
from diagnosis.likelihood.mains_lines import mains_line, mains_lines
from diagnosis.noise.mains import find_hum, hum_noted, refine_frequency, remove_hum
from diagnosis.search.investigate import nominal_study
from diagnosis.settings import Settings
from tests.marks import slow
from tests.reference import free_decays
from tests.reference.free_decays import SIX, Setting, angle_of, with_records
from tests.support.gap_campaigns import nominal
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.physics.forward import backlash
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Record

NOISE = 4e-4


def decays(seed=1, rate=500.0, duration=6.0):
    return free_decays.campaign(
        SIX, noise=NOISE, rate=rate, duration=duration, rng=np.random.default_rng(seed)
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
    cleaned, hum = remove_hum(data, refined, NOISE**2, Settings().read_off)
    assert abs(hum.amplitude - amplitude) < 4.0 * hum.std + 0.01 * amplitude
    assert hum.excess == pytest.approx(0.5 * amplitude**2 * (1.0 + 0.3**2) / NOISE**2, rel=0.1)
    left = [
        np.mean((a.record.yaw_rad - b.record.yaw_rad) ** 2)
        for a, b in zip(cleaned.runs, clean.runs, strict=True)
    ]
    # nine in a thousand of the hum at the most, where the frequency of a short record is off by its error
    assert np.mean(left) < 0.02 * hum.excess * NOISE**2
    assert find_hum(nominal(cleaned)) is None


@pytest.mark.parametrize("frequency", [49.1, slow(50.4), slow(59.2), slow(60.0), 60.9])
def test_a_hum_is_found_wherever_grids_wander(frequency):
    found = nominal_study(humming(decays(), 1e-3, frequency), ALL_EFFECTS)
    assert found.prepared.hum is not None
    assert found.similarity.own(found.prepared.hum.frequency, "Hz") == pytest.approx(frequency, abs=3e-3)
    assert found.prepared.hum.amplitude == pytest.approx(1e-3, abs=4.0 * found.prepared.hum.std)
    assert found.prepared.hum.harmonic == 1
    assert not found.gap.test.detected


@pytest.mark.parametrize("frequency", [44.0, slow(55.0), slow(65.0), 72.0])
def test_a_line_elsewhere_is_not_a_hum(frequency):
    assert nominal_study(humming(decays(), 1e-3, frequency), ALL_EFFECTS).prepared.hum is None


#: Sample rate and mains, Hz, the multiple that hums, and where it then appears, Hz.
FOLDED = [
    (100.0, 60.0, 1, 40.0),
    slow(90.0, 50.0, 1, 40.0),
    slow(90.0, 60.2, 1, 29.8),
    slow(80.0, 49.8, 1, 30.2),
    (125.0, 60.0, 2, 5.0),
    (170.0, 49.9, 2, 70.2),
    slow(250.0, 59.9, 3, 70.3),
    (500.0, 60.0, 2, 120.0),
]


@pytest.mark.parametrize(("rate", "mains", "multiple", "place"), FOLDED)
def test_a_hum_is_found_where_the_sample_rate_folds_it(rate, mains, multiple, place):
    settings = [Setting(16.12, speed) for speed in (0.0, 15.0, 25.0)]
    clean = free_decays.campaign(
        settings, noise=NOISE, rate=rate, duration=10.0, rng=np.random.default_rng(2)
    )
    data = humming(clean, 2e-3, multiple * mains)
    folded = abs(multiple * mains - rate * round(multiple * mains / rate))
    assert folded == pytest.approx(place, abs=1e-9)
    stated = Settings().changed({"read_off.mains_hz": round(mains, -1)})
    found = nominal_study(data, ALL_EFFECTS, stated)
    if multiple > 1 and multiple * mains > 0.5 * rate:  # alone, it may be a line of another source
        assert nominal_study(data, ALL_EFFECTS).prepared.hum is None
    if place < 3.0 * 2.1:  # within the harmonics of a motion of 2 Hz
        assert found.prepared.hum is None
        return
    assert found.prepared.hum is not None
    assert found.similarity.own(found.prepared.hum.frequency, "Hz") == pytest.approx(mains, abs=3e-3)
    assert found.prepared.hum.harmonic == multiple
    assert found.prepared.hum.amplitude == pytest.approx(2e-3, abs=4.0 * found.prepared.hum.std)
    assert not found.gap.test.detected
    noted = hum_noted(found.campaign, found.prepared.hum, found.similarity)
    said = [remark(one).what for one in noted]
    assert any(f"appears at {place:.5g} Hz" in one for one in said) == (place != multiple * mains)
    assert any("times the mains' frequency" in one for one in said) == (multiple > 1)
    assert nominal_study(clean, ALL_EFFECTS).prepared.hum is None


#: Sample rate, and the line of a structure, Hz, where a multiple of 50 or 60 Hz within 1.1 % of it is folded to.
STRUCTURAL = [(240.0, 12.76), slow(240.0, 41.2), slow(170.0, 70.2), slow(130.0, 10.9), slow(200.0, 48.6)]


@pytest.mark.parametrize(("rate", "place"), STRUCTURAL)
def test_a_structural_line_is_not_a_folded_harmonic(rate, place):
    """Of motions of 1 Hz: the folded ranges cover a quarter of the spectrum at such rates."""
    settings = [Setting(4.0, speed) for speed in (0.0, 5.0, 8.0)]
    clean = free_decays.campaign(
        settings, noise=NOISE, rate=rate, duration=10.0, rng=np.random.default_rng(6)
    )
    assert nominal_study(humming(clean, 1e-3, place), ALL_EFFECTS).prepared.hum is None


@pytest.mark.parametrize(("rate", "mains"), [(240.0, 50.4), slow(170.0, 59.8)])
def test_a_folded_harmonic_beside_its_fundamental_is_a_hum(rate, mains):
    settings = [Setting(16.12, speed) for speed in (0.0, 15.0, 25.0)]
    clean = free_decays.campaign(
        settings, noise=NOISE, rate=rate, duration=10.0, rng=np.random.default_rng(7)
    )
    data = humming(clean, 3e-4, mains, third=5.0)
    found = nominal_study(data, ALL_EFFECTS)
    assert found.prepared.hum is not None
    assert found.similarity.own(found.prepared.hum.frequency, "Hz") == pytest.approx(mains, abs=3e-3)
    assert found.prepared.hum.harmonic == 3
    assert not found.gap.test.detected


def test_the_width_that_is_searched_is_priced():
    """At 240 Hz all multiples cover a tenth of the spectrum and more, the fundamentals a twentieth."""
    clean = decays(rate=240.0, duration=8.0)
    lines = {(line.harmonic, round(line.parameter, -1)): line for line in mains_lines(nominal(clean))}
    first = lines[1, 50.0]
    assert 0.02 < first.covered < 0.06  # 2 % of 50 and of 60 Hz to either side, of about 110 Hz
    assert max(line.covered for line in lines.values()) > 2.5 * first.covered
    data = humming(clean, 1e-3)
    strict = Settings().changed({"read_off.hum_covered": 0.5 * first.covered})
    assert nominal_study(data, ALL_EFFECTS).prepared.hum is not None
    assert nominal_study(data, ALL_EFFECTS, strict).prepared.hum is None


@pytest.mark.parametrize(("rate", "multiple"), [(110.0, 1), (220.0, 2)])
def test_what_the_sample_rate_cannot_tell_apart_is_said(rate, multiple):
    """At 110 Hz all multiples of 50 and of 60 Hz appear at the same places, and at 220 Hz the even ones do."""
    data = humming(decays(rate=rate, duration=10.0), 2e-3, multiple * 60.0)
    found = nominal_study(data, ALL_EFFECTS)
    assert found.prepared.hum is not None
    own = found.similarity.own(found.prepared.hum.frequency, "Hz")
    noted = hum_noted(found.campaign, found.prepared.hum, found.similarity)
    said = [remark(one).what for one in noted]
    assert own == pytest.approx(50.0, abs=3e-3)
    assert any(one.startswith(f"mains of {110.0 - own:.5g} Hz would show the same line") for one in said)
    assert not found.gap.test.detected


def test_a_mode_that_decays_is_not_a_hum():
    def ring(rate):
        return lambda t, y: y + 3e-3 * np.exp(-rate * t) * np.sin(2.0 * np.pi * 60.0 * t)

    assert nominal_study(with_records(decays(), ring(0.5)), ALL_EFFECTS).prepared.hum is None
    assert nominal_study(with_records(decays(), ring(0.0)), ALL_EFFECTS).prepared.hum is not None


@pytest.mark.parametrize(("orders", "hums"), [((13, 19), False), ((25,), True)])
def test_a_line_at_a_multiple_of_the_motion_is_a_hum_only_where_the_motion_has_no_others(orders, hums):
    """A motion whose 25th multiple is at 50 Hz, and which has the 13th and the 19th as well."""
    truth = free_decays.Truth(yaw_inertia=16.12 / (4.0 * np.pi) ** 2, mechanical_damping=0.001)
    data = free_decays.campaign(
        (Setting(16.12, 0.0),) * 2, truth=truth, noise=NOISE, duration=20.0, rng=np.random.default_rng(8)
    )

    def add(t, y):
        return y + sum(1e-3 * np.sin(4.0 * np.pi * k * t + k) for k in {25, *orders})

    assert (nominal_study(with_records(data, add), ALL_EFFECTS).prepared.hum is not None) == hums


def test_a_hum_that_only_some_sample_rates_show_is_found_and_removed():
    fast = decays()
    slow = decays(rate=50.0, duration=8.0)  # 50 Hz would be at rest
    data = humming(replace(fast, runs=(*fast.runs[:4], *slow.runs[4:])), 1e-3)
    found = nominal_study(data, ALL_EFFECTS)
    assert found.prepared.hum is not None
    assert found.prepared.hum.amplitude == pytest.approx(1e-3, abs=4.0 * found.prepared.hum.std)


def noise_only(base, rng):
    """The fit of a campaign whose residuals are white noise of unit variance."""
    return replace(base, residuals=[rng.standard_normal(one.size) for one in base.residuals])


@pytest.mark.parametrize(("runs", "rate"), [slow(1, 250.0), slow(1, 90.0), (6, 250.0)])
def test_white_noise_is_a_hum_no_oftener_than_stated(runs, rate):
    """Of a thousand campaigns one may have a line beyond chance, all frequencies and multiples together."""
    data = decays(rate=rate, duration=8.0)
    base = nominal(replace(data, runs=data.runs[:runs]))
    rng = np.random.default_rng(5)
    trials = 600 if runs == 1 else 12
    beyond = found = 0
    for _ in range(trials):
        fit = noise_only(base, rng)
        lines = mains_lines(fit)
        beyond += any(
            line.drop > chdtri(line.freedom, Settings().read_off.hum_rate / line.trials) for line in lines
        )
        found += find_hum(fit) is not None
    assert beyond <= binom.ppf(1.0 - 1e-3, trials, 1e-3)
    assert found <= beyond


@pytest.mark.slow
def test_the_amplitude_s_error_is_as_stated():
    pulls = []
    for seed in range(20):
        _, hum = remove_hum(humming(decays(seed), 3e-4), 50.0, NOISE**2, Settings().read_off)
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
    assert found.prepared.hum is not None
    own = found.similarity.own
    assert own(found.prepared.hum.frequency, "Hz") == pytest.approx(50.0, abs=3e-3)
    assert found.prepared.hum.amplitude == pytest.approx(1e-3, rel=0.02)
    assert found.prepared.hum.excess == pytest.approx(0.5 * 1e-3**2 / NOISE**2, rel=0.1)
    assert not found.gap.test.detected
    assert nominal_study(clean, ALL_EFFECTS).prepared.hum is None


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
    settings = iter(SIX)
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
    cleaned, hum = remove_hum(data, 50.0, NOISE**2, Settings().read_off)
    left = [
        np.mean((a.record.yaw_rad - b.record.yaw_rad) ** 2)
        for a, b in zip(cleaned.runs, clean.runs, strict=True)
    ]
    # what the removed columns take of the noise itself, and at most a hundredth of the hum
    columns = 2 * 5 + (2 * 7 if depth else 0)
    noise = columns / clean.runs[0].record.yaw_rad.size * NOISE**2
    assert np.mean(left) < 3.0 * noise + 0.01 * hum.excess * NOISE**2


def wandering(data, amplitude):
    """A hum whose frequency walks at random: by 2 mHz in half a second, as on a large grid, and ten times that."""
    rng = np.random.default_rng(5)

    def add(t, y):
        knots = np.arange(0.0, t[-1] + 1.0, 0.5)
        turns = np.concatenate(
            [[0.0], np.cumsum(0.5 * (50.0 + np.cumsum(rng.normal(0.0, 0.02, knots.size - 1))))]
        )
        return y + amplitude * np.sin(
            2.0 * np.pi * np.interp(t, knots, turns) + rng.uniform(0.0, 2.0 * np.pi)
        )

    return with_records(data, add)


def test_a_hum_that_wanders_is_taken_out_at_the_ends_as_well():
    """The rest of a hum at an end would be a burst, as no steady noise has."""
    clean, amplitude = decays(duration=12.0), 4e-3
    data = wandering(clean, amplitude)
    frequency = refine_frequency(data, 50.0)
    cleaned, _ = remove_hum(data, frequency, NOISE**2, Settings().read_off)
    apart = [a.record.yaw_rad - b.record.yaw_rad for a, b in zip(cleaned.runs, clean.runs, strict=True)]
    ends = np.concatenate([np.concatenate([one[:300], one[-300:]]) for one in apart])
    assert np.mean(np.concatenate(apart) ** 2) < 0.01 * 0.5 * amplitude**2
    assert np.mean(ends**2) < 0.02 * 0.5 * amplitude**2


def test_of_uneven_samples_a_hum_near_a_fast_motion_is_taken_out():
    """The curve that takes out the motion first follows no line, though it could follow one of this frequency."""
    fast = (Setting(750.0, 0.0), Setting(750.0, 20.0), Setting(600.0, 20.0))
    clean = free_decays.campaign(fast, noise=NOISE, rate=1000.0, duration=4.0, rng=np.random.default_rng(6))
    data, rng = humming(clean, 2e-3), np.random.default_rng(7)
    kept = [np.flatnonzero(rng.random(run.record.time_s.size) < 0.7) for run in data.runs]

    def some(campaign):
        runs = [
            replace(run, record=Record(run.record.time_s[place], run.record.yaw_rad[place]))
            for run, place in zip(campaign.runs, kept, strict=True)
        ]
        return replace(campaign, runs=tuple(runs))

    cleaned, hum = remove_hum(some(data), 50.0, NOISE**2, Settings().read_off, motion=13.7)
    assert hum.amplitude == pytest.approx(2e-3, rel=0.05)
    for one, other in zip(cleaned.runs, some(clean).runs, strict=True):
        assert np.mean((one.record.yaw_rad - other.record.yaw_rad) ** 2) < 0.02 * 0.5 * 2e-3**2
