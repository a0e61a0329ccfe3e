"""Every number of the tables that all faces show is the one of the document or the estimate.

Truth: a document and an estimate written by hand; cells are read back as a person reads them.
"""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

from diagnosis.findings.next_run import NextRun
from diagnosis.findings.next_steps import rival_lines
from diagnosis.findings.sections import printed
from identification.estimate import Estimate, RunEstimate, WindowEstimate
from identification.printing import coefficients_table, estimate_blocks, status_lines, windows_table
from identification.printing import runs_table as estimated_runs
from identification.show.blocks import Paragraph, TextTable
from identification.show.numbers import probability, share
from identification.show.quantity import Quantity
from identification.status import Status
from tests.support import rendered as tables
from tests.support.diagnosis_document import CONDITIONS, IDS, both, campaign, document, findings_of
from tests.support.rendered import (
    candidates_table,
    coefficients_line,
    hidden_line,
    hidden_table,
    inclusion_line,
    model_line,
    noise_line,
    parameters_table,
    runs_table,
    waterfall_table,
)
from tests.support.shown_numbers import assert_shows, assert_units
from tunnel_lab.commands.demo import truth_table
from tunnel_lab.report.page import render_report

Document = dict[str, Any]
Y_UNIT = re.compile(r"\[[^\]]*\]|N m s²/rad²|N m/rad|m/s|N m|1/rad")


@pytest.fixture
def given() -> Document:
    return document()


def rows(table: TextTable) -> list[list[str]]:
    """The cells of a table without its details, units and brackets of units left out."""
    return [[Y_UNIT.sub("", cell) for cell in row] for row in table.without_detail().rows]


def short(text: str) -> tuple[float, float]:
    """Value and standard deviation of the short notation."""
    found = re.fullmatch(r"(-?\d+\.?(\d*))\((\d+\.?\d*)\)", text)
    assert found, text
    unit = 1.0 if "." in found[3] else 10.0 ** -len(found[2])
    return float(found[1]), unit * float(found[3])


def test_answers(given: Document) -> None:
    *listed, last = rows(candidates_table(findings_of(given)))
    assert len(listed) == 4
    assert_shows(last[0], [3])
    assert last[1] == "< 1 %"


def test_several_effects_of_an_answer_have_a_line_each(given: Document) -> None:
    given["candidates"][0]["effect"] = "free_play + mains_hum + sensor_drift"
    assert rows(candidates_table(findings_of(given)))[0][0] == "free_play +\nmains_hum +\nsensor_drift"


def test_parameters_of_the_answer(given: Document) -> None:
    ((effect, name, text),) = rows(parameters_table(findings_of(given)))
    assert (effect, name) == (given["causes"][0], "coefficient")
    assert_shows(text, [0.003125, 1.7e-5])
    given["candidates"][0]["parameters"] = {
        "a.x": {"value": 0.25, "std": 0.01, "unit": "1"},
        "a.y": {"value": 2.5, "std": None, "unit": "1", "bound": "upper"},
        "b.x": {"value": 0.0, "std": None, "unit": "1", "determined": False},
        "b.y": {"value": 21.0217, "std": 0.0, "unit": "N m/rad"},
    }
    found = rows(parameters_table(findings_of(given)))
    assert [row[:2] for row in found] == [["a", "x"], ["", "y"], ["b", "x"], ["", "y"]]
    assert [row[2] for row in found] == [
        "0.250 ± 0.010",
        "2.500 (at its upper bound)",
        "not determined by these runs",
        "21.02  (fixed)",
    ]
    given["candidates"] = given["candidates"][-2:]
    given["candidates"][0]["parameters"] = {}
    assert rows(parameters_table(findings_of(given))) == []


def test_springs_of_which_one_is_off_have_a_row_each(given: Document) -> None:
    given["candidates"][0] |= {"effect": "coulomb_friction + spring_miscalibration"}
    given["candidates"][0]["parameters"] = {
        "spring_miscalibration.error": {"value": 0.02, "std": 1e-6, "unit": "1"},
        "coulomb_friction.friction_moment": {"value": 0.004, "std": 1e-5, "unit": "N m"},
        "spring_miscalibration.spring_stiffness": {"value": 44.84, "std": 0.0, "unit": "N m/rad"},
    }
    one = {"stiffness": 44.84, "error": 0.02, "std": 1e-4, "probability": 0.5}
    given["found"]["choices"] = [one, one | {"stiffness": 16.12, "error": -0.0196}]
    assert rows(parameters_table(findings_of(given))) == [
        ["coulomb_friction", "friction_moment", "0.004000 ± 0.000010 "],
        ["spring_miscalibration", "error if 44.84  is off", "0.02000 ± 0.00010"],
        ["", "error if 16.12  is off", "-0.01960 ± 0.00010"],
    ]


