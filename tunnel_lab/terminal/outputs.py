"""Output of commands: blocks and lines, progress, and the tables of imports and budgets."""

from __future__ import annotations

import csv
import io
import re
import shlex
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from html import escape
from math import sqrt
from pathlib import Path
from textwrap import wrap
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from identification import printing
from identification.blocks import Block, Paragraph, Table, brief, lines
from identification.printing import SYMBOLS, in_stds, significant, unit, with_std
from tunnel_lab.terminal.encoding import printable_json
from tunnel_lab.terminal.inputs import TableFormat, chosen, quiet
from tunnel_lab.terminal.time_left import Reached
from tunnel_sim.vocabulary.text_cells import as_text_cell

if TYPE_CHECKING:
    from rich.table import Column

    from identification.estimate import Estimate, Quantity
    from tunnel_sim.files.importing.records import Imported
    from tunnel_sim.vocabulary.campaign import Campaign


PROSE = 30
"""Columns: a longer cell is a sentence, which may be wrapped."""
_PADDING, _BETWEEN = 2, 1  # columns beside a cell, and between two
DIAGNOSE = "run the diagnosis"
"""The ending of notes whose remedy is a diagnosis."""
Document = Mapping[str, Any]
_DOMINANT = 0.5  # of the variance: more than all others together
_NUMBER = re.compile(r"[+-]?\d+(\.\d+)?(e[+-]?\d+)?")


