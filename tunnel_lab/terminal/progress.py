"""Progress on standard error: a bar with the time left, and the steps of a diagnosis."""

from __future__ import annotations

import time
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
    """From now on, print tried sets of effects too where no terminal shows them, at most one in so many seconds."""
    global _sets_every
    _sets_every = every


@contextmanager
def step_display() -> Iterator[Callable[[str], None]]:
    """A spinner with the step, the effect tried and the time, or one line per step where no terminal shows it.

    Yields:
        The function to call with each step.
    """
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    terminal = console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=terminal, disable=not terminal.is_terminal, transient=True) as progress:
        task = progress.add_task("starting", total=None)
        step, begun, printed = "", time.perf_counter(), 0.0

        def show_step(text: str) -> None:
            nonlocal step, printed
            now = time.perf_counter() - begun
            if text in STEPS:
                step = STEPS[text]
                progress.update(task, description=step)
                if not terminal.is_terminal:
                    terminal.print(f"{now:.1f} s: {step}", markup=False)
            else:
                progress.update(task, description=f"{step}: {text}")
                if not terminal.is_terminal and _sets_every is not None and now - printed >= _sets_every:
                    printed = now
                    terminal.print(f"{now:.1f} s: {step}: {text}", markup=False, soft_wrap=True)

        yield show_step
