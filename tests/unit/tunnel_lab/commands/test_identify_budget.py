"""``tunnel identify --budget``: what is reported, what dominates, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Tunnel

KNOWN = """
schema_version = 1
[common]
wind_speed = 0.02
reference_length = 0.001
"""


@pytest.fixture
def known(tmp_path: Path) -> Path:
    path = tmp_path / "known.toml"
    path.write_text(KNOWN)
    return path


def test_the_combined_uncertainty_is_what_is_reported(
    tunnel: Tunnel, tiny_campaign: Path, known: Path, tmp_path: Path
) -> None:
    plain = json.loads(tunnel("identify", tiny_campaign, "--json", "-")[1])
    status, out, err = tunnel(
        "identify", tiny_campaign, "--uncertainties", known, "--json", tmp_path / "e.json"
    )
    assert (status, err) == (0, "")
    assert "Cnβ: wind_speed, common dominates" in out
    stated = json.loads((tmp_path / "e.json").read_text())
    assert stated["cn_beta"]["value"] == plain["cn_beta"]["value"]
    # 2 % of the speed are 4 % of Cnβ, beside little else.
    assert stated["cn_beta"]["std"] == pytest.approx(0.04 * abs(plain["cn_beta"]["value"]), rel=0.05)
    assert stated["budget"]["combined_std"]["cn_beta"] == stated["cn_beta"]["std"]
    assert stated["yaw_inertia"]["std"] < 1.5 * plain["yaw_inertia"]["std"] + 1e-9
    assert "budget" not in plain


def test_without_a_file_the_inputs_count_as_exact(tunnel: Tunnel, tiny_campaign: Path) -> None:
    status, out, _ = tunnel("identify", tiny_campaign, "--budget", "--model", "conventional")
    assert status == 0
    assert "wind_speed" not in out
    assert "has no redundant runs" in out
    assert "choice of model" in out


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (KNOWN + "wind_sped = 0.1\n", ["unknown key 'wind_sped'", "did you mean 'wind_speed'"]),
        (KNOWN.replace("0.02", "2.0"), ["wind_speed", "relative standard uncertainty"]),
        (KNOWN.replace("0.02", "-0.02"), ["wind_speed"]),
        (KNOWN.replace("schema_version = 1", ""), ["schema_version"]),
        (
            KNOWN + '[[correlations]]\nbetween = ["wind_speed", "air_density"]\ncoefficient = 0.5\n',
            ["air_density has no uncertainty"],
        ),
        (
            KNOWN + '[[correlations]]\nbetween = ["wind_speed", "wind"]\ncoefficient = 0.5\n',
            ["no input 'wind'"],
        ),
    ],
)
def test_a_bad_file_is_refused_in_a_line(
    tunnel: Tunnel, tiny_campaign: Path, known: Path, text: str, parts: list[str]
) -> None:
    known.write_text(text)
    status, out, err = tunnel("identify", tiny_campaign, "--uncertainties", known)
    assert (status, out, err.count("\n")) == (2, "", 1)
    for part in (str(known), *parts):
        assert part in err


def test_no_budget_without_coefficients(tunnel: Tunnel, normalised_campaign: Path) -> None:
    status, out, err = tunnel("identify", normalised_campaign, "--budget")
    assert (status, out) == (2, "")
    assert "state spring_stiffness" in err


def test_model_goes_with_budget(tunnel: Tunnel, tiny_campaign: Path) -> None:
    status, _, err = tunnel("identify", tiny_campaign, "--model", "conventional")
    assert status == 2
    assert "add --budget" in err
