"""Independent work side by side in processes of this machine, and untrusted input in a process with limits.

Every process has one thread: most of the work is Python, which threads cannot share, and the last bit of a sum must
not depend on the number of threads of a linear algebra library. Measured in benchmarks/sweep.py.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import islice
from multiprocessing.connection import Connection
from multiprocessing.spawn import get_executable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

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
"""Variables of the environment that say to the libraries how many threads they may start."""
_FEW_ARENAS = {"MALLOC_ARENA_MAX": "2"}  # each reserves 64 MiB of the address space, which is limited
_LIMITED = """
import json, sys
header = json.loads(sys.stdin.buffer.readline())
sys.path[:] = header["path"]
from tunnel_sim.processes import _serve
_serve(header)
"""
_OUT_OF_MEMORY = 77  # exit status
_START_S = 30.0  # a busy machine may need this long to start a process and to import


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let linear algebra use one thread in this process; also a decorator.

    Its matrices are small: a second thread mostly waits for a core. With two threads, matrix exponentials of a
    Kalman filter take fifty times as long.
    """
    import scipy.linalg  # noqa: F401  # has a library of its own, which must be loaded to be limited
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


class LimitReached(Exception):
    """Work in a limited process did not finish; the text gives the reason, such as ``takes more than 30 s``."""


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
    """One process of one thread, whose modules keep their state from one piece of work to the next."""

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


def in_limited_process(
    work: Callable[[bytes], bytes], given: bytes, *, prepare: Callable[[], None], seconds: float, memory: int
) -> bytes:
    """Do work on untrusted input in a process of its own, which can open no file. Bytes go in and out, no pickles.

    Args:
        prepare: a function of a module, like the work, called before the limits apply: it loads all that is needed.
        seconds: processor time of the work, s; the clock allows four times as long.
        memory: memory of the work, bytes.

    Raises:
        LimitReached: when the work takes too long or too much memory, or its process dies.
    """
    header = {
        "path": sys.path,
        "calls": [(call.__module__, call.__qualname__) for call in (prepare, work)],
        "limits": (seconds, memory),
    }
    try:
        process = subprocess.run(  # ends it on Ctrl-C, too
            [get_executable(), "-W", "ignore", "-c", _LIMITED],
            input=json.dumps(header).encode() + b"\n" + given,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=_START_S + 4.0 * seconds,
            env=os.environ | dict.fromkeys(ONE_THREAD, "1") | _FEW_ARENAS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise LimitReached(f"takes more than {seconds:g} s") from None
    status = process.returncode
    if status == 0:
        return process.stdout
    if status == -getattr(signal, "SIGXCPU", 0):
        raise LimitReached(f"takes more than {seconds:g} s")
    if status == _OUT_OF_MEMORY:
        raise LimitReached(f"takes more than {memory / 2**20:.0f} MiB of memory")
    raise LimitReached(f"ended its process with {status}")


def _serve(header: dict[str, Any]) -> None:
    """The limited process: do the given work, and answer on standard output."""
    answer = os.dup(1)
    os.dup2(2, 1)  # the output of a library is not the answer
    prepare, work = (getattr(import_module(module), name) for module, name in header["calls"])
    prepare()
    given = sys.stdin.buffer.read()
    _limit(*header["limits"])
    try:
        found = work(given)
    except MemoryError:
        os._exit(_OUT_OF_MEMORY)
    with os.fdopen(answer, "wb") as stream:
        stream.write(found)
    os._exit(0)


def _limit(seconds: float, memory: int) -> None:
    """Limit this process from now on; where the system has no such limits, only the clock applies."""
    try:
        import resource
    except ImportError:
        return
    with suppress(OSError, ValueError):  # a lower limit already applies
        used = int(Path("/proc/self/statm").read_bytes().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
    with suppress(OSError, ValueError):
        limit = math.ceil(time.process_time() + seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))


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
