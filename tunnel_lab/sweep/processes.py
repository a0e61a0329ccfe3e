"""Shards in parallel in processes of this machine.

Every worker is a process with one thread: most of the work is Python, which threads cannot share, and the last
bit of a sum must not depend on the number of threads of a linear algebra library. Measured in benchmarks/sweep.py.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_lab.sweep.shard import Finished

PATIENCE = 3
"""How often a pool may break in succession without finishing a shard."""
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")

Said = Callable[[str], None]


def available_processors() -> int:
    """Number of processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_processes(workers: int, say: Said) -> Callable[[str, Sequence[int]], Iterator[Finished]]:
    """Work by processes of this machine.

    Args:
        workers: number of processes.
        say: called with each line for the user.

    Returns:
        A function that does shards: given the sweep as JSON and the shards' numbers, it yields them as they finish.
    """
    return partial(_work, workers, say)


def _work(workers: int, say: Said, sweep: str, shards: Sequence[int]) -> Iterator[Finished]:
    left = list(shards)
    broken = 0
    while left:
        try:
            for done in _one_pool(min(workers, len(left)), sweep, tuple(left)):
                left.remove(done.index)
                broken = 0
                yield done
        except BrokenProcessPool:
            broken += 1
            if broken >= PATIENCE:
                raise TunnelError(
                    f"worker processes died {PATIENCE} times without finishing a shard",
                    remedy="check the memory and give fewer --workers; finished shards are kept",
                ) from None
            say("a worker process was lost; its shards are repeated")


def _one_pool(workers: int, sweep: str, shards: Sequence[int]) -> Iterator[Finished]:
    """Shards as they finish, few in flight at a time: memory does not grow with their number."""
    context = multiprocessing.get_context("spawn")
    line, end = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker, initargs=(line,))
    waiting = iter(shards)
    try:
        flying = {_submit(pool, sweep, index) for index in islice(waiting, 2 * workers)}
        while flying:
            landed, flying = wait(flying, return_when=FIRST_COMPLETED)
            flying |= {_submit(pool, sweep, index) for index in islice(waiting, len(landed))}
            while landed:
                yield landed.pop().result()
        pool.shutdown()
    finally:
        end.close()  # ends the workers at once
        pool.shutdown(wait=False, cancel_futures=True)
        line.close()


def _submit(pool: ProcessPoolExecutor, sweep: str, index: int) -> Future[Finished]:
    from tunnel_lab.sweep.shard import run_shard

    return pool.submit(run_shard, sweep, index)


def _start_worker(line: Connection) -> None:
    """Prepare a worker: one thread, Ctrl-C handled by the parent, and an end with the parent."""
    for name in _ONE_THREAD:
        os.environ[name] = "1"
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(line,), daemon=True).start()


def _end_with(line: Connection) -> None:
    """End this process when the pipe to the parent is closed, by the parent or by its death."""
    try:
        line.recv()
    except (EOFError, OSError):
        os._exit(1)
