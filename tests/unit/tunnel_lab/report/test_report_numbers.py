"""The page, the terminal and the text of a result have the same numbers, in the same words, as its blocks."""

from __future__ import annotations

from html import escape

import pytest

from diagnosis.findings.cards import key_figures
from diagnosis.findings.sections import printed, sections
from identification.show.blocks import Figure, TextTable, as_html, as_text, lines, typeset
from tests.support.diagnosis_document import campaign, document, findings_of
from tests.support.shown_numbers import all_blocks
from tunnel_lab.report import render_report
from tunnel_lab.terminal.outputs import show


@pytest.fixture(scope="module")
def page() -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tunnel_lab.report.page.inline_svg", lambda *_: "")
        return render_report(findings_of(document()), campaign())


def test_the_page_has_the_tables_of_all_sections_and_the_figures_of_the_head(page: str) -> None:
    for section in sections(findings_of(document()), campaign()):
        for block in all_blocks(section.blocks):
            assert isinstance(block, Figure) or as_html([block], titled=True) in page, block
    for figure in key_figures(findings_of(document())):
        assert escape(typeset(figure.value)) in page


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
