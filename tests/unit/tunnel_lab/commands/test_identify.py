"""``tunnel identify`` and ``tunnel plot`` on campaigns written by hand from the closed form."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Tunnel
from tests.support.diagnosis_document import document, scattering_document

PNG = b"\x89PNG\r\n\x1a\n"


def test_identify_finds_the_truth_of_the_closed_form(
    tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path, truth: dict[str, float]
) -> None:
    file = tmp_path / "estimate.json"
    status, out, err = tunnel("identify", tiny_campaign, "--json", file)
    assert (status, err) == (0, "")
    document = json.loads(file.read_text(encoding="utf-8"))
    for name, value in truth.items():
        quantity = document[name]
        assert abs(quantity["value"] - value) < 4.0 * quantity["std"], name
        assert quantity["std"] < 0.05 * abs(value), name
    for symbol, unit in (("Cnβ", "1/rad"), ("Cnr", "1/rad"), ("Izz", "kg m"), ("Cr", "N m s/rad")):
        assert any(symbol in line and "±" in line and unit in line for line in out.splitlines())


def test_the_json_alone_goes_to_standard_output(tunnel: Tunnel, tiny_campaign: Path) -> None:
    status, out, _ = tunnel("identify", tiny_campaign, "--json", "-")
    assert status == 0
    document = json.loads(out)
    assert set(document["cn_beta"]) == {"value", "std", "unit"}
    assert [run["id"] for run in document["runs"]] == ["r01", "r02"]
    assert set(document["runs"][0]["zeta"]) == {"value", "std", "unit"}


def test_without_stiffness_the_form_is_normalised(tunnel: Tunnel, normalised_campaign: Path) -> None:
    status, out, _ = tunnel("identify", normalised_campaign)
    assert status == 0
    assert "not stated" in out
    assert "windows of 3 cycles" in out
    assert "state it in campaign.toml" in out
    assert "Cnβ" not in out


def test_windows_are_shown_when_asked_for(tunnel: Tunnel, tiny_campaign: Path) -> None:
    assert "r01: windows" in tunnel("identify", tiny_campaign, "--windows")[1]
    assert "r01: windows" not in tunnel("identify", tiny_campaign, "--no-windows")[1]


def test_an_estimate_that_fails_ends_with_status_one(
    tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from identification.estimate import Estimate, RunEstimate, Status

    def fail(*_: object, **__: object) -> Estimate:
        statuses = (Status.NO_RUN_IDENTIFIED,)
        runs = tuple(RunEstimate(name, (Status.NO_OSCILLATION,)) for name in ("r01", "r02"))
        return Estimate("tiny", "output_error", runs, statuses)

    monkeypatch.setattr("identification.identify", fail)
    status, out, _ = tunnel("identify", tiny_campaign, "--json", tmp_path / "estimate.json")
    assert status == 1
    assert Status.NO_RUN_IDENTIFIED.value in " ".join(out.split())
    assert json.loads((tmp_path / "estimate.json").read_text())["cn_beta"] is None


def test_plot_writes_whole_figures(tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path) -> None:
    status, out, err = tunnel("plot", tiny_campaign, "--out", tmp_path / "figures")
    assert (status, err) == (0, "")
    files = sorted((tmp_path / "figures" / "tiny").iterdir())
    names = ("spectrum", "traces-1", "windows")
    assert [path.name for path in files] == [f"{name}.{form}" for name in names for form in ("pdf", "png")]
    for path in files:
        assert path.read_bytes().startswith(PNG if path.suffix == ".png" else b"%PDF")
        assert f"Written: {path}" in out


@pytest.mark.usefixtures("unrendered")
def test_plot_draws_the_fit_of_a_diagnosis(tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "answer.json").write_text(json.dumps(document()))
    status, out, err = tunnel("plot", tmp_path / "answer.json", "--out", tmp_path / "figures")
    assert (status, err) == (0, "")
    files = sorted((tmp_path / "figures" / "answer").iterdir())
    assert [path.name for path in files] == ["fit-1.pdf", "fit-1.png"]
    assert all(f"Written: {path}" in out for path in files)
    status, _, err = tunnel("plot", tmp_path / "answer.json", "--run", "delta", "--out", tmp_path / "figures")
    assert (status, err.count("\n")) == (2, 1)
    assert "no run 'delta'" in err
    assert "alpha, gamma" in err
    (tmp_path / "bare.json").write_text(json.dumps(document() | {"maps": None}))
    status, _, err = tunnel("plot", tmp_path / "bare.json", "--out", tmp_path / "figures")
    assert (status, err.count("\n")) == (2, 1)
    assert "no curves to draw" in err
    status, _, err = tunnel("plot", tiny_campaign, "--run", "r01")
    assert (status, err.count("\n")) == (2, 1)


@pytest.mark.usefixtures("unrendered")
def test_an_unknown_unit_or_a_lost_field_of_a_diagnosis_is_one_line(tunnel: Tunnel, tmp_path: Path) -> None:
    spoilt = [document() for _ in range(5)]
    spoilt[0]["maps"]["unit"] = "x"
    spoilt[1]["gap"]["misfit"]["unit"] = "x"
    spoilt[2]["coefficients"]["after"]["cn_beta"]["unit"] = "furlong"
    del spoilt[3]["maps"]["traces"][0]["time_s"]
    spoilt[4].setdefault("found", {})["rivals"] = [{"kind": "two springs off", "springs": []}]
    unit, lost = "'x' is no unit of a reading", "maps.traces.0.time_s: Field required"
    said = (unit, unit, "'furlong'", lost, "the rival 'two springs off' has no words")
    for given, field in zip(spoilt, said, strict=True):
        (tmp_path / "answer.json").write_text(json.dumps(given))
        status, _, err = tunnel("plot", tmp_path / "answer.json", "--out", tmp_path / "figures")
        assert (status, err.count("\n")) == (2, 1), err
        assert field in err


@pytest.mark.usefixtures("unrendered")
def test_plot_draws_how_the_runs_repeat(tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "answer.json").write_text(json.dumps(scattering_document()))
    status, _, err = tunnel("plot", tmp_path / "answer.json", "--out", tmp_path / "all")
    assert (status, err) == (0, "")
    names = {path.name for path in (tmp_path / "all" / "answer").iterdir()}
    assert names == {"fit-1.pdf", "fit-1.png", "repeatability.pdf", "repeatability.png"}
    status, _, err = tunnel(
        "plot", tmp_path / "answer.json", "repeatability", "waterfall", "--out", tmp_path / "two"
    )
    assert (status, err) == (0, "")
    names = {path.name for path in (tmp_path / "two" / "answer").iterdir()}
    assert names == {"repeatability.pdf", "repeatability.png", "waterfall.pdf", "waterfall.png"}
    status, _, err = tunnel("plot", tmp_path / "answer.json", "repeatable", "--out", tmp_path / "none")
    assert (status, err.count("\n")) == (2, 1)
    assert "no figure 'repeatable'; choose of its figures: " in err
    assert not (tmp_path / "none").exists()
    status, _, err = tunnel("plot", tiny_campaign, "repeatability", "--out", tmp_path / "none")
    assert (status, err.count("\n")) == (2, 1)
    assert "is one of a diagnosis; give the file of tunnel diagnose --json" in err
