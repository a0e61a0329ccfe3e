"""Independent work side by side in processes of this machine.

Every process has one thread: most of the work is Python, which threads cannot share, and the last bit of a sum must
not depend on the number of threads of a linear algebra library. Measured in benchmarks/sweep.py.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from multiprocessing.connection import Connection
from typing import ParamSpec, TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
Given = ParamSpec("Given")
ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "POLARS_MAX_THREADS",
)
"""Environment variables of the libraries that would start threads of their own, for a process of one thread."""


def in_processes(
    work: Callable[[ItemT], ResultT], items: Sequence[ItemT], jobs: int
) -> Iterator[tuple[ItemT, ResultT]]:
    """Do work in processes of one thread each, few items in flight at a time, which bounds the memory.

    Args:
        work: what to do; it and its results must be picklable.
        items: on which.
        jobs: number of processes; 0 works in this one.

    Yields:
        Items with their results, in the order in which they finish.

    Raises:
        BrokenProcessPool: when a process dies.
    """
    if jobs == 0 or not items:
        yield from ((item, work(item)) for item in items)
        return
    context = multiprocessing.get_context("spawn")
    line, end = context.Pipe(duplex=False)
    waiting = iter(items)
    with _one_thread_each():
        pool = ProcessPoolExecutor(
            min(jobs, len(items)), mp_context=context, initializer=_start, initargs=(line,)
        )
        try:
            flying = {pool.submit(work, item): item for item in islice(waiting, 2 * jobs)}
            while flying:
                landed, _ = wait(flying, return_when=FIRST_COMPLETED)
                flying |= {pool.submit(work, item): item for item in islice(waiting, len(landed))}
                for done in landed:
                    yield flying.pop(done), done.result()
            pool.shutdown()
        finally:
            end.close()  # ends the processes at once
            pool.shutdown(wait=False, cancel_futures=True)
            line.close()


class Worker:
    """One process of one thread, which keeps what its modules hold from one piece of work to the next."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._line, self._end = context.Pipe(duplex=False)
        self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_start, initargs=(self._line,))

    def submit(
        self, work: Callable[Given, ResultT], *given: Given.args, **named: Given.kwargs
    ) -> Future[ResultT]:
        """Do work after what was submitted before.

        Args:
            work: what to do; it, its arguments and its result must be picklable.
        """
        with _one_thread_each():  # the process is started by the first work
            return self._pool.submit(work, *given, **named)

    def end(self) -> None:
        """End the process at once."""
        self._end.close()
        self._pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start(line: Connection) -> None:
    """Prepare a process: Ctrl-C is handled by the parent, and the process ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(line,), daemon=True).start()


def _end_with(line: Connection) -> None:
    """End this process when the pipe to the parent is closed, by the parent or by its death."""
    try:
        line.recv()
    except (EOFError, OSError):
        os._exit(1)
