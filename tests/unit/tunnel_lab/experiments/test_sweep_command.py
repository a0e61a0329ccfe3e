"""``tunnel sweep``: what it says, what it refuses, and its summary. Truth of the summary: rows made by hand."""

from __future__ import annotations

import re
import shutil
from itertools import pairwise
from pathlib import Path

import polars as pl
import pytest

from identification.show.style import styled
from tests.marks import slow
from tests.support.gone_reader import unheard
from tests.support.small_sweep import SMALL
from tunnel_lab.cli import main
from tunnel_lab.experiments import runner, sweep_view
from tunnel_lab.experiments.experiment import run_in
from tunnel_lab.experiments.sweep import read_sweep, sweep_of
from tunnel_lab.experiments.sweep_cases import Sweep
from tunnel_lab.experiments.sweep_view import ScoreLine, lines_of, summarise
from tunnel_lab.experiments.sweep_work import RESULT_COLUMNS, SCATTER_COLUMNS

EFFECT = 'name = "coulomb_friction"\nparameters = { friction_moment = [0.002, 0.02] }'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seed = 1", "seed = ", "not valid TOML"),
        ("seed = 1", "sead = 1", "unknown key 'sead'; did you mean 'seed'?"),
        ("cn_r = -0.114", "cn_rr = -0.114", "[truth]: unknown key 'cn_rr'; did you mean 'cn_r'?"),
        ("cn_r = -0.114", "cn_r = [-0.1, nan]", "'cn_r' = nan is not a finite number"),
        ("cn_r = -0.114", 'cn_r = "x"', "'cn_r' = 'x' is not a number"),
        ("cn_r = -0.114", "", "[truth]: 'cn_r' is missing; give cn_r as a number or a list of them, 1/rad"),
        ("[0.0002, 0.002]", "[]", "[sensor]: 'noise_std' is empty"),
        ("[0.0002, 0.002]", "[0.0002, 0.0002]", "sensor contains a value twice"),
        ("[0.0002, 0.002]", "[0.0002, -0.1]", "'noise_std' = -0.1"),
        ("conventional", "convetional", "unknown estimator 'convetional'; did you mean 'conventional'?"),
        ("coulomb_friction", "coulomb_frictoin", "did you mean 'coulomb_friction'?"),
        ("friction_moment", "friction_momnet", "did you mean 'friction_moment'?"),
        (EFFECT, 'name = "coulomb_friction"', "friction_moment is missing"),
        (EFFECT, 'name = "none"', "effects contains a value twice"),
        ("0.02]", "-0.02]", "friction_moment = -0.02 is out of range"),
        ("springs = [8]", "springs = [11]", "there is no spring 11"),
        ("springs = [8]", "", "no spring"),
        ("wind_speeds = [0.0, 15.0]", "wind_speeds = []", "'wind_speeds' is empty"),
        ("sample_rate = 500.0", "sample_rate = 300.0", "not a whole number of"),
        ("replicates = 2", "replicates = 0", "'replicates' = 0"),
        ("[conditions]", '[[rig]]\nfile = "no.toml"\n[conditions]', "no.toml"),
        ("[conditions]", "[[rig]]\nchanges = { dynamic = { x = 1 } }\n[conditions]", "did you mean 'dynamics'?"),
        ('["conventional"]\nrecords = true', "[]", "neither estimators nor records"),
        ("replicates = 2", "replicates = 2\neffects = []", "small.toml"),
    ],
)  # fmt: skip
def test_a_broken_file_is_one_line_and_leaves_nothing(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, said: str
) -> None:
    assert old in SMALL
    small.write_text(SMALL.replace(old, new), encoding="utf-8")
    assert main(["sweep", str(small), "--out", str(tmp_path / "out")]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert said in captured.err
    assert ".toml" in captured.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["FILE"], "--out is missing"),
        (["--out", "OUT"], "FILE is missing"),
        (["no.toml", "--out", "OUT"], "no such file"),
        (["FILE", "--out", "OUT", "--summary", "OUT"], "takes neither FILE nor --out"),
        (["--summary", "OUT"], "sweep.json: no such file; name the folder of a sweep"),
        (["FILE", "--out", "TAKEN"], "the folder holds something else"),
        (["FILE", "--out", "FILE"], "cannot be written"),
        (["FILE", "--out", "OUT", "--jobs", "0"], "--jobs"),
        (["FILE", "--out", "OUT", "--scheduler", "tcp://127.0.0.1:1"], "no scheduler answers"),
        (["FILE", "--out", "OUT", "--scheduler", "tcp://h:1", "--jobs", "2"], "leave out --jobs"),
        (["FILE", "--out", "OUT", "--scheduler", "nonsense://h"], "no scheduler answers"),
    ],
)
def test_bad_words_are_one_line(
    small: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    said: str,
) -> None:
    monkeypatch.setattr(runner, "CONNECT_S", 0.5)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "thesis.txt").write_text("")
    places = {"FILE": small, "OUT": tmp_path / "out", "TAKEN": tmp_path / "taken"}
    assert main(["sweep", *(str(places.get(word, word)) for word in words)]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert said in captured.err


def test_the_file_in_the_help_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "100")
        assert main(["sweep", "--help"]) == 0
    shown = capsys.readouterr().out.partition("A sweep file")[2].partition("Examples")[0]
    (tmp_path / "help.toml").write_text(shown, encoding="utf-8")
    assert read_sweep(tmp_path / "help.toml").size == 2 * 3 * 3 * 10


