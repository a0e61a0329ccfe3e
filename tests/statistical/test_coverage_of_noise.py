"""Intervals of Cnβ and Cnr in white, quantised and coloured noise and with stated scatter: bounded from both sides.

Campaigns are drawn in closed form; noise is made by SciPy's recursive filter. An estimator passes where the share
of its 95 % intervals that hold the truth, and the root mean square of error over deviation, are those of a right
statement, but for `TOLERANCE`. The planted cases are an estimator that takes coloured noise for a misfit, and
deviations of a wrong noise level: they must be caught.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import ndtr
from scipy.stats import binom, chi2

from identification import Status, identify
from identification.estimators import ALL_ESTIMATORS
from identification.estimators.output_error import OutputError
from identification.signal import noise
from identification.signal.run_fit import NO_WINDOWS
from tests.marks import slow
from tests.reference.free_decays import RESOLUTION, Setting, Truth, campaign, with_records
from tests.reference.scattering import USUAL, scattering
from tunnel_sim.vocabulary.between_runs import SCATTERED
from tunnel_sim.vocabulary.campaign import Repeatability

pytestmark = pytest.mark.usefixtures("unexamined")
NAMES = ("cn_beta", "cn_r")
FALSE_ALARM = 1e-3  # of one verdict: two coefficients, two statistics, two sides
TOLERANCE = 1.1  # of a deviation: spectra are estimated, and scatter is of few runs
LEVEL = 5e-4
SHAPE = {"duration": 10.0, "rate": 200.0}
SETTINGS = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 20.0))
FILTERS = {  # numerator and denominator, of unit variance
    "ar 0.5": ([np.sqrt(0.75)], [1.0, -0.5]),
    "ar 0.9": ([np.sqrt(0.19)], [1.0, -0.9]),
    "ma": (np.array([1.0, 0.8, 0.5]) / np.sqrt(1.89), [1.0]),
}
KINDS = ("white", "quantised", "scatter", *FILTERS)
# Their deviations include the networks' own errors and rival models, and are above the error in noise alone.
WIDER = ("neural_network", "neural_posterior")


def drawn(kind, seed):
    rng = np.random.default_rng([seed, 23])
    if kind == "scatter":
        data = scattering(SETTINGS, rng, noise=LEVEL, **SHAPE)
        return replace(data, repeatability=Repeatability(**dict(zip(SCATTERED, USUAL, strict=True))))
    if kind not in FILTERS:
        step = 2.0 * RESOLUTION if kind == "quantised" else None
        return campaign(SETTINGS, noise=LEVEL, resolution=step, rng=rng, **SHAPE)

    def coloured(time, yaw):
        return yaw + LEVEL * lfilter(*FILTERS[kind], rng.standard_normal(time.size + 500))[500:]

    data = with_records(campaign(SETTINGS, **SHAPE), coloured)
    return replace(data, sensor=replace(data.sensor, noise_std=LEVEL))


@cache
def trials(kind, estimator, count):
    """Errors over their deviations, shape (count, 2), and how many campaigns say that the model departs."""
    scores, departing = [], 0
    method = OutputError(cycles_per_window=NO_WINDOWS) if estimator == "output_error" else estimator
    for seed in range(count):
        found = identify(drawn(kind, seed), method)
        quantities = [(getattr(found, name), getattr(Truth(), name)) for name in NAMES]
        scores.append([(quantity.value - truth) / quantity.std for quantity, truth in quantities])
        departing += Status.MODEL_DEPARTS in found.statuses
    return np.array(scores), departing


def objections(scores, least=1.0 / TOLERANCE):
    """What is wrong with the deviations, at the false-alarm rate; nothing, if nothing is."""
    count, alarm, found = len(scores), FALSE_ALARM / (4 * len(NAMES)), []
    rms_low, rms_high = np.sqrt(chi2.isf([1.0 - alarm, alarm], count) / count)
    wide = 2.0 * ndtr(1.959964 / least) - 1.0 if least else 1.0
    low = binom.ppf(alarm, count, 2.0 * ndtr(1.959964 / TOLERANCE) - 1.0)
    high = binom.isf(alarm, count, wide)
    for name, column in zip(NAMES, scores.T, strict=True):
        held, rms = int(np.sum(np.abs(column) <= 1.959964)), float(np.sqrt(np.mean(column**2)))
        if not low <= held <= high:
            found.append(f"{name}: {held} of {count} intervals hold")
        if not least * rms_low <= rms <= TOLERANCE * rms_high:
            found.append(f"{name}: errors are {rms:.2f} deviations")
    return found


CASES = [
    pytest.param("ar 0.9", "output_error", 60),
    *(
        slow(kind, name, 200)
        for kind in KINDS
        for name in ALL_ESTIMATORS
        if name not in WIDER and (kind, name) != ("ar 0.9", "output_error")
    ),
]


@pytest.mark.parametrize(("kind", "estimator", "count"), CASES)
def test_deviations_are_neither_too_small_nor_too_large(kind, estimator, count, record_property):
    scores, departing = trials(kind, estimator, count)
    held, rms = np.mean(np.abs(scores) <= 1.959964, axis=0), np.sqrt(np.mean(scores**2, axis=0))
    text = f"{estimator}, {kind}: 95 % intervals cover {100.0 * held} %, errors are {rms} deviations"
    print(text)
    record_property("summary", text)
    assert objections(scores) == []
    # Four runs and their joint fit are tested, at one in a thousand each.
    assert departing <= binom.isf(FALSE_ALARM, count, 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "estimator"), [(k, e) for k in KINDS for e in WIDER if (k, e) != ("scatter", "neural_posterior")]
)
def test_the_networks_deviations_are_not_too_small(kind, estimator):
    scores, _ = trials(kind, estimator, 60)
    assert objections(scores, least=0.0) == []


def test_the_posterior_refuses_runs_that_scatter():
    found = identify(drawn("scatter", 0), "neural_posterior", throw=False)
    assert Status.UNLIKE_TRAINING in found.statuses
    assert found.cn_beta is None
    assert all(run.zeta is not None for run in found.runs)


@pytest.mark.parametrize("factor", [0.6, 1.0 / 0.6])
def test_a_wrong_noise_level_is_caught_from_either_side(factor):
    scores, _ = trials("ar 0.9", "output_error", 60)
    found = objections(scores / factor)
    assert {text.partition(":")[0] for text in found} == set(NAMES)


def test_coloured_noise_taken_for_a_misfit_is_caught(monkeypatch):
    monkeypatch.setattr(noise, "_coloured", lambda *_: None)
    scores, departing = trials.__wrapped__("ar 0.9", "output_error", 30)
    assert len(objections(scores)) >= len(NAMES)
    assert departing == 30
