"""The numbers of the charts that the report draws on a screen are those of its document, by run and view.

Truth: a document written by hand.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from diagnosis.findings.misfit import run_labels
from diagnosis.where.maps import RunMap
from tests.support.diagnosis_document import IDS, findings_of
from tunnel_lab.report.charts import charts

Document = dict[str, Any]


def test_the_spectrum_of_all_runs_and_of_each(given: Document) -> None:
    spectrum = given["maps"]["frequency"]
    spectrum["by_run"] = [[2.25, None, 0.5], [-0.5, 0.0, 1.0], [None, 3.0, -0.95]]
    (chart,) = charts(findings_of(given).maps)["where-spectrum"]
    centres = [0.7071, 2.0, 8.0]  # Hz, √(0.5 · 1), √(1 · 4), √(4 · 16)
    whole, *each = chart["views"]
    assert [view["run"] for view in each] == list(IDS)
    assert [view["label"] for view in each] == run_labels([RunMap(**run) for run in given["maps"]["runs"]])
    frequency, low, high, before, after = whole["data"]
    assert frequency == centres
    assert low == pytest.approx([1.0 - 3.0 * 0.051, 1.0 - 3.0 * 0.052, 0.3])  # the last below the axis
    assert high == pytest.approx([1.0 + 3.0 * std for std in spectrum["std"]])
    assert before == pytest.approx([2.25, 81.0, 0.3])
    assert after == pytest.approx([1.15, 1.75, 1.05])
    assert [view["data"][0] for view in each] == [
        [0.7071, 8.0],
        centres,
        [2.0, 8.0],
    ]  # empty bins are left out
    powers = [view["data"][3] for view in each]
    assert powers == [[3.25, 1.5], [0.5, 1.0, 2.0], [4.0, 0.3]]
    for view in each:
        assert [view["data"][place] for place in (1, 2, 4)] == [[None] * len(view["data"][0])] * 3
    assert len(chart["series"]) == len(whole["data"]) - 1
    assert [chart["series"][place - 1]["label"] for place in chart["band"]] == ["noise +3σ", "noise −3σ"]


def test_bins_without_a_record_are_left_out(given: Document) -> None:
    spectrum = given["maps"]["frequency"]
    spectrum["excess"][0], spectrum["after"] = None, None
    spectrum["std"] = [None, 0.052, 0.4]
    spectrum["by_run"] = [[None, 1.0, 2.0]] * 3
    (chart,) = charts(findings_of(given).maps)["where-spectrum"]
    frequency, _, _, before, after = chart["views"][0]["data"]
    assert frequency == pytest.approx([2.0, 8.0])
    assert (before, after) == ([81.0, 0.3], [None, None])
    assert chart["views"][1]["data"][3] == [2.0, 3.0]


def test_the_cells_of_runs_over_time(given: Document) -> None:
    (chart,) = charts(findings_of(given).maps)["where-runs"]
    floor = 3.0 * 0.017 * np.sqrt(3.0)  # three deviations of a cell, of which there are three to a run
    assert chart["values"] == [[60.0, 21.0, None], [9.0, None, 1.5], [2.0, 0.5, None]]
    assert chart["range"] == pytest.approx([floor, 60.0])
    assert chart["x"]["edges"] == given["maps"]["time"]["edges_s"]
    assert chart["y"]["edges"] == [0, 1, 2, 3]
    assert chart["y"]["names"] == list(IDS)


def test_the_cells_of_the_missing_moment(given: Document) -> None:
    (chart,) = charts(findings_of(given).maps)["where-phase-plane"]
    assert chart["values"] == [[12.0, -25.0], [None, None]]  # the last is within three deviations
    assert chart["unit"] == "10⁻³ N m"
    reach = 1e3 * float(np.quantile([0.012, 0.025, 0.001], 0.98))
    assert chart["range"] == pytest.approx([-reach, reach])
    edges = np.degrees(given["maps"]["phase_plane"]["edges_rad"]).tolist()
    assert chart["x"]["edges"] == chart["y"]["edges"] == edges
    given["maps"]["phase_plane"] = None
    assert "where-phase-plane" not in charts(findings_of(given).maps)


def test_no_maps_no_charts(given: Document) -> None:
    assert charts(findings_of(given | {"maps": None}).maps) == {}
