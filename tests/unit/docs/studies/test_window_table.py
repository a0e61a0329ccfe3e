"""Tables of windows: simulated ones against closed forms, and planted causes found again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from docs.studies.window_rivals import diagnose_windows
from docs.studies.window_table import Columns, read_table, rig_state, simulate_windows
from identification.datasets import WindowRow, paper_windows
from tunnel_lab.paper.networks import infer_springs
from tunnel_sim.effects import effect_from
from tunnel_sim.effects.friction_laws import CoulombFriction
from tunnel_sim.effects.mechanics import CubicStiffness, QuadraticDamping
from tunnel_sim.vocabulary.errors import TunnelError

OMEGA, ZETA, COUNT = 12.6, 0.006, 8
FEW = (CoulombFriction, QuadraticDamping, CubicStiffness)


def columns(*effects, state=None, **base) -> Columns:
    found = simulate_windows(state or rig_state(), effects, OMEGA, ZETA, COUNT, **base)
    assert found is not None
    return found


def noisy(table: Columns, seed: int) -> list[WindowRow]:
    rng = np.random.default_rng(seed)
    return [
        WindowRow(i + 1, z + 3e-4 * rng.standard_normal(), w + 0.015 * rng.standard_normal())
        for i, (z, w) in enumerate(zip(table.zeta, table.omega_n, strict=True))
    ]


def test_the_linear_model_leaves_both_columns_constant() -> None:
    found = columns()
    assert np.allclose(found.omega_n, OMEGA, rtol=1e-6)
    assert np.allclose(found.zeta, ZETA, atol=1e-7)


def test_without_wind_the_frequency_is_that_of_spring_and_inertia() -> None:
    windy = rig_state()
    still = dataclasses.replace(windy, wind_speed=0.0)
    found = columns(state=still, base=windy)
    air = 0.5 * 1.204 * 100.0 * 0.036 * 0.625 * windy.derivatives.cn_beta
    assert found.omega_n == pytest.approx(OMEGA * np.sqrt(16.12 / (16.12 - air)), rel=1e-6)


def test_a_cubic_spring_shifts_the_frequency_by_three_eighths_of_kappa_a_squared() -> None:
    kappa, windless = -0.3, dataclasses.replace(rig_state(), wind_speed=0.0)
    found = columns(effect_from("cubic_stiffness", {"coefficient": kappa}), state=windless)
    middle = np.radians(20.0) * np.exp(-ZETA * 6.0 * np.pi * (np.arange(COUNT) + 0.5))
    assert found.omega_n / OMEGA - 1.0 == pytest.approx(0.375 * kappa * middle**2, rel=0.04)


def test_quadratic_damping_adds_in_proportion_to_the_amplitude() -> None:
    inertia, c2, windless = 16.12 / OMEGA**2, 0.003, dataclasses.replace(rig_state(), wind_speed=0.0)
    found = columns(effect_from("quadratic_damping", {"coefficient": c2}), state=windless)
    ends = np.radians(20.0) * np.exp(-6.0 * np.pi * np.cumsum(np.append(0.0, found.zeta)))
    amplitude = np.sqrt(ends[1:] * ends[:-1])
    assert found.zeta - ZETA == pytest.approx(4.0 / (3.0 * np.pi) * c2 / inertia * amplitude, rel=0.02)


def test_an_effect_with_a_random_part_is_refused_rather_than_left_out() -> None:
    with pytest.raises(TunnelError, match="effect mains_hum: the random part of the run is missing"):
        columns(effect_from("mains_hum", {"amplitude": 0.002}))


def test_a_body_that_comes_to_rest_gives_no_table() -> None:
    effect = effect_from("coulomb_friction", {"friction_moment": 0.5})
    assert simulate_windows(rig_state(), [effect], OMEGA, ZETA, COUNT) is None


def test_only_spring_5_is_left_by_the_printed_derivatives() -> None:
    possible = [row for row in infer_springs() if row.mechanical_damping >= 0.0]
    assert [row.spring for row in possible] == [5]
    assert possible[0].wind_speed == pytest.approx(10.0, abs=1.0)


def test_an_entry_with_two_readings_is_their_mean_and_less_certain() -> None:
    values, std = read_table(paper_windows())
    assert values.omega_n[2] == pytest.approx(0.5 * (12.5074 + 12.5054))
    assert std.omega_n[2] ** 2 - std.omega_n[0] ** 2 == pytest.approx(0.001**2, rel=1e-3)
    with pytest.raises(TunnelError, match="six or more"):
        read_table(paper_windows()[:5])


@pytest.mark.slow
def test_no_cause_is_called_where_none_was_planted() -> None:
    found = diagnose_windows(noisy(columns(), 1), kinds=FEW)
    assert "none" in [e.name for e in found.tied]


@pytest.mark.slow
def test_a_planted_pair_is_found_again_and_its_rivals_are_not() -> None:
    planted = {"cubic_stiffness": -0.4, "quadratic_damping": 0.0038}
    effects = [
        effect_from("cubic_stiffness", {"coefficient": -0.4}),
        effect_from("quadratic_damping", {"coefficient": 0.0038}),
    ]
    found = diagnose_windows(noisy(columns(*effects), 2), kinds=FEW)
    best = found.explanations[0]
    assert [e.name for e in found.tied] == ["cubic_stiffness + quadratic_damping"]
    for effect in best.effects:
        assert effect.severity == pytest.approx(planted[effect.name], rel=0.3)
    assert "coulomb_friction" in found.flat
    assert found.probability_of("cubic_stiffness") > 0.95
    with pytest.raises(TunnelError, match="was not weighed"):
        found.explanation("coulomb_friction")


@pytest.mark.slow
def test_a_further_run_sets_apart_only_what_differs() -> None:
    effects = [effect_from("cubic_stiffness", {"coefficient": -0.4})]
    found = diagnose_windows(noisy(columns(*effects), 3), kinds=FEW)
    cubic, none = found.explanation("cubic_stiffness"), found.explanation()
    assert found.separation(cubic, cubic, found.state) == 0.0
    apart = [
        found.separation(cubic, none, dataclasses.replace(found.state, release_angle=angle))
        for angle in (0.1, 0.5)
    ]
    assert apart[0] < apart[1]


def test_the_scatter_is_what_a_quadratic_leaves_over_its_degrees_of_freedom() -> None:
    rng = np.random.default_rng(12)
    number = np.arange(9.0)
    zeta = 0.006 + 1e-4 * number - 2e-5 * number**2 + 3e-5 * rng.standard_normal(9)
    omega = 12.6 + 0.01 * number + 0.002 * rng.standard_normal(9)
    _, std = read_table([WindowRow(i + 1, z, w) for i, (z, w) in enumerate(zip(zeta, omega, strict=True))])
    model = np.stack([number**0, number, number**2], axis=1)
    for found, column in ((std.zeta, zeta), (std.omega_n, omega)):
        left = np.linalg.lstsq(model, column)[1][0]
        assert found == pytest.approx(np.full(9, np.sqrt(left / (9 - 3))))
