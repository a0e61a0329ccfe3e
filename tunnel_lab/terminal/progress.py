"""A progress bar with the time left."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tunnel_lab.terminal.tables import console


@contextmanager
def bar(what: str, total: int | None = None) -> Iterator[Callable[..., None]]:
    """A progress bar on standard error, where that is a terminal; elsewhere nothing is printed.

    Args:
        total: number of items, where it is known beforehand.

    Yields:
        A function to call with the number finished, the total and, where it has one, the name of the last item. The
        first call gives the number finished before, which does not count for the speed.
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
            # Rich leaves the first change out of the speed: what was finished before needs no treatment of its own.
            progress.update(task, completed=done, total=count, description=f"{what} {name}".rstrip())

        yield advance
