"""Rounding of slow motions: its error is not white, is allowed for, and is not a gap."""

import numpy as np
import pytest

from diagnosis import vocabulary
from diagnosis.likelihood.residuals import misfit
from diagnosis.model.blocks import prepare
from diagnosis.noise.rounding import Rounded
from diagnosis.noise.sensor_noise import (
    campaign_noise,
    lattice_step,
    reading_levels,
    reading_step,
    typical_step,
)
from diagnosis.search.investigate import investigate
from diagnosis.search.prepared import fit_nominal
from diagnosis.search.views.stretches import in_stretches
from diagnosis.settings import Settings
from tests.marks import slow
from tests.reference import free_decays
from tests.reference.free_decays import Setting, with_records
from tests.support.gap_campaigns import judged
from tunnel_sim.effects import ALL_EFFECTS

DEGREE = np.pi / 180.0
FEW = vocabulary(["coulomb_friction", "cubic_stiffness", "free_play", "sensor_drift", "sensor_quantisation"])
SETTINGS = (Setting(16.12, 0.0), Setting(20.0, 0.0), Setting(16.12, 20.0), Setting(20.0, 20.0))


def decays(rate, step, *, noise=1e-6, duration=6.0, seed=1):
    """Four runs of the nominal model in closed form, at about 2 Hz, with next to no noise before rounding."""
    how = {"noise": noise, "stated_noise": None, "resolution": step, "rate": rate, "duration": duration}
    return free_decays.campaign(SETTINGS, **how, rng=np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("rate", "step"), [(20.0, DEGREE), (100.0, DEGREE), (1000.0, DEGREE), (4000.0, 0.1 * DEGREE)]
)
def test_the_rounding_of_a_slow_motion_is_not_a_gap(rate, step):
    _, noise, found = judged(decays(rate, step))
    assert not found.detected, found.tests
    assert noise.colour is None
    assert all(value >= step**2 / 12.0 * (1.0 - 1e-9) for value in noise.variance.values())


@pytest.mark.parametrize(("rate", "step"), [(20.0, DEGREE), (1000.0, DEGREE)])
def test_a_motion_that_the_model_misses_is_a_gap_beside_the_rounding(rate, step):
    def stiffening(time, yaw):
        return step * np.round((yaw + 0.1 * np.exp(-0.3 * time) * np.sin(3.0 * np.pi * time)) / step)

    assert judged(with_records(decays(rate, None), stiffening))[2].detected


@pytest.mark.parametrize(("share", "gap"), [(0.75, False), (1.0, True), (3.0, True)])
def test_a_gap_is_larger_than_the_error_of_the_steps(share, gap):
    """The levels of a camera are off by a share of a step, from its middle to its edge, whatever the motion."""
    step = 0.2 * DEGREE

    def bowed(_time, yaw):
        return step * np.round(yaw / step + 0.5 * share * np.cos(2.0 * np.pi * yaw / np.abs(yaw).max()))

    fit, _, found = judged(with_records(decays(30.0, None, noise=0.1 * step, duration=30.0), bowed))
    assert fit.excess > 0.1
    assert (found.detected, found.within_step) == (gap, not gap)


def test_noise_that_blurs_the_steps_needs_no_allowance():
    data = decays(500.0, 4e-4, noise=4e-4)
    noise = campaign_noise(data, Settings().noise)
    fit = fit_nominal(prepare(data, noise.variance))
    assert not isinstance(noise.rounded(fit, reading_step(data)).rounding, Rounded)
    assert judged(data)[0].problem.data.runs[0].noise.variance == noise.variance["r01"] / 2


@pytest.mark.parametrize("share", [0.1, 0.2])
def test_noise_hidden_by_a_coarse_step_is_measured_by_the_edges_it_crosses(share):
    """Truth: the noise added before rounding. The motion crosses a step in hundreds of samples."""
    data = decays(10_000.0, DEGREE, noise=share * DEGREE, duration=2.0)
    for white in campaign_noise(data, Settings().noise).white(lattice_step(data)).values():
        assert white == pytest.approx(share * DEGREE, rel=0.3)


