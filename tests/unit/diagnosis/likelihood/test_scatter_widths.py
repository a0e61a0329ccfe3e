"""Evidence of chance differences between runs: what it costs, whatever a set knows of the runs, and of what."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.likelihood.scatter_widths import ScatterColumns
from identification.campaign.random_effects import WidthPrior
from tunnel_sim.vocabulary.record import Array

RUNS, SAMPLES, WIDTH = 12, 40, 3e-3
PRIOR = WidthPrior(np.array([WIDTH]), np.array([0.5]), np.array([1e-3 * WIDTH]), np.array([20.0 * WIDTH]))


def columns(accuracy: float, seed: int = 3, *, within: bool = False) -> ScatterColumns:
    """Runs with a deviation each and one common parameter, of unit noise.

    Args:
        accuracy: standard deviation of a run's deviation, seen by itself, relative.
        within: whether every run shows the common parameter otherwise than a deviation does; else as one does.
    """
    rng = np.random.default_rng(seed)
    one = np.ones(SAMPLES) / np.sqrt(SAMPLES)
    other = np.resize([1.0, -1.0], SAMPLES) / np.sqrt(SAMPLES)
    own = [(one / accuracy)[:, None] for _ in range(RUNS)]
    common = [(other if within else one)[:, None] / accuracy for _ in range(RUNS)]
    noise = rng.standard_normal((RUNS, SAMPLES))
    deviations = WIDTH * rng.standard_normal(RUNS)
    seen = [d[:, 0] * e + n for d, e, n in zip(own, deviations, noise, strict=True)]
    return ScatterColumns([np.zeros((SAMPLES, 0))] * RUNS, own, common, seen, PRIOR)


def cost(found: ScatterColumns, known: Array) -> float:
    return found.likeliest().cost(known)


def test_what_a_set_knows_better_neither_costs_nor_pays() -> None:
    """A line of the wind shows the speed of a run a hundred times as well as its damping does."""
    nominal, sharper = columns(0.03 * WIDTH), columns(0.0003 * WIDTH)
    known = nominal.products.own
    assert cost(sharper, known) == pytest.approx(cost(nominal, known), abs=0.5)
    # by its own knowledge it would pay for every run
    assert cost(sharper, sharper.products.own) > cost(nominal, known) + RUNS


def test_runs_that_repeat_better_cost_less() -> None:
    rough, fine = columns(0.03 * WIDTH), columns(0.03 * WIDTH)
    close = ScatterColumns(
        fine.bases, fine.deviations, fine.common, [0.2 * one for one in fine.residuals], PRIOR
    )
    known = rough.products.own
    assert cost(rough, known) - cost(close, known) > 2.0 * (RUNS - 1) * np.log(4.0)


def test_few_runs_that_repeat_exactly_have_no_width() -> None:
    """Each shows a deviation of 3e-4 usual widths, and has none; a normal density would keep a tenth of one."""
    found = columns(3e-4 * WIDTH)
    pairs = list(zip(found.residuals, found.deviations, strict=True))[:3]
    noise = [0.1 * (z - d[:, 0] * (d[:, 0] @ z) / (d[:, 0] @ d[:, 0])) for z, d in pairs]
    few = ScatterColumns(found.bases[:3], found.deviations[:3], found.common[:3], noise, PRIOR)
    assert few.likeliest().widths[0] < 0.01 * WIDTH


@pytest.mark.parametrize(
    ("within", "size", "shown"), [(True, 0.1, True), (False, 0.1, False), (False, 140.0, True)]
)
def test_runs_show_by_themselves_what_greatest_differences_cannot_hide(
    within: bool, size: float, shown: bool
) -> None:
    """Twelve runs know their common deviation to a third of the greatest width, which is 20 widths."""
    between = columns(0.03 * WIDTH, within=within).likeliest()
    assert between.shown(np.array([size * WIDTH]), 4.0).tolist() == [shown]


def test_a_parameter_that_single_runs_show_costs_nothing_for_being_compared() -> None:
    """One parameter that acts as a deviation does: its variance is the runs' mean, a² + w² for the width w."""
    found = columns(0.03 * WIDTH).likeliest()
    known = columns(0.03 * WIDTH).products.own
    given, free = found.cost(known, np.array([True])), found.cost(known, np.array([False]))
    assert free == found.cost(known)
    accuracy, most = 0.03 * WIDTH, PRIOR.most[0]
    gain = np.log((accuracy**2 + most**2) / (accuracy**2 + found.widths[0] ** 2))
    assert free - given == pytest.approx(gain, rel=1e-6)
    assert gain > 5.0


def test_parameters_that_the_runs_do_not_determine_cost_nothing_when_given() -> None:
    """Two equal columns and one of no change cost as one column does, but for slightly other widths."""
    one = columns(0.03 * WIDTH)
    none = [np.zeros_like(part) for part in one.common]
    common = [np.hstack([part, part, zero]) for part, zero in zip(one.common, none, strict=True)]
    found = ScatterColumns(one.bases, one.deviations, common, one.residuals, PRIOR).likeliest()
    known, both = one.products.own, np.array([True, True, True])
    assert found.cost(known, both) == pytest.approx(one.likeliest().cost(known, np.array([True])), abs=0.5)