def test_effects_among_the_causes(given: Document) -> None:
    line = inclusion_line(findings_of(given))
    assert line.endswith(": quadratic damping 93 %, coulomb friction 7 %.")
    assert line.index("quadratic damping") < line.index("coulomb friction")
    assert inclusion_line(findings_of(given | {"inclusion": {"free_play": 0.009}})) == ""


def test_the_gap_as_the_causes_are_added(given: Document) -> None:
    table = waterfall_table(findings_of(given))
    assert given["waterfall_on"] in table.title
    first, second, third = rows(table)
    assert_shows(first[1], both(28.45))
    assert_shows(" ".join(second[1:]), [*both(2.75), *both(21.85)])
    assert_shows(" ".join(third[1:]), [*both(0.1345), *both(2.85)])
    assert rows(waterfall_table(findings_of(given | {"waterfall": given["waterfall"][:1]}))) == []


def test_coefficients_that_are_not_determined(given: Document) -> None:
    given["coefficients"]["after"]["cn_r"] |= {"std": None, "determined": False}
    cells = rows(tables.coefficients_table(findings_of(given)))[1]
    assert cells[2:] == ["not determined by these runs", "–"]


def test_answers_that_have_no_probability_are_counted_with_theirs(given: Document) -> None:
    for candidate in given["candidates"][1:]:
        candidate["probability"] = 0.0046
    *listed, last = rows(candidates_table(findings_of(given)))
    assert len(listed) == 1
    assert_shows(last[0], [6])
    assert last[1] == "3 %"
    for candidate in given["candidates"]:
        candidate["probability"] = 0.005
    assert len(rows(candidates_table(findings_of(given)))) == 7  # six and the rest
    for candidate in given["candidates"]:
        candidate["probability"] = 0.0
    assert len(rows(candidates_table(findings_of(given)))) == 2  # one always, and the rest
    given["candidates"] = given["candidates"][:1]
    assert len(rows(candidates_table(findings_of(given)))) == 1


def test_the_gap(given: Document) -> None:
    gap = given["gap"]
    whole, *_ = rows(runs_table(findings_of(given)))
    assert_shows(whole[1], both(gap["excess_before"]))
    assert_shows(whole[2], both(gap["excess_after"]))


def test_a_gap_without_a_name_has_nothing_after(given: Document) -> None:
    cells = rows(runs_table(findings_of(given | {"causes": ["unknown"]})))
    assert [row[2] for row in cells] == ["–"] * 4
    given["gap"]["detected"] = False
    assert rows(runs_table(findings_of(given))) == []


def test_a_coefficient_of_zero_or_without_a_fit_has_no_change(given: Document) -> None:
    before, after = given["coefficients"]["before"], given["coefficients"]["after"]
    before["cn_r"]["value"] = 0.0
    assert rows(tables.coefficients_table(findings_of(given)))[1][3] == "–"
    del after["cn_beta"]
    assert rows(tables.coefficients_table(findings_of(given)))[0][2:] == ["–", "–"]


@pytest.mark.parametrize(
    ("one", "two", "shown"),
    [
        (-0.122, -0.114, "-6.6 %"),  # the size falls, as the verdict says
        (-0.114, -0.122, "+7 %"),
        (0.590, 0.537, "-9 %"),
        (-0.1, 0.02, "other sign"),
        (0.5, 0.5, "0 %"),
    ],
)
def test_a_coefficient_changes_by_its_size(given: Document, one: float, two: float, shown: str) -> None:
    given["coefficients"]["before"]["cn_r"]["value"] = one
    given["coefficients"]["after"]["cn_r"]["value"] = two
    assert rows(tables.coefficients_table(findings_of(given)))[1][3] == shown


def test_the_run_to_make(given: Document) -> None:
    run = given["next_run"]
    keys = ("spring_stiffness", "wind_speed", "release_angle", "duration", "separation")
    own = run | {"release_angle": np.degrees(run["release_angle"])}
    assert_shows(NextRun(**run).words(), [own[key] for key in keys])
    calm = NextRun(**run | {"wind_speed": 0.0}).words()
    assert_shows(calm, [own[key] for key in keys if key != "wind_speed"])
    assert len(rival_lines(findings_of(given))) == 2
    assert len(rival_lines(findings_of(given | {"next_run": None}))) == 2
    close = rival_lines(findings_of(given | {"next_run": run | {"separation": 2.9}}))
    assert close[1].startswith("No run with the springs and wind speeds of this campaign distinguishes")
    assert "by 2.9 standard deviations" in close[1]
    assert rival_lines(findings_of(given | {"next_run": None, "ambiguous_with": []})) == []


