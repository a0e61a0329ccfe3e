"""Every field of a table of a file format has a description, which ``tunnel schema`` shows."""

from __future__ import annotations

import importlib
from collections.abc import Iterator

import pydantic

from tests.architecture.test_layers import PACKAGES, ROOT


def tables() -> Iterator[type[pydantic.BaseModel]]:
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        if "pydantic" in path.read_text("utf-8"):
            module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
            yield from (
                member
                for name, member in vars(module).items()
                if isinstance(member, type)
                and issubclass(member, pydantic.BaseModel)
                and member.__module__ == module.__name__
                and not name.startswith("_")
            )


def test_every_field_of_a_file_is_described() -> None:
    found = list(tables())
    assert len(found) > 5
    undescribed = [
        f"{table.__module__}.{table.__name__}.{name}"
        for table in found
        for name, field in table.model_fields.items()
        if not field.description and "Table" not in str(field.annotation)  # nested tables have their own
    ]
    assert undescribed == []
