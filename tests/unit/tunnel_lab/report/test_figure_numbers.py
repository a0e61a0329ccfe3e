"""What the figures of a diagnosis draw is what its document says: bars, curves, bands and axes read back.

Truth: a document written by hand.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex

from diagnosis.findings.misfit import run_labels
from diagnosis.where.maps import RunMap
from identification.show.style import styled
from tests.support import rendered
from tests.support.diagnosis_document import CONDITIONS, IDS, document, findings_of, rms, scattering_document
from tests.support.rendered import backbone_figure, friction_figure, law_figure
from tests.support.shown_numbers import numbers

NORMAL = 1.959963984540054  # of 95 %: NIST/SEMATECH e-Handbook, 1.3.6.7.1, to more digits

Document = dict[str, Any]


def shown_runs(runs: list[Document]) -> list[RunMap]:
    """The runs of the maps as values."""
    return [RunMap(**run) for run in runs]


def curve(line: Any) -> list[tuple[float, float]]:
    return list(zip(*(np.asarray(data, float).tolist() for data in line.get_data()), strict=True))


def band(area: Any) -> np.ndarray:
    """Corners of a filled band, in order of x and then of y."""
    corners = np.unique(np.concatenate([path.vertices for path in area.get_paths()]), axis=0)
    return corners[np.lexsort((corners[:, 1], corners[:, 0]))]


def test_bars_of_the_answers(given: Document) -> None:
    fig = rendered.candidates_figure(findings_of(given))
    assert fig is not None
    axes, shown = fig.axes[0], given["candidates"][:4]  # the others are improbable
    assert [bar.get_width() for bar in axes.patches] == [c["probability"] for c in shown]
    words = [text for text in axes.texts if text.get_text()]
    assert [round(text.get_position()[1]) for text in words] == list(range(4))
    for text, candidate in zip(words, shown, strict=True):
        assert text.get_text() == f"{100.0 * candidate['probability']:.0f} %"
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == [c["effect"].replace("_", " ") for c in shown]
    ticks = zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
    assert all(float(label.get_text()) == pytest.approx(tick) for tick, label in ticks)
    colours = [bar.get_facecolor() for bar in axes.patches]
    assert colours[0] != colours[1]
    assert len(set(colours[1:])) == 1
    low, high = axes.get_xlim()
    assert low == 0.0
    assert 1.0 < high < 1.5


def test_one_probable_answer_needs_no_bars(given: Document) -> None:
    for candidate in given["candidates"][1:]:
        candidate["probability"] = 0.009
    assert rendered.candidates_figure(findings_of(given)) is None


def test_points_of_the_closure(given: Document) -> None:
    fig = rendered.closure_figure(findings_of(given))
    axes, runs = fig.axes[0], given["gap"]["runs"]
    before, held_out, fitted = axes.lines
    rows = [(rms(run["before"]), row) for row, run in enumerate(runs)]
    assert np.array(curve(before)) == pytest.approx(np.array(rows))
    for line, whether in ((held_out, True), (fitted, False)):
        wanted = [(rms(r["after"]), row) for row, r in enumerate(runs) if r["held_out"] == whether]
        assert np.array(curve(line)) == pytest.approx(np.array(wanted))
    assert [label.get_text() for label in axes.get_yticklabels()] == list(IDS)
    ends = np.array([sorted(segment[:, 0]) for segment in axes.collections[0].get_segments()])
    assert ends == pytest.approx(np.array([sorted((rms(r["before"]), rms(r["after"]))) for r in runs]))
    noise = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    assert (noise.x0, noise.x1) == pytest.approx((0.0, rms(0.063)))  # three times 0.021
    low, high = axes.get_xlim()
    assert low == 0.0
    assert high > rms(31.72)


def test_closure_without_maps_and_without_causes(given: Document) -> None:
    given["maps"] = None
    for run in given["gap"]["runs"]:
        run["after"] = run["before"]
    axes = rendered.closure_figure(findings_of(given)).axes[0]
    noise = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    assert noise.x1 == pytest.approx(rms(0.03))
    assert len(axes.lines) == 1


@pytest.mark.parametrize("speeds", [[0.0, 13.5, 21.5], None])
def test_the_place_of_the_gap(given: Document, speeds: list[float] | None) -> None:
    grid = given["maps"]["grid"]
    if speeds is None:
        grid |= {"wind_speeds": None, "time_edges_s": [0.0, 2.5, 5.0, 7.5]}
    fig = rendered.place_figure(findings_of(given))
    assert fig is not None
    axes, (mesh,) = fig.axes[0], fig.axes[0].collections
    shown = np.ma.filled(mesh.get_array().astype(float), np.nan)
    wanted = [[rms(2.25), rms(4.25), np.nan], [rms(6.25), np.nan, rms(9.25)]]  # 0.05 is within the noise
    np.testing.assert_allclose(shown, wanted)
    corners = mesh.get_coordinates()
    assert list(corners[:, 0, 1]) == pytest.approx(np.degrees(grid["amplitude_edges_rad"]).tolist())
    if speeds is None:
        assert corners[0, :, 0].tolist() == grid["time_edges_s"]
    else:
        assert [label.get_text() for label in axes.get_xticklabels()] == ["off", "13.5", "21.5"]
    assert mesh.get_clim() == pytest.approx((0.0, rms(9.25)))
    given["maps"] = None
    assert rendered.place_figure(findings_of(given)) is None


def test_intervals_of_the_coefficients(given: Document) -> None:
    fig = rendered.coefficients_figure(findings_of(given))
    assert fig is not None
    for axes, name in zip(fig.axes, ("cn_beta", "cn_r"), strict=True):
        for row, (key, container) in enumerate(zip(("before", "after"), axes.containers, strict=True)):
            values = given["coefficients"][key][name]
            line, _, (bar,) = container.lines
            assert curve(line) == [(values["value"], row)]
            reach = NORMAL * values["std"]
            (ends,) = bar.get_segments()
            assert ends[:, 0] == pytest.approx([values["value"] - reach, values["value"] + reach])
        bottom, top = axes.get_ylim()
        assert bottom > 1 > 0 > top  # before above after
    given["coefficients"]["after"]["cn_r"] |= {"std": None, "determined": False}
    alone = rendered.coefficients_figure(findings_of(given))
    assert alone is not None
    assert len(alone.axes) == 1
    given["coefficients"]["after"] = {}
    assert rendered.coefficients_figure(findings_of(given)) is None


def test_the_map_of_runs(given: Document) -> None:
    grid = rendered.runs_figure(findings_of(given)).axes[0]
    image = np.ma.filled(grid.images[0].get_array().astype(float), np.nan)
    wanted = np.array([[60.0, 21.0, np.nan], [9.0, np.nan, 1.5], [2.0, 0.5, np.nan]])
    assert np.array_equal(image, wanted, equal_nan=True)  # cells below three times 0.017 √3 stay empty
    assert grid.images[0].get_clim() == pytest.approx((3.0 * 0.017 * np.sqrt(3.0), 60.0))
    assert grid.images[0].get_extent() == [0.0, 9.0, 2.5, -0.5]
    assert [label.get_text() for label in grid.get_yticklabels()] == [
        "alpha · 16.25 N m/rad · wind off", "beta · 44.75 N m/rad · 13.5 m/s", "gamma · 21.5 m/s",
    ]  # fmt: skip


def test_the_time_axis_of_runs_with_long_names_is_labelled_within_the_figure() -> None:
    given = document()
    for number, run in enumerate(given["maps"]["runs"]):
        run["id"] = f"Messung_{number}_lang"
    fig = rendered.runs_figure(findings_of(given))
    fig.draw_without_rendering()
    label = fig.axes[0].xaxis.label.get_window_extent()
    assert 0.0 <= label.x0 < label.x1 <= fig.bbox.width


def test_a_map_within_the_noise_says_so(given: Document) -> None:
    given["maps"]["time"]["by_run"] = [[0.01, -0.02, None]] * 3
    texts = rendered.runs_figure(findings_of(given)).axes[0].texts
    assert [text.get_text() for text in texts] == ["every cell within the noise"]
    assert not rendered.runs_figure(findings_of(document())).axes[0].texts


@pytest.mark.parametrize(("place", "key", "edges"), [(0, "time", "edges_s"), (2, "amplitude", "edges_rad")])
def test_profiles(given: Document, place: int, key: str, edges: str) -> None:
    axes = rendered.profiles_figure(findings_of(given)).axes[place]
    values, interval = given["maps"][key], given["where"][key + ("_s" if key == "time" else "_rad")]
    shade, noise, mean = axes.patches
    shown = np.degrees if key == "amplitude" else np.asarray
    box = shade.get_extents().transformed(axes.transData.inverted())
    assert (box.x0, box.x1) == pytest.approx(shown(interval).tolist())
    drawn = mean.get_data()
    assert drawn.values.tolist() == values["excess"]
    assert drawn.edges.tolist() == pytest.approx(shown(values[edges]).tolist())
    spread = noise.get_data()
    assert spread.values.tolist() == pytest.approx([3.0 * s for s in values["std"]])
    assert np.asarray(spread.baseline).tolist() == pytest.approx([-3.0 * s for s in values["std"]])
    assert axes.get_xlim() == pytest.approx((0.0, float(shown(values[edges][-1]))))
    low, high = axes.get_ylim()
    assert low <= min(-3.0 * min(values["std"]), *values["excess"])
    assert high >= max(values["excess"])


def test_the_share_of_the_missing_moment(given: Document) -> None:
    fig = rendered.profiles_figure(findings_of(given))
    (beside,) = (axes for axes in fig.axes if "%" in axes.get_ylabel())
    drawn = beside.patches[0].get_data()
    assert drawn.values == pytest.approx([55.0, 34.0, 11.0])
    assert drawn.edges.tolist() == given["maps"]["time"]["edges_s"]
    low, high = beside.get_ylim()
    assert low == 0.0
    assert 55.0 < high < 60.0


def test_no_interval_no_shade(given: Document) -> None:
    given["where"]["time_s"] = None
    assert len(rendered.profiles_figure(findings_of(given)).axes[0].patches) == 2


def test_the_spectrum(given: Document) -> None:
    axes = rendered.spectrum_figure(findings_of(given)).axes[0]
    values = given["maps"]["frequency"]
    before, after = (np.array(curve(line)) for line in axes.lines)
    centres = [np.sqrt(0.5 * 1.0), np.sqrt(1.0 * 4.0), np.sqrt(4.0 * 16.0)]
    assert before[:, 0] == pytest.approx(centres)
    assert before[:, 1] == pytest.approx([2.25, 81.0, 0.3])  # the last is below the axis and drawn on it
    assert after[:, 1] == pytest.approx([1.0 + a for a in values["after"]])
    corners = band(axes.collections[0])
    for x, std, low in zip(centres, values["std"], (0.847, 0.844, 0.3), strict=True):
        column = corners[np.isclose(corners[:, 0], x), 1]
        assert (column.min(), column.max()) == pytest.approx((low, 1.0 + 3.0 * std))
    boxes = [patch.get_extents().transformed(axes.transData.inverted()) for patch in axes.patches]
    assert (boxes[0].x0, boxes[0].x1) == pytest.approx(given["where"]["frequency_hz"])
    assert 1.8 < boxes[1].x0 < 1.9
    assert 2.6 < boxes[1].x1 < 2.7
    assert axes.get_xlim() == pytest.approx((0.5, 16.0))
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_a_spectrum_without_causes_has_one_curve(given: Document) -> None:
    given["maps"]["frequency"]["after"] = None
    assert len(rendered.spectrum_figure(findings_of(given)).axes[0].lines) == 1


def test_backbones(given: Document) -> None:
    given["maps"]["backbones"][1]["time_s"] = [1.0]  # one window makes no curve
    fig = backbone_figure(findings_of(given))
    frequency, damping = fig.axes
    swings = np.degrees([0.1, 0.2, 0.3]).tolist()
    for axes, values, stds in (
        (frequency, [4.0, 2.0, 1.0], lambda nominal: [0.3 / nominal, 0.2 / nominal, 0.1 / nominal]),
        (damping, [4.0, 2.0, 1.0], lambda _: [0.3, 0.2, 0.1]),
    ):
        assert len(axes.lines) == 3  # two curves and the level line
        for line, area, nominal in zip(axes.lines, axes.collections, (1.95, 2.55), strict=False):
            assert np.array(curve(line)) == pytest.approx(np.array(list(zip(swings, values, strict=True))))
            corners = band(area)
            for x, y, std in zip(swings, values, stds(nominal), strict=True):
                column = corners[np.isclose(corners[:, 0], x), 1]
                assert (column.min(), column.max()) == pytest.approx((y - NORMAL * std, y + NORMAL * std))
        assert list(axes.lines[-1].get_ydata()) == [0.0, 0.0]
    labels = [line.get_label() for line in damping.lines[:2]]
    named = run_labels(shown_runs(given["maps"]["runs"]))
    assert labels == [named[0], named[2]]


def test_no_two_backbones_are_of_one_colour(given: Document) -> None:
    for name in ("backbones", "runs"):
        first = given["maps"][name][0]
        given["maps"][name] = [first | {"id": f"run-{i}"} for i in range(12)]
    _, damping = backbone_figure(findings_of(given)).axes
    curves = damping.lines[:-1]
    assert len({to_hex(line.get_color()) for line in curves}) == len(curves) == 12


@pytest.mark.parametrize("size", [2, 18, 40])
def test_the_legend_of_the_backbones_is_no_wider_than_the_figure(given: Document, size: int) -> None:
    for run, curve in zip(given["maps"]["runs"], given["maps"]["backbones"], strict=True):
        run["id"] = curve["id"] = run["id"].rjust(size, "w")
    fig = backbone_figure(findings_of(given))
    styled(fig.draw_without_rendering)()
    legend = fig.legends[0].get_window_extent()
    assert 0.0 <= legend.x0 < legend.x1 <= fig.bbox.x1


def test_the_runs_that_carry_the_gap_are_drawn_first(given: Document) -> None:
    labels = [line.get_label() for line in backbone_figure(findings_of(given)).axes[1].lines[:3]]
    assert [label.split(" ")[0] for label in labels] == ["alpha", "gamma", "beta"]


@pytest.mark.parametrize(("size", "factor", "unit"), [(1.0, 1e3, "10⁻³ N m"), (100.0, 1.0, "N m")])
def test_the_phase_plane(given: Document, size: float, factor: float, unit: str) -> None:
    plane = given["maps"]["phase_plane"]
    for name in ("moment", "std"):
        plane[name] = [[None if v is None else size * v for v in row] for row in plane[name]]
    fig = rendered.phase_plane_figure(findings_of(given))
    assert fig is not None
    field = fig.axes[0]
    image = np.ma.filled(field.images[0].get_array().astype(float), np.nan)
    wanted = factor * size * np.array([[0.012, -0.025], [np.nan, np.nan]])
    assert np.allclose(image, wanted, equal_nan=True)  # the last cell is within three standard deviations
    low, high = field.images[0].get_clim()
    assert low == -high
    assert high == pytest.approx(factor * size * np.quantile([0.012, 0.025, 0.001], 0.98))
    assert field.images[0].get_extent() == pytest.approx(np.degrees([-0.4, 0.4, -0.4, 0.4]).tolist())
    assert any(f"[{unit}]" in axes.get_xlabel() for axes in fig.axes)
    means = rendered.moment_figure(findings_of(given))
    assert means is not None
    for axes, name in zip(means.axes, ("by_angle", "by_rate"), strict=True):
        assert f"[{unit}]" in axes.get_ylabel()
        assert np.array(curve(axes.lines[1])) == pytest.approx(
            np.array(list(zip(np.degrees([-0.2, 0.2]), [factor * v for v in plane[name]], strict=True)))
        )
        corners = band(axes.collections[0])
        for x, y, std in zip(np.degrees([-0.2, 0.2]), plane[name], plane[name + "_std"], strict=True):
            column = corners[np.isclose(corners[:, 0], x), 1] / factor
            assert (column.min(), column.max()) == pytest.approx((y - NORMAL * std, y + NORMAL * std))


def test_no_phase_plane_no_figure(given: Document) -> None:
    given["maps"]["phase_plane"] = None
    assert rendered.phase_plane_figure(findings_of(given)) is None
    assert rendered.moment_figure(findings_of(given)) is None


def test_the_label_of_a_run_holds_its_conditions(given: Document) -> None:
    for label, (spring, speed, *_) in zip(
        run_labels(shown_runs(given["maps"]["runs"])), CONDITIONS, strict=True
    ):
        assert [n.value for n in numbers(label)] == [v for v in (spring, speed) if v]


def test_no_label_speaks_of_wind_where_no_run_had_any(given: Document) -> None:
    still = [run | {"wind_speed": 0.0} for run in given["maps"]["runs"]]
    still[0]["spring_stiffness"] = 0.0
    labels = run_labels(shown_runs(still))
    assert labels[0] == IDS[0]
    assert not any("wind" in label for label in labels)


def test_the_band_of_a_proposed_law_holds_two_standard_deviations(given: Document) -> None:
    law = {
        "over": ["angle"],
        "places": [[-0.1, 0.0, 0.1]],
        "values": [3.0, 1.0, -2.0],
        "std": [0.1, 0.2, 0.3],
    }

    def drawn(unit: str) -> Any:
        closable = {"ceilings": [], "kind": "angle", "curve": law | {"unit": unit}}
        return law_figure(findings_of(given | {"closable": closable}))

    fig = drawn("N m")
    assert fig is not None
    (axes,) = fig.axes
    (line,) = axes.lines
    far = math.degrees(0.1)
    np.testing.assert_allclose(curve(line), [(-far, 3.0), (0.0, 1.0), (far, -2.0)])
    low_high = [(-far, 2.804), (-far, 3.196), (0.0, 0.608), (0.0, 1.392), (far, -2.588), (far, -1.412)]
    assert band(axes.collections[0]) == pytest.approx(np.array(low_high), rel=1e-4)
    assert axes.get_xlabel() == "angle [°]"
    assert axes.get_ylabel() == "missing moment [N m]"
    (reading,) = drawn("rad").axes
    np.testing.assert_allclose([y for _, y in curve(reading.lines[0])], np.degrees([3.0, 1.0, -2.0]))
    assert reading.get_ylabel() == "error of the reading [°]"


def test_friction_is_drawn_with_its_band_and_the_points_with_their_errors(given: Document) -> None:
    assert friction_figure(findings_of(given)) is None
    found = {
        "effect": "coulomb_friction", "unit": "N m",
        "rate_rad_s": [0.1, 1.0], "moment": [3.0, 2.0], "std": [0.1, 0.2],
        "points": [{"rate_rad_s": 0.2, "moment": 2.5, "std": 0.05, "strokes": 3}],
    }  # fmt: skip
    fig = friction_figure(findings_of(given | {"maps": given["maps"] | {"friction": found}}))
    assert fig is not None
    (axes,) = fig.axes
    assert curve(axes.lines[0]) == [(0.1, 3.0), (1.0, 2.0)]
    assert band(axes.collections[0]) == pytest.approx(
        np.array([(0.1, 2.804), (0.1, 3.196), (1.0, 1.608), (1.0, 2.392)]), rel=1e-4
    )
    (points,) = axes.containers
    assert curve(points.lines[0]) == [(0.2, 2.5)]
    assert points.lines[2][0].get_segments()[0][:, 1] == pytest.approx([2.402, 2.598], rel=1e-4)
    assert axes.get_ylim()[0] == 0.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("rate [rad/s]", "coulomb friction [N m]")
    (other,) = friction_figure(
        findings_of(given | {"maps": given["maps"] | {"friction": found | {"unit": "rad/s2", "points": []}}})
    ).axes
    assert other.get_ylabel() == "coulomb friction [rad/s², over inertia]"


def test_every_run_is_drawn_against_the_model_with_its_band() -> None:
    given = scattering_document()
    fig = rendered.repeatability_figure(findings_of(given))
    assert fig is not None
    runs = given["repeatability"]["runs"]
    for axes, name in zip(fig.axes, ("frequency", "damping"), strict=True):
        bands = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in axes.patches]
        assert bands == [
            pytest.approx((-100 * NORMAL * run[f"{name}_band"], 100 * NORMAL * run[f"{name}_band"]))
            for run in runs
        ]
        drawn = {round(y): x for box in axes.containers[1:] for x, y in curve(box.lines[0])}
        assert drawn == {row: pytest.approx(100.0 * run[name]) for row, run in enumerate(runs)}
        for box in axes.containers[1:]:
            for (x, y), bar in zip(curve(box.lines[0]), box.lines[2][0].get_segments(), strict=True):
                reach = 100 * NORMAL * runs[round(y)][f"{name}_std"]
                assert bar[:, 0] == pytest.approx([x - reach, x + reach])
    assert [label.get_text() for label in fig.axes[0].get_yticklabels()] == list(IDS)  # in their order
    # the outlying run has a mark of its own, and its deviation where it is beyond the band
    marks = {box.get_label(): box.lines[0] for box in fig.axes[0].containers[1:]}
    assert curve(marks["deviates far beyond"])[0][1] == IDS.index("beta")
    assert [text.get_text() for text in fig.axes[0].texts] == ["−1.2 %"]
    assert not [text.get_text() for text in fig.axes[1].texts][1:]
    assert marks["wind on"].get_markerfacecolor() != marks["wind off"].get_markerfacecolor()


def test_runs_that_repeat_have_bands_of_the_noise_and_a_single_run_no_figure() -> None:
    given = scattering_document()
    found = given["repeatability"]
    found |= {"spreads": [], "outlier": ""}
    for run in found["runs"]:
        run |= {"frequency_band": 0.0, "damping_band": 0.0}
    fig = rendered.repeatability_figure(findings_of(given))
    assert fig is not None
    widths = [bar.get_width() for bar in fig.axes[0].patches]
    assert widths == [pytest.approx(200 * NORMAL * run["frequency_std"]) for run in found["runs"]]
    assert "noise (95 %)" in [text.get_text() for text in fig.legends[0].get_texts()]
    given["repeatability"]["runs"] = found["runs"][:1]
    assert rendered.repeatability_figure(findings_of(given)) is None
    given["repeatability"] = None
    assert rendered.repeatability_figure(findings_of(given)) is None


def test_scatter_between_runs_is_one_bar_of_the_waterfall_and_of_the_answers() -> None:
    given = scattering_document()
    for fig in (
        rendered.waterfall_figure(findings_of(given)),
        rendered.candidates_figure(findings_of(given)),
    ):
        assert fig is not None
        labels = " ".join(label.get_text() for label in fig.axes[0].get_yticklabels()).replace("\n", " ")
        assert "scatter between runs" in labels
        assert "wind speed scatter" not in labels
