"""A gain of one run is named by noise and swing together; chance and another release alone are not."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from identification.examination.examine import examine
from identification.examination.slips.odd_sensors import odd_gains
from tests.marks import slow
from tests.support.slip_cases import RELEASED
from tests.support.slip_rig import clocking, reading, scaling, sensing
from tunnel_sim.vocabulary.campaign import Campaign

_NAMED = "another gain"


def _named(data: Campaign) -> list[str]:
    return [remark.what for remark in examine(data).remarks if _NAMED in remark.what]


def _rounded(step: float, *names: str):
    return reading(lambda yaw: np.round(yaw / step) * step, *names)


@pytest.mark.parametrize("scaled", [False, True], ids=["before the converter", "behind it"])
@pytest.mark.parametrize("gain", [0.65, 1.5])
def test_a_gain_beside_coarse_rounding_is_named(gain: float, scaled: bool):
    """The step is twice the noise: it grows with a gain behind the converter, not with one before it."""
    step, amplify = 1e-3, reading(lambda yaw: gain * yaw, "r5")
    data = amplify(_rounded(step)(RELEASED)) if scaled else _rounded(step)(amplify(RELEASED))
    assert len(_named(sensing(resolution=step)(data))) == 1


def test_another_release_is_no_gain():
    assert not _named(scaling("r5", release_angle=0.7)(RELEASED))


def test_another_noise_is_no_gain():
    rng = np.random.default_rng(4)
    assert not _named(reading(lambda yaw: yaw + rng.normal(0.0, 5e-4, yaw.size), "r5")(RELEASED))


def test_clipping_is_no_gain():
    assert not _named(reading(lambda yaw: np.clip(yaw, -0.16, 0.16), "r5")(RELEASED))


def test_a_gain_needs_stated_releases():
    amplified = reading(lambda yaw: 1.3 * yaw, "r5")(RELEASED)
    assert _named(amplified)
    runs = tuple(replace(run, release_angle=None) for run in amplified.runs)
    assert not _named(replace(amplified, runs=runs))


def test_records_without_noise_show_no_gain():
    """Rounding errors of a record scale with its swing, and another release would look like a gain."""
    smooth = reading(lambda yaw: 0.2 * np.exp(-0.2 * np.arange(yaw.size) / 500.0)
                     * np.cos(12.0 * np.arange(yaw.size) / 500.0))(RELEASED)  # fmt: skip
    assert not _named(scaling("r5", release_angle=0.7)(smooth))


def test_uneven_times_do_not_hide_a_gain():
    jittered = clocking(lambda time: time + 1e-4 * np.sin(40.0 * time))(RELEASED)
    assert _named(reading(lambda yaw: 1.4 * yaw, "r5")(jittered))


GRID = [*product((0.002, 0.03, 0.1), (0.0, 0.02, 0.2), (5, 8, 12), (0.0, 0.3))]
QUICK = {
    (0.002, 0.0, 5, 0.0), (0.1, 0.2, 5, 0.0), (0.1, 0.0, 12, 0.0), (0.002, 0.2, 12, 0.0),
    (0.1, 0.0, 5, 0.3), (0.002, 0.2, 5, 0.3), (0.002, 0.0, 12, 0.3), (0.1, 0.2, 12, 0.3),
}  # fmt: skip
"""Both ends of every range with each of every other."""


@pytest.mark.parametrize(
    ("release", "scatter", "runs", "wrong"), [one if one in QUICK else slow(*one) for one in GRID]
)
def test_false_alarms_are_rarer_than_stated(release: float, scatter: float, runs: int, wrong: float):
    """At most one campaign in a hundred beside one release from a wrong angle, and one in a thousand else."""
    rng = np.random.default_rng([runs, round(1e3 * release), round(1e3 * scatter)])
    known, false, trials = np.full(runs, 0.025), 0, 500
    for _ in range(trials):
        swing = release * rng.standard_normal(runs)
        swing[0] += wrong
        noise = scatter * rng.standard_normal((runs, 1)) + 0.025 * np.sqrt(2.0) * rng.standard_normal(
            (runs, 2)
        )
        false += bool(odd_gains(swing, noise, known))
    assert false <= (11 if wrong else 3)  # the binomial's upper 0.5 %
