"""``paper.md``: its figures are those of the pages, and its references and pictures exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TEXT = " ".join((ROOT / "paper.md").read_text(encoding="utf-8").split())
BLIND = (DOCS / "blind-check.md").read_text(encoding="utf-8")
REAL = (DOCS / "real-records.md").read_text(encoding="utf-8")
NEURAL = (DOCS / "neural-posterior.md").read_text(encoding="utf-8")
CAUSES = (DOCS / "benchmark-of-causes.md").read_text(encoding="utf-8")


def found(pattern: str, page: str) -> tuple[str, ...]:
    match = re.search(pattern, page, re.MULTILINE)
    assert match is not None, pattern
    return match.groups()


def test_the_figures_of_the_blind_check_are_those_of_its_page() -> None:
    right, of, low, high = found(r"^\| all \| (\d+) \| (\d+) \| .*? \| ([\d.]+)–([\d.]+) % \|$", BLIND)
    assert f"{right} of {of} sets were exactly right (95 % interval {low} to {high} %)" in TEXT
    caught, acting, false, named = found(
        r"^\| all \| \d+/\d+, .*? \| (\d+)/(\d+), .*? \| (\d+)/(\d+), ", BLIND
    )
    assert f"{caught} of {acting} were found, and {false} of {named} named causes were false" in TEXT
    right, of = found(r"^\| none acts \| (\d+) \| (\d+) \|", BLIND)
    assert right == of
    assert f"All {of} campaigns without an effect" in TEXT
    right, of = found(r"^\| outside the vocabulary \| (\d+) \| (\d+) \|", BLIND)
    assert f"{right} of {of} with an effect outside the vocabulary" in TEXT


def test_the_figures_of_the_real_records_are_those_of_their_page() -> None:
    right, of = found(r"^\*\*(\d+) of (\d+) are right\.\*\*", REAL)
    assert f"{right} of {of} are answered rightly" in TEXT


def test_the_figures_of_the_benchmark_are_those_of_its_page() -> None:
    rows = re.findall(r"^\| (.*?) \| (\d+/\d+) \(", CAUSES, re.MULTILINE)
    exact = {name: share for name, share in reversed(rows)}  # of a method's rows the first, which is of sets
    rivals = sorted(
        (share for name, share in exact.items() if name != "tunnel diagnose"),
        key=lambda s: int(s.split("/")[0]),
    )
    assert f"names the exact set in {exact['tunnel diagnose']}" in TEXT
    assert f"the best names the exact set in {rivals[-1]}" in TEXT
    causes = CAUSES[CAUSES.index("## Causes") :]
    false, named = found(r"^\| tunnel diagnose \|(?:[^|]*\|){2} (\d+)/(\d+) ", causes)
    assert f"{false} of {named} named causes false" in " ".join(TEXT.split())


def test_the_figures_of_other_programs_are_those_of_their_pages() -> None:
    of, right, ours = found(
        r"On the (\d+) campaigns that both answered it has (\d+) exact sets, and `tunnel diagnose` (\d+)",
        CAUSES,
    )
    assert f"has answered {of} campaigns, {right} of them exactly; this package has {ours} of these" in TEXT
    name = {"sbi": "sbi, our windows", "ours": "neural posterior"}
    bound = {who: found(rf"^\| {row} \| ([\d.]+) \| [\d.]+ \| 9", NEURAL)[0] for who, row in name.items()}
    error = {who: found(rf"^\| {row} \| ([\d.]+) \| \d+\.\d ± ", NEURAL)[0] for who, row in name.items()}
    assert f"{bound['sbi']} times the Cramér–Rao bound" in TEXT
    assert f"is right, against {bound['ours']}" in TEXT
    assert f"is {error['sbi']} standard deviations of the nominal fit, against {error['ours']}." in TEXT


def test_references_and_pictures_exist() -> None:
    keys = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"@([a-z]+\d{4})", TEXT)) == keys
    for picture in re.findall(r"\]\((docs/[^)]+)\)", TEXT):
        assert (ROOT / picture).is_file()


@pytest.mark.parametrize(
    "heading", ["Summary", "Statement of need", "State of the field", "Method", "Checks"]
)
def test_the_article_has_every_section(heading: str) -> None:
    assert re.search(rf"^# {heading}$", (ROOT / "paper.md").read_text(encoding="utf-8"), re.MULTILINE)