def test_noise_and_confirmation(given: Document) -> None:
    assert_shows(noise_line(findings_of(given)), [np.degrees(given["noise"]["std"]), given["noise"]["std"]])
    checked = given["confirmation"]
    names = ("largest_difference_rad", "rms_difference_rad", "tolerance_rad")
    assert_shows(model_line(findings_of(given)), [np.degrees(checked[name]) for name in names])
    assert checked["run"] in model_line(findings_of(given))
    given["gap"]["misfit"]["unit"] = "rad/s"
    assert "°/s (noise_std = 0.000412 rad/s)" in noise_line(findings_of(given))
    given["confirmation"]["agrees"] = False
    assert model_line(findings_of(given)) == ""


@pytest.mark.usefixtures("undrawn")
def test_what_trades_off_is_said_with_its_correlation_and_the_run_that_would_separate_it(
    given: Document,
) -> None:
    names = ["mechanical_damping", "coulomb_friction.friction_moment"]
    given["trade_off"] = {"parameters": names, "correlation": -0.976, "remedy": "drive it slower"}
    line = (
        "What trades off: damping and coulomb friction (friction moment) are poorly separable in these runs "
        "(correlation −0.98): drive it slower."
    )
    assert Paragraph(line) in printed(findings_of(given))
    assert f"<p>{line}</p>" in render_report(findings_of(given), campaign())
    assert "What trades off" not in render_report(findings_of(given | {"trade_off": None}), campaign())


def test_what_the_deviations_of_the_coefficients_include_is_said_below_their_table(given: Document) -> None:
    after = given["coefficients"]["after"]
    after["cn_beta"]["shares"] = {"noise": 0.2, "misfit": 0.8}
    after["cn_r"]["shares"] = {"noise": 0.6, "rivals": 0.4}
    line = coefficients_line(findings_of(given))
    assert line == (
        "± includes noise of the readings (most of the variance of Cnr), model error (most of the "
        "variance of Cnβ) and other answers, weighted by probability. The ± of tunnel identify includes the noise, "
        "the scatter between runs and the misfit of its model, so it may be far smaller or larger."
    )
    assert Paragraph(line) in printed(findings_of(given))
    assert coefficients_line(findings_of(given | {"coefficients": {"before": {}, "after": {}}})) == ""
    for one in after.values():
        one["shares"] = {"noise": 0.3, "scatter": 0.7, "air density": 0.0}
    assert coefficients_line(findings_of(given)).startswith(
        "± is the ± of tunnel identify; it includes noise of the readings and "
    )


def test_a_unit_of_this_field_is_explained_where_it_is_used(given: Document) -> None:
    move = {name: {"value": 0.1, "std": None, "unit": "1/rad"} for name in ("cn_beta", "cn_r")}
    lag = {
        "effect": "unsteady_aero_lag",
        "parameter": "lag",
        "size": {"value": 0.014, "std": None, "unit": "l/V"},
        "moves": move,
    }
    meant = "l/V: the time in which the air passes the reference length"
    assert hidden_line(findings_of(given | {"hidden": [lag]})).endswith(
        f"if a lag of 0.014 l/V ({meant}) acts."
    )
    title = "Upper limits on undetected effects (95 %), which ± does not include"
    assert hidden_table(findings_of(given | {"hidden": [lag]})).title == f"{title} ({meant})"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.996, "> 99 %"), (0.994, "99 %"), (0.006, "1 %"), (0.004, "< 1 %")],
)
def test_probabilities(value: float, text: str) -> None:
    assert probability(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.0, "100 %"),
        (0.9996, "> 99.9 %"),
        (0.982, "98.2 %"),
        (0.0004, "< 0.1 %"),
        (0.0, "0 %"),
        (-0.02, "none"),
    ],
)
def test_shares(value: float, text: str) -> None:
    assert share(value) == text


def quantity(value: float, std: float, unit: str = "1/rad") -> Quantity:
    return Quantity(value, std, unit)


