"""What print, a notebook and Polars show of an estimate and of a diagnosis. Texts are worked out by hand."""

from __future__ import annotations

import dataclasses
import re

import polars as pl
import pytest

from diagnosis import Candidate, Coefficients, Diagnosis, GapSummary, RunGap, Where
from diagnosis.answer.held_out import ON_RUNS
from diagnosis.findings.closure import Confirmation, NoiseSummary
from diagnosis.findings.decision import decision
from diagnosis.findings.misfit import Misfit
from diagnosis.settings import Settings
from identification import Estimate, Quantity, Remark, RunEstimate, Status, WindowEstimate
from identification.show.blocks import (
    Detail,
    Figure,
    Paragraph,
    TextTable,
    as_html,
    as_notebook,
    as_text,
    brief,
    typeset,
)
from identification.status import Outcome

ZETA = Quantity(0.0123, 0.00045, "1")
OMEGA = Quantity(12.34, 0.056, "rad/s", (12.2, 12.5))
WINDOW = WindowEstimate(0.25, 1.5, Quantity(0.31, 0.0012, "rad"), OMEGA, ZETA)


@pytest.fixture
def estimate() -> Estimate:
    runs = (
        RunEstimate("on", omega_n=OMEGA, zeta=ZETA, windows=(WINDOW,)),
        RunEstimate("<off>", (Status.NO_OSCILLATION,)),
    )
    return Estimate(
        "by hand",
        "own",
        runs,
        (Status.NO_WIND_ON,),
        cn_beta=Quantity(0.4513, 0.0024, "1/rad"),
        yaw_inertia=Quantity(0.1014, 0.0013, "kg m2"),
        remarks=(Remark(Outcome.CUT, ("on",), "it starts late", "cut it"),),
    )


ESTIMATE = """\
by hand by own
quantity     estimate ± std
----------------------------
Cnβ [1/rad]  0.4513 ± 0.0024
Izz [kg m²]  0.1014 ± 0.0013

Runs of by hand
run    ωn          ζ            status
       [rad/s]     [1]
----------------------------------------------
on     12.340(56)  0.01230(45)  ok
<off>  –           –            no oscillation

In brackets: the standard deviation in the last digits; 12.53(10) is 12.53 ± 0.10. It
includes the noise, and is wider where the model departs; tunnel diagnose adds the error
of the model.
Note: run on: it starts late; cut it
Note: no decaying motion above the noise: check the sensor, start a free record at its
release, or check the input of a driven one (<off>)
Note: no wind-on runs, so cn_beta and cn_r are not given: add runs with the wind on"""


def test_an_estimate_prints_as_tables(estimate: Estimate) -> None:
    assert str(estimate).splitlines() == ESTIMATE.splitlines()


def test_many_runs_are_counted_not_listed(estimate: Estimate) -> None:
    many = dataclasses.replace(estimate, runs=estimate.runs[:1] * 20)
    assert str(many).count("12.340(56)") == 16
    assert "and 4 more runs" in str(many)


def test_a_notebook_shows_the_same_with_names_escaped(estimate: Estimate) -> None:
    page = estimate._repr_html_()
    assert "<span>12.340(56)</span></td>" in page
    assert "0.4513\u00a0±\u00a00.0024" in page
    assert "&lt;off&gt;" in page
    assert "<off>" not in page


def test_an_estimate_as_frames(estimate: Estimate) -> None:
    coefficients = estimate.coefficients_frame()
    assert coefficients.columns == ["quantity", "value", "std", "unit", "low", "high"]
    row = coefficients.row(by_predicate=pl.col("quantity") == "cn_beta", named=True)
    assert (row["value"], row["std"], row["unit"]) == (0.4513, 0.0024, "1/rad")
    assert (row["low"], row["high"]) == pytest.approx((0.446596, 0.456004))
    assert coefficients.row(by_predicate=pl.col("quantity") == "cn_r")[1:] == (None,) * 5

    runs = estimate.runs_frame()
    assert runs.select("id", "status", "omega_n", "omega_n_std", "zeta").rows() == [
        ("on", "ok", 12.34, 0.056, 0.0123),
        ("<off>", "no_oscillation", None, None, None),
    ]
    (window,) = estimate.windows_frame().rows(named=True)
    assert (window["run"], window["start_s"], window["cycles"]) == ("on", 0.25, 3)
    assert (window["amplitude"], window["amplitude_std"]) == (0.31, 0.0012)


def test_the_interval_of_the_method_is_kept() -> None:
    found = Estimate("c", "own", (), cn_r=OMEGA).coefficients_frame()
    row = found.row(by_predicate=pl.col("quantity") == "cn_r", named=True)
    assert (row["low"], row["high"]) == (12.2, 12.5)


def test_frames_without_rows_keep_their_columns() -> None:
    empty = Estimate("c", "own", ())
    filled = Estimate("c", "own", (RunEstimate("r", windows=(WINDOW,)),))
    assert empty.windows_frame().schema == filled.windows_frame().schema
    assert empty.runs_frame().height == 0


