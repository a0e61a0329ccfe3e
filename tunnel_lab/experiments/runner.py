"""The workers of experiments: processes of this machine, or of a Dask cluster.

Nothing heavy is imported here, because worker processes start with this module.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError, library, one_line

if TYPE_CHECKING:
    from distributed import Client

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")
Progress = Callable[[int, int], None]
"""A function to call with the number finished and the number in all, at the start and after each task."""
Say = Callable[[str], None]
"""A function to call with each line for the user."""
PATIENCE = 3
"""Maximum number of processes that may die in succession without finishing a task."""
LOCAL = "local"
ATTEMPTS = 3
"""Number of times a task is submitted again after Dask has given it up."""
POLL_S = 5.0
"""Time to wait for a task before the workers are counted, s."""
CONNECT_S = 10.0
"""Time limit for a scheduler to answer, s."""
_FEWEST_IN_FLIGHT = 8


class Workers(Protocol):
    """Function that does the work: `processes` or a cluster."""

    def __call__(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT], /
    ) -> Generator[tuple[TaskT, ResultT], None, None]:
        """Yield every task with its result, in the order of completion."""


def say_on_stderr(line: str) -> None:
    """Print a line about the workers on standard error."""
    # imported here because worker processes start with this module
    from tunnel_lab.terminal.outputs import say

    say(f"tunnel: {line}", stderr=True)


def processes(jobs: int, say: Say = say_on_stderr) -> Workers:
    """Processes of this machine; 0 jobs: this process. The tasks of a process that dies are repeated."""

    def workers(
        work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Generator[tuple[TaskT, ResultT], None, None]:
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
                    what = f"worker processes died {PATIENCE} times without finishing a task"
                    remedy = (
                        "give fewer --jobs if memory is short, and check that an estimator of your own does not "
                        "end its process; finished work is kept"
                    )
                    raise TunnelError(what, remedy=remedy) from None
                say("a worker process was lost; its tasks are repeated")

    return workers


def available_processors() -> int:
    """Number of processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def crew(
    jobs: int | None, scheduler: str | None, tasks: int | None = None, *, usual: int | None = None
) -> Workers:
    """The workers requested by the options of a command.

    Args:
        jobs: value of ``--jobs``; None: the value of ``usual``.
        scheduler: value of ``--scheduler``; None: processes of this machine.
        tasks: number of tasks, which limits the number of workers; None: not known yet.
        usual: usual number of workers; None: one for each processor.
    """
    if jobs is not None and scheduler not in (None, LOCAL):
        what = "its workers are started on their own machines"
        raise TunnelError(what, where=f"--scheduler {scheduler}", remedy="leave out --jobs")
    count = available_processors() if usual is None else usual
    count = count if jobs is None else jobs
    count = count if tasks is None else min(count, tasks)
    return processes(count) if scheduler is None else on_cluster(scheduler, max(count, 1), say_on_stderr)


def on_cluster(address: str, workers: int, say: Say, *, poll_s: float = POLL_S) -> Workers:
    """Workers of a Dask cluster.

    Args:
        address: address of a scheduler, such as ``tcp://host:8786``, or ``local`` to start a cluster here.
        workers: number of workers of a local cluster.
        poll_s: time to wait for a task before counting the workers, s.
    """

    def at_work(
        work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Generator[tuple[TaskT, ResultT], None, None]:
        if not tasks:
            return
        distributed = library("distributed", "--scheduler", "cluster")
        gone = distributed.CancelledError, distributed.comm.core.CommClosedError
        with _client(address, workers) as client:
            try:
                yield from _work_of(client, work, tasks, say, poll_s)
            except gone:
                raise _gone() from None

    return at_work


@contextmanager
def _client(address: str, workers: int) -> Iterator[Client]:
    import distributed

    make_client: Any = distributed.Client  # Dask's functions are not typed
    make_cluster: Any = distributed.LocalCluster

    for name in ("distributed", "distributed.client"):  # replaced by a line of this program
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if address == LOCAL:
        options: dict[str, Any] = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
        with (
            make_cluster(n_workers=workers, threads_per_worker=1, **options) as here,
            make_client(here) as client,
        ):
            yield client
        return
    try:
        client = make_client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError, ImportError) as error:
        what = f"no scheduler answers ({one_line(error, 80)})"
        remedy = "start one with: dask scheduler"
        raise TunnelError(what, where=f"--scheduler {address}", remedy=remedy) from None
    with client:
        yield client


def _work_of(
    client: Any, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT], say: Say, poll_s: float
) -> Iterator[tuple[TaskT, ResultT]]:
    """Tasks with their results in the order of completion; at most two per thread are in flight."""
    from distributed import KilledWorker, wait

    wait_for: Any = wait
    waiting = iter(range(len(tasks)))
    flying: dict[Any, int] = {}
    attempts: dict[int, int] = {}

    def submit(number: int) -> None:
        key = f"task-{number}-{attempts.setdefault(number, 1)}-{id(attempts)}"
        flying[client.submit(work, tasks[number], key=key, pure=False)] = number

    alone = _tell_of_workers(client, False, say)
    while True:
        threads = sum(int(count) for count in client.nthreads().values())
        for number in islice(waiting, max(0, max(_FEWEST_IN_FLIGHT, 2 * threads) - len(flying))):
            submit(number)
        if not flying:
            return
        try:
            landed = wait_for(list(flying), timeout=poll_s, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            alone = _tell_of_workers(client, alone, say)
            continue
        for future in landed:
            number = flying.pop(future)
            try:
                result: ResultT = future.result()
            except (ImportError, RuntimeError) as error:
                remedy = "give scheduler and workers the same environment as here"
                raise TunnelError(f"a worker cannot do a task ({one_line(error)})", remedy=remedy) from None
            except KilledWorker:
                attempts[number] += 1
                if attempts[number] > ATTEMPTS:
                    what = f"a task lost all {ATTEMPTS} workers it was given to"
                    remedy = "check the memory of the workers; finished work is kept"
                    raise TunnelError(what, remedy=remedy) from None
                submit(number)
                continue
            finally:
                future.release()
            alone = False
            yield tasks[number], result


def _tell_of_workers(client: Any, alone: bool, say: Say) -> bool:
    """Whether no worker is connected; each such interruption is reported once."""
    if client.status != "running":
        raise _gone()
    address = client.scheduler.address if client.scheduler else ""
    if client.nthreads():
        if alone:
            say("workers are connected again")
        return False
    if not alone:
        say(f"no worker is connected to {address}: start some with: dask worker {address}; waiting")
    return True


def _gone() -> TunnelError:
    return TunnelError(
        "the scheduler is gone",
        remedy="finished work is kept: start scheduler and workers again, and repeat the command",
    )
