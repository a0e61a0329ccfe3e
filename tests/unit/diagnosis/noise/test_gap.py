"""Is there a gap: chance is let pass at the stated rate, and a misfit in any band is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, kstest

from diagnosis.likelihood.residuals import resonance
from diagnosis.noise import gap
from diagnosis.noise.bands import p_values
from diagnosis.noise.colour import Colour
from diagnosis.noise.kinds import Estimated, Floor, StatedNoise
from diagnosis.noise.rounding import Rounded
from diagnosis.noise.sensor_noise import NoiseTrend
from diagnosis.settings import Settings
from tests.support.gap_campaigns import campaign, nominal

STEADY = NoiseTrend(0.0, 0.0, 0.0, judged=False)


def noise_of(kind, variance, stated, estimated=None):
    """Noise of a kind and a variance, rad², the same in all runs, as estimated where nothing else is given."""
    by_run = {f"r{i}": variance for i in range(1, 7)}
    return kind(by_run, stated, "", estimated or variance, 0.0, by_run)


NOISE = noise_of(Estimated, 1.6e-7, None)


@pytest.fixture(scope="module")
def fitted():
    return nominal(campaign())


def white(fitted, rng):
    return replace(fitted, residuals=[rng.normal(size=r.size) for r in fitted.residuals])


def at_a_kilohertz(fitted):
    """The same fit, as though four samples had been averaged for every block."""
    runs = tuple(replace(run, block=4) for run in fitted.problem.data.runs)
    return replace(fitted, problem=replace(fitted.problem, data=replace(fitted.problem.data, runs=runs)))


def verdict(fit, *, noise=NOISE, trend=STEADY, coarse_step=False):
    return gap.gap_test(fit, noise, trend, coarse_step=coarse_step)


@pytest.mark.slow
def test_white_residuals_raise_no_more_alarms_than_stated(fitted):
    rng = np.random.default_rng(12)
    trials = 2000
    alarms = sum(verdict(white(fitted, rng)).detected for _ in range(trials))
    assert alarms <= binom.ppf(0.9999, trials, Settings().gap.detection_rate)


def test_p_values_of_white_residuals_are_uniform(fitted):
    rng = np.random.default_rng(13)
    values = []
    for _ in range(300):
        found = p_values(white(fitted, rng))
        values.append([found[name] for name in ("f0", "2f0", "3f0", "offset")])
    for column in np.array(values)[:, :3].T:
        assert kstest(column, "uniform").pvalue > 1e-4
    # the fit takes one degree of freedom of the means; raw noise has it still, so p is a little small here
    assert np.mean(np.array(values)[:, 3] < 0.5) < 0.8


def test_a_tolerance_makes_the_tests_milder(fitted):
    fit = white(fitted, np.random.default_rng(14))
    milder, plain = p_values(fit, 1.03), p_values(fit)
    assert all(milder[name] >= plain[name] for name in plain)


def test_a_stated_noise_a_little_too_small_raises_no_alarm(fitted):
    """Residuals in units of a noise whose variance is stated a tenth too small, as few records may bear out."""
    residuals = [np.sqrt(1.1) * r for r in white(fitted, np.random.default_rng(14)).residuals]
    louder = replace(fitted, residuals=residuals)
    assert not verdict(louder, noise=noise_of(StatedNoise, 1.0, 1.0, 1.1)).detected
    assert verdict(louder, noise=noise_of(StatedNoise, 1.0, 1.0, 1.0)).detected


@pytest.mark.parametrize(("band", "multiple"), [("below", 0.25), ("f0", 1.0), ("2f0", 2.0), ("3f0", 3.0),
                                                ("above", 9.0)])  # fmt: skip
def test_a_line_in_any_band_is_seen_there(fitted, band, multiple):
    fit = white(fitted, np.random.default_rng(15))
    residuals = []
    for i, r in enumerate(fit.residuals):
        time = fit.problem.data.runs[i].interval * np.arange(r.size)
        residuals.append(r + 0.5 * np.sin(2.0 * np.pi * multiple * resonance(fit, i) * time))
    found = verdict(replace(fit, residuals=residuals))
    assert found.detected
    assert min(found.tests, key=found.tests.__getitem__) == band
    assert not found.noisy


def test_runs_of_their_own_zero_are_seen_in_the_means(fitted):
    fit = white(fitted, np.random.default_rng(16))
    sides = (1.0, -1.0) * 3
    found = verdict(replace(fit, residuals=[r + 0.15 * s for r, s in zip(fit.residuals, sides, strict=True)]))
    assert found.detected
    assert min(found.tests, key=found.tests.__getitem__) == "offset"
    data = fit.problem.data.with_runs(fit.problem.data.runs[:1])
    one_run = replace(fit, problem=replace(fit.problem, data=data), residuals=fit.residuals[:1])
    assert p_values(one_run)["offset"] == 1.0


def test_what_rounding_leaves_beside_white_noise_is_no_gap(fitted):
    """Residuals and errors of one distribution, of three times the power of the noise."""
    rng = np.random.default_rng(19)
    runs, std = fitted.problem.data.runs, np.sqrt(3.0)
    louder = replace(fitted, residuals=[std * r for r in white(fitted, rng).residuals])
    errors = [std * run.noise.scale * rng.normal(size=(16, run.reading.size)) for run in runs]
    rounding = Rounded(errors)
    assert verdict(louder).detected
    assert not verdict(louder, noise=replace(NOISE, rounding=rounding)).detected
    assert rounding.allowed_in(fitted.problem.data) is fitted.problem.data
    averaged = at_a_kilohertz(fitted).problem.data  # of four samples, which reduce white noise by as much
    raised = [run.noise.variance / NOISE.used for run in rounding.allowed_in(averaged).runs]
    assert raised == pytest.approx([3.0] * 6, rel=0.05)


FLAT = Colour(np.array([1.0, 10.0]), np.log(np.array([2.0, 2.0])), np.array([0.1, 0.1]), 0.0, 0.0, 0.0)


def test_every_kind_of_noise_says_how_it_was_found(fitted):
    """Noise of twice the power of the white noise assumed, in all frequencies."""
    data = fitted.problem.data
    for kind, source in ((StatedNoise, "stated"), (Estimated, "estimated"), (Floor, "floor")):
        noise = noise_of(kind, 1.6e-7, 1.6e-7, 1.76e-7).rounded(fitted, 4.0 * NOISE.std)
        assert (noise.source, noise.shown, noise.colour) == (source, source != "floor", None)
        assert (noise.margin, noise.std, noise.spread(np.ones(3))) == (pytest.approx(1.1), NOISE.std, 0.0)
        coloured = noise.coloured(FLAT, data)
        assert (coloured.source, coloured.shown, coloured.margin) == ("estimated", True, 1.0)
        assert coloured.std == pytest.approx(np.sqrt(2.0) * NOISE.std)
        assert coloured.spread(np.ones(3)) == pytest.approx(0.1)
        assert coloured.rounding is noise.rounding
        again = coloured.rounded(fitted, 4.0 * NOISE.std)
        assert (type(again), again.colour, again.std) == (type(coloured), FLAT, coloured.std)


def test_noise_that_misbehaves_is_a_gap_unless_a_coarse_step_explains_it(fitted):
    fit = white(at_a_kilohertz(fitted), np.random.default_rng(17))
    loud, floor = noise_of(Estimated, 4.0, 1.0), noise_of(Floor, 4.0, 1.0)
    cases = (
        ("noise against rate", {"trend": NoiseTrend(0.0, 15.0, 0.1)}),
        ("noise against amplitude", {"trend": NoiseTrend(-15.0, 0.0, 0.1)}),
        ("noise in bursts", {"trend": NoiseTrend(0.0, 0.0, 1.0)}),
        ("noise level", {"noise": loud}),
    )
    for name, options in cases:
        found = verdict(fit, **options)
        assert found.detected
        assert found.noisy
        assert min(found.tests, key=found.tests.__getitem__) == name
        quiet = verdict(fit, **options, coarse_step=True)
        assert not quiet.detected
        assert not quiet.noisy
    # where the accuracy of the fits stands in, the record's noise shows nothing
    assert not verdict(fit, noise=floor, trend=NoiseTrend(15.0, 15.0, 1.0)).noisy


def test_the_p_value_counts_the_tests(fitted):
    found = verdict(white(fitted, np.random.default_rng(18)))
    assert found.p_value == pytest.approx(min(1.0, min(found.tests.values()) * len(found.tests)))
    assert found.detected == (found.p_value < Settings().gap.detection_rate)


def test_a_step_in_the_reading_a_thousandth_of_a_swing_is_seen():
    """A gap that a χ² over all samples would miss: a drift of one standard deviation."""
    data = campaign(added=4e-4 * np.linspace(-0.5, 0.5, 2500), duration=10.0)
    fit = nominal(data)
    assert abs(fit.excess) < 0.15
    assert verdict(fit).detected
