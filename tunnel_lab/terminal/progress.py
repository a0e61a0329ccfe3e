"""Progress on standard error: bars, occasional lines, and the steps of a diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

from rich.text import Text

from tunnel_lab.terminal.outputs import console
from tunnel_lab.terminal.time_left import Reached


@contextmanager
def bar(what: str, total: int | None = None) -> Iterator[Callable[..., None]]:
    """A progress bar on standard error, if that is a terminal; elsewhere nothing is printed.

    Args:
        total: number of items, if known beforehand.

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
        total: number of items, if known beforehand.
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
    "explained share": "predicting held-out runs",
    "remainder": "estimating the explainable share of the residual",
}
"""Steps of the study in words; any other progress message is a set of effects."""
_sets_every: float | None = None


def print_sets(every: float) -> None:
    """From now on, without a terminal, also print the tried sets of effects, at most one in ``every`` seconds."""
    global _sets_every
    _sets_every = every


@contextmanager
def step_display() -> Iterator[Callable[[str], None]]:
    """A spinner with step, current effect, elapsed and remaining time; without a terminal, a line per step.

    Yields:
        The function to call with each step.
    """
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeElapsedColumn

    terminal = console(stderr=True)
    step, begun, printed, reached = "", time.perf_counter(), 0.0, Reached()

    class TimeLeft(ProgressColumn):
        """The time left, in words."""

        def render(self, _: Task) -> Text:
            """The text at this moment."""
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
