"""The list of estimators in a command's help, generated from the registry."""

from __future__ import annotations

import inspect
import textwrap

from identification.estimators import SUMMARIES

PLACE = "  {estimators}"
"""Placeholder of the list in a command's docstring."""

_WIDTH = 78


def with_estimators(text: str | None) -> str:
    """A command's docstring with one paragraph per estimator: its name, and its summary wrapped beside it."""
    column = max(map(len, SUMMARIES)) + 4
    paragraphs = [
        textwrap.fill(
            summary, _WIDTH, initial_indent=f"  {name}".ljust(column), subsequent_indent=" " * column
        )
        for name, summary in SUMMARIES.items()
    ]
    return inspect.cleandoc(text or "").replace(PLACE, "\n".join(paragraphs))