@pytest.mark.slow
def test_the_summary_of_a_sweep(
    sweep: Sweep, here, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_in(sweep_of(sweep), tmp_path / "out", here)
    assert unheard("sweep", "--summary", tmp_path / "out") == 0
    assert len(list((tmp_path / "out" / "summary").iterdir())) == 8  # written before the first word
    shutil.rmtree(tmp_path / "out" / "summary")
    assert main(["sweep", "--summary", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    for part in ("All cases without effects", "Error against noise", "Error against coulomb friction"):
        assert part in said
    files = {path.name: path for path in (tmp_path / "out" / "summary").iterdir()}
    names = ("noise-std", "wind-speed", "coulomb-friction")
    drawn = {f"error-by-{name}.{form}" for name in names for form in ("png", "pdf")}
    assert set(files) == {"summary.csv", "index.html"} | drawn
    assert all(path.read_bytes()[:4] == b"\x89PNG" for name, path in files.items() if name.endswith("png"))
    table = pl.read_csv(files["summary.csv"])
    friction = table.filter((pl.col("axis") == "severity") & (pl.col("quantity") == "zeta"))
    assert friction["at"].to_list() == [0.0, 0.002, 0.02]
    assert friction["count"].to_list() == [8, 8, 8]  # two noises, two replicates, wind off and on
    assert friction["bias"][2] > friction["bias"][1] > 0.0  # dry friction is taken for damping


def hand_made(values: list[float | None], status: str = "ok") -> pl.DataFrame:
    """Rows of one estimator whose truth is 2: noise 1 for the first half, 10 for the second."""
    half = len(values) // 2
    return pl.DataFrame(
        {
            "effect": ["none"] * len(values),
            "severity": [0.0] * len(values),
            "noise_std": [1.0] * half + [10.0] * (len(values) - half),
            "wind_speed": [0.0] * len(values),
            "spring_stiffness": [None] * len(values),
            "duration": [1.0] * len(values),
            **{column: [0.0] * len(values) for column in SCATTER_COLUMNS},
            "truth": [2.0] * len(values),
            "value": values,
            "std": [None if value is None else 0.05 for value in values],
            "bound": [0.04] * len(values),
            "status": [status if value is None else "ok" for value in values],
            "unit": ["1"] * len(values),
        }
    )


def test_figures_by_hand() -> None:
    lines = list(lines_of(hand_made([2.02, 1.98, 2.2, 2.2, None, 2.2], "raised"), "e", "zeta"))
    overall, *along = lines
    assert [line.at for line in along] == [1.0, 10.0]  # not by speed (one value) or spring (none)
    assert overall.score.failures.count == 1
    one, ten = (line.score for line in along)
    assert ten.bias.value == pytest.approx(10.0)  # 2.2 of 2.0, in %
    assert (ten.bias.std, ten.coverage.value) == (pytest.approx(0.0, abs=1e-9), 0.0)
    assert one.rmse.value == pytest.approx(((1.0 + 1.0 + 100.0) / 3.0) ** 0.5)
    assert one.coverage.value == pytest.approx(2.0 / 3.0)


def test_the_title_says_that_cases_with_scatter_are_left_out() -> None:
    rows = hand_made([2.02, 1.98, 2.2, 2.2])
    scattered = rows.with_columns(scatter_wind_speed=pl.lit(0.01), value=pl.lit(3.0))
    mixed = list(lines_of(pl.concat([rows, scattered]), "e", "zeta"))
    title = sweep_view.overall_table(mixed).title
    assert title == "All cases without effects and without scatter"
    assert mixed[0].score.count == 4
    for alone in (rows, scattered):
        title = sweep_view.overall_table(lines_of(alone, "e", "zeta")).title
        assert title == "All cases without effects"
    along = [line for line in mixed if line.axis == "scatter_wind_speed"]
    assert sweep_view.axis_table(along).columns[0] == "relative scatter of wind speed [1]"


def test_errors_about_a_truth_of_zero_are_in_its_unit() -> None:
    rows = hand_made([0.02, -0.02, 0.1, 0.1]).with_columns(truth=pl.lit(0.0), unit=pl.lit("rad"))
    for truth, unit, rmse in ((0.0, "rad", 0.1), (-1.0, "%", 110.0)):
        *_, last = lines_of(rows.with_columns(truth=pl.lit(truth)), "e", "sensor_zero")
        assert (last.score.rmse.value, last.score.rmse.unit) == (pytest.approx(rmse), unit)


def test_a_row_of_the_csv_is_its_line_with_intervals() -> None:
    overall, *_ = lines_of(hand_made([2.02, 1.98, 2.2, 2.2, None, 2.2], "raised"), "e", "zeta")
    row = overall.to_row()
    assert (row["axis"], row["at"], row["unit"], row["count"]) == ("all", None, "%", 6)
    assert (row["bias"], row["rmse"]) == (pytest.approx(6.0), pytest.approx((302.0 / 5.0) ** 0.5))
    assert (row["failures"], row["coverage"]) == (pytest.approx(1.0 / 6.0), pytest.approx(0.4))
    assert row["rmse_over_bound"] == pytest.approx(((2 * 0.5**2 + 3 * 5.0**2) / 5.0) ** 0.5)
    for name in ("failures", "coverage"):
        assert 0.0 < row[f"{name}_low"] < row[name] < row[f"{name}_high"] < 1.0
    none, *_ = lines_of(hand_made([None, None], "raised"), "e", "zeta")
    empty = none.to_row()
    assert empty["failures"] == 1.0
    assert [empty[name] for name in ("unit", "bias", "rmse_std", "coverage", "coverage_low")] == [None] * 5


def test_a_figure_has_a_column_of_panels_for_each_quantity() -> None:
    values = {"zeta": [2.02, 1.98, 2.2, 2.2], "omega_n": [2.0, 2.02, 2.04, 2.08]}
    lines = [line for name, some in values.items() for line in lines_of(hand_made(some), "e", name)]
    along = [line for line in lines if line.axis == "noise_std"]
    drawn = sweep_view.error_figure(along)
    assert drawn is not None
    panels = [[line.get_ydata().tolist() for line in axes.get_lines()[:1]] for axes in drawn.axes]
    wanted = [[quantity, figure] for quantity in ("omega_n", "zeta") for figure in ("rmse", "bias")]
    assert panels == [
        [[getattr(line.score, figure).value for line in along if line.quantity == quantity]]
        for quantity, figure in wanted
    ]


@pytest.mark.parametrize(
    "noise",
    [
        (3e-4, 1e-3, 2e-3),
        (0.0, 1e-3),
        (2e-6, 1e-5),
        *map(slow, ((1e-4, 2e-3), (1e-5, 2e-4), (1.25e-4, 2.5e-4, 5e-4))),
    ],
)
@styled  # as a figure is saved
def test_labels_of_the_axes_do_not_touch(noise: tuple[float, ...]) -> None:
    rows = pl.concat(
        [hand_made([2.02, 1.98, 2.2, 2.3]).with_columns(noise_std=at) for at in map(pl.lit, noise)]
    )
    drawn = sweep_view.error_figure(
        [line for line in lines_of(rows, "e", "zeta") if line.axis == "noise_std"]
    )
    assert drawn is not None
    shown = []
    drawn.draw_without_rendering()
    for axes in drawn.axes:
        low, high = axes.get_xlim()
        shown += [
            text
            for at, text in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
            if low <= at <= high
        ]
    assert len(shown) >= 4
    boxes = sorted((text.get_window_extent() for text in shown), key=lambda box: box.x0)
    assert all(left.x1 + 4.0 < right.x0 for left, right in pairwise(boxes))  # pixels, about a digit's width
    assert [
        text.get_text() for text in shown if re.search(r"\{-?\d+\.\d", text.get_text())
    ] == []  # such as 10^-3.7


def test_each_line_has_the_rows_of_one_estimator_and_quantity_that_were_asked() -> None:
    """Left out are rows without a truth, and values that the runs cannot give; any other status is a failure."""
    good, none = hand_made([2.02, 1.98]), hand_made([None, None], "no_wind_on")
    given = hand_made([2.2]).with_columns(pl.lit("no_wind_on").alias("status"))
    failed, untrue = (
        hand_made([None], "raised"),
        hand_made([2.0]).with_columns(truth=pl.lit(None, pl.Float64)),
    )
    parts = [
        part.with_columns(estimator=pl.lit(estimator), quantity=pl.lit(quantity))
        for estimator, quantity, *some in (
            ("a", "zeta", good, none, given, failed, untrue),
            ("a", "omega_n", good),
            ("b", "zeta", good, failed, failed),
            ("b", "omega_n", none),
        )
        for part in some
    ]
    found = {
        (line.estimator, line.quantity): (line.score.count, line.score.failures.count)
        for line in summarise(pl.concat(parts).lazy())
        if line.axis == "all"
    }
    assert found == {("a", "zeta"): (4, 1), ("a", "omega_n"): (2, 0), ("b", "zeta"): (4, 2)}


def test_a_sweep_without_estimators_has_no_summary(
    here, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SMALL.replace('["conventional"]', "[]").replace("replicates = 2", "replicates = 1")
    (tmp_path / "only.toml").write_text(text[: text.index("[[effects]]")], encoding="utf-8")
    run_in(sweep_of(read_sweep(tmp_path / "only.toml")), tmp_path / "out", here)
    assert main(["sweep", "--summary", str(tmp_path / "out")]) == 2
    assert "the sweep has no estimators" in capsys.readouterr().err


def test_what_runs_cannot_give_is_no_failure(here, tmp_path: Path) -> None:
    """The conventional method estimates no zero: it has no line; wind-off runs give no Cnβ: nor has that."""
    text = SMALL.replace("[0.0, 15.0]", "[0.0]")
    (tmp_path / "off.toml").write_text(text[: text.index("[[effects]]")], encoding="utf-8")
    lines = summarise(run_in(sweep_of(read_sweep(tmp_path / "off.toml")), tmp_path / "out", here)[0].scan())
    assert {"omega_n", "zeta"} <= {line.quantity for line in lines}
    assert not {"cn_beta", "cn_r", "sensor_zero"} & {line.quantity for line in lines}
    assert all(line.score.failures.count == 0 for line in lines)


def test_a_figure_without_quantities_to_draw_is_none() -> None:
    lines: list[ScoreLine] = [*lines_of(hand_made([1.0, 2.0, 3.0, 4.0]), "e", "yaw_inertia")]
    assert sweep_view.error_figure(lines[1:]) is None
    assert "noise_std" in RESULT_COLUMNS
