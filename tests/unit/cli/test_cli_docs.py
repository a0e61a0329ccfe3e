"""``tunnel docs``: a small site is built as the large one is, and faults are one line or status 1."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Tunnel = Callable[..., tuple[int, str, str]]


@pytest.fixture
def pages(tmp_path: Path) -> Path:
    (tmp_path / "conf.py").write_text('project = "small"\n')
    (tmp_path / "index.rst").write_text("Title\n=====\n\nText.\n")
    return tmp_path


def test_a_site_is_built(tunnel: Tunnel, pages: Path) -> None:
    status, out, _ = tunnel("docs", "--source", pages, "--no-browser")
    page = pages / "_build" / "html" / "index.html"
    assert (status, "".join(out.split())) == (0, f"Built:{page}")
    assert "Text." in page.read_text()


def test_a_page_that_cannot_be_built_ends_with_status_one(tunnel: Tunnel, pages: Path) -> None:
    (pages / "index.rst").write_text("Title\n=====\n\n:doc:`no-such-page`\n")
    assert tunnel("docs", "--source", pages, "--no-browser")[0] == 1


def test_without_pages_or_sphinx_a_remedy_is_given(
    tunnel: Tunnel, pages: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    status, out, err = tunnel("docs", "--source", pages / "none")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "--source" in err
    monkeypatch.setitem(sys.modules, "sphinx.cmd.build", None)
    status, out, err = tunnel("docs", "--source", pages)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "pip install 'virtual-wind-tunnel[docs]'" in err
