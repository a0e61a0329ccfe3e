"""The list of estimators in a command's help, generated from the registry."""

from __future__ import annotations

import textwrap

import typer
from typer.core import TyperCommand

PLACE = "{estimators}"
"""Placeholder of the list in a command's docstring."""

_WIDTH = 78
_INDENT = "  "


def command_with_estimators() -> type[TyperCommand]:
    """A command class whose help lists the estimators; the registry is read when the help is shown."""
    return _CommandWithEstimators


class _CommandWithEstimators(TyperCommand):
    def format_help(self, ctx: typer.Context, formatter: object) -> None:  # type: ignore[override]  # click's own types
        if self.help and PLACE in self.help:
            self.help = self.help.replace(f"{_INDENT}{PLACE}", listing()).replace(PLACE, listing().lstrip())
        super().format_help(ctx, formatter)  # type: ignore[arg-type]


def listing() -> str:
    """One paragraph per estimator: its name, and its summary wrapped beside it."""
    from identification.estimators import ENTRIES

    column = max(len(entry.name) for entry in ENTRIES) + 2
    return "\n".join(
        textwrap.fill(
            entry.summary,
            _WIDTH,
            initial_indent=_INDENT + entry.name.ljust(column),
            subsequent_indent=_INDENT + " " * column,
        )
        for entry in ENTRIES
    )
