"""``tunnel paper``: a page with ours beside theirs."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.unit.tunnel_lab.conftest import Tunnel


def test_quick_parts(tunnel: Tunnel, tmp_path: Path) -> None:
    words = (
        "paper",
        "--out",
        tmp_path / "p",
        "--only",
        "table-1",
        "--only",
        "equations",
        "--only",
        "figure-2",
    )
    status, out, err = tunnel(*words)
    assert (status, err) == (0, "")
    assert "Izz 0.11 kg m²" in out
    assert f"Written: {tmp_path / 'p' / 'index.html'}" in out
    page = (tmp_path / "p" / "index.html").read_text(encoding="utf-8")
    assert page.count("<section") == 3
    assert page.index('id="table-1"') < page.index('id="equations"') < page.index('id="figure-2"')
    assert {path.name for path in (tmp_path / "p").iterdir()} == {
        "index.html",
        "parts",
        "impulse.png",
        "impulse.pdf",
    }


@pytest.mark.slow
def test_the_whole_page(tunnel: Tunnel, tmp_path: Path) -> None:
    status, out, err = tunnel("paper", "--out", tmp_path)
    assert (status, err) == (0, "")
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert page.count("<section") == 9
    assert out.count("reproduced") == 2
    assert "not reproducible" in out
    for name in ("springs", "impulse", "network-errors", "windows", "responses"):
        assert f'src="{name}.png"' in page
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / f"{name}.pdf").read_bytes().startswith(b"%PDF")
