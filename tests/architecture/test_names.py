"""Names of types and of files: each says by itself which one is meant."""

from __future__ import annotations

import re
from collections import Counter, defaultdict

from tests.support.sources import ROOT, SOURCES, modules

ON_EVERY_LEVEL = {"__init__.py", "__main__.py", "CMakeLists.txt", "README.md", "py.typed"}


def test_no_public_class_name_is_defined_twice() -> None:
    places = defaultdict(list)
    for module, path in modules().items():
        for name in re.findall(r"^class ([A-Za-z]\w*)", path.read_text(encoding="utf-8"), re.MULTILINE):
            places[name].append(module)
    assert len(places) > 400
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_no_source_file_has_a_name_that_two_others_have() -> None:
    files = [
        path
        for folder in SOURCES
        for ending in ("py", "c", "h")
        for path in (ROOT / folder).rglob(f"*.{ending}")
    ]
    count = Counter(path.name for path in files)
    assert len(count) > 300
    assert {name: n for name, n in count.items() if n > 2 and name not in ON_EVERY_LEVEL} == {}
