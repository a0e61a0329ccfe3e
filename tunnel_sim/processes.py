"""Independent work side by side in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def in_processes(
    work: Callable[[ItemT], ResultT], items: Sequence[ItemT], jobs: int
) -> Iterator[tuple[ItemT, ResultT]]:
    """Do work in processes of one thread each.

    Args:
        work: what to do; it and its results must be picklable.
        jobs: number of processes; 0 works in this one.

    Yields:
        Items with their results, in the order in which they finish.
    """
    if jobs == 0 or not items:
        yield from ((item, work(item)) for item in items)
        return
    context = multiprocessing.get_context("spawn")
    with (
        _one_thread_each(),
        ProcessPoolExecutor(min(jobs, len(items)), mp_context=context, initializer=_die_quietly) as pool,
    ):
        try:
            waiting = {pool.submit(work, item): item for item in items}  # items need not be hashable
            for finished in as_completed(waiting):
                yield waiting[finished], finished.result()
        except BaseException:  # an interruption above all: nobody will read what is still running
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Give children one thread for linear algebra: the last digits must not depend on the machine."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _die_quietly() -> None:
    """A child ends silently on Ctrl-C; the parent reports it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
