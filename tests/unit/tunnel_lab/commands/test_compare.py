"""``tunnel compare``: diagnoses side by side, from their JSON.

Truth: documents written by hand, and differences worked out by hand.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.command import Tunnel
from tests.support.diagnosis_document import document, scattering_document

Document = dict[str, Any]


def written(path: Path, **changes: Any) -> Path:
    path.write_text(json.dumps(document() | changes), encoding="utf-8")
    return path


@pytest.fixture
def before(tmp_path: Path) -> Path:
    return written(tmp_path / "before.json", campaign="before")


@pytest.fixture
def after(tmp_path: Path) -> Path:
    estimates = {
        "cn_beta": {"value": 0.4829, "std": 0.0084, "unit": "1/rad"},
        "cn_r": {"value": 3.0, "std": None, "unit": "1/rad", "determined": False},
    }
    calm = {"detected": False, "excess_before": 0.0123, "excess_after": 0.0123, "closed": 0.0}
    return written(
        tmp_path / "after.json",
        campaign="after",
        causes=[],
        ambiguous_with=[],
        gap=document()["gap"] | calm,
        candidates=[document()["candidates"][4] | {"probability": 0.9876}],
        coefficients={"before": estimates, "after": estimates},
        maps=None,
    )


def test_an_interval_is_read(tunnel: Tunnel, before: Path, tmp_path: Path) -> None:
    given = document()
    given["coefficients"]["after"]["cn_r"]["interval"] = [-0.28, -0.24]
    status, _, err = tunnel("compare", before, written(tmp_path / "skewed.json", **given))
    assert (status, err) == (0, "")


def test_widths_of_scatter_are_compared_in_per_cent(tunnel: Tunnel, before: Path, tmp_path: Path) -> None:
    scattering = written(tmp_path / "scattering.json", **scattering_document())
    status, out, err = tunnel("compare", before, scattering, "--format", "csv")
    assert (status, err) == (0, "")
    assert "wind_speed_scatter" in out
    assert "0.29 % (0.13 to 0.62 %)" in out


def tables(out: str) -> dict[str, list[dict[str, Any]]]:
    """The rows of each table, by its title."""
    found = [json.loads(line) for line in out.splitlines()]
    return {table["table"]: table["rows"] for table in found}


def test_gap_answer_parameters_and_coefficients_stand_side_by_side(
    tunnel: Tunnel, before: Path, after: Path
) -> None:
    status, out, err = tunnel("compare", before, after, "--format", "json")
    assert (status, err) == (0, "")
    gap, parameters, coefficients, changes = tables(out).values()
    gaps = {row["quantity"]: (row["before"], row["after"]) for row in gap}
    # ± the noise of three runs: √(0.021² + 0.019² + 0.017²) / 3 = 0.011
    assert gaps["gap [× noise variance]"] == ("27.350 ± 0.011", 0.0123)
    assert gaps["residual gap [× noise variance]"] == ("0.123 ± 0.011", "–")
    assert gaps["share explained"] == ("98.8 %", "–")
    assert gaps["causes"] == ("quadratic_damping", "none")
    assert gaps["or instead"] == ("coulomb_friction", "–")
    assert gaps["probability"] == ("91 %", "99 %")
    assert parameters == [
        {
            "effect": "quadratic_damping", "parameter": "coefficient",
            "before": "0.003125 ± 0.000017 N m s²/rad²", "after": "–",
        }
    ]  # fmt: skip
    assert coefficients[1] == {
        "quantity": "Cnβ [1/rad] after", "before": "0.4789 ± 0.0013", "after": "0.4829 ± 0.0084",
    }  # fmt: skip
    assert coefficients[3]["after"] == "not determined by these runs"
    assert changes == [
        {"quantity": "Cnβ [1/rad]", "after": "0.0040 ± 0.0085 (+0.5 σ)"},  # √(13² + 84²) = 85
        {"quantity": "Cnr [1/rad]", "after": "–"},
    ]
    assert "difference from before" in list(tables(out))[3]


def test_text_csv_and_markdown_say_the_same(tunnel: Tunnel, before: Path, after: Path) -> None:
    for words in ([], ["--format", "csv"], ["--format", "md"]):
        status, out, _ = tunnel("compare", before, after, *words)
        assert status == 0
        for part in ("27.350 ± 0.011", "0.4829 ± 0.0084", "quadratic_damping", "+0.5 σ"):
            assert part in out


def test_campaigns_of_one_name_go_by_their_files(tunnel: Tunnel, tmp_path: Path) -> None:
    files = [written(tmp_path / name) for name in ("one.json", "two.json", "three.json")]
    _, out, _ = tunnel("compare", *files, "--format", "json")
    assert list(next(iter(tables(out).values()))[0]) == ["quantity", "one", "two", "three"]
    (tmp_path / "again").mkdir()
    same = written(tmp_path / "again" / "one.json")
    _, out, _ = tunnel("compare", files[0], same, "--format", "json")
    assert list(next(iter(tables(out).values()))[0]) == ["quantity", "1: one", "2: one"]


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"schema_version": 2}, "schema_version is 2"),
        ({"gap": {}}, "gap.detected"),
        ({"candidates": []}, "'candidates' is empty"),
        ({"campaign": "two\nlines"}, "line breaks"),
        ({"candidates": [document()["candidates"][0] | {"probability": 1.5}]}, "1.5"),
        ({"gap": document()["gap"] | {"closed": -0.5}}, "-0.5"),
        (
            {"coefficients": {"before": {}, "after": {"zeta": {"value": "1", "std": None, "unit": "1"}}}},
            "coefficients.after.zeta.va",
        ),
    ],
)
def test_a_document_that_is_no_diagnosis_is_one_line(
    tunnel: Tunnel, before: Path, tmp_path: Path, changes: Document, part: str
) -> None:
    status, out, err = tunnel("compare", before, written(tmp_path / "bad.json", **changes))
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert part in err
    assert "bad.json" in err


def test_one_file_is_too_few(tunnel: Tunnel, before: Path) -> None:
    status, out, err = tunnel("compare", before)
    assert (status, out) == (2, "")
    assert "name two files or more" in err
    status, out, err = tunnel("compare", before, before.parent / "missing.json")
    assert (status, out) == (2, "")
    assert "missing.json" in err
