"""The pages show what their examples print; ``python -m docs.studies.quotes`` writes it."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.studies.quotes import outputs, pages, path_of, quotes, refreshed
from tests.marks import slow

QUICK = {"how-to/add-a-finding", "how-to/add-an-estimator", "how-to/identify-a-record"}
ELSEWHERE = {"README"}
"""The README is run by its own test, which also looks at the files written."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else slow(name) for name in pages() if name not in ELSEWHERE]
)
def test_a_page_shows_what_its_examples_print(name: str, tmp_path: Path) -> None:
    page = path_of(name).read_text(encoding="utf-8")
    assert refreshed(page, outputs(page, tmp_path)) == page, f"run: python -m docs.studies.quotes {name}"


def test_every_page_with_examples_is_run() -> None:
    assert {"README", "reference/envs/free-decay", "tutorials/a-driven-rig", *QUICK} <= set(pages())
    assert len(pages()) >= 20


PAGE = """A page.

```console
$ tunnel one
1.234 rad
$ tunnel two
first
…
```

```python
x = 1
```

```python
print(x)
```

```text
1
```
"""


def test_the_examples_of_a_page() -> None:
    assert [(one.source, one.shown) for one in quotes(PAGE)] == [
        ("tunnel one", "1.234 rad\n"),
        ("tunnel two", "first\n…\n"),
        ("x = 1\n", ""),
        ("print(x)\n", "1\n"),
    ]


def test_only_what_differs_is_written() -> None:
    same = ["1.235 rad\n", "first\nsecond\n", "", "1\n"]
    assert refreshed(PAGE, same) == PAGE  # a last digit, and the rest of an excerpt
    changed = ["2.234 rad\nmore\n", "other\nsecond\n", "new\n", "7\n"]
    again = refreshed(PAGE, changed)
    assert "$ tunnel one\n2.234 rad\nmore\n$ tunnel two\nother\n…\n```" in again
    assert "x = 1\n```\n\n```text\nnew\n```\n" in again
    assert again.endswith("```text\n7\n```\n")
    assert refreshed(again, changed) == again
