"""Pages of results made by one command: which, on which day, and what an interrupted study does next.

Truth: the list of results in docs/README.md, and pages and commands written by hand.
"""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

import pytest

from docs.studies import all as studies
from docs.studies.all import PAGES, ResultPage, Step, Work, main, make
from docs.studies.page_text import made_on
from tunnel_sim.vocabulary.errors import TunnelError

DOCS = Path(__file__).parents[4] / "docs"
WRITTEN = "# Waves\n\nMeasured.\n\n<!-- heights -->\nold\n<!-- end -->\n"


def test_every_page_of_results_can_be_made_and_states_its_day_and_command() -> None:
    index = (DOCS / "README.md").read_text("utf-8").split("## Results")[1].split("\n## ")[0]
    results = {name.removesuffix(".md") for name in re.findall(r"\]\(([\w-]+\.md)\)", index)}
    assert results
    dated = {page.name: page.path.read_text("utf-8") for page in PAGES if page.dated}
    assert results <= dated.keys()
    for name, text in dated.items():
        assert re.fullmatch(r"(\d{1,2} to )?\d{1,2} \w+ 2\d{3}", made_on(text)), name
        assert f"`python -m docs.studies.all {name}`" in text


def test_every_command_names_a_module_or_a_command_of_this_project() -> None:
    root = DOCS.parent
    for page in PAGES:
        for step in page.steps:
            first, second, *_ = step.command.split()
            if first == "tunnel":
                assert second in ("blind", "effects"), step
            else:
                module = root / step.command.split()[2].replace(".", "/")
                assert module.with_suffix(".py").exists() or (module / "__main__.py").exists(), step
            if step.table:
                assert f"<!-- {step.table} -->\n" in page.path.read_text("utf-8"), step


def test_an_interrupted_study_continues_with_the_unfinished_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(studies, "DOCS", tmp_path)
    (tmp_path / "waves.md").write_text(WRITTEN, "utf-8")
    first = "python -c \"print('noise'); print('| 1 | m |'); open(r'{work}/first', 'a').write('x')\""
    second = "python -c \"open(r'{work}/second').read()\""
    page = ResultPage("waves", (Step(first, table="heights"), Step(second)))
    work = Work(tmp_path, code="a")
    given = {"work": str(tmp_path)}
    with pytest.raises(TunnelError, match="status 1"):
        make(page, work, given)
    assert made_on(page.path.read_text("utf-8")) == ""
    (tmp_path / "second").write_text("")
    make(page, work, given)
    assert (tmp_path / "first").read_text() == "x"  # once
    text = page.path.read_text("utf-8")
    assert "<!-- heights -->\n| 1 | m |\n<!-- end -->" in text
    today = date.today()
    assert made_on(text) == f"{today.day} {today:%B %Y}"
    with pytest.raises(TunnelError, match="another state of the code"):
        make(page, Work(tmp_path, code="b"), given)


def test_unknown_pages_and_missing_data_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["tides"])
    assert "no page of results: tides; choose from blind-check, " in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["driven-records"])
    assert "driven-records: measured campaigns are not packaged; give --data" in capsys.readouterr().err
