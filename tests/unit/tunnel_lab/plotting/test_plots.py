"""Figures of campaigns and estimates: what is drawn is what was given, and files are fit for print.

Truth: closed forms, and signals whose spectrum is known.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from identification.show import style
from identification.show.quantity import Quantity
from identification.show.style import figure, limit_to_known, log_axis, styled
from tests.support.diagnosis_document import campaign
from tunnel_lab.plotting import runs
from tunnel_lab.plotting.runs import deviations, thinned, windows_figure
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Record


def test_deviation_of_two_values_from_their_weighted_mean() -> None:
    first, second = deviations([Quantity(1.0, 0.1, "1"), Quantity(4.0, 0.2, "1")])
    assert first.value == pytest.approx(0.2 * (1.0 - 4.0))  # weights 0.8 and 0.2
    assert second.value == pytest.approx(0.8 * (4.0 - 1.0))
    spread = np.hypot(0.1, 0.2)
    assert (first.std, second.std) == pytest.approx((0.2 * spread, 0.8 * spread))


def test_a_value_that_is_exact_deviates_by_nothing() -> None:
    exact, other = deviations([Quantity(1.0, 0.0, "1"), Quantity(2.0, 0.1, "1")])
    assert exact.value == pytest.approx(0.0, abs=1e-10)
    assert (other.value, other.std) == pytest.approx((1.0, 0.1))
    assert [q.value for q in deviations([Quantity(v, 0.0, "1") for v in (1.0, 3.0)])] == [-1.0, 1.0]


def window(amplitude: float, zeta: float, std: float, omega_n: float = 10.0) -> SimpleNamespace:
    zetas, omegas = Quantity(zeta, std, "1"), Quantity(omega_n, omega_n * std, "rad/s")
    return SimpleNamespace(amplitude=Quantity(amplitude, 0.0, "rad"), zeta=zetas, omega_n=omegas)


def estimate(*runs: tuple[SimpleNamespace, ...]) -> SimpleNamespace:
    shown = [SimpleNamespace(id=f"r{i}", windows=run) for i, run in enumerate(runs)]
    return SimpleNamespace(runs=shown, motion="angle")


def test_a_noisy_window_moves_only_itself_from_zero() -> None:
    slow = (window(0.3, 0.010, 1e-5), window(0.2, 0.010, 1e-5), window(0.1, 0.013, 1e-3))
    fast = (window(0.3, 0.02, 1e-5, 30.0), window(0.1, 0.02, 1e-5, 30.0))
    zeta, omega = windows_figure(estimate(slow, fast)).axes
    first = zeta.lines[0].get_ydata()
    assert first == pytest.approx([0.0, 0.0, 3.0], abs=1e-3)  # 10⁻³
    assert omega.lines[0].get_ydata() == pytest.approx([0.0] * 3)
    assert "weighted mean" in zeta.get_ylabel()


def test_windows_of_one_rig_are_drawn_as_they_are() -> None:
    zeta, omega = windows_figure(estimate((window(0.3, 0.01, 1e-4), window(0.1, 0.02, 1e-4, 11.0)))).axes
    assert list(zeta.lines[0].get_ydata()) == [0.01, 0.02]
    assert list(omega.lines[0].get_ydata()) == [10.0, 11.0]


def test_what_is_known_far_worse_does_not_set_the_axis() -> None:
    axes = figure(3.0, 2.0).add_subplot()
    limit_to_known(axes, np.array([1.0, 2.0, 3.0, 90.0]), np.array([0.1, 0.1, 0.5, 40.0]))
    assert axes.get_ylim() == pytest.approx((0.8 - 0.16, 4.0 + 0.16))
    limit_to_known(axes, np.array([1.0, np.nan, 2.0]), np.array([0.1, np.nan, 0.1]))
    assert axes.get_ylim() == pytest.approx((0.8 - 0.07, 2.2 + 0.07))
    limit_to_known(axes, np.array([np.nan]), np.array([np.nan]))
    assert axes.get_ylim() == pytest.approx((0.8 - 0.07, 2.2 + 0.07))


def test_no_windows_no_curves() -> None:
    fig = windows_figure(estimate((window(0.3, 0.01, 1e-4),), ()))
    assert not any(axes.containers for axes in fig.axes)


def test_a_spectrum_shows_its_line_and_not_the_mean() -> None:
    time = np.arange(4000) / 100.0
    rng = np.random.default_rng(5)
    angle = 3.0 + 0.1 * time + 0.01 * np.sin(2.0 * np.pi * 5.0 * time) + 1e-5 * rng.standard_normal(4000)
    frequency, density = runs.spectrum(Run("r", Record(time, angle), 0.0))
    assert frequency[0] == pytest.approx(2.0 / 40.0)
    assert frequency[np.argmax(density[frequency > 1.0]) + np.sum(frequency <= 1.0)] == pytest.approx(
        5.0, rel=0.03
    )
    level = np.median(density[frequency > 20.0])
    assert level == pytest.approx(2.0 * 1e-10 / 100.0, rel=0.3)  # white noise: 2 σ² over the sample rate


def test_a_spectrum_of_two_samples() -> None:
    frequency, density = runs.spectrum(Run("r", Record(np.array([0.0, 1.0]), np.array([0.0, 1.0])), 0.0))
    assert frequency.tolist() == [0.5]
    assert density.shape == (1,)


def test_errors_are_drawn_in_standard_deviations() -> None:
    given = [
        SimpleNamespace(estimator="a_b", cn_beta=Quantity(0.51, 0.005, "1/rad"), cn_r=None),
        SimpleNamespace(
            estimator="c", cn_beta=Quantity(0.4, 0.02, "1/rad"), cn_r=Quantity(-0.1, 0.0, "1/rad")
        ),
    ]
    errors, stds = runs.truth_figure(given, {"cn_beta": 0.5, "cn_r": -0.1}).axes
    drawn = [line.get_xdata() for line in errors.lines if line.get_linestyle() == "None"]
    assert [list(x) for x in drawn] == [pytest.approx([2.0]), pytest.approx([-5.0])]
    low, high = errors.get_xlim()
    assert low < -5.0 < 2.0 < high
    assert [list(line.get_xdata()) for line in stds.lines if line.get_linestyle() == "None"] == [
        pytest.approx([1.0]),
        pytest.approx([4.0]),
    ]


def test_estimates_without_errors_are_drawn_empty(tmp_path: Path) -> None:
    given = [SimpleNamespace(estimator="a", cn_beta=Quantity(0.5, 0.0, "1/rad"), cn_r=None)]
    fig = runs.truth_figure(given, {"cn_beta": 0.5, "cn_r": -0.1})
    assert style.save(fig, tmp_path / "a.png").exists()


def test_a_reading_that_does_not_move_has_a_figure(tmp_path: Path) -> None:
    run = Run("r", Record(np.arange(100.0), np.zeros(100)), 0.0)
    assert style.save(runs.spectrum_figure((run,)), tmp_path / "a.png").exists()


def test_no_line_crosses_missing_samples() -> None:
    time = np.delete(0.01 * np.arange(600), range(200, 300))
    record = Record(time, np.cos(time))
    run = Run("r", record, 0.0)
    (page,) = runs.trace_pages(replace(campaign(), runs=(run,)))
    drawn = [axes.lines[0].get_xydata() for axes in (*page.axes, *runs.wind_off_on_figure(run, run).axes)]
    long = np.repeat(time, 20) + np.tile(0.0005 * np.arange(20), time.size)  # more samples than are drawn
    drawn += [np.stack(thinned(t, np.cos(t)), axis=-1) for t in (time, long)]
    for curve in map(np.asarray, drawn):
        broken = curve[np.isnan(curve[:, 1]), 0]
        assert broken == pytest.approx([0.5 * (1.99 + 3.0)], abs=0.02)
        kept = curve[~np.isnan(curve[:, 1])]
        assert np.allclose(kept[:, 1], np.cos(kept[:, 0]), atol=0.02)


@pytest.mark.parametrize("ends", [(0.21, 0.9), (3.0, 70.0), (1e-6, 1e2)])
def test_labels_of_a_logarithmic_axis_are_few(ends: tuple[float, float]) -> None:
    fig = figure(3.0, 2.0)
    axes = fig.add_subplot()
    axes.plot(ends, ends)
    log_axis(axes, "x")
    fig.draw_without_rendering()
    shown = [t for t in axes.get_xticks() if ends[0] <= t <= ends[1]]
    assert 2 <= len(shown) <= 8
    assert not any(label.get_text() for label in axes.get_xticklabels(minor=True))


@pytest.mark.parametrize("ends", [(0.09, 2.5), (0.5, 1.6), (0.8, 9.0), (0.7, 900.0)])
def test_labels_of_a_short_logarithmic_axis_do_not_touch(ends: tuple[float, float]) -> None:
    room = 0.8
    fig = figure(room + 0.6, 1.0)
    axes = fig.add_subplot()
    axes.plot(ends, ends)
    log_axis(axes, "x", room)
    fig.canvas.draw()
    boxes = [label.get_window_extent() for label in axes.get_xticklabels() if label.get_text()]
    low, high = axes.get_window_extent().intervalx
    boxes = [box for box in boxes if low <= 0.5 * (box.x0 + box.x1) <= high]
    assert len(boxes) >= 1
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))


def test_the_colours_are_those_of_the_style() -> None:
    @styled
    def cycle() -> list[str]:
        import matplotlib as mpl

        return [entry["color"] for entry in mpl.rcParams["axes.prop_cycle"]]

    assert tuple(cycle()) == style.COLOURS


def test_a_figure_for_print_holds_its_font_and_no_date(tmp_path: Path) -> None:
    fig = figure(3.0, 2.0)
    fig.add_subplot().set_title("ωn [rad/s]")
    picture, printed = style.save_both(fig, tmp_path / "a.b.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert printed == tmp_path / "a.b.pdf"
    content = printed.read_bytes()
    assert b"/FontFile2" in content
    assert b"/Type3" not in content
    assert b"CreationDate" not in content
    style.save_both(fig, tmp_path / "a.b.png")
    assert printed.read_bytes() == content
