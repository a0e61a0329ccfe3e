"""Names of runs, springs and campaigns are shown as they are: no formula, no markup."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.show.style import figure_text
from tests.reference.free_decays import Setting, campaign
from tests.support.command import Tunnel
from tests.unit.tunnel_lab.conftest import PROGRESS
from tunnel_lab.plotting.runs import run_label, spectrum_figure
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.vocabulary.campaign import Campaign

NAMES = (r"$\foo$", "[/x]", "_hidden", "[bold]:smile:", r"a\$b$", 'id="x"<svg>&amp;')


def hostile() -> Campaign:
    """Six runs, each with a name that would mean something to matplotlib, Rich or HTML."""
    settings = [Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0, 24.0)]
    rng = np.random.default_rng(3)
    data = campaign(settings, duration=6.0, rate=250.0, noise=5e-4, rng=rng)
    runs = tuple(replace(run, id=name) for run, name in zip(data.runs, NAMES, strict=True))
    return replace(data, name=r"[/c] $\bar$", runs=runs)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_campaign(hostile(), tmp_path_factory.mktemp("names") / r"[c] $\bar$")


def test_plot(tunnel: Tunnel, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every text is laid out, as a formula of it would be, and nothing painted."""
    from matplotlib.figure import Figure

    def laid_out(figure: Figure, stream: Any, **_: Any) -> None:
        figure.draw_without_rendering()
        stream.write(b"\x89PNG\r\n\x1a\n")

    monkeypatch.setattr(Figure, "savefig", laid_out)
    status, out, err = tunnel("plot", folder, "--out", tmp_path / "figures")
    assert (status, err) == (0, "")
    assert r"[c] $\bar$/windows.png" in out
    assert len(list((tmp_path / "figures" / folder.name).iterdir())) == 6


def test_identify(tunnel: Tunnel, folder: Path) -> None:
    status, out, err = tunnel("identify", folder)
    assert (status, err) == (0, "")
    for name in NAMES:
        assert f"\n {name} " in out
    assert r"Runs of [/c] $\bar$" in out


@pytest.mark.slow
def test_diagnose_with_a_report(tunnel: Tunnel, folder: Path, tmp_path: Path) -> None:
    page = tmp_path / r"$\page$.html"
    status, out, err = tunnel("diagnose", folder, "--effects", "mains_hum", "--report", page)
    assert status == 0
    assert all(PROGRESS.match(line) for line in err.splitlines())
    assert f"Written: {page}" in out
    text = page.read_text(encoding="utf-8")
    assert r"$\foo$" in text
    assert "<svg>&amp;" not in text
    figure = text.partition('aria-label="Misfit of every run with')[2].partition("</svg>")[0]
    assert 'id="how-far-' in figure
    assert '>id="x"&lt;svg&gt;&amp;amp;</text>' in figure


def test_springs(tunnel: Tunnel, tmp_path: Path) -> None:
    table = tmp_path / "springs.csv"
    rows = "[/x],16.12,2.0\n[bold]b,21.02,2.28\n:smile:,44.84,3.33\n"
    table.write_text("spring,stiffness_N_m_per_rad,frequency_Hz\n" + rows)
    status, out, err = tunnel("springs", table)
    assert (status, err) == (0, "")
    for name in ("[/x]", "[bold]b", ":smile:"):
        assert f"\n {name} " in out


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_shows_a_name_as_it_is(name: str) -> None:
    from matplotlib.text import Text

    shown, formula = Text(0.0, 0.0, figure_text(name))._preprocess_math(figure_text(name))
    assert shown.strip() == name
    assert formula is False


def test_a_legend_leaves_no_run_out() -> None:
    data = hostile()
    figure = spectrum_figure(data.runs)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [run_label(run) for run in data.runs]
