"""The page, the terminal and the text of a result have the same numbers, in the same words, as its blocks."""

from __future__ import annotations

import pytest

from diagnosis.findings.sections import printed, sections
from identification.show.blocks import Figure, TextTable, as_html, as_text, lines
from tests.support.diagnosis_document import campaign, document, findings_of
from tests.support.shown_numbers import all_blocks
from tunnel_lab.report import render_report
from tunnel_lab.terminal.outputs import show


@pytest.fixture(scope="module")
def page() -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tunnel_lab.report.page.inline_svg", lambda *_: "")
        return render_report(findings_of(document()), campaign())


def blank(text: str) -> str:
    """The text with ordinary blanks only."""
    return text.replace("\u00a0", " ")


def test_the_page_has_the_blocks_of_all_sections(page: str) -> None:
    for section in sections(findings_of(document()), campaign()):
        for block in all_blocks(section.blocks):
            shown = as_html([block], titled=section.key != "head")
            assert isinstance(block, Figure) or blank(shown) in blank(page), block


def test_terminal_and_text_have_every_cell_and_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "250")
    blocks = printed(findings_of(document()))
    show(blocks)
    for shown in (capsys.readouterr().out, as_text(blocks)):
        words = " ".join(shown.split())
        for block in blocks:
            cells = (
                [cell for row in block.rows for cell in row] if isinstance(block, TextTable) else lines(block)
            )
            for part in (line for cell in cells for line in cell.split("\n")):
                assert " ".join(part.split()) in words
