"""Links of all pages lead to files and headings that exist. Links to other sites: see CONTRIBUTING.md."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for folder in ("", "docs", "benchmarks", "mjcf", "tests")
    for page in (ROOT / folder).glob("**/*.md" if folder else "*.md")
    if "_build" not in page.parts
)
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub and MyST give to the headings of a page."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    found: set[str] = set()
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        found.add(slug)
    return found


def broken(page: Path) -> list[str]:
    wrong = []
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        address, _, anchor = link.partition("#")
        if ":" in address:  # another site
            continue
        target = page if not address else page.parent / address
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            wrong.append(link)
    return wrong


def test_links_lead_to_files_and_headings() -> None:
    found = {page.relative_to(ROOT): broken(page) for page in PAGES}
    assert {page: links for page, links in found.items() if links} == {}


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    (tmp_path / "other.md").write_text("# One two\n## `x`: [y](z.md)?\n")
    good = "[a](other.md#one-two) [b](other.md#x-y) [c](#top)"
    page.write_text(f"# Top\n{good} [d](other.md#three) [e](none.md) [f](#low)\n")
    assert broken(page) == ["other.md#three", "none.md", "#low"]
