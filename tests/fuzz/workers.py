"""Trials in processes of their own: one that dies or never returns is reported with its trial, and replaced."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from tests.fuzz.trials import LIMIT_S, MEMORY, Outcome, chosen, run_trial

BATCH = 50
"""Trials handed to a worker at a time."""
LATE = 2.0
"""A worker that does not answer is ended after this many times the trial's limit, seconds of its processor."""
IDLE_S = 30.0
"""Likewise one that has nothing to do for so long, s."""
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")
_READY, _RETIRED = "ready", "retired"
Shares = dict[str, float] | None
Trial = Callable[[int, int, Shares], Outcome]
_CONTEXT = multiprocessing.get_context("spawn")


@dataclass
class _Worker:
    process: BaseProcess
    pipe: Connection
    ready: bool = False
    retired: bool = False  # grown too large; its trials are for another
    ended: bool = False  # its pipe is closed and all it said is read
    left: list[int] = field(default_factory=list)
    begun: float = 0.0  # processor time when it last answered, s
    looked: tuple[float, float] = (0.0, 0.0)  # clock and processor time when it was last seen at work, s


def run_trials(
    seed: int,
    indices: Sequence[int],
    *,
    workers: int = 1,
    shares: Shares = None,
    progress: Callable[[Outcome], None] = lambda _outcome: None,
    trial: Trial = run_trial,
) -> list[Outcome]:
    """Run trials in worker processes.

    Args:
        seed: of all trials.
        indices: which trials.
        workers: number of processes.
        shares: of the groups; those of `fuzz.trials` where not given.
        progress: called with every outcome as it comes.
        trial: what runs one.

    Returns:
        An outcome for every trial, by index.
    """
    found: list[Outcome] = []
    for outcome in _outcomes(seed, list(indices), workers, shares, trial):
        found.append(outcome)
        progress(outcome)
    return sorted(found, key=lambda outcome: outcome.index)


def _outcomes(seed: int, indices: list[int], workers: int, shares: Shares, trial: Trial) -> Iterator[Outcome]:
    todo = [indices[i : i + BATCH] for i in range(0, len(indices), BATCH)][::-1]
    crew = [_started(seed, shares, trial) for _ in range(max(1, min(workers, len(todo))))]
    try:
        while todo or any(worker.left for worker in crew):
            for place, worker in enumerate(crew):
                if worker.retired and worker.left:
                    todo.append(worker.left)
                    worker.left = []
                if worker.ready and not worker.retired and not worker.left and todo:
                    worker.left = todo.pop()
                    worker.pipe.send(worker.left)
                lost = _lost(worker, seed, shares)
                if lost is not None:
                    todo += [worker.left] if worker.left else []
                    yield lost
                if lost is not None or _has_retired(worker):
                    crew[place] = _started(seed, shares, trial)
            ready = set(wait([worker.pipe for worker in crew if not worker.ended], timeout=0.5))
            for worker in crew:
                if worker.pipe in ready:
                    yield from _received(worker)
    finally:
        for worker in crew:
            worker.process.kill()
            worker.process.join()


def _received(worker: _Worker) -> Iterator[Outcome]:
    """The outcome of a trial, where the worker does not speak of itself."""
    try:
        outcome: Outcome | str = worker.pipe.recv()
    except (EOFError, OSError):
        worker.ended = True
        worker.process.join()
        return
    worker.ready = True
    worker.retired = outcome == _RETIRED
    worker.begun = _processor_time(worker)
    worker.looked = (time.monotonic(), worker.begun)
    if isinstance(outcome, Outcome):
        worker.left.remove(outcome.index)
        yield outcome


def _lost(worker: _Worker, seed: int, shares: Shares) -> Outcome | None:
    """The finding of a worker that has died or does not answer; it is ended, and its other trials stay."""
    if not worker.left:
        return None
    index = worker.left[0]
    group, name, _ = chosen(seed, index, shares)
    late = not worker.ended and _is_late(worker, LATE * LIMIT_S[group])
    if not (worker.ended or late):
        return None
    said = "does not answer" if late else f"the process ended with {worker.process.exitcode}"
    worker.process.kill()
    worker.process.join()
    worker.left.remove(index)
    return Outcome(index, name, "finding", "Hang" if late else "Death", name, name, said)


def _has_retired(worker: _Worker) -> bool:
    """Whether a worker has ended between two trials, because it had grown too large.

    Raises:
        RuntimeError: when it never got so far.
    """
    if worker.left or not worker.ended:
        return False
    if not worker.ready:
        raise RuntimeError(f"a worker ended before its first trial, with {worker.process.exitcode}")
    return True


def _is_late(worker: _Worker, limit: float) -> bool:
    """Whether a worker has used too much of the processor since its last answer, or none for long."""
    now, used = time.monotonic(), _processor_time(worker)
    if used - worker.looked[1] > 0.01 * IDLE_S:
        worker.looked = (now, used)
    return used - worker.begun > limit or now - worker.looked[0] > IDLE_S


def _processor_time(worker: _Worker) -> float:
    """Of the worker's process, s; zero where it has ended."""
    try:
        fields = Path(f"/proc/{worker.process.pid}/stat").read_text("ascii").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _started(seed: int, shares: Shares, trial: Trial) -> _Worker:
    here, there = _CONTEXT.Pipe()
    kept = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        process = _CONTEXT.Process(target=_work, args=(there, seed, shares, trial), daemon=True)
        process.start()
    finally:
        for name, value in kept.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
    there.close()
    return _Worker(process, here)


def _work(pipe: Connection, seed: int, shares: Shares, trial: Trial) -> None:
    """What a worker does: trials, one outcome after the other, until it is ended or has grown too large."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    if trial is run_trial:
        _prepare()
    pipe.send(_READY)
    while True:
        for index in pipe.recv():
            outcome = trial(seed, index, shares)
            pipe.send(outcome)
            if _peak() > MEMORY:  # a peak never goes down: a fresh process must judge the next trial
                pipe.send(_RETIRED)
                return


def _prepare() -> None:
    """Import what trials would otherwise import on their time, and bound the memory for the machine's sake."""
    import matplotlib as mpl

    from tests.fuzz import seeds

    mpl.use("agg")
    __import__("torch")
    __import__("tunnel_sim.engine.joint_patch")
    __import__("tunnel_sim.engine.virtual_campaign")
    __import__("diagnosis._diagnose")
    __import__("tunnel_lab.report")
    for make in _seed_makers(seeds):
        make()
    used = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 2 * MEMORY, used + 2 * MEMORY))


def _seed_makers(seeds: Any) -> list[Callable[[], object]]:
    return [
        seeds.campaign_document, seeds.run_frame, seeds.springs_csv, seeds.sweep_folder, seeds.estimate_document,
        seeds.weights, seeds.checkpoint, seeds.answer_document, seeds.baseline_frame,
    ]  # fmt: skip


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
