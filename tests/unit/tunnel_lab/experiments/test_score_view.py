"""The rows of a score's tables. Truth: figures by hand; Wilson's intervals of 2 of 5 and of 1 of 6."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.scoring import Trials, score
from tunnel_lab.experiments.score import packaged_baseline
from tunnel_lab.experiments.score_view import cell_figures, notes_below, pooled_figures, summary_tables


def trials(errors: list[float], failures: int = 0, *, bound: bool = True) -> Trials:
    """Errors in units of a tenth, whose bound and reported standard deviation are a tenth, of truths of 2."""
    ones = np.ones(len(errors))
    return Trials(0.1 * np.array(errors), 0.1 * ones, 2.0 * ones, 0.1 * ones if bound else None, failures)


def test_cells_are_pooled_in_units_of_their_bounds() -> None:
    rmse, worst, bias, covered, failed = pooled_figures([trials([1.0, -1.0, 3.0]), trials([2.0, 2.0], 1)])
    assert float(rmse.partition("(")[0]) == pytest.approx(((11.0 / 3.0 + 4.0) / 2.0) ** 0.5, abs=0.05)
    assert float(worst) == 2.0
    assert float(bias.partition("(")[0]) == pytest.approx(1.4, abs=0.05)  # 1.4 ± 0.68
    assert covered == "40 (12–77)"
    assert failed == "16.7 (3–56)"


def test_what_a_cell_does_not_give_is_a_dash() -> None:
    assert pooled_figures([trials([1.0, 2.0], bound=False)])[:3] == ("–", "–", "–")
    assert pooled_figures([trials([], 3)]) == ("–", "–", "–", "–", "100 (44–100)")
    assert cell_figures(score(trials([], 2)))[:4] == ("–", "–", "–", "–")
    assert cell_figures(score(trials([1.0, 1.0, 1.0])))[3:] == ("100 (44–100)", "0")


def test_two_trials_have_a_bias_and_one_has_none() -> None:
    assert float(pooled_figures([trials([1.0, 2.0])])[2].partition("(")[0]) == pytest.approx(1.5, abs=0.05)
    assert pooled_figures([trials([1.0])])[2] == "–"


def test_the_time_is_not_under_a_heading_of_another_figure() -> None:
    """In a narrow terminal a row is printed as headings and values: a time is not one of an RMSE."""
    decays, *_ = summary_tables(packaged_baseline())
    times = [others for first, *others in decays.rows if first.endswith("ms/record")]
    assert len(times) == len(packaged_baseline().estimators)
    assert not any(cell for others in times for cell in others)


def test_few_trials_are_said() -> None:
    results = packaged_baseline()
    assert not any(note.text.startswith("Few trials") for note in notes_below(results))
    few = replace(results, grid=replace(results.grid, trials=4))
    (note,) = (note for note in notes_below(few) if note.text.startswith("Few trials"))
    assert note.text.startswith(
        "Few trials: with 4 in a cell, the RMSE of many would be 0.6 to 2.9 times the one shown"
    )


def test_a_cell_has_its_bias_in_per_cent_and_in_deviations() -> None:
    over_bound, per_cent, deviations, *_ = cell_figures(score(trials([1.0, 2.0, 3.0])))
    assert float(over_bound.partition("(")[0]) == pytest.approx((14.0 / 3.0) ** 0.5, abs=0.05)
    assert float(per_cent.partition("(")[0]) == pytest.approx(10.0, abs=0.5)
    assert float(deviations.partition("(")[0]) == pytest.approx(2.0, abs=0.05)