class _Console(Console):
    """A console that leaves a closed pipe to ``main``."""

    def on_broken_pipe(self) -> None:
        """Pass the error on; Rich itself would exit with status 1."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """A console that prints text unchanged, without highlighting and markup, or not at all with ``--quiet``."""
    return _Console(stderr=stderr, quiet=quiet.get(), highlight=False, markup=False, emoji=False)


def say(line: str, *, stderr: bool = False) -> None:
    """Print one line unchanged, so that paths can be copied; on standard error where tables are not text."""
    console(stderr=stderr or chosen.get() is not TableFormat.TEXT).print(line, soft_wrap=True)


def say_written(*paths: Path | None) -> None:
    """Print the paths of the files that were written; None is left out."""
    for path in filter(None, paths):
        say(f"Written: {path}")


def show(blocks: Iterable[Block]) -> None:
    """Print blocks without figures and details; an empty line parts tables from the lines above."""
    after_line = False
    for block in brief(blocks):
        if isinstance(block, Table):
            if after_line:
                say("")
            show_tables(block)
        for line in lines(block):
            say(line)
        after_line = not isinstance(block, Table)


def show_tables(*tables: Table | RichTable) -> None:
    """Print tables that have rows, each followed by an empty line, in the format of ``--format``.

    A table of text that is wider than the terminal is printed row by row.
    """
    out = console()
    for given in tables:
        table = rich_table(given) if isinstance(given, Table) else given
        if not table.row_count:
            continue
        if chosen.get() is TableFormat.TEXT and is_too_wide(table, out.width):
            out.print(stacked(table, out.width), soft_wrap=True)
        elif chosen.get() is TableFormat.TEXT:
            for column in table.columns:  # wide enough that only headings and sentences are wrapped
                column.min_width = _least_width(column)
            out.print(table)
        else:
            out.print(rendered(table, chosen.get()), soft_wrap=True, end="")
        if chosen.get() is not TableFormat.JSON:
            out.print()


def rendered(table: RichTable, kind: TableFormat) -> str:
    """A table of texts as CSV, Markdown or JSON with a final line feed; numeric cells become numbers in JSON."""
    plain = text_table(table)
    title, heads, rows = plain.title, list(plain.columns), plain.rows
    if kind is TableFormat.JSON:
        from tunnel_sim.files.writing import json_line

        records = [
            {
                head: cell if not _NUMBER.fullmatch(cell) else int(cell) if cell.isdecimal() else float(cell)
                for head, cell in zip(heads, row, strict=True)
            }
            for row in rows
        ]
        return printable_json(json_line({"table": title, "rows": records})) + "\n"
    if kind is TableFormat.MD:
        lines = [heads, ["---"] * len(heads), *rows]
        cells = (" | ".join(map(_as_markdown, line)) for line in lines)
        body = "\n".join(f"| {line} |" for line in cells)
        return f"**{_as_markdown(title)}**\n\n{body}\n"
    stream = io.StringIO()
    stream.write(f"# {title}\n")
    texts = ([as_text_cell(cell) for cell in line] for line in (heads, *rows))
    csv.writer(stream, lineterminator="\n").writerows(texts)
    return stream.getvalue()


def text_table(table: RichTable) -> Table:
    """A table of texts without its style, each cell on one line."""
    heads = tuple(_plain(column.header) for column in table.columns)
    rows = tuple(zip(*(map(_plain, column.cells) for column in table.columns), strict=True))
    right = tuple(
        head for head, column in zip(heads, table.columns, strict=True) if column.justify == "right"
    )
    return Table(_plain(table.title or ""), heads, rows, right)


def _as_markdown(text: str) -> str:
    """Text of a cell without HTML, links and ends of cells."""
    marked = escape(text.replace("\\", "\\\\"), quote=False)
    return marked.replace("|", "\\|").replace("](", "]\\(")


def _plain(cell: object) -> str:
    return " ".join(str(cell).split())


def table(title: str, *columns: str, right: Sequence[str] = ()) -> RichTable:
    """An empty table in the common style: headings have units, those of ``right`` align to the right."""
    result = RichTable(
        title=Text(title), title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, show_edge=False
    )
    for column in columns:
        # As text, not markup: units are in brackets. Folded, not cut, so that no digit is lost.
        result.add_column(Text(column), justify="right" if column in right else "left", overflow="fold")
    return result


def rich_table(given: Table) -> RichTable:
    """A table without its details, in the common style."""
    plain = given.without_detail()
    result = table(plain.title, *plain.columns, right=plain.right)
    for column in result.columns:
        column.no_wrap = str(column.header) in plain.names  # for copying
    for row in plain.rows:
        result.add_row(*map(Text, row), end_section=plain.ruled)
    return result


def truth_table(estimate: Estimate, truth: Mapping[str, float]) -> Table:
    """An estimate beside the injected values.

    Args:
        truth: injected values by name, each in the unit of the estimate's quantity of that name.
    """
    from identification.estimate import UNITS

    rows = []
    for name, value in truth.items():
        cells = (f"{SYMBOLS[name]} {unit(UNITS[name])}", significant(value))
        quantity: Quantity | None = getattr(estimate, name)
        if quantity is None:
            rows.append((*cells, estimate.status.name.lower().replace("_", " "), "", ""))
            continue
        error = quantity.value - value
        relative = f"{100.0 * error / abs(value):+.1g} %" if value else ""
        rows.append((*cells, with_std(quantity.value, quantity.std), relative, in_stds(error, quantity.std)))
    heads = ("quantity", "truth", "estimate ± std", "error", "error/std")
    right = ("truth", "error", "error/std")
    return Table(f"{estimate.estimator} against the injected truth", heads, tuple(rows), right)


def is_too_wide(table: RichTable, width: int) -> bool:
    """Whether cells other than sentences, or words of a heading, would be broken at this width."""
    needed = sum(_least_width(column) + _PADDING for column in table.columns)
    return needed + _BETWEEN * (len(table.columns) - 1) > width


def _least_width(column: Column) -> int:
    widths = [cell_len(word) for word in str(column.header).split()]
    for cell in column.cells:  # its longest line, or the longest word of a sentence
        longest = max(map(cell_len, str(cell).splitlines()), default=0)
        widths.append(longest if longest <= PROSE else max(map(cell_len, str(cell).split())))
    return max(widths, default=0)


def stacked(table: RichTable, width: int) -> str:
    """A table row by row: its first cell, and below it the others with their headings; empty ones are left out.

    Sentences are wrapped to the width of the terminal; words are never broken.
    """
    heads = [" ".join(str(column.header).split()) for column in table.columns]
    lines = [str(table.title or "")]
    for first, *others in zip(*(column.cells for column in table.columns), strict=True):
        named = [(head, str(cell)) for head, cell in zip(heads[1:], others, strict=True) if str(cell)]
        if len(heads) == 2:
            named, first = [], f"{first}: {others[0]}"
        else:
            first = f"{heads[0]} {first}"
        lines += _wrapped(first, " ", width)
        room = max((cell_len(head) for head, _ in named), default=0)
        for head, cell in named:
            lines += _wrapped(cell, f"   {head}{' ' * (room - cell_len(head))}  ", width)
    return "\n".join(lines)


def _wrapped(text: str, prefix: str, width: int) -> Iterator[str]:
    """Lines of a text after a prefix; later lines are indented by the length of the prefix."""
    room = max(width - cell_len(prefix), PROSE)
    lines = [part for line in text.splitlines() for part in wrap(line, room, break_long_words=False)]
    for number, line in enumerate(lines or [""]):
        yield f"{prefix if number == 0 else ' ' * cell_len(prefix)}{line}".rstrip()


def show_estimate(
    campaign: Campaign, estimate: Estimate, *, windows: bool, source: Path | None = None
) -> None:
    """Print an estimate.

    Args:
        source: the path of the campaign, for commands to copy; None: there is no path.
    """
    document = estimate.to_json_dict()
    conditions = {run.id: (run.spring_stiffness, run.wind_speed) for run in campaign.runs}
    coefficients, runs, *notes = printing.estimate_blocks(document, conditions)
    of_windows = map(printing.windows_table, document["runs"]) if windows else ()
    command = DIAGNOSE if source is None else f"run tunnel diagnose {shlex.quote(str(source))}"
    show(
        (
            coefficients,
            runs,
            *of_windows,
            *(
                replace(note, text=note.text.replace(DIAGNOSE, command))
                if isinstance(note, Paragraph)
                else note
                for note in notes
            ),
        )
    )


def parts_table(imported: Imported) -> Table:
    """The runs of an import: samples, rate, begin and end, swing, conditions, and the file where several."""
    swing = f"swing\n[{imported.campaign.sensor.unit}]"
    used = [part.run for part in imported.parts if part.run is not None]
    windless = all(run.drive is not None and run.wind_speed == 0.0 for run in used)  # a joint
    wind = () if windless else ("V\n[m/s]",)
    headings = ("samples", "rate\n[Hz]", "from\n[s]", "to\n[s]", swing, *wind, "Kr\n[N m/rad]")
    several = len(imported.sources) > 1
    rows = []
    for part in imported.parts:
        time, run = part.raw.cleaned.file_time_s[part.piece.first : part.piece.last], part.run
        cells = [f"{time.size}", "left out", *[""] * (len(headings) - 2)]
        if run is not None:
            cells[1:] = [
                f"{run.record.sample_rate:.4g}",
                f"{time[0]:.2f}",
                f"{time[-1]:.2f}",
                f"±{0.5 * (part.reading.max() - part.reading.min()):.3g}",
                *([f"{run.wind_speed:g}"] if wind else []),
                "not stated" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
            ]
        rows.append((part.id, *([part.raw.source.name] if several else []), *cells))
    return Table("Read", ("run", *(["file"] if several else []), *headings), tuple(rows), right=headings)


def budget_table(budget: Document) -> Table:
    """Standard uncertainties, a row for each source and one for all of them, in the quantities' units.

    A negative value is the reduction by a correlation.
    """
    from identification.estimate import UNITS

    names = [name for name in UNITS if name in budget["combined_std"]]
    headings = tuple(f"{SYMBOLS[name]}\n{unit(UNITS[name])}" for name in names)
    rows = []
    for component in budget["components"]:
        cells = []
        for variance in (float(component["variance"][name]) for name in names):
            if variance == 0.0:
                cells.append("0" if component["known"] else "–")
            else:
                cells.append(f"{'−' if variance < 0.0 else ''}{significant(sqrt(abs(variance)), 2)}")
        rows.append((component["name"], *cells))
    rows.append(("all together", *(significant(budget["combined_std"][name], 2) for name in names)))
    title = "Uncertainty budget: one standard uncertainty each"
    return Table(title, ("source", *headings), tuple(rows), right=headings)


def budget_lines(budget: Document) -> list[str]:
    """The dominant source of each quantity, and the notes of the sources."""
    from identification.estimate import UNITS

    components = budget["components"]
    said = []
    for name in (name for name in UNITS if name in budget["combined_std"]):
        variances = [float(component["variance"][name]) for component in components]
        largest, total = max(variances), sum(variances)
        share = largest / total if total > 0.0 else 0.0
        verb = "dominates" if share > _DOMINANT else "is the largest source"
        source = components[variances.index(largest)]["name"]
        said.append(f"{SYMBOLS[name]}: {source} {verb}, {100.0 * share:.0f} % of the variance")
    return [*said, *(f"{part['name']}: {part['note']}" for part in components if part["note"])]


@contextmanager
def bar(what: str, total: int | None = None) -> Iterator[Callable[..., None]]:
    """A progress bar on standard error, where that is a terminal; elsewhere nothing is printed.

    Args:
        total: number of items, where it is known beforehand.

    Yields:
        A function to call with the number finished, the total and, if any, the name of the last item. The first
        call gives the number finished before, which does not count for the speed.
    """
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    terminal = console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(elapsed_when_finished=False),
    )  # fmt: skip
    with Progress(
        *columns, console=terminal, disable=not terminal.is_terminal, speed_estimate_period=600
    ) as progress:
        task = progress.add_task(what, total=total)

        def advance(done: int, count: int, name: str = "") -> None:
            # Rich leaves the first change out of the speed: items finished before need no special treatment.
            progress.update(task, completed=done, total=count, description=f"{what} {name}".rstrip())

        yield advance


@contextmanager
def bar_or_lines(
    what: str, total: int | None = None, *, every: float = 30.0
) -> Iterator[Callable[..., None]]:
    """A progress bar for work of minutes; without a terminal, an occasional line on standard error.

    Args:
        total: number of items, where it is known beforehand.
        every: time between two lines, s.

    Yields:
        The function of `bar`.
    """
    terminal, begun, over = console(stderr=True), time.perf_counter(), Event()
    reached = "" if total is None else f", 0 of {total}"

    def print_lines() -> None:
        while not over.wait(every):
            seconds = time.perf_counter() - begun
            terminal.print(f"{seconds:.0f} s: {what}{reached}", soft_wrap=True)

    with bar(what, total) as advance:

        def advance_and_note(done: int, count: int, name: str = "") -> None:
            nonlocal reached
            reached = f", {done} of {count}"
            advance(done, count, name)

        lines = Thread(target=print_lines, daemon=True)
        if not terminal.is_terminal:
            lines.start()
        try:
            yield advance_and_note
        finally:
            over.set()
            if lines.is_alive():
                lines.join()


STEPS = {
    "noise": "estimating the noise",
    "nominal fit": "fitting the nominal model",
    "where": "locating the gap",
    "effects": "fitting sets of effects",
    "random moments": "fitting random moments",
    "pruning": "fitting the answer without each effect",
    "polishing": "fitting the answer to convergence",
    "how far it closes": "predicting held-out runs",
    "what no effect explains": "estimating what no effect explains",
}
"""Steps of the study in words; any other progress message is a set of effects."""
_sets_every: float | None = None


def print_sets(every: float) -> None:
    """From now on, without a terminal, also print tried sets of effects, at most one in ``every`` seconds."""
    global _sets_every
    _sets_every = every


@contextmanager
def step_display() -> Iterator[Callable[[str], None]]:
    """A spinner with step, effect tried, elapsed and remaining time; without a terminal, a line per step.

    Yields:
        The function to call with each step.
    """
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeElapsedColumn

    terminal = console(stderr=True)
    step, begun, printed, reached = "", time.perf_counter(), 0.0, Reached()

    class TimeLeft(ProgressColumn):
        """The time left, in words."""

        def render(self, _: Task) -> Text:
            """As of now."""
            return Text(reached.words(time.perf_counter() - begun))

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
        TimeLeft(),
    )
    with Progress(*columns, console=terminal, disable=not terminal.is_terminal, transient=True) as progress:
        task = progress.add_task("starting", total=None)

        def show_step(text: str) -> None:
            nonlocal step, printed, reached
            now = time.perf_counter() - begun
            if text in STEPS:
                again, step, reached = STEPS[text] == step, STEPS[text], Reached(text, now)
                progress.update(task, description=step)
                if not again and not terminal.is_terminal:  # a repeated step is one step to the user
                    terminal.print(f"{now:.1f} s: {step}", markup=False)
            else:
                progress.update(task, description=f"{step}: {text}")
                if not terminal.is_terminal and _sets_every is not None and now - printed >= _sets_every:
                    printed = now
                    terminal.print(f"{now:.1f} s: {step}: {text}", markup=False, soft_wrap=True)

        yield show_step
