"""The fit over the data: figure and charts show the document's numbers, and the document shows the records.

Truth: a document written by hand, and the records of a simulated campaign.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from diagnosis.compose import localise
from diagnosis.findings.fit_view import fit_figure, fit_pages
from tests.support.diagnosis_document import findings_of
from tests.support.gap_campaigns import added, campaign, nominal, studied
from tunnel_lab.report.charts import fit_charts
from tunnel_sim.effects import effect_from
from tunnel_sim.vocabulary.errors import TunnelError

Document = dict[str, Any]
CAUSE = "quadratic_damping"


def test_the_charts_hold_the_readings_the_models_and_the_residuals_of_every_run(given: Document) -> None:
    fits, residuals = fit_charts(findings_of(given).maps)["fit"]
    assert [one["label"] for one in fits["series"]] == ["measured", "model", "model with the causes"]
    assert [one["label"] for one in residuals["series"]] == ["model", "model with the causes"]
    for over, below, trace in zip(fits["views"], residuals["views"], given["maps"]["traces"], strict=True):
        assert over["run"] == below["run"] == trace["id"]
        assert over["label"].startswith(trace["id"])
        assert over["range"] == below["range"] == trace["differ_s"]
        reading, before = np.degrees(trace["reading_rad"]), np.degrees(trace["before_rad"])
        assert over["data"][:3] == [
            trace["time_s"],
            pytest.approx(reading, abs=1e-3),
            pytest.approx(reading - before, abs=1e-3),
        ]
        assert below["data"][:2] == [trace["time_s"], pytest.approx(before, rel=1e-4)]
        if trace["after_rad"] is None:
            assert over["data"][3] == below["data"][2] == [None] * 3
        else:
            after = np.degrees(trace["after_rad"])
            assert over["data"][3] == pytest.approx(reading - after, abs=1e-3)
            assert below["data"][2] == pytest.approx(after, rel=1e-4)
    assert (fits["y"]["label"], residuals["y"]["label"]) == ("reading [°]", "residual [°]")
    assert (fits["x"]["label"], residuals["x"]["label"]) == ("", "time since the start of the record [s]")


def test_the_figure_draws_the_cycles_where_the_models_differ_most(given: Document) -> None:
    fig = fit_figure(findings_of(given).maps)
    assert fig is not None
    for column, trace in enumerate(given["maps"]["traces"]):
        whole, near, left = (fig.axes[2 * row + column] for row in range(3))
        assert trace["id"] in whole.get_title(loc="left")
        reading = np.degrees(trace["reading_rad"])
        assert whole.lines[0].get_ydata() == pytest.approx(reading)
        box = whole.patches[0].get_extents().transformed(whole.transData.inverted())
        assert (box.x0, box.x1) == pytest.approx(trace["differ_s"])
        for axes in (near, left):
            assert axes.get_xlim() == pytest.approx(trace["differ_s"])
        inside = [trace["differ_s"][0] <= time <= trace["differ_s"][1] for time in trace["time_s"]]
        wanted = [np.degrees(trace[key]) for key in ("before_rad", "after_rad") if trace[key] is not None]
        assert near.lines[0].get_ydata() == pytest.approx(reading[inside])
        for line, residual in zip(near.lines[1:], wanted, strict=True):
            assert line.get_ydata() == pytest.approx((reading - residual)[inside])
        for line, residual in zip(left.lines[:-1], wanted, strict=True):  # the last is the level of zero
            assert line.get_ydata() == pytest.approx(residual[inside])


def test_any_run_can_be_chosen_and_another_is_refused(given: Document) -> None:
    fig = fit_figure(findings_of(given).maps, ["gamma"])
    assert fig is not None
    assert len(fig.axes) == 3
    assert "gamma" in fig.axes[0].get_title(loc="left")
    with pytest.raises(TunnelError, match=r"no run 'delta'.*alpha, gamma"):
        fit_figure(findings_of(given).maps, ["delta"])
    given["maps"]["traces"] *= 2
    for name, trace in zip("abcd", given["maps"]["traces"], strict=True):
        given["maps"]["traces"]["abcd".index(name)] = trace | {"id": name}
    assert [len(page.axes) for page in fit_pages(findings_of(given).maps)] == [6, 6]


@pytest.mark.parametrize(("unit", "shown"), [("rad", "°"), ("rad/s", "°/s"), ("rad/s2", "°/s²")])
def test_the_unit_is_that_of_the_readings(given: Document, unit: str, shown: str) -> None:
    given["maps"]["unit"] = unit
    assert fit_charts(findings_of(given).maps)["fit"][0]["y"]["label"] == f"reading [{shown}]"


def test_no_maps_no_fit(given: Document) -> None:
    assert fit_figure(findings_of(given | {"maps": None}).maps) is None
    assert fit_charts(findings_of(given | {"maps": None}).maps) == {}


def test_the_document_holds_the_records_and_the_cycles_where_the_models_differ() -> None:
    data = campaign(effect_from(CAUSE, {"coefficient": 0.003}))
    base = nominal(data)
    best = added(base, CAUSE)
    _, maps, _ = localise(studied(data, base, (CAUSE,), best))
    assert {trace.id for trace in maps.traces} == {run.id for run in data.runs}
    records = {run.id: run.record for run in data.runs}
    for trace in maps.traces:
        record = records[trace.id]
        since = record.time_s - record.time_s[0]
        reading = np.interp(trace.time_s, since, record.yaw_rad)
        swing = float(np.ptp(record.yaw_rad))
        assert (
            float(np.max(np.abs(trace.reading_rad - reading))) < 0.05 * swing
        )  # means over a part of a cycle
        assert trace.after_rad is not None
        assert float(np.mean(trace.after_rad**2)) < float(np.mean(trace.before_rad**2))
        low, high = trace.differ_s
        frequency = next(run.frequency_hz for run in maps.runs if run.id == trace.id)
        assert (high - low) * frequency == pytest.approx(6.0, rel=1e-6)
        energy = (trace.before_rad - trace.after_rad) ** 2
        inside = (trace.time_s >= low) & (trace.time_s <= high)
        elsewhere = [
            float(energy[(trace.time_s >= start) & (trace.time_s <= start + high - low)].sum())
            for start in trace.time_s[trace.time_s <= trace.time_s[-1] - (high - low)]
        ]
        assert float(energy[inside].sum()) >= (1.0 - 1e-9) * max(elsewhere)
