"""Independent work side by side in processes of this machine.

Every process has one thread. Most of the work is Python, which threads cannot share, and the last bit of a sum
must not depend on the number of threads of a linear algebra library. Measured in benchmarks/sweep_cost.py.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from itertools import islice
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

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
"""Environment variables that limit the number of threads of the libraries."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let linear algebra use one thread in this process; also a decorator.

    Its matrices are small: a second thread mostly waits for a core. With two threads, matrix exponentials of a
    Kalman filter take fifty times as long.
    """
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """The loaded libraries; finding them takes some milliseconds."""
    import scipy.linalg  # noqa: F401  # has a library of its own, which must be loaded to be limited
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def in_processes(
    work: Callable[[ItemT], ResultT], items: Sequence[ItemT], jobs: int
) -> Iterator[tuple[ItemT, ResultT]]:
    """Do work in processes of one thread each (0: in this one), with few items in flight to limit the memory.

    Items are returned with results as they finish; BrokenProcessPool where a process dies.
    """
    if jobs == 0 or not items:
        with _one_thread_each(), one_blas_thread():
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
    """One process of one thread; its modules keep their state between pieces of work."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._line, self._end = context.Pipe(duplex=False)
        self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_start, initargs=(self._line,))

    def submit(
        self, work: Callable[Given, ResultT], *given: Given.args, **named: Given.kwargs
    ) -> Future[ResultT]:
        """Do work after all earlier submissions; it, its arguments and its result must be picklable."""
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

    def end() -> None:
        try:
            line.recv()
        except (EOFError, OSError):  # the pipe to the parent is closed, by the parent or by its death
            os._exit(1)

    threading.Thread(target=end, daemon=True).start()