def test_averaging_hardly_reduces_the_error_of_a_motion_slower_than_the_steps():
    """Truth: a motion that stays within a few steps is off by a twelfth of a step's square, averaged or not."""
    small = tuple(Setting(s.spring, s.speed, 2.0 * DEGREE) for s in SETTINGS)
    data = free_decays.campaign(
        small, noise=1e-6, stated_noise=None, resolution=DEGREE, rate=1000.0, duration=6.0,
        rng=np.random.default_rng(2),
    )  # fmt: skip
    noise = campaign_noise(data, Settings().noise)
    fit = fit_nominal(prepare(data, noise.variance))
    rounded = noise.rounded(fit, reading_step(data)).rounding
    allowed = rounded.allowed_in(fit.problem.data)
    for run, error in zip(allowed.runs, rounded.errors, strict=True):
        assert run.block == 4
        assert np.mean(error**2) == pytest.approx(DEGREE**2 / 12.0, rel=0.3)
        assert run.noise.variance > 0.7 * noise.variance[run.id]


def test_the_errors_of_stretches_are_those_of_their_runs():
    """The power of the errors does not depend on where the runs are cut."""
    data = decays(200.0, DEGREE)
    noise = campaign_noise(data, Settings().noise)
    whole = prepare(data, noise.variance)
    powers = []
    for part in (whole, in_stretches(whole).data):
        errors = noise.rounded(fit_nominal(part), DEGREE).rounding.errors
        powers.append(np.mean(np.concatenate(errors, axis=1) ** 2))
    assert powers[1] == pytest.approx(powers[0], rel=0.1)


@pytest.mark.parametrize("step", [DEGREE, 5e-4])
def test_only_readings_on_a_lattice_have_its_step(step):
    assert lattice_step(decays(200.0, step)) == pytest.approx(step, rel=1e-6)
    printed = with_records(decays(200.0, DEGREE), lambda _time, yaw: np.round(yaw, 3))
    assert lattice_step(printed) == pytest.approx(DEGREE, rel=0.06)
    assert lattice_step(decays(200.0, None, noise=4e-4)) == 0.0
    assert lattice_step(decays(200.0, None, noise=0.0)) == 0.0


def coarse(rate=500.0, noise=4e-4):
    """A lattice with steps of 0.8 and 1.6 degrees in turn, far coarser than stated."""

    def readings(_time, yaw):
        levels = DEGREE * np.cumsum(np.tile([0.8, 1.6], 60))
        levels -= levels.mean()
        return levels[np.searchsorted(0.5 * (levels[1:] + levels[:-1]), yaw)]

    return with_records(decays(rate, 4e-4, noise=noise, duration=6.0), readings)


def test_the_typical_step_has_the_power_of_the_uneven_ones():
    """Truth: an angle anywhere is off by w²/12 in a step of width w, and is there in proportion to w."""
    levels = reading_levels(coarse(noise=1e-6))
    anywhere = np.linspace(levels[0], levels[-1], 100_001)
    nearest = levels[np.argmin(np.abs(anywhere[:, None] - levels), axis=1)]
    assert np.mean((anywhere - nearest) ** 2) == pytest.approx(typical_step(levels) ** 2 / 12.0, rel=0.02)


@pytest.mark.parametrize("kinds", [FEW, slow(ALL_EFFECTS)], ids=["few", "all"])
def test_a_coarse_lattice_of_uneven_steps_is_the_only_cause(kinds):
    """What the lattice leaves by itself in each channel does not count against it."""
    found = investigate(coarse(), kinds)
    assert found.causes == ("sensor_quantisation",)
    assert found.answers[0].probability > 0.5
    nominal = misfit(found.nominal)
    assert nominal.excess.max() > 10.0 * np.sqrt(2.0 * nominal.count.max())  # it is a gap
