"""Effects with a number of their own in every run: found in the residuals, then fitted to what was planted.

Truth: campaigns made from known values by the forward integrator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import chdtrc

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.per_run import ringing, ringing_p_value, skip
from diagnosis.likelihood.starting_points import starting_points
from tests.support import gap_campaigns
from tests.support.gap_campaigns import campaign, nominal
from tests.unit.diagnosis.noise.test_colour import coloured
from tunnel_sim.effects import Effect, effect_from
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array, Record

MODE = effect_from("second_mode", {"amplitude": 0.002, "frequency": 70.0, "damping_ratio": 0.01})
LOST = effect_from("dropped_samples", {"lost_time": 0.006})
OWN = np.linspace(0.2, 0.8, 6)  # as planted: rad, or share of the run


INSTANTS = np.sort(np.random.default_rng(8).uniform(0.1, 0.9, (6, 3)), axis=1)  # shares of the run
CLOSE = INSTANTS[:, :2] * [0.3, 1.0] + [0.0, 0.1]
CLOSE = np.column_stack((CLOSE, CLOSE[:, 1] + 0.005))  # the last two within a tenth of a period


def thrice_skipped(shares: Array) -> Campaign:
    """The same motions with 10 ms lost at each of three instants of every run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gap_campaigns, "NOISE", 1e-12)
        quiet = campaign()
    rng, runs = np.random.default_rng(9), []
    for run, instants in zip(quiet.runs, shares, strict=True):
        time = run.record.time_s
        read = time + 0.01 * np.sum(time[:, None] >= instants * time[-1], axis=1)
        reading = CubicSpline(time, run.record.yaw_rad)(read)[read <= time[-1]]
        runs.append(
            replace(
                run,
                record=Record(
                    time[: reading.size], reading + rng.normal(0.0, gap_campaigns.NOISE, reading.size)
                ),
            )
        )
    return replace(campaign(), runs=tuple(runs))


def fitted(effect: Effect) -> Fit:
    base = nominal(campaign(effect, duration=10.0))
    (start,) = starting_points(base, type(effect))
    return fit(start.problem, start.point, base=base)


@pytest.mark.parametrize("effect", [MODE, LOST], ids=lambda effect: effect.name)
def test_the_effect_planted_is_fitted_within_its_errors(effect: Effect) -> None:
    found = fitted(effect)
    assert found.excess == pytest.approx(0.0, abs=4.0 * np.sqrt(2.0 / found.count))
    for info in effect.parameters():
        if not (info.form or info.of_input):
            name = f"{effect.name}.{info.name}"
            assert found.value(name) == pytest.approx(getattr(effect, info.name), abs=4.0 * found.std(name))


def test_a_ringing_is_seen_beside_the_motion() -> None:
    found = ringing(nominal(campaign(MODE)))
    assert found is not None
    amplitude, frequency, damping_ratio = found.values
    assert amplitude == pytest.approx(0.002, rel=0.3)
    assert frequency == pytest.approx(70.0, abs=1.0)
    assert 0.003 < damping_ratio < 0.03
    assert found.numbers == pytest.approx(OWN, abs=0.7)


def test_no_ringing_is_sought_at_the_motion_or_near_its_harmonics_in_most_runs() -> None:
    """The nominal fit leaves the harmonics of a hardening spring, by far the strongest lines of its residual."""
    found = ringing(nominal(campaign(effect_from("cubic_stiffness", {"coefficient": 0.3}))))
    assert found is not None
    line = found.values[1] * np.sqrt(1.0 - found.values[2] ** 2)
    own = np.sqrt([spring / gap_campaigns.INERTIA for spring, _ in gap_campaigns.CONDITIONS])
    away = [abs(line - k * own) > share * own for k, share in ((1.0, 0.04), (2.0, 0.25), (3.0, 0.25))]
    assert np.mean(np.all(away, axis=0)) >= 0.5


SHEDDING = effect_from("vortex_shedding", {"amplitude": 0.1, "strouhal_number": 0.12})
NEAR = effect_from("second_mode", {"amplitude": 0.001, "frequency": 24.0, "damping_ratio": 0.003})


@pytest.mark.parametrize(
    ("made", "least", "most"),
    [
        (campaign(MODE), 0.0, 1e-12),
        (campaign(NEAR), 0.0, 1e-12),
        (campaign(SHEDDING), 1e-4, 1.0),
        *((coloured(campaign(seed=seed), "ar2", 3.0, seed), 1e-6, 1.0) for seed in range(8)),
    ],
    ids=["mode", "near the motion", "vortices", *(f"resonant noise {seed}" for seed in range(8))],
)
def test_a_mode_stands_on_the_floor_beside_it_and_noise_with_a_resonance_does_not(
    made: Campaign, least: float, most: float
) -> None:
    base = nominal(made)
    line = ringing(base)
    assert line is not None
    assert chdtrc(2.0 * len(base.residuals), line.drop) < 1e-9  # in white noise each would be a mode
    assert least <= ringing_p_value(base, line) <= most


def test_a_skip_is_placed_to_within_a_few_blocks() -> None:
    found = skip(nominal(campaign(LOST)))
    assert found is not None
    assert found.values[0] == pytest.approx(0.006, rel=0.1)
    assert found.numbers[:, 0] == pytest.approx(
        OWN, abs=0.005
    )  # 50 ms: at a turn of the motion a skip is not seen


@pytest.mark.parametrize("instants", [INSTANTS, CLOSE], ids=["apart", "close"])
def test_three_skips_in_every_run_are_found_and_fitted(instants: Array) -> None:
    base = nominal(thrice_skipped(instants))
    found = skip(base)
    assert found is not None
    assert found.numbers.shape == (6, 3)
    assert np.sort(found.numbers, axis=1) == pytest.approx(instants, abs=0.02)
    (start,) = starting_points(base, type(LOST))
    fit_found = fit(start.problem, start.point, base=base)
    assert fit_found.excess < 0.02 * base.excess
    assert fit_found.value("dropped_samples.lost_time") == pytest.approx(0.03, rel=0.02)


def test_without_a_gap_next_to_nothing_is_expected_of_either() -> None:
    base = nominal(campaign())
    for find in (ringing, skip):
        found = find(base)
        assert found is not None
        assert found.drop < 0.02 * base.total
