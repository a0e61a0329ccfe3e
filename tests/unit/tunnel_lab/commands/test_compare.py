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


def test_widths_of_scatter_are_compared_in_per_cent(tunnel: Tunnel, before: Path, tmp_path: Path) -> None:
    scattering = written(tmp_path / "scattering.json", **scattering_document())
    status, out, err = tunnel("compare", before, scattering, "--format", "csv")
    assert (status, err) == (0, "")
    assert "wind_speed_scatter,spread,%,,,,,0.291,,0.132,0.619" in out
    _, out, _ = tunnel("compare", before, scattering, "--format", "md")
    assert "0.29 % (0.13 to 0.62 %)" in out


def tables(out: str) -> dict[str, list[dict[str, Any]]]:
    """The rows of each table, by its title."""
    found = [json.loads(line) for line in out.splitlines()]
    return {table["table"]: table["rows"] for table in found}


def test_gap_answer_parameters_and_coefficients_stand_side_by_side(
    tunnel: Tunnel, before: Path, after: Path
) -> None:
    status, out, err = tunnel("compare", before, after, "--format", "md")
    assert (status, err) == (0, "")
    # ± the noise of three runs: √(0.021² + 0.019² + 0.017²) / 3 = 0.011
    for row in (
        "gap [× noise variance] | 27.350 ± 0.011 | 0.0123",
        "residual gap [× noise variance] | 0.123 ± 0.011 | –",
        "share explained | 98.8 % | –",
        "causes | quadratic_damping | none",
        "or instead | coulomb_friction | –",
        "probability | 91 % | 99 %",
        "quadratic_damping | coefficient | 0.003125 ± 0.000017 N m s²/rad² | –",
        "Cnβ [1/rad] | with the causes | 0.4789 ± 0.0013 | 0.4829 ± 0.0084",
        "Cnr [1/rad] | with the causes | -0.257 ± 0.012 | not determined by these runs",
        "Cnβ [1/rad] | 0.0040 ± 0.0085 (+0.5 σ)",  # √(13² + 84²) = 85
        "Cnr [1/rad] | –",
    ):
        assert f"| {row} |" in out
    assert "difference from before" in out


def test_a_program_gets_each_number_alone(tunnel: Tunnel, before: Path, after: Path) -> None:
    """In a spreadsheet, too: no text that begins like a formula, and no deviation within a text."""
    _, out, _ = tunnel("compare", before, after, "--format", "json")
    gap, parameters, coefficients, changes = tables(out).values()
    assert [(row["quantity"], row["unit"], row["before"], row["after"]) for row in gap] == [
        ("gap", "× noise variance", 27.35, 0.0123),
        ("residual gap", "× noise variance", 0.1234, None),
        ("share explained", "%", 98.76, None),
        ("causes", "", "quadratic_damping", "none"),
        ("decided", "", "yes", "yes"),
        ("or instead", "", "coulomb_friction", None),
        ("probability", "%", 91.23, 98.76),
    ]
    assert parameters == [
        {
            "effect": "quadratic_damping", "parameter": "coefficient", "unit": "N m s2/rad2",
            "before": 0.003125, "before: std": 1.7e-05, "after": None, "after: std": None,
        }
    ]  # fmt: skip
    assert coefficients[1] == {
        "quantity": "Cnβ", "model": "with the causes", "unit": "1/rad",
        "before": 0.4789, "before: std": 0.0013, "after": 0.4829, "after: std": 0.0084,
    }  # fmt: skip
    assert coefficients[3]["after"] is None
    assert changes[0] == {"quantity": "Cnβ", "unit": "1/rad", "after": 0.004, "after: std": 0.0085}
    _, out, _ = tunnel("compare", before, after, "--format", "csv")
    assert "Cnr,without the causes,1/rad,-0.3132,0.0225,,\n" in out
    assert "'" not in out


def test_a_fall_of_a_coefficient_is_a_number(tunnel: Tunnel, before: Path, after: Path) -> None:
    _, out, _ = tunnel("compare", after, before, "--format", "csv")
    assert "\nCnβ,1/rad,-0.004,0.0085" in out


def test_campaigns_of_one_name_go_by_their_files(tunnel: Tunnel, tmp_path: Path) -> None:
    files = [written(tmp_path / name) for name in ("one.json", "two.json", "three.json")]
    _, out, _ = tunnel("compare", *files, "--format", "json")
    assert list(next(iter(tables(out).values()))[0])[2::2] == ["one", "two", "three"]
    (tmp_path / "again").mkdir()
    same = written(tmp_path / "again" / "one.json")
    _, out, _ = tunnel("compare", files[0], same, "--format", "json")
    assert list(next(iter(tables(out).values()))[0])[2::2] == ["1: one", "2: one"]


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


def test_displacements_are_compared_in_own_words(tunnel: Tunnel, before: Path, tmp_path: Path) -> None:
    estimates = {
        "yaw_inertia": {"value": 2.0, "std": 0.01, "unit": "kg"},
        "mechanical_damping": {"value": 0.3, "std": 0.02, "unit": "N s/m"},
    }
    own = {"motion": "displacement", "motion_scale": 1.0, "coefficients": {"before": {}, "after": estimates}}
    carts = [written(tmp_path / f"{name}.json", campaign=name, **own) for name in ("cart", "angle")]
    status, out, err = tunnel("compare", *carts, "--format", "csv")
    assert (status, err) == (0, "")
    assert "mass,with the causes,kg,2,0.01,2,0.01" in out
    assert "quantity,unit,angle,angle: std" in out  # the name of a campaign is kept
    assert "nertia" not in out
    status, _, err = tunnel("compare", before, carts[0])
    assert status == 2
    assert "cart.json: has motion = 'displacement', and the first one has 'angle'; compare" in err
    assert err.count("\n") == 1
