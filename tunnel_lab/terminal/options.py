"""Options that several commands share; ``--quiet`` and ``--format`` belong to every command."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from enum import StrEnum
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table


PlanArgument = Annotated[
    Path | None,
    typer.Argument(help="Plan of a campaign (TOML). Default: the rig with its default spring at 10 m/s."),
]
RunOption = Annotated[
    str | None, typer.Option("--run", metavar="ID", help="Run of the plan. Default: its first.")
]
SpringOption = Annotated[int | None, typer.Option("--spring", help="Number of the spring in Table II.")]
WindOption = Annotated[float | None, typer.Option("--wind", help="Wind speed, m/s.")]
AngleOption = Annotated[float | None, typer.Option("--angle", help="Release angle, degrees.")]
EffectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--effect",
        metavar="NAME:PARAMETER=VALUE",
        help="Add an effect to the nominal model. May be repeated; tunnel effects lists them.",
    ),
]
HELP = "Format of the tables: text, csv, md or json (one object per line). Other lines then go to standard error."
EVERY = "As for every command"
"""Where the help lists what every command takes."""
QUIET_HELP = "Print errors only; files and --json - are still written."
quiet: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether this command prints errors only."""
_NUMBER = re.compile(r"[+-]?\d+(\.\d+)?(e[+-]?\d+)?")


def _know_effects(context: typer.Context, path: Path | None) -> Path | None:
    """Make the effects of a file known until the command ends."""
    if path is not None:
        from tunnel_sim.effects.expression_effect import read_effects
        from tunnel_sim.effects.registry import answering_with

        context.with_resource(answering_with(read_effects(path)))
    return path


EffectsFileOption = Annotated[
    Path | None,
    typer.Option(
        "--effects-file",
        metavar="FILE.toml",
        rich_help_panel="Effects",
        help="Add the effects that this file states as expressions to the vocabulary.",
        callback=_know_effects,
    ),
]


def split_names(words: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, from lists with commas, or from both."""
    return tuple(name.strip() for word in words or () for name in word.split(",") if name.strip())


def known_estimator(name: str) -> None:
    """Refuse an unknown estimator.

    Raises:
        TunnelError: when there is no such estimator; it suggests the closest name.
    """
    from identification.estimators import known_estimators
    from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

    known = known_estimators()
    if name not in known:
        raise TunnelError(
            f"there is no estimator {name!r}", where="--estimator", remedy=did_you_mean(name, known)
        )


def refuse_unwritable_files(*paths: Path | None) -> None:
    """Refuse files that cannot be written before the work is done; None is left out.

    Raises:
        TunnelError: for the first of them.
    """
    from tunnel_sim.files.writing import refuse_unwritable

    for path in filter(None, paths):
        refuse_unwritable(path)


class TableFormat(StrEnum):
    """How tables are printed."""

    TEXT = "text"
    CSV = "csv"
    MD = "md"
    JSON = "json"


chosen: ContextVar[TableFormat] = ContextVar("table format", default=TableFormat.TEXT)
"""The format of this command's tables."""


def with_format(run: Callable[..., None]) -> Callable[..., None]:
    """A command with ``--quiet``, and ``--format`` for the tables that it prints."""
    kind = Annotated[
        TableFormat, typer.Option("--format", metavar="FORMAT", rich_help_panel=EVERY, help=HELP)
    ]
    return _with_option(with_quiet(run), "table_format", kind, chosen)


def with_quiet(run: Callable[..., None]) -> Callable[..., None]:
    """A command with the option ``--quiet``."""
    return _with_option(
        run,
        "quiet",
        Annotated[bool, typer.Option("--quiet", "-q", rich_help_panel=EVERY, help=QUIET_HELP)],
        quiet,
    )


def _with_option(
    run: Callable[..., None], name: str, kind: Any, variable: ContextVar[Any]
) -> Callable[..., None]:
    """A command with one more option, whose value a variable has while it runs."""
    default = variable.get()

    @wraps(run)
    def wider(*args: Any, **named: Any) -> None:
        token = variable.set(named.pop(name, default))
        try:
            run(*args, **named)
        finally:
            variable.reset(token)

    option = Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)
    given = signature(run, eval_str=True)  # Typer finds its own annotations only where they are not texts
    vars(wider)["__signature__"] = given.replace(parameters=[*given.parameters.values(), option])
    wider.__annotations__ = {**run.__annotations__, name: kind}
    return wider


def rendered(table: Table, kind: TableFormat) -> str:
    """A table in another format.

    Args:
        table: of texts.
        kind: not text.

    Returns:
        Lines with a final line feed. Cells are as printed; JSON has numbers where a cell is one.
    """
    heads = [_plain(column.header) for column in table.columns]
    rows = list(zip(*([_plain(cell) for cell in column.cells] for column in table.columns), strict=True))
    title = _plain(table.title or "")
    if kind is TableFormat.JSON:
        from tunnel_sim.files.writing import json_line

        records = [{head: _value(cell) for head, cell in zip(heads, row, strict=True)} for row in rows]
        return json_line({"table": title, "rows": records}) + "\n"
    return _markdown(title, heads, rows) if kind is TableFormat.MD else _csv(title, heads, rows)


def _csv(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    stream.write(f"# {title}\n")
    writer.writerows([heads, *rows])
    return stream.getvalue()


def _markdown(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    body = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
    return f"**{title}**\n\n{body}\n"


def _plain(cell: object) -> str:
    return " ".join(str(cell).split())


def _value(cell: str) -> str | float:
    if not _NUMBER.fullmatch(cell):
        return cell
    return int(cell) if cell.isdecimal() else float(cell)
