"""Figures of a score: every number and point drawn is one of the table's. Truth: tables written by hand."""

from __future__ import annotations

import polars as pl
import pytest

from identification.estimators import ALL_ESTIMATORS
from tunnel_lab.experiments.breakdown import breakdown_figure, exceeding, packaged_breakdown
from tunnel_lab.experiments.score_grid import Cell
from tunnel_lab.experiments.score_trials import packaged_baseline
from tunnel_lab.experiments.score_view import cell_labels, score_figure
from tunnel_sim.effects import ALL_EFFECTS


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
    free = [kind.name for kind in ALL_EFFECTS if not (kind.driven or kind.scatters)]
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


def test_points_of_the_score_are_those_of_the_table() -> None:
    from identification.scoring import score

    results = packaged_baseline()
    trials = results.trials()
    parts = score_figure(results).subfigs
    assert len(parts) == 4
    for part, covered in zip(parts[:2], (False, True), strict=True):
        for axes, name in zip(part.axes, results.estimators, strict=True):
            assert axes.get_title(loc="center") == name.replace("_", " ")
            for quantity, container in zip(("zeta", "omega_n"), axes.containers, strict=True):
                scores = [score(trials[name, cell, quantity]) for cell in range(13)]
                wanted = [100 * s.coverage.value if covered else s.rmse_over_bound.value for s in scores]  # type: ignore[union-attr]
                assert container.lines[0].get_xdata() == pytest.approx(wanted)
