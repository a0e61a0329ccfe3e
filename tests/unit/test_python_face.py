"""What a Python session offers: places of campaigns, short representations, tables, figures and the report.

Truth: the same answer by the longer way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from diagnosis import Diagnosis, diagnose, vocabulary
from identification import Estimate, identify
from tests.marks import slow
from tests.support.gap_campaigns import campaign
from tunnel_sim import Campaign, TunnelError, write_campaign
from tunnel_sim.effects import effect_from

FRAME = ["part", "quantity", "value", "std", "unit"]


@pytest.fixture(scope="module")
def data() -> Campaign:
    return campaign(effect_from("quadratic_damping", {"coefficient": 0.003}), duration=6.0)


@pytest.fixture(scope="module")
def estimate(data: Campaign) -> Estimate:
    return identify(data)


@pytest.fixture(scope="module")
def found(
    data: Campaign, tmp_path_factory: pytest.TempPathFactory, causes_alone_throughout: None
) -> Diagnosis:
    del causes_alone_throughout
    folder = tmp_path_factory.mktemp("face") / "small"
    write_campaign(data, folder)
    return diagnose(str(folder), kinds=vocabulary(["quadratic_damping", "coulomb_friction"]))


@pytest.mark.parametrize("given", [str, slow(Path), lambda folder: folder / "campaign.toml"])
def test_identify_takes_a_folder_and_a_campaign_alike(
    data: Campaign, estimate: Estimate, tmp_path: Path, given: Callable[[Path], str | Path]
) -> None:
    write_campaign(data, tmp_path / "small")
    there = identify(given(tmp_path / "small"))
    assert there.to_json_dict() == estimate.to_json_dict()


def test_a_file_of_a_logger_is_a_campaign_too(data: Campaign, tmp_path: Path) -> None:
    record = data.runs[0].record
    rows = "\n".join(f"{t:.4f},{y:.8f}" for t, y in zip(record.time_s, record.yaw_rad, strict=True))
    (tmp_path / "log.csv").write_text(f"time_s,yaw_rad\n{rows}\n")
    assert [run.id for run in identify(tmp_path / "log.csv").runs] == ["log"]
    with pytest.raises(TunnelError, match="no such folder"):
        identify(tmp_path / "nowhere")


def test_diagnose_takes_a_folder(found: Diagnosis) -> None:
    assert found.causes == ("quadratic_damping",)
    assert found.data is not None
    assert [run.id for run in found.data.runs] == [run.id for run in found.gap.runs]


def test_everything_is_represented_in_three_lines(
    data: Campaign, estimate: Estimate, found: Diagnosis
) -> None:
    for one in (data, data.runs[0].record, estimate, found):
        lines = repr(one).splitlines()
        assert len(lines) == 3, lines
        assert all(len(line) <= 140 for line in lines)
    assert repr(data).startswith(f"Campaign 'small': {len(data.runs)} runs")
    assert f"{data.runs[0].record.time_s.size} samples" in repr(data.runs[0].record)
    assert "quadratic damping (probability" in repr(found)
    assert "explained on held-out runs" in repr(found)
    assert "° root mean square, " in repr(found)
    assert "Cnβ = " in repr(estimate)
    normalised = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs[:1]))
    assert "ωn = " in repr(identify(normalised))
    assert "no spring stated" in repr(normalised)


def test_the_answer_is_one_table(found: Diagnosis) -> None:
    table = found.to_frame()
    assert table.columns == FRAME
    rows = {(row["part"], row["quantity"]): row for row in table.iter_rows(named=True)}
    assert rows["gap", "closed"]["value"] == found.gap.closed
    assert found.gap.misfit is not None
    assert rows["gap", "rms_before"]["value"] == found.gap.misfit.rms(found.gap.excess_before)
    for name, value in found.candidates[0].parameters.items():
        row = rows["quadratic_damping", name]
        assert (row["value"], row["std"], row["unit"]) == (value.value, value.std, value.unit)
    for part, given in (("before", found.coefficients.before), ("after", found.coefficients.after)):
        for quantity, value in given.items():
            assert (rows[part, quantity]["value"], rows[part, quantity]["std"]) == (value.value, value.std)


def test_an_estimate_is_a_table_of_coefficients_or_of_runs(data: Campaign, estimate: Estimate) -> None:
    assert estimate.to_frame().equals(estimate.coefficients_frame())
    normalised = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs[:1]))
    alone = identify(normalised)
    assert alone.to_frame().equals(alone.runs_frame())


@pytest.mark.usefixtures("undrawn")
def test_figures_and_the_report_are_those_of_the_command(found: Diagnosis, tmp_path: Path) -> None:
    fit = found.plot()
    assert isinstance(fit, Figure)
    ids = [run.id for run in found.gap.runs]
    assert ids[1] in found.plot("fit", [ids[1]]).axes[0].get_title(loc="left")
    assert found.plot("waterfall").axes[0].get_xlabel() == "root mean square misfit [°]"
    with pytest.raises(TunnelError, match=r"no figure 'fits'.*waterfall"):
        found.plot("fits")
    with pytest.raises(TunnelError, match="no run 'r99'"):
        found.plot(runs=["r99"])
    page = found.write_report(tmp_path / "report.html", author="A. Smith", notes="Cold day.")
    text = page.read_text("utf-8")
    assert found.verdict in unescape(text)
    assert "A. Smith" in text
    assert "Cold day." in text
    with pytest.raises(TunnelError, match="does not hold its runs"):
        replace(found, data=None).write_report(tmp_path / "other.html")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_pandas_is_given_tables_without_pyarrow(estimate: Estimate, found: Diagnosis) -> None:
    made: tuple[Diagnosis | Estimate, ...] = (found, estimate)
    for one in made:
        table = one.to_pandas()
        assert list(table.columns) == one.to_frame().columns
        assert table["value"].tolist() == pytest.approx(one.to_frame()["value"].to_list(), nan_ok=True)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_run_is_a_dataset(data: Campaign) -> None:
    run = data.runs[0]
    dataset = run.to_xarray()
    np.testing.assert_array_equal(dataset["yaw_rad"].to_numpy(), run.record.yaw_rad)
    np.testing.assert_array_equal(dataset["time_s"].to_numpy(), run.record.time_s)
    assert dataset.attrs["wind_speed"] == run.wind_speed


def test_draws_have_the_moments_of_the_estimate(estimate: Estimate) -> None:
    posterior = estimate.to_arviz(np.random.default_rng(1), draws=20_000).posterior
    assert estimate.cn_beta is not None
    draws = np.stack([posterior[name].to_numpy()[0] for name in estimate.parameters])
    std = np.sqrt(np.diag(estimate.covariance_matrix))
    means = np.array([getattr(estimate, name).value for name in estimate.parameters])
    # five standard errors of a mean of 20,000 draws, and of a correlation of them
    np.testing.assert_allclose((draws.mean(axis=1) - means) / std, 0.0, atol=5.0 / np.sqrt(20_000))
    correlation = estimate.covariance_matrix / np.outer(std, std)
    np.testing.assert_allclose(np.corrcoef(draws), correlation, atol=5.0 / np.sqrt(20_000))
    first = estimate.runs[0].omega_n
    assert first is not None
    own = posterior["omega_n"].sel(run=estimate.runs[0].id)
    assert float(own.std()) == pytest.approx(first.std, rel=0.03)
    assert abs(float(own.mean()) - first.value) < 5.0 * first.std / np.sqrt(20_000)
    assert posterior.attrs["estimator"] == estimate.estimator


def test_a_missing_library_is_named(
    data: Campaign, estimate: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("pandas", "xarray", "arviz_base", "uncertainties"):
        monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(TunnelError, match=r"pandas is not installed.*\[frames\]"):
        estimate.to_pandas()
    with pytest.raises(TunnelError, match=r"xarray is not installed.*\[frames\]"):
        data.runs[0].to_xarray()
    with pytest.raises(TunnelError, match=r"needs the package arviz_base.*\[arviz\]"):
        estimate.to_arviz(np.random.default_rng(0))
    with pytest.raises(TunnelError, match=r"needs the package uncertainties.*\[frames\]"):
        estimate.to_uncertainties()


def test_a_quantity_is_a_number(estimate: Estimate, found: Diagnosis) -> None:
    for one in (estimate.cn_beta, found.coefficients.after["cn_beta"]):
        assert one is not None
        assert float(one) == np.asarray(one) == one.value
        np.testing.assert_array_equal(np.asarray([one, one], dtype=np.float64), [one.value] * 2)
        assert 2.0 * np.asarray(one) == 2.0 * one.value


def test_uncertain_values_have_the_covariance(estimate: Estimate, found: Diagnosis) -> None:
    from uncertainties import correlation_matrix, covariance_matrix

    values = estimate.to_uncertainties()
    assert tuple(values) == estimate.parameters
    np.testing.assert_allclose(
        covariance_matrix(list(values.values())), estimate.covariance_matrix, rtol=1e-6
    )
    ratio = values["cn_beta"] / values["yaw_inertia"]
    first, second = estimate.parameters.index("cn_beta"), estimate.parameters.index("yaw_inertia")
    matrix = estimate.covariance_matrix
    share = np.array([1.0 / values["cn_beta"].n, -1.0 / values["yaw_inertia"].n])
    pair = matrix[np.ix_([first, second], [first, second])]
    assert ratio.s / abs(ratio.n) == pytest.approx(np.sqrt(share @ pair @ share))
    after = found.to_uncertainties()
    for name, one in found.coefficients.after.items():
        assert (after[name].n, after[name].s) == pytest.approx((one.value, one.std))
    matrix = np.array(correlation_matrix(list(after.values())))
    np.testing.assert_allclose(matrix, found.coefficients.correlation, atol=1e-9)
    assert np.all(np.abs(matrix[~np.eye(len(after), dtype=bool)]) <= 1.0)
    assert Estimate("c", "own", ()).to_uncertainties() == {}
