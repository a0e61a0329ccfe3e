"""One runner of experiments: a task is data, the work on it a pure function; finished tasks are not done again.

Sweeps, scores, breakdowns and training samples differ in their tasks, their work and the files of their results.
They share this loop, its resumption and its progress. The workers are processes of this machine, or those of a Dask
cluster, which repeats the tasks of a lost worker elsewhere; only this process keeps results, so that a task that is
done twice is stored once. Nothing heavy is imported here, because worker processes start with this module.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from itertools import islice
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

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
"""How often processes may die in succession without finishing a task."""
LOCAL = "local"
ATTEMPTS = 3
"""How often a shard is submitted again after Dask has given it up."""
POLL_S = 5.0
"""How long to wait for a shard before the workers are counted, s."""
CONNECT_S = 10.0
"""How long a scheduler may take to answer, s."""
_FEWEST_IN_FLIGHT = 8


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


def on_cluster(address: str, workers: int, say: Say, *, poll_s: float = POLL_S) -> Workers:
    """Workers of a Dask cluster.

    Args:
        address: of a scheduler, such as ``tcp://host:8786``, or ``local`` for a cluster that is started here.
        workers: number of workers of a local cluster.
        say: called with each line for the user.
        poll_s: how long to wait for a shard before the workers are counted, s.
    """

    def crew(work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]) -> Iterator[tuple[TaskT, ResultT]]:
        distributed = library("distributed", "--scheduler", "cluster")
        gone = distributed.CancelledError, distributed.comm.core.CommClosedError
        with _client(address, workers) as client:
            try:
                yield from _Crew(client, work, say, poll_s).work(tasks)
            except gone:
                raise _gone() from None

    return crew


@contextmanager
def _client(address: str, workers: int) -> Iterator[Client]:
    import distributed

    make_client: Any = distributed.Client  # Dask's own functions carry no types
    make_cluster: Any = distributed.LocalCluster

    for name in ("distributed", "distributed.client"):  # replaced by one line of our own
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
        raise TunnelError(
            f"no scheduler answers ({one_line(error, 80)})",
            where=f"--scheduler {address}",
            remedy="start one with: dask scheduler",
        ) from None
    with client:
        yield client


class _Crew(Generic[TaskT, ResultT]):
    """The workers of a cluster at one kind of work."""

    def __init__(self, client: Any, work: Callable[[TaskT], ResultT], say: Say, poll_s: float) -> None:
        self._client = client
        self._work = work
        self._say = say
        self._poll_s = poll_s
        self._attempts: dict[TaskT, int] = {}
        self._alone = False

    def work(self, tasks: Sequence[TaskT]) -> Iterator[tuple[TaskT, ResultT]]:
        """Tasks with their results as they finish, few in flight at a time."""
        import distributed

        wait: Any = distributed.wait
        waiting = iter(tasks)
        flying: dict[Any, TaskT] = {}
        self._workers()
        while True:
            for task in islice(waiting, max(0, self._room() - len(flying))):
                flying[self._submit(task)] = task
            if not flying:
                return
            try:
                landed = wait(list(flying), timeout=self._poll_s, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                self._workers()
                continue
            for future in landed:
                task = flying.pop(future)
                result = self._result(future, task)
                if result is None:
                    flying[self._submit(task)] = task
                else:
                    self._alone = False
                    yield task, result

    def _submit(self, task: TaskT) -> Any:
        attempt = self._attempts.setdefault(task, 1)
        return self._client.submit(self._work, task, key=f"shard-{task}-{attempt}-{id(self)}", pure=False)

    def _result(self, future: Any, task: TaskT) -> ResultT | None:
        """The result of a task; None where its workers were lost and it must be submitted again."""
        from distributed import KilledWorker

        try:
            result: ResultT = future.result()
        except (ImportError, RuntimeError) as error:
            raise TunnelError(
                f"a worker cannot do a shard ({one_line(error)})",
                remedy="give scheduler and workers the same environment as here",
            ) from None
        except KilledWorker:
            self._attempts[task] += 1
            if self._attempts[task] > ATTEMPTS:
                raise TunnelError(
                    f"shard {task} lost every worker it was given to",
                    remedy="check the memory of the workers; finished shards are kept",
                ) from None
            return None
        finally:
            future.release()
        return result

    def _workers(self) -> None:
        """Report when no worker is connected, once each time."""
        if self._client.status != "running":
            raise _gone()
        address = self._client.scheduler.address if self._client.scheduler else ""
        if self._client.nthreads():
            if self._alone:
                self._say("workers are connected again")
            self._alone = False
        elif not self._alone:
            self._alone = True
            self._say(f"no worker is connected to {address}: start some with: dask worker {address}; waiting")

    def _room(self) -> int:
        """Number of shards in flight: two for each thread."""
        threads = sum(int(count) for count in self._client.nthreads().values())
        return max(_FEWEST_IN_FLIGHT, 2 * threads)


def _gone() -> TunnelError:
    return TunnelError(
        "the scheduler is gone",
        remedy="finished shards are kept: start scheduler and workers again, and repeat the command",
    )
