"""Figures of a score: every number and point drawn is one of the table's. Truth: tables written by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import polars as pl
import pytest

from identification.estimators import ALL_ESTIMATORS
from identification.show.style import styled
from tests.marks import slow
from tunnel_lab.experiments.breakdown import breakdown_figure, exceeding, packaged_breakdown
from tunnel_lab.experiments.score import Results, packaged_baseline
from tunnel_lab.experiments.score_drawing import cell_labels, score_figure
from tunnel_lab.experiments.score_grid import Cell, Grid
from tunnel_sim.effects import ALL_EFFECTS, BetweenRuns

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox


def row(
    effect: str, severity: float, name: str, percent: float | None, stds: float | None, of: str = "cn_r"
) -> dict[str, object]:
    return {
        "effect": effect, "severity_noise_powers": severity, "estimator": name, "quantity": of,
        "bias_percent": percent, "bias_in_stds": stds,
    }  # fmt: skip


FRAME = pl.DataFrame(
    [
        row("no effect", 0.0, "one", 0.2, -1.5),
        row("no effect", 0.0, "two", 0.1, 0.5),
        row("free_play", 1.0, "one", -3.0, -1.01),
        row("free_play", 10.0, "one", 40.0, 300.0),
        row("free_play", 1.0, "two", 9.0, 0.99),
        row("free_play", 10.0, "two", None, None),
    ]
)


def test_only_what_exceeds_one_standard_deviation_is_printed() -> None:
    assert exceeding(FRAME, "cn_r") == {
        ("no effect", 0.0, "one"): (0.2, -1.5),
        ("free_play", 1.0, "one"): (-3.0, -1.01),
        ("free_play", 10.0, "one"): (40.0, 300.0),
    }
    assert exceeding(FRAME, "cn_beta") == {}
    others = pl.DataFrame([row("free_play", 1.0, "one", 5.0, 2.0, of) for of in ("cn_beta", "yaw_inertia")])
    assert exceeding(pl.concat([FRAME, others]), "cn_r") == exceeding(FRAME, "cn_r")
    axes = breakdown_figure(FRAME, "cn_r").axes[0]
    assert [text.get_text() for text in axes.texts] == ["+0.20", "−3.0", "+40"]
    assert [text.get_position() for text in axes.texts] == [(0.5, 0), (0.25, 1), (0.75, 1)]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["no effect", "free play"]


def test_the_packaged_breakdown_has_every_effect_and_estimator() -> None:
    frame = packaged_breakdown()
    # its runs are free decays, and repeat
    free = [kind.name for kind in ALL_EFFECTS if not (kind.driven or issubclass(kind, BetweenRuns))]
    assert set(frame["effect"]) == {"no effect", *free}
    assert set(frame["estimator"]) == set(ALL_ESTIMATORS)
    at_ten = frame.filter(pl.col("severity_noise_powers") == 10.0)
    assert at_ten.height == len(free) * len(ALL_ESTIMATORS) * 4


def test_the_label_of_a_cell_leaves_out_what_all_have() -> None:
    cells = [
        Cell("decay", 0.01, duration, 0.35, 1000.0, 0.0, zeta=zeta, frequency=4.0)
        for zeta, duration in ((0.002, 20.0), (0.05, 20.0), (0.05, 5.0))
    ]
    labels, common = cell_labels(cells)
    assert labels == ["ζ 0.002, 20 s", "ζ 0.05, 20 s", "ζ 0.05, 5 s"]
    assert common == "4 Hz, noise 1 %"
    assert cell_labels(cells[:1]) == (["ζ 0.002, 4 Hz, noise 1 %, 20 s"], "")


FRICTION = "coulomb_friction:friction_moment=0.002"
LONG = "wind_speed_scatter:spread=0.01 + stiffness_scatter:spread=0.01 + damping_scatter:spread=0.01"


def made(cells: list[Cell], given: dict[str, tuple[str, ...]]) -> Results:
    """A score with four trials of each cell, in which every estimator gives some quantities."""
    grid = Grid("small", 1, 4, (), tuple(cells))
    rows = [
        {
            "cell": index, "trial": trial, "estimator": name, "quantity": quantity, "unit": "1", "truth": 1.0,
            "value": 1.0 + (-0.1) ** trial if quantity in some else None,
            "std": 0.1 if quantity in some else None, "bound": 0.2, "status": "ok", "milliseconds": 1.0,
        }
        for index, cell in enumerate(cells)
        for trial in range(1, 5)
        for name, some in given.items()
        for quantity in cell.quantities
    ]  # fmt: skip
    return Results(grid, tuple(given), pl.DataFrame(rows))


@styled
def texts_of(fig: Figure) -> list[Bbox]:
    """Draw a figure; where its texts are, without the numbers along the axes."""
    fig.draw_without_rendering()
    found = []
    for part in fig.subfigs:
        found += [text.get_window_extent() for text in (part._suptitle, part._supxlabel)]
        found += [legend.get_window_extent() for legend in part.legends]
        for axes in part.axes:
            found.append(axes.title.get_window_extent())
            if axes.get_subplotspec().is_first_col():
                found += [label.get_window_extent() for label in axes.get_yticklabels() if label.get_text()]
    return [box for box in found if box.width > 0.0]


@pytest.mark.parametrize("count", [slow(1), slow(2), 9])
def test_nothing_overlaps_or_is_cut_off(count: int) -> None:
    """One decay cell, one campaign cell and one whose effects have long names; warnings are errors."""
    decay = Cell("decay", 0.005, 3.0, 0.35, 200.0, 0.0, zeta=0.01, frequency=3.0)
    plain = Cell("campaign", 0.002, 4.0, 0.35, 200.0, 0.0, wind_speed=20.0, springs=(16.12, 44.84))
    cells = [decay, plain, replace(plain, effect=LONG)]
    every = (*decay.quantities, *plain.quantities)
    fig = score_figure(made(cells, {f"method_{number}": every for number in range(count)}))
    boxes, whole = texts_of(fig), fig.bbox
    assert all(box.x0 >= -1.0 and box.x1 <= whole.x1 + 1.0 for box in boxes)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    panels = [axes.get_window_extent() for part in fig.subfigs for axes in part.axes]
    assert min(panel.width for panel in panels) > 0.6 * fig.dpi
    assert min(panel.height for panel in panels) > 0.15 * fig.dpi


def test_what_is_not_given_is_said_or_left_out() -> None:
    decay = Cell("decay", 0.005, 3.0, 0.35, 200.0, 0.0, zeta=0.01, frequency=3.0)
    plain = Cell("campaign", 0.002, 4.0, 0.35, 200.0, 0.0, wind_speed=20.0, springs=(16.12, 44.84))
    rates = made([decay, plain], {"rates": ("zeta", "omega_n")})
    assert [part._suptitle.get_text() for part in score_figure(rates).subfigs] == ["Single decays"] * 2
    both = made(
        [decay, plain], {"rates": ("zeta", "omega_n"), "whole": (*decay.quantities, *plain.quantities)}
    )
    parts = score_figure(both).subfigs
    said = [[text.get_text() for text in axes.texts] for part in parts[2:] for axes in part.axes]
    assert said == [["not given"], []] * 2
    assert parts[2].axes[0].get_xscale() == "log"
    assert [len(part.legends[0].get_texts()) for part in parts] == [2, 2, 2, 2]


def test_points_of_the_score_are_those_of_the_table() -> None:
    from identification.scoring import score

    results = packaged_baseline()
    trials = results.trials
    parts = score_figure(results).subfigs
    assert len(parts) == 4
    for part, covered in zip(parts[:2], (False, True), strict=True):
        for axes, name in zip(part.axes, results.estimators, strict=True):
            assert axes.get_title(loc="center") == name.replace("_", " ")
            for quantity, container in zip(("zeta", "omega_n"), axes.containers, strict=True):
                scores = [score(trials[name, cell, quantity]) for cell in range(13)]
                wanted = [100 * s.coverage.value if covered else s.rmse_over_bound.value for s in scores]  # type: ignore[union-attr]
                assert container.lines[0].get_xdata() == pytest.approx(wanted)
