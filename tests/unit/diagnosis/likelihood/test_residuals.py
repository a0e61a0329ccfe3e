"""Residuals by channel: what is planted in one is found there."""

import dataclasses

import numpy as np
import pytest

from diagnosis.likelihood.residuals import CHANNELS, misfit, resonance
from tests.support.gap_campaigns import campaign, nominal


@pytest.fixture(scope="module")
def fitted():
    return nominal(campaign())


def planted(fit, change):
    """What the channels hold beyond noise of a fit whose residuals are these changes of its motion alone."""
    residuals = []
    for i, (run, residual) in enumerate(zip(fit.problem.data.runs, fit.residuals, strict=True)):
        motion = run.scaled(run.reading - fit.zero(i)) - residual
        slope = np.gradient(motion) / (2.0 * np.pi * resonance(fit, i) * run.interval)
        residuals.append(change(motion, slope, np.linspace(0.0, 1.0, motion.size), i))
    found = misfit(fit, residuals)
    assert found.chi2.sum() == pytest.approx(sum(float(r @ r) for r in residuals))
    return dict(zip(CHANNELS, found.chi2 / found.chi2.sum(), strict=True))


CHANGES = {
    "damping": lambda motion, _, time, __: np.cos(5.0 * np.pi * time) * motion,
    "frequency": lambda _, slope, time, __: np.cos(5.0 * np.pi * time) * slope,
    "damping of runs": lambda motion, _, time, __: time * motion,
    "frequency of runs": lambda _, slope, time, run: (-1) ** run * time * slope,
    "zero": lambda _, __, time, ___: np.sin(np.pi * time),
    "harmonics": lambda motion, slope, _, __: motion**3 - 0.75 * motion * (motion**2 + slope**2),
}


@pytest.mark.parametrize(("channel", "change"), CHANGES.items())
def test_what_is_planted_in_a_channel_is_found_there(fitted, channel, change):
    found = planted(fitted, change)
    assert max(found, key=found.get) == channel
    assert found[channel] > 0.8


def test_noise_gives_as_much_as_it_has_values(fitted):
    rng = np.random.default_rng(2)
    trials = []
    for _ in range(60):
        noise = [rng.standard_normal(r.size) for r in fitted.residuals]
        found = misfit(fitted, noise)
        trials.append(found.excess / np.sqrt(2.0 * found.count))
    assert found.count.sum() == sum(r.size for r in fitted.residuals)
    mean = np.mean(trials, axis=0)
    assert np.all(np.abs(mean) < 5.0 / np.sqrt(60.0))  # of a standard normal by channel
    assert np.all(np.std(trials, axis=0) < 1.5)


def test_the_residuals_of_the_fit_are_taken_where_none_are_given(fitted):
    same = misfit(fitted, [r.copy() for r in fitted.residuals])
    np.testing.assert_array_equal(misfit(fitted).chi2, same.chi2)
    doubled = misfit(dataclasses.replace(fitted), [2.0 * r for r in fitted.residuals])
    np.testing.assert_allclose(doubled.chi2, 4.0 * same.chi2)
