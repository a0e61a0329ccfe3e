"""One runner of experiments: a task is data, the work on it a pure function; finished tasks are not done again.

Sweeps, scores, breakdowns and training samples differ in their tasks, their work and the files of their results.
They share this loop, its resumption and its progress. Nothing heavy is imported here, because worker processes
start with this module.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from typing import Protocol, TypeVar

from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
Progress = Callable[[int, int], None]
"""A function to call with the number finished and the number in all, at the start and after each task."""
Say = Callable[[str], None]
"""A function to call with each line for the user."""
PATIENCE = 3
"""How often processes may die in succession without finishing a task."""


class Workers(Protocol):
    """Those that do the work: `processes`, `lasting_processes`, or a cluster."""

    def __call__(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT], /
    ) -> Iterator[tuple[TaskT, ResultT]]:
        """Yield every task with its result, in the order in which they finish."""


def run_tasks(
    work: Callable[[TaskT], ResultT],
    tasks: Sequence[TaskT],
    workers: Workers,
    *,
    finished: Callable[[TaskT], bool],
    keep: Callable[[TaskT, ResultT], object],
    size: Callable[[TaskT], int] = lambda _: 1,
    progress: Progress | None = None,
) -> int:
    """Do the tasks that are not finished.

    Args:
        work: a pure function of a module: a task that is done twice gives the same.
        finished: whether the result of a task is kept already.
        keep: called in this process with each task and its result.
        size: of a task, as progress counts it.

    Returns:
        Number of tasks that were finished before.
    """
    waiting = [task for task in tasks if not finished(task)]
    total = sum(map(size, tasks))
    done = total - sum(map(size, waiting))
    if progress is not None:
        progress(done, total)
    with closing(_results(work, waiting, workers)) as results:
        for task, result in results:
            keep(task, result)
            done += size(task)
            if progress is not None:
                progress(done, total)
    return len(tasks) - len(waiting)


def _results(
    work: Callable[[TaskT], ResultT], waiting: Sequence[TaskT], workers: Workers
) -> Generator[tuple[TaskT, ResultT], None, None]:
    """The work as a generator, which is always closed at the end."""
    if waiting:
        yield from workers(work, waiting)


def processes(jobs: int) -> Workers:
    """Processes of this machine.

    Args:
        jobs: how many; 0 works in this one.
    """

    def workers(work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]) -> Iterator[tuple[TaskT, ResultT]]:
        return in_processes(work, tasks, jobs)

    return workers


def lasting_processes(jobs: int, say: Say) -> Workers:
    """Processes of this machine; the tasks of a process that dies are repeated."""

    def workers(work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]) -> Iterator[tuple[TaskT, ResultT]]:
        waiting = list(tasks)
        broken = 0
        while waiting:
            try:
                for task, result in in_processes(work, tuple(waiting), jobs):
                    waiting.remove(task)
                    broken = 0
                    yield task, result
            except BrokenProcessPool:
                broken += 1
                if broken >= PATIENCE:
                    raise TunnelError(
                        f"worker processes died {PATIENCE} times without finishing a shard",
                        remedy="check the memory and give fewer --workers; finished shards are kept",
                    ) from None
                say("a worker process was lost; its shards are repeated")

    return workers


def available_processors() -> int:
    """Number of processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