def estimate() -> Estimate:
    windows = (
        WindowEstimate(0.25, 1.5, quantity(0.31, 0.0012), quantity(12.5, 0.021), quantity(0.0123, 0.00034)),
        WindowEstimate(1.75, 1.25, quantity(0.21, 0.0014), quantity(12.7, 0.023), quantity(0.0145, 0.00036)),
    )
    runs = tuple(
        RunEstimate(
            name,
            omega_n=quantity(12.34 + i, 0.056),
            zeta=quantity(0.0123 + 0.001 * i, 0.00045),
            windows=windows,
        )
        for i, name in enumerate(IDS)
    )
    return Estimate(
        campaign="by hand", estimator="own", statuses=(Status.OK,),
        cn_beta=quantity(0.4513, 0.0024), cn_r=quantity(-0.3132, 0.0225), yaw_inertia=quantity(0.1014, 0.0013),
        mechanical_damping=quantity(0.0125, 0.00037), wind_off_inertia=quantity(0.1027, 0.0021), runs=runs,
    )  # fmt: skip


def test_coefficients_of_an_estimate() -> None:
    found = estimate()
    named = (found.cn_beta, found.cn_r, found.yaw_inertia, found.mechanical_damping, found.wind_off_inertia)
    for cells, value in zip(rows(coefficients_table(found.to_json_dict())), named, strict=True):
        assert value is not None
        assert_shows(cells[1], [value.value, value.std])


def test_every_number_of_an_estimate_has_a_unit() -> None:
    conditions = {run.id: (run.spring_stiffness, run.wind_speed) for run in campaign().runs}
    blocks = estimate_blocks(estimate().to_json_dict(), conditions, windows=True)
    shown = [block for block in blocks if isinstance(block, TextTable)]
    assert len(shown) == 2 + len(IDS)
    for table in shown:
        assert_units(table)


def test_errors_against_the_truth() -> None:
    found, truth = estimate(), {"cn_beta": 0.5, "cn_r": -0.25, "yaw_inertia": 0.12}
    table = truth_table(found, truth)
    assert table.title.startswith("own")
    cells = rows(table)
    for row, (name, value) in zip(cells, truth.items(), strict=True):
        own = getattr(found, name)
        error = own.value - value
        assert_shows(row[1], [value])
        assert_shows(row[2], [own.value, own.std])
        assert float(row[3].replace(" %", "")) == pytest.approx(100 * error / abs(value), rel=0.5)
        assert float(row[3].replace(" %", "")) * error > 0
        assert_shows(row[4].replace("+", ""), [error / own.std])


def test_runs_of_an_estimate() -> None:
    found = estimate()
    conditions = {run.id: (run.spring_stiffness, run.wind_speed) for run in campaign().runs}
    for cells, run, (spring, speed, *_) in zip(
        rows(estimated_runs(found.to_json_dict(), conditions)), found.runs, CONDITIONS, strict=True
    ):
        assert cells[0] == run.id
        assert_shows(cells[1], [] if spring is None else [spring])
        assert float(cells[2]) == speed
        for cell, value in zip(cells[3:5], (run.omega_n, run.zeta), strict=True):
            assert value is not None
            assert short(cell) == pytest.approx((value.value, value.std), rel=0.03)


def test_windows_of_a_run() -> None:
    run = estimate().runs[0]
    table = windows_table(run.to_json_dict())
    assert "3 cycles" in str(table.title)
    for cells, window in zip(rows(table), run.windows, strict=True):
        assert_shows(cells[0], [window.start_s])
        assert_shows(cells[1], [window.start_s + window.duration_s])
        for cell, value in zip(cells[2:], (window.amplitude, window.zeta, window.omega_n), strict=True):
            assert short(cell) == pytest.approx((value.value, value.std), rel=0.03)


def test_notes_name_the_runs_they_concern() -> None:
    calm = estimate()
    assert status_lines(calm.to_json_dict()) == []
    first = dataclasses.replace(calm.runs[0], statuses=(Status.NO_OSCILLATION,))
    (line,) = status_lines(dataclasses.replace(calm, runs=(first, *calm.runs[1:])).to_json_dict())
    assert line == f"{Status.NO_OSCILLATION.value} (alpha)"
    every = tuple(dataclasses.replace(run, statuses=(Status.NO_OSCILLATION,)) for run in calm.runs)
    found = status_lines(dataclasses.replace(calm, runs=every).to_json_dict())
    assert found == [Status.NO_OSCILLATION.value]


def test_the_gravest_note_comes_first() -> None:
    calm = estimate()
    swings = (Status.FREQUENCY_CHANGES, Status.MODEL_DEPARTS)
    every = tuple(dataclasses.replace(run, statuses=swings) for run in calm.runs)
    found = dataclasses.replace(calm, runs=every, statuses=(Status.MODEL_DEPARTS, Status.NO_STIFFNESS))
    assert status_lines(found.to_json_dict()) == [one.value for one in (*swings, Status.NO_STIFFNESS)]
