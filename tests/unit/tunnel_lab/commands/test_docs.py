"""``tunnel docs``: a small site is built as the large one is, and faults are one line or status 1."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.support.command import Tunnel


@pytest.fixture
def pages(tmp_path: Path) -> Path:
    folder = tmp_path / "pages"
    folder.mkdir()
    (folder / "conf.py").write_text('project = "small"\n')
    (folder / "index.rst").write_text("Title\n=====\n\nText.\n")
    return folder


def test_a_site_is_built_and_the_source_left_as_it_is(tunnel: Tunnel, pages: Path, tmp_path: Path) -> None:
    before = sorted(pages.rglob("*"))
    status, out, _ = tunnel("docs", "--source", pages, "--out", tmp_path / "site", "--no-browser")
    page = tmp_path / "site" / "html" / "index.html"
    assert (status, "".join(out.split())) == (0, f"Built:{page}")
    assert "Text." in page.read_text()
    assert sorted(pages.rglob("*")) == before
    status, _, err = tunnel("docs", "--source", pages, "--out", pages / "site", "--no-browser")
    assert (status, err.count("\n")) == (2, 1)
    assert "is among the pages" in err
    assert sorted(pages.rglob("*")) == before


def test_a_page_that_cannot_be_built_ends_with_status_one(
    tunnel: Tunnel, pages: Path, tmp_path: Path
) -> None:
    (pages / "index.rst").write_text("Title\n=====\n\n:doc:`no-such-page`\n")
    assert tunnel("docs", "--source", pages, "--out", tmp_path / "site", "--no-browser")[0] == 1


def test_without_pages_or_sphinx_a_remedy_is_given(
    tunnel: Tunnel, pages: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    status, out, err = tunnel("docs", "--source", pages / "none")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "--source" in err
    monkeypatch.setitem(sys.modules, "sphinx.cmd.build", None)
    status, out, err = tunnel("docs", "--source", pages, "--out", pages.parent / "site")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "pip install '.[docs]'" in err