@pytest.fixture
def diagnosis() -> Diagnosis:
    friction = {
        "friction_moment": Quantity(0.00399, 0.00006, "N m"),
        "ratio": Quantity(2.0, None, "1", bound="upper"),
    }
    return Diagnosis(
        campaign="by hand",
        causes=("coulomb_friction",),
        verdict="The gap is explained by coulomb friction.",
        gap=GapSummary(
            True,
            19.0,
            0.01,
            0.99,
            ON_RUNS,
            (RunGap("a", 19.0, 0.01), RunGap("b", 18.0, 0.02, False)),
            0.01,
            1e-9,
            {},
            Misfit(5e-4, 0.1, "rad"),
        ),
        where=Where("damping", "always"),
        candidates=(
            Candidate("coulomb_friction", 0.97, 0.01, 0.99, friction),
            Candidate("none", 0.03, 19.0, 0.0),
        ),
        ambiguous_with=(),
        next_run=None,
        coefficients=Coefficients(
            {"cn_r": Quantity(-0.3132, 0.0225, "1/rad")},
            {
                "cn_r": Quantity(-0.2574, 0.0118, "1/rad"),
                "zeta": Quantity(0.01, 0.001, "1"),
            },
        ),
        confirmation=Confirmation(True, 1e-6, "a", 1e-7, 1e-5),
        noise=NoiseSummary(4e-4, None, "estimated", "from the records"),
        decision=decision([("coulomb_friction", 0.97), ("none", 0.03)], Settings().answer),
        blind_spots=("a drift",),
        cautions=("few runs",),
    )


def test_a_diagnosis_prints_verdict_tables_and_caveats(diagnosis: Diagnosis) -> None:
    text = str(diagnosis)
    lines = text.splitlines()
    assert [line.partition(":")[0] for line in lines[:4]] == [
        "What",
        "How sure",
        "What it costs",
        "Do this first",
    ]
    assert sum(line.startswith("What it costs:") for line in lines) == 1
    assert "The gap is explained by coulomb friction." in lines
    assert "coulomb_friction         97 %                99.0 %" in lines
    assert "coulomb_friction  friction_moment  0.003990 ± 0.000060 N m" in lines
    assert any(line.strip() == "ratio            2.000 (at its upper bound)" for line in lines)
    assert "Cnr [1/rad] -0.313 ± 0.022 -0.257 ± 0.012 -18 %" in [" ".join(line.split()) for line in lines]
    assert lines[lines.index("Caveats:") + 1] == "- few runs"
    assert lines[lines.index("These runs cannot show:") + 1] == "- a drift"
    assert lines[lines.index("What to do next:") + 1].startswith("1. ")
    assert "<ul><li>few runs</li></ul>" in diagnosis._repr_html_()


def test_a_diagnosis_as_frames(diagnosis: Diagnosis) -> None:
    assert diagnosis.candidates_frame().rows() == [
        ("coulomb_friction", 0.97, 0.01, 0.99),
        ("none", 0.03, 19.0, 0.0),
    ]
    assert diagnosis.parameters_frame().rows() == [
        ("coulomb_friction", "friction_moment", 0.00399, 0.00006, "N m", None),
        ("coulomb_friction", "ratio", 2.0, None, "1", "upper"),
    ]
    assert diagnosis.coefficients_frame().rows() == [
        ("cn_r", "1/rad", -0.3132, 0.0225, -0.2574, 0.0118),
        ("zeta", "1", None, None, 0.01, 0.001),
    ]
    assert diagnosis.runs_frame().rows() == [("a", 19.0, 0.01, True), ("b", 18.0, 0.02, False)]


def test_a_cell_of_several_lines_keeps_its_column() -> None:
    table = TextTable("t", ("a", "b"), (("x", "1\n22"), ("longer", "3")), right=("b",))
    assert as_text([table]).splitlines() == [
        "t",
        "a        b",
        "----------",
        "x        1",
        "        22",
        "longer   3",
    ]
    assert "1<br>22" in as_html([table])


def test_cells_stand_apart_in_a_notebook() -> None:
    page = as_notebook([TextTable("t", ("a", "b"), (("x", "1"),), right=("b",))])
    (side,) = re.findall(r"<style[^>]*>.*td.*padding: [\d.]+em ([\d.]+)em.*</style>", page)
    assert float(side) >= 0.5
    assert '<td data-head="b" class="n">' in page


def test_details_are_for_pages_only() -> None:
    table = TextTable(
        "t", ("effect", "run", "more"), (("dry_friction", "run_1", "2"),), names=("effect",), detail=("more",)
    )
    blocks = (table, Figure("drawn", "what it shows"), Detail((Paragraph("a detail"),), "fold"))
    page = as_html(blocks, {"drawn": "<svg/>"})
    for part in (
        ">dry friction<",
        ">run_1<",
        ">2<",
        "<svg/><figcaption>What",
        "<summary>fold</summary><p>a detail</p>",
    ):
        assert part.lower() in page.lower()
    (kept,) = brief(blocks)
    assert isinstance(kept, TextTable)
    assert (kept.columns, kept.rows) == (("effect", "run"), (("dry_friction", "run_1"),))
    assert "drawn" not in as_html(blocks)


def test_minus_signs_powers_of_ten_and_values_that_stay_together() -> None:
    shown = typeset("-0.5 to (1.2 ± 0.3)e-05, 1.910e+06 [N m/rad]").replace("\u00a0", "_")
    assert shown == "−0.5 to (1.2_±_0.3)_×_10⁻⁵, 1.910_×_10⁶ [N_m/rad]"
    assert typeset("wind-on run r-1e5 at 3e") == "wind-on run r-1e5 at 3e"


def test_tables_without_rows_and_empty_paragraphs_are_left_out() -> None:
    blocks = (Paragraph(""), TextTable("t", ("a",), ()), Paragraph("said", "Label"))
    assert as_text(blocks) == "Label: said"
    assert as_html(blocks) == "<p><b>Label:</b> said</p>"
    assert as_html(blocks, titled=True) == "<p>said</p>"
