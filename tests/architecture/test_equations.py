"""Equations of the pages: TeX between ``$$``, which the site shows as MathML, without a network or a script."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(page for page in DOCS.glob("**/*.md") if "_build" not in page.parts)
FENCE = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
EQUATION = re.compile(r"^ *\$\$$(.*?)^ *\$\$$", re.DOTALL | re.MULTILINE)
TEX = {page: EQUATION.findall(FENCE.sub("", page.read_text(encoding="utf-8"))) for page in PAGES}
WITH_EQUATIONS = [page for page in PAGES if TEX[page]]


def test_pages_have_equations() -> None:
    assert DOCS / "theory" / "what-no-free-decay-can-show.md" in WITH_EQUATIONS


@pytest.mark.parametrize("page", WITH_EQUATIONS, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_equations_become_mathml(page: Path) -> None:
    from latex2mathml.converter import convert

    for tex in TEX[page]:
        root = ElementTree.fromstring(convert(tex, display="block"))
        shown = "".join(root.itertext())
        assert root.tag.endswith("math")
        assert shown.strip()
        assert "\\" not in shown, "a command that the converter does not know"


def test_no_equation_is_an_indented_block() -> None:
    texts = {page.relative_to(DOCS): FENCE.sub("", page.read_text(encoding="utf-8")) for page in PAGES}
    found = {page: re.findall(r"(?<=\n\n) {4,}(?![-*\d$\\]).*[=≈].*", text) for page, text in texts.items()}
    assert {page: lines for page, lines in found.items() if lines} == {}
