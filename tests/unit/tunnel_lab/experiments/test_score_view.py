"""The rows of a score's tables. Truth: figures by hand; Wilson's intervals of 2 of 5 and of 1 of 6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identification.scoring import Trials
from tunnel_lab.experiments.score import packaged_baseline
from tunnel_lab.experiments.score_columns import CELL, COVERAGE, POOLED, ScoreColumn, ScoredRow, score_table
from tunnel_lab.experiments.score_view import notes_below, summary_tables
from tunnel_lab.terminal.outputs import show


def trials(errors: list[float], failures: int = 0, *, bound: bool = True) -> Trials:
    """Errors in units of a tenth, whose bound and reported standard deviation are a tenth, of truths of 2."""
    ones = np.ones(len(errors))
    return Trials(0.1 * np.array(errors), 0.1 * ones, 2.0 * ones, 0.1 * ones if bound else None, failures)


def shown(columns: Sequence[ScoreColumn], *cells: Trials) -> dict[str, str]:
    """The row of one estimator, by heading."""
    table = score_table("one", columns, [({"estimator": "e"}, ScoredRow("e", "zeta", cells))])
    (row,) = table.rows
    heads = (" ".join(head.split()) for head in table.columns)
    return {head.replace("/ ", "/"): text for head, text in zip(heads, row, strict=True)}


def value(text: str) -> float:
    return float(text.partition("(")[0])


def test_cells_are_pooled_in_units_of_their_bounds() -> None:
    row = shown(POOLED, trials([1.0, -1.0, 3.0]), trials([2.0, 2.0], 1))
    assert value(row["RMSE/bound"]) == pytest.approx(((11.0 / 3.0 + 4.0) / 2.0) ** 0.5, abs=0.05)
    assert float(row["worst"]) == 2.0
    assert value(row["bias/bound"]) == pytest.approx(1.4, abs=0.05)  # 1.4 ± 0.68
    assert value(row["RMSE [%]"]) == pytest.approx(
        5.0 * (19.0 / 5.0) ** 0.5, abs=0.5
    )  # the truth is 20 bounds
    assert row["95 % covers [%]"] == "40 (12–77) low"
    assert row["failed"] == "1/6"
    assert (row["estimator"], row["quantity"]) == ("e", "ζ")


def test_what_a_cell_does_not_give_is_a_dash() -> None:
    def dashes(row: dict[str, str]) -> set[str]:
        return {head for head, text in row.items() if text == "–"}

    assert dashes(shown(POOLED, trials([1.0, 2.0], bound=False))) == {"RMSE/bound", "worst", "bias/bound"}
    none = shown(POOLED, trials([], 3))
    assert dashes(none) == {"RMSE [%]", "RMSE/bound", "worst", "bias/bound", "95 % covers [%]"}
    assert none["failed"] == "3/3"
    assert dashes(shown(CELL, trials([], 2))) == {
        "RMSE [%]", "RMSE/bound", "bias [%]", "bias/std", "95 % covers [%]",
    }  # fmt: skip
    exact = shown(CELL, trials([1.0, 1.0, 1.0]))
    assert (exact["95 % covers [%]"], exact["failed"]) == ("100 (44–100)", "0/3")


def test_two_trials_have_a_bias_and_one_has_none() -> None:
    assert value(shown(POOLED, trials([1.0, 2.0]))["bias/bound"]) == pytest.approx(1.5, abs=0.05)
    assert shown(POOLED, trials([1.0]))["bias/bound"] == "–"


def test_the_time_is_not_under_a_heading_of_another_figure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a narrow terminal estimator and time stand above the rows of their section."""
    decays, *_ = summary_tables(packaged_baseline())
    assert decays.columns[:3] == ("estimator", "time [ms/record]", "quantity")
    monkeypatch.setenv("COLUMNS", "80")
    show([decays])
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    for estimator, time in {row[:2] for row in decays.rows}:
        at = lines.index(estimator)
        assert lines[at + 1] == f"{time} ms/record"
        assert lines[at + 2].split()[0] == "ζ"


def test_few_trials_are_said() -> None:
    results = packaged_baseline()
    assert not any(note.text.startswith("Few trials") for note in notes_below(results))
    few = replace(results, grid=replace(results.grid, trials=4))
    (note,) = (note for note in notes_below(few) if note.text.startswith("Few trials"))
    assert note.text.startswith(
        "Few trials: with 4 in a cell, the RMSE of many would be 0.6 to 2.9 times the one shown"
    )


def test_a_cell_has_its_bias_in_per_cent_and_in_deviations() -> None:
    row = shown(CELL, trials([1.0, 2.0, 3.0]))
    assert value(row["RMSE/bound"]) == pytest.approx((14.0 / 3.0) ** 0.5, abs=0.05)
    assert value(row["bias [%]"]) == pytest.approx(10.0, abs=0.5)
    assert value(row["bias/std"]) == pytest.approx(2.0, abs=0.05)
    assert value(row["RMSE [%]"]) == pytest.approx(5.0 * (14.0 / 3.0) ** 0.5, abs=0.5)


def test_a_coverage_is_marked_where_it_is_too_low_and_where_it_is_too_high() -> None:
    """Truth: binomial probabilities of 95 %; 0.95^200 = 4e-5, and 180 or fewer of 200 have 0.3 %."""

    def marks(*hits: int) -> list[str]:
        rows = [ScoredRow("e", "zeta", (trials([1.0] * hit + [3.0] * (200 - hit)),)) for hit in hits]
        table = score_table("one", [COVERAGE], [({"estimator": "e"}, row) for row in rows])
        return [row[-1].partition(")")[2].strip() for row in table.rows]

    assert marks(200, 190, 170) == ["high", "", "low"]
    assert marks(180) == ["low"]
    assert marks(180, *[190] * 9) == [""] * 10  # ten rows: a chance of one in 250 is no longer beyond chance


def test_the_notes_say_what_the_columns_mean() -> None:
    said = notes_below(packaged_baseline())[0].text
    assert said.count("Bound: Cramér–Rao's") == 1
    for column in (*POOLED, *CELL):
        assert column.what in said
