"""Monte-Carlo: errors against the Cramér–Rao bound, intervals against their stated coverage, cases that must fail.

One harness judges scores; the planted cases feed it a wrong noise level and must be caught. Seeds are fixed;
the false-alarm rate is that of an efficient estimator over the choice of seeds.
"""

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom, chi2

from identification import Status
from identification.estimators.conventional import Conventional
from identification.estimators.output_error import OutputError
from identification.uncertainty.cramer_rao import campaign_bound
from tests.reference.free_decays import RESOLUTION, Setting, Truth, campaign

NAMES = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")
SEEDS = 2000
NOISE = 5e-4
FALSE_ALARM = 1e-3  # of one verdict on four quantities
SETTINGS = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0, 24.0))
SHAPE = {"duration": 10.0, "rate": 200.0, "resolution": RESOLUTION}
NO_WINDOWS = 10**6  # cycles in a window: longer than any record, and the trials are quicker

pytestmark = pytest.mark.slow


def bound():
    found = campaign_bound(
        campaign(SETTINGS, **SHAPE),
        Truth(),
        noise_std=float(np.hypot(NOISE, RESOLUTION / np.sqrt(12.0))),
    )
    return np.array([found.std(name) for name in NAMES])


@cache
def trials(method, noise=NOISE, seeds=SEEDS):
    """Errors and claimed deviations, shape (seeds, 4), and how many trials raised a flag."""
    errors, deviations, flagged = [], [], 0
    truth = np.array([getattr(Truth(), name) for name in NAMES])
    for seed in range(seeds):
        data = campaign(SETTINGS, noise=noise, stated_noise=NOISE, rng=np.random.default_rng(seed), **SHAPE)
        estimate = method.estimate(data)
        flagged += estimate.status is not Status.OK
        quantities = [getattr(estimate, name) for name in NAMES]
        errors.append([quantity.value for quantity in quantities] - truth)
        deviations.append([quantity.std for quantity in quantities])
    return np.array(errors), np.array(deviations), flagged


def objections(errors, deviations, limit):
    """What is wrong with an estimator that claims efficiency and honest intervals; nothing, if nothing is."""
    count = errors.shape[0]
    alarm = FALSE_ALARM / (2 * len(NAMES))
    highest = np.sqrt(chi2.isf(alarm, count) / count)
    low, high = binom.ppf(alarm / 2, count, 0.95) / count, binom.isf(alarm / 2, count, 0.95) / count
    found = []
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / limit
    coverage = np.mean(np.abs(errors) <= 1.959964 * deviations, axis=0)
    for name, one, share in zip(NAMES, ratio, coverage, strict=True):
        if one > min(highest, 1.1):
            found.append(f"{name}: RMSE is {one:.3f} of the bound")
        if not max(low, 0.93) <= share <= min(high, 0.97):
            found.append(f"{name}: 95 % intervals cover {100 * share:.1f} %")
    return found


def summary(label, errors, deviations, limit):
    rows = [f"{label}, {errors.shape[0]} seeds"]
    for i, name in enumerate(NAMES):
        bias, scatter = errors[:, i].mean(), errors[:, i].std(ddof=1)
        rmse = np.sqrt(np.mean(errors[:, i] ** 2))
        cover = np.mean(np.abs(errors[:, i]) <= 1.959964 * deviations[:, i])
        rows.append(
            f"  {name}: bias {bias / limit[i]:+.3f}, scatter {scatter / limit[i]:.3f}, "
            f"RMSE {rmse / limit[i]:.3f} of the bound {limit[i]:.3g}; coverage {100 * cover:.1f} %"
        )
    return "\n".join(rows)


def test_output_error_is_efficient_and_its_intervals_hold(record_property):
    errors, deviations, flagged = trials(OutputError(cycles_per_window=NO_WINDOWS))
    text = summary("output_error", errors, deviations, bound())
    print(text)
    record_property("summary", text)
    assert objections(errors, deviations, bound()) == []
    # Its alarm on the model is set to one campaign in a thousand; quantisation may cost a little more.
    assert flagged <= binom.isf(1e-3, SEEDS, 3e-3)


def test_conventional_method_beside_it(record_property):
    seeds = 400
    errors, deviations, _ = trials(Conventional(), seeds=seeds)
    text = summary("conventional", errors, deviations, bound())
    print(text)
    record_property("summary", text)
    best, _, _ = trials(OutputError(cycles_per_window=NO_WINDOWS))
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / np.sqrt(np.mean(best[:seeds] ** 2, axis=0))
    assert np.all(ratio > 1.0)  # nothing beats the bound's companion; how far off it is stands in the summary


def test_planted_overconfidence_is_caught():
    errors, deviations, _ = trials(OutputError(cycles_per_window=NO_WINDOWS))
    found = objections(errors, 0.8 * deviations, bound())  # as if the noise were 20 % lower than it is
    assert len([text for text in found if "cover" in text]) == len(NAMES)


def test_planted_timidity_is_caught():
    errors, deviations, _ = trials(OutputError(cycles_per_window=NO_WINDOWS))
    found = objections(errors, 1.25 * deviations, bound())
    assert len([text for text in found if "cover" in text]) == len(NAMES)


def test_planted_noise_is_caught_by_the_harness_and_by_the_estimator():
    errors, deviations, flagged = trials(
        OutputError(cycles_per_window=NO_WINDOWS), noise=1.3 * NOISE, seeds=400
    )
    found = objections(errors, deviations, bound())
    assert len([text for text in found if "RMSE" in text]) == len(NAMES)
    assert flagged == 400  # every campaign says that the noise is not what was stated
    # It then takes the residual's noise, so that its intervals stay honest all the same.
    assert not [text for text in found if "cover" in text]
