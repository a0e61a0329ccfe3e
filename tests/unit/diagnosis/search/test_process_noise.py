"""A random moment: its likelihood finds what drove the rig, and it is not called for anything else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.stats import binom

from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.run_noise import NoiseWithMoment
from diagnosis.search import process_noise as pn
from diagnosis.search import random_moments
from diagnosis.search.evident import needed
from diagnosis.search.grow import grow
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.process_noise import MomentLayer, with_response
from diagnosis.search.random_moments import excess_elsewhere, is_no_noise, obeys_a_law, weigh_random_moments
from diagnosis.search.random_spectra import BROAD, CENTRED, STREAM, SpectrumPart, wandering
from diagnosis.search.steady_noise import (
    BURST_SHARE,
    bursts,
    departure_from_white,
    is_steady_noise,
    of_all_runs,
)
from diagnosis.search.weights import FittedSet
from diagnosis.settings import Settings
from tests.marks import slow
from tests.reference.linear_rig import response
from tests.support.gap_campaigns import (
    CN_BETA,
    CN_R,
    CONDITIONS,
    DAMPING,
    FOUR,
    INERTIA,
    INTERVAL,
    added,
    campaign,
    nominal,
    whole_runs,
    with_blow,
)
from tests.support.own_effects import OwnCubic
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.record import Record

AREA, LENGTH = 0.036, 0.625
BUFFETING = (effect_class("buffeting"),)
BOTH = (*BUFFETING, effect_class("vortex_shedding"))


ONE_SPEED = tuple((spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 25.0))


def four_runs(*effects):
    return campaign(*effects, conditions=FOUR)


def moment_of(answer: Hypothesis) -> MomentLayer:
    assert answer.moment is not None
    return answer.moment


def left(answer: Hypothesis) -> FittedSet:
    return moment_of(answer).left


def buffeted(data, intensity, bandwidth, seed=5):
    """A first-order random moment on every wind-on run, sampled exactly: the nominal model is linear."""
    rng = np.random.default_rng(seed)
    runs = []
    for run in data.runs:
        if run.wind_on:
            response = random_response(
                rng, run.spring_stiffness, run.wind_speed, intensity, bandwidth, run.record.yaw_rad.size
            )
            run = replace(run, record=Record(run.record.time_s, run.record.yaw_rad + response))
        runs.append(run)
    return replace(data, runs=tuple(runs))


def random_response(rng, spring, speed, intensity, bandwidth, count):
    pressure = 0.5 * 1.2 * speed**2 * AREA * LENGTH
    stiffness = spring - pressure * CN_BETA
    damping = DAMPING - pressure * LENGTH / speed * CN_R
    corner = 2.0 * np.pi * bandwidth
    dynamics = np.array(
        [[0, 1, 0], [-stiffness / INERTIA, -damping / INERTIA, pressure / INERTIA], [0, 0, -corner]], float
    )
    step = expm(dynamics * INTERVAL)
    # the covariance over one step, by the matrix exponential's block form
    drive = np.diag([0.0, 0.0, 2.0 * corner * intensity**2])
    block = expm(np.block([[-dynamics, drive], [np.zeros((3, 3)), dynamics.T]]) * INTERVAL)
    scatter = step @ block[:3, 3:]
    root = np.linalg.cholesky(0.5 * (scatter + scatter.T) + 1e-24 * np.eye(3))
    state = np.array([0.0, 0.0, intensity * rng.standard_normal()])
    angles = np.empty(count)
    for k in range(angles.size):
        angles[k] = state[0]
        state = step @ state + root @ rng.standard_normal(3)
    return angles


def fit_turbulence(base, *, centred=False):
    return pn._fit(pn._channels(base), (CENTRED if centred else BROAD,))


def fit_wandering_shedding(base):
    return pn._fit(pn._channels(base), (wandering(base.problem.data),))


@pytest.fixture(scope="module")
def windy():
    return nominal(buffeted(four_runs(), 0.01, 4.0))


@pytest.fixture(scope="module")
def found(windy):
    """The random moment fitted to the windy campaign."""
    found = fit_turbulence(windy)
    assert found is not None
    return found


def test_intensity_and_bandwidth_are_recovered(found):
    # at the rig only the level of the spectrum around resonance is seen well: intensity²/bandwidth
    (spectrum,) = found.spectrum
    assert spectrum.intensity**2 / spectrum.bandwidth == pytest.approx(0.01**2 / 4.0, rel=0.5)
    assert spectrum.intensity == pytest.approx(0.01, rel=0.5)
    assert found.drop > 1000.0
    assert abs(found.excess) < 0.1


def test_innovations_of_the_right_model_are_white_and_steady(found):
    assert departure_from_white(found) < 5.0
    assert bursts(found, 0.001) < 1.0
    assert len(found.innovations) == sum(speed > 0.0 for _, speed in FOUR)


@pytest.mark.parametrize("length", [1, 4, 16, 60])
def test_a_blow_in_steady_turbulence_is_a_burst(found, length):
    struck = [i.copy() for i in found.innovations]
    struck[0][100 : 100 + length] += 8.0 / length**0.25  # standard deviations
    assert bursts(replace(found, innovations=struck), 0.001) > 1.5


def test_a_jump_that_is_a_small_part_of_a_moment_is_no_burst(found):
    """Such as lost samples beside turbulence; a blow is a large part of the moment that is taken for it."""
    rng = np.random.default_rng(12)
    drawn = [rng.standard_normal(2000) for _ in range(3)]
    assert bursts(replace(found, innovations=drawn), 0.001, BURST_SHARE) < 1.0
    for size, counts in ((10.0, False), (25.0, True)):
        struck = [drawn[0].copy(), *drawn[1:]]
        struck[0][100] += size
        assert bursts(replace(found, innovations=struck), 0.001) > 1.5
        assert (bursts(replace(found, innovations=struck), 0.001, BURST_SHARE) > 1.5) is counts


def test_steady_innovations_burst_at_the_stated_rate_at_most(found):
    rng = np.random.default_rng(11)
    drawn = [[rng.standard_normal(400) for _ in range(3)] for _ in range(300)]
    alarms = sum(bursts(replace(found, innovations=innovations), 0.05) > 1.0 for innovations in drawn)
    assert 1 <= alarms <= binom.ppf(0.999, 300, 0.05)  # none at all would mean that it cannot fail


def test_a_random_moment_of_all_runs_is_taken_for_one_of_a_single_run_at_the_stated_rate_at_most(found):
    rng = np.random.default_rng(12)
    drawn = [rng.exponential(size=8) for _ in range(2000)]
    alarms = sum(of_all_runs(replace(found, by_run=power)) < 0.01 for power in drawn)
    assert binom.ppf(0.001, 2000, 0.01) <= alarms <= binom.ppf(0.999, 2000, 0.01)


def test_turbulence_in_one_run_is_not_that_of_the_stream(found):
    assert of_all_runs(found) > 0.1
    assert is_steady_noise(found, Settings().moment)
    assert not is_steady_noise(replace(found, by_run=np.array([1.0, *np.full(7, 0.01)])), Settings().moment)
    blown, still = buffeted(campaign(), 0.01, 4.0), campaign()
    last = max(i for i, (_, speed) in enumerate(CONDITIONS) if speed > 0.0)
    runs = tuple(blown.runs[i] if i == last else run for i, run in enumerate(still.runs))
    base = nominal(replace(still, runs=runs))
    assert not is_steady_noise(fit_turbulence(base), Settings().moment)
    assert weigh_random_moments(whole_runs(base, BOTH), []) == []


def test_without_a_random_moment_there_is_nothing_to_gain():
    found = fit_turbulence(nominal(four_runs()))
    assert found is not None
    assert found.drop < 20.0  # χ² of two parameters, fitted over a grid


def deflected(data, coefficient):
    """Every wind-on run about the angle where the spring holds a steady moment, as a misaligned flow has it."""
    runs = []
    for run in data.runs:
        pressure = 0.5 * 1.2 * run.wind_speed**2 * AREA * LENGTH
        angle = pressure * coefficient / (run.spring_stiffness - pressure * CN_BETA)
        runs.append(replace(run, record=Record(run.record.time_s, run.record.yaw_rad + angle)))
    return replace(data, runs=tuple(runs))


def test_a_law_that_is_missing_is_no_random_moment(monkeypatch):
    base = nominal(deflected(four_runs(), 0.005))
    assert obeys_a_law(base, STREAM)
    assert is_no_noise(base)  # so that none is even sought
    for guard in ("obeys_a_law", "is_no_noise", "is_slow"):  # each run rests at its own angle, which is slow
        assert weigh_random_moments(whole_runs(base, BOTH), []) == []
        monkeypatch.setattr(random_moments, guard, lambda *_: False)
    assert [answer.names for answer in weigh_random_moments(whole_runs(base, BOTH), [])] == [("buffeting",)]


@pytest.mark.parametrize("bandwidth", [slow(0.05), slow(0.5), 10.0])
def test_a_random_moment_obeys_no_law(bandwidth):
    for seed in range(2):
        blown = nominal(buffeted(four_runs(), 0.01, bandwidth, seed))
        assert not obeys_a_law(blown, STREAM)
        assert not is_no_noise(blown)


def test_buffeting_is_offered_where_it_blows(windy):
    (answer,) = weigh_random_moments(whole_runs(windy, BOTH), [])
    assert answer.names == ("buffeting",)
    assert left(answer).share < 0.1


@pytest.mark.slow
def test_turbulence_is_not_called_vortices_where_buffeting_is_excluded():
    """A narrow spectrum that follows the wind takes up turbulence too; the broad one explains it better."""
    base = nominal(buffeted(four_runs(), 0.002, 1.0))
    narrow = fit_wandering_shedding(base)
    assert narrow is not None
    assert narrow.drop > Settings().moment.acts_from
    assert weigh_random_moments(whole_runs(base, BOTH[1:]), []) == []


def test_a_rival_beside_turbulence_is_an_answer_as_well():
    strong = effect_from("cubic_stiffness", {"coefficient": -0.2})
    base = nominal(buffeted(four_runs(strong), 0.0012, 4.0))
    (start, *_) = starting_points(base, type(strong))
    spring = Hypothesis(("cubic_stiffness",), fit(start.problem, start.point, base=base))
    view = whole_runs(base, (*BUFFETING, type(strong), OwnCubic, effect_class("coulomb_friction")))
    one, other = weigh_random_moments(view, [spring])
    assert {one.names, other.names} == {("buffeting", "cubic_stiffness"), ("buffeting", "own_cubic")}
    assert left(other).excess == pytest.approx(left(one).excess, rel=0.01, abs=1.0)


@pytest.mark.slow
def test_skips_beside_strong_turbulence_are_placed_where_they_are():
    """Least squares takes the motion that turbulence drives for white noise, and misplaces them."""
    base = nominal(
        buffeted(campaign(effect_from("dropped_samples", {"lost_time": 0.006}), duration=10.0), 0.01, 4.0)
    )
    (start,) = starting_points(base, effect_class("dropped_samples"))
    white = fit(start.problem, start.point, base=base)
    planted = np.linspace(0.2, 0.8, len(CONDITIONS))  # shares of the runs
    assert np.max(np.abs(white.point.per_run[:, -1] - planted)) > 0.05
    kinds = (*BUFFETING, effect_class("dropped_samples"))
    (answer,) = weigh_random_moments(whole_runs(base, kinds), [Hypothesis(("dropped_samples",), white)])
    assert answer.names == ("buffeting", "dropped_samples")
    found = answer.fit
    assert found.point.per_run[:, -1] == pytest.approx(planted, abs=0.005)
    assert found.value("dropped_samples.lost_time") == pytest.approx(0.006, rel=0.01)
    assert abs(excess_elsewhere(found, moment_of(answer).process.runs)) < 0.1


@pytest.mark.slow
def test_beside_turbulence_that_misleads_all_sets_they_are_grown_anew():
    friction = effect_from("coulomb_friction", {"friction_moment": 0.003})
    spring = effect_from("cubic_stiffness", {"coefficient": -0.03})
    base = nominal(buffeted(campaign(friction, spring, duration=10.0), 0.02, 4.0))
    names = ("buffeting", "coulomb_friction", "cubic_stiffness", "quadratic_damping")
    kinds = [effect_class(name) for name in names]
    misled = grow(whole_runs(base, kinds[1:]))
    (answer,) = weigh_random_moments(whole_runs(base, kinds), misled)
    assert answer.names == ("buffeting", "coulomb_friction", "cubic_stiffness")
    found = answer.fit
    assert found.value("coulomb_friction.friction_moment") == pytest.approx(0.003, rel=0.05)
    assert found.value("cubic_stiffness.coefficient") == pytest.approx(-0.03, rel=0.05)
    assert abs(excess_elsewhere(found, moment_of(answer).process.runs)) < 0.1


@pytest.mark.slow
def test_an_effect_of_the_wind_that_is_weak_beside_turbulence_is_found():
    """It closes too little of the gap to be compared by shares, but far more than chance."""
    base = nominal(
        buffeted(
            campaign(effect_from("nonlinear_yaw_moment", {"coefficient": 0.6}), duration=10.0), 0.004, 4.0
        )
    )
    kinds = (*BUFFETING, effect_class("nonlinear_yaw_moment"), effect_class("nonlinear_yaw_damping"))
    (answer,) = weigh_random_moments(whole_runs(base, kinds), [])
    assert answer.names == ("buffeting", "nonlinear_yaw_moment")
    assert answer.fit.value("nonlinear_yaw_moment.coefficient") == pytest.approx(0.6, rel=0.5)


def test_turbulence_as_noise_leaves_white_residuals_of_the_stated_variance(windy, found):
    data = with_response(windy, found.spectrum)
    again = fit(replace(windy.problem, data=data), windy.point)
    for run, residual in zip(data.runs, again.residuals, strict=True):
        assert np.mean(residual**2) == pytest.approx(1.0, abs=0.2)
        assert isinstance(run.noise, NoiseWithMoment) == run.wind_on
        neighbours = float(residual[1:] @ residual[:-1]) / float(residual @ residual)
        assert abs(neighbours) < 4.0 / np.sqrt(residual.size)
        start = residual[: residual.size // 20]  # the rig is at rest there: its response begins with the run
        assert np.mean(start**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / start.size))


def test_turbulence_that_is_slowly_forgotten_can_be_noise(windy):
    assert with_response(windy, (SpectrumPart(1e-3, 0.03),)) is not None


def test_one_gust_is_no_buffeting():
    struck = with_blow(four_runs(), 0.01, 5.5)
    struck = replace(
        struck,
        runs=tuple(
            b if b.wind_on else a for a, b in zip(four_runs().runs, struck.runs, strict=True)
        ),
    )  # fmt: skip
    assert weigh_random_moments(whole_runs(nominal(struck), BOTH), []) == []


def test_turbulence_that_misleads_the_fit_of_still_air_is_tried_where_it_is_steady(monkeypatch, windy):
    settled = []
    monkeypatch.setattr(random_moments, "_settled", lambda best, *_: settled.append(best) or (best, set()))
    runs = windy.problem.data.runs
    misled = [r if run.wind_on else 300.0 * r for run, r in zip(runs, windy.residuals, strict=True)]
    fitted = replace(windy, residuals=misled, chi2=np.array([float(r @ r) for r in misled]))
    weigh_random_moments(whole_runs(fitted, BOTH), [])
    assert len(settled) == 1
    drifting = [
        r * np.linspace(0.2, 1.8, r.size) if run.wind_on else r for run, r in zip(runs, misled, strict=True)
    ]
    weigh_random_moments(whole_runs(replace(fitted, residuals=drifting), BOTH), [])
    assert len(settled) == 1


DRIFT = effect_from("sensor_drift", {"drift": 0.01})
SPRING = effect_from("cubic_stiffness", {"coefficient": 0.1})


def test_an_effect_that_growth_misses_in_the_first_noise_is_added_in_the_next(monkeypatch):
    """Growth finds the drift alone; the spring acts beside it, and both beside turbulence."""

    def grown(view):
        point = starting_points(view.base, type(DRIFT))[0]
        return [Hypothesis((DRIFT.name,), fit(point.problem, point.point))]

    monkeypatch.setattr(random_moments, "grow", grown)
    kinds, drifting = (*BUFFETING, type(SPRING)), nominal(buffeted(four_runs(DRIFT, SPRING), 0.003, 3.0))
    (answer,) = weigh_random_moments(whole_runs(drifting, kinds), [])
    assert answer.names == ("buffeting", "cubic_stiffness", "sensor_drift")


def test_a_gap_in_still_air_is_no_buffeting():
    fit = nominal(four_runs(effect_from("quadratic_damping", {"coefficient": 0.003})))
    assert excess_elsewhere(fit, fit_turbulence(fit).runs) > 0.1
    assert weigh_random_moments(whole_runs(fit, BOTH), []) == []


def test_where_an_effect_closes_the_gap_no_random_moment_is_tried(windy):
    noise = np.random.default_rng(5)
    residuals = [noise.standard_normal(r.size) for r in windy.residuals]
    closed = replace(windy, residuals=residuals, chi2=np.array([float(r @ r) for r in residuals]))
    assert weigh_random_moments(whole_runs(windy, BOTH), [Hypothesis(("free_play",), closed)]) == []


def test_runs_without_wind_have_no_random_moment():
    still = campaign()
    still = replace(still, runs=tuple(run for run in still.runs if not run.wind_on))
    assert fit_turbulence(nominal(still)) is None


def with_moment(data, moment):
    """A moment coefficient added to every wind-on run: ``moment(time, speed)`` at 2 kHz, held over its samples."""
    runs = []
    for run in data.runs:
        if run.wind_on:
            speed = run.wind_speed
            pressure = 0.5 * 1.2 * speed**2 * AREA * LENGTH
            stiffness, damping = (
                run.spring_stiffness - pressure * CN_BETA,
                DAMPING - pressure * LENGTH / speed * CN_R,
            )
            time = np.arange(2 * run.record.yaw_rad.size) * INTERVAL / 2
            given = pressure * moment(time, speed)
            angle = response(given, INTERVAL / 2, INERTIA, damping, stiffness)[::2]
            run = replace(run, record=Record(run.record.time_s, run.record.yaw_rad + angle))
        runs.append(run)
    return replace(data, runs=tuple(runs))


def wandering_vortices(strouhal, amplitude, seed):
    """A moment at a frequency that follows the wind, of 0.02 Hz and more, whose phase is a random walk."""
    rng, width = np.random.default_rng(seed), 0.225

    def moment(time, speed):
        walk = 0.5 * np.cumsum(rng.standard_normal(time.size)) * np.sqrt(time[1])
        return amplitude * np.sin(2.0 * np.pi * strouhal * speed / width * time + walk)

    return moment


def test_vortices_whose_phase_wanders_are_shedding_and_not_turbulence():
    strouhal = 0.15
    fit = nominal(with_moment(four_runs(), wandering_vortices(strouhal, 0.05, seed=8)))
    found = fit_wandering_shedding(fit)
    assert found is not None
    assert found.spectrum[0].strouhal_number == pytest.approx(strouhal, rel=0.01)
    assert np.sqrt(2.0) * found.spectrum[0].intensity == pytest.approx(0.05, rel=0.4)
    (answer,) = weigh_random_moments(whole_runs(fit, BOTH), [])
    assert answer.names == ("vortex_shedding",)
    assert left(answer).share < 0.1
    assert weigh_random_moments(whole_runs(fit, BUFFETING), []) == []


def test_at_one_wind_speed_vortices_are_not_told_from_turbulence_about_a_frequency():
    """The frequency of vortices follows the wind, which one speed cannot show: both are answers, as likely."""
    one_speed = with_moment(campaign(conditions=ONE_SPEED), about_a_frequency(0.3, 8.0))
    found = weigh_random_moments(whole_runs(nominal(one_speed), BOTH), [])
    assert {answer.names for answer in found} == {("vortex_shedding",), ("buffeting",)}
    assert left(found[0]).share == pytest.approx(left(found[1]).share, abs=0.02)


def both_at_once():
    return nominal(with_moment(buffeted(campaign(), 0.006, 2.0), wandering_vortices(0.15, 0.05, seed=8)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", BOTH)
def test_one_kind_alone_does_not_explain_turbulence_and_vortices(kind):
    assert weigh_random_moments(whole_runs(both_at_once(), (kind,)), []) == []


def test_turbulence_and_vortices_at_once_are_one_spectrum_with_two_parts():
    """The steady filter of both parts whitens what neither of them does alone."""
    base = both_at_once()
    for alone in (fit_turbulence(base), fit_turbulence(base, centred=True), fit_wandering_shedding(base)):
        assert not is_steady_noise(alone, Settings().moment)
    (answer,) = weigh_random_moments(whole_runs(base, BOTH), [])
    assert answer.names == ("buffeting", "vortex_shedding")
    parts = {part.band: part for part in moment_of(answer).process.spectrum}
    assert parts["broad_band"].intensity == pytest.approx(0.006, rel=0.5)
    assert parts["narrow_band"].strouhal_number == pytest.approx(0.15, rel=0.01)
    assert np.sqrt(2.0) * parts["narrow_band"].intensity == pytest.approx(0.05, rel=0.4)


def test_the_covariance_of_two_parts_is_that_of_independent_moments():
    """From rest both responses add; compared at one spectrum whose parts are equal to twice its power."""
    fit = nominal(buffeted(four_runs(), 0.01, 4.0))
    one, two = SpectrumPart(0.01 * np.sqrt(2.0), 4.0), SpectrumPart(0.01, 4.0)
    whole, halves = with_response(fit, (one,)), with_response(fit, (two, two))
    for run, other in zip(whole.runs, halves.runs, strict=True):
        assert other.noise.variance == pytest.approx(run.noise.variance, rel=1e-9)


def test_vortices_beside_a_slow_error_of_one_run_have_one_part(monkeypatch):
    """A second part would take the error up, and be named turbulence; it shows in too few runs."""
    data = with_moment(four_runs(), wandering_vortices(0.15, 0.05, seed=8))
    *others, last = data.runs
    creeping = 4e-4 * last.record.time_s / last.record.time_s[-1]  # rad
    last = replace(last, record=Record(last.record.time_s, last.record.yaw_rad + creeping))
    base = nominal(replace(data, runs=(*others, last)))

    def second_parts():
        again = replace(base)  # a fit's random moments are sought once
        return {part.band for one in pn.random_moments(again, STREAM) for part in one.spectrum[1:]}

    assert "broad_band" not in second_parts()
    monkeypatch.setattr(pn, "_pays_in_all_runs", lambda *_: True)
    assert "broad_band" in second_parts()


@pytest.mark.slow
def test_turbulence_of_another_spectrum_is_not_called_vortices_beside_turbulence():
    """An octave with sharp edges has two parts, both of them turbulence."""
    rng = np.random.default_rng(3)

    def octave(time, speed):
        del speed
        white = np.fft.rfft(rng.standard_normal(time.size))
        frequency = np.fft.rfftfreq(time.size, time[1])
        white[(frequency < 4.0) | (frequency > 8.0)] = 0.0
        found = np.fft.irfft(white, time.size)
        return 0.03 * found / np.std(found)

    base = nominal(with_moment(campaign(), octave))
    found = pn.likeliest(pn.random_moments(base, STREAM), Settings().moment)
    assert [part.band for part in found.spectrum] == ["broad_band", "broad_band"]
    (answer,) = weigh_random_moments(whole_runs(base, BOTH), [])
    assert answer.names == ("buffeting",)


def about_a_frequency(bandwidth, centre):
    """A moment of first order about a fixed frequency, both in Hz."""
    rng = np.random.default_rng(9)

    def moment(time, speed):
        del speed
        corner, turn = 2.0 * np.pi * bandwidth, 2.0 * np.pi * centre
        pole = np.exp((-corner + 1j * turn) * time[1])
        drive = rng.standard_normal(time.size) + 1j * rng.standard_normal(time.size)
        return 0.02 * np.real(lfilter([np.sqrt(1.0 - abs(pole) ** 2)], [1.0, -pole], drive))

    return moment


def test_turbulence_about_a_frequency_is_recovered():
    fit = nominal(with_moment(four_runs(), about_a_frequency(0.8, 5.0)))
    broad, centred = fit_turbulence(fit), fit_turbulence(fit, centred=True)
    assert broad is not None
    assert centred is not None
    assert centred.spectrum[0].centre == pytest.approx(5.0, rel=0.1)
    assert centred.cost < broad.cost - 100.0


def test_an_effect_that_is_not_evident_beside_a_random_moment_goes():
    """Vortices have a phase in every run, so they fit some of any random motion; the friction is there."""
    known = four_runs(effect_from("coulomb_friction", {"friction_moment": 0.004}))
    base = nominal(buffeted(known, 3e-3, 1.0))
    noisy = replace(base.problem, data=with_response(base, (SpectrumPart(3e-3, 1.0, source=STREAM),)))
    fitted = added(fit(noisy, base.point), "coulomb_friction", "vortex_shedding")
    both = Hypothesis(("coulomb_friction", "vortex_shedding"), fitted)
    assert needed(both).effects == ("coulomb_friction",)
