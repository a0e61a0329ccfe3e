"""Work of the bench in separate processes: commands of ``tunnel``, and fits with causes chosen by hand.

A command outlives a page and a crash of the server. Its log has the command and the process in the first line, then
the output, and the exit status in the last line. The process locks the log, so any server sees whether it still
runs. The process of the fits caches its results.
"""

from __future__ import annotations

import asyncio
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from datetime import datetime
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tunnel_sim.processes import Worker
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from diagnosis.by_hand import ByHand, Closure
    from diagnosis.findings.next_run import NextRun


_FIRST = re.compile(r"\$ (?P<command>.*) \(process (?P<process>\d+), started (?P<started>\S+)\)")
_LAST = re.compile(r"exit status (?P<status>-?\d+)")
_PAUSED, _GOES_ON = "paused", "goes on"
_PATIENCE_S = 3.0  # s for a command to end by itself
_started: dict[Path, subprocess.Popen[bytes]] = {}
Given = ParamSpec("Given")
ResultT = TypeVar("ResultT")
State = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True)
class Work:
    """The state of a command, from its log.

    Args:
        command: the command as typed in a terminal; empty without a log.
        started: date and time, ISO 8601.
        lines: lines printed so far.
        printed: time of the last line, s since the epoch.
        pauses: number of pauses.
        status: exit status; None while the command runs, and if it ended without a status.
    """

    command: str = ""
    process: int = 0
    started: str = ""
    lines: tuple[str, ...] = ()
    printed: float = 0.0
    pauses: int = 0
    running: bool = False
    paused: bool = False
    status: int | None = None

    @property
    def error(self) -> str:
        """The line with the reason for ending without a result; empty otherwise."""
        if not self.command or self.running or self.status == 0:
            return ""
        if self.status is None:
            return "Another process ended it."
        errors = [line.removeprefix("tunnel: ") for line in self.lines if line.startswith("tunnel: ")]
        return errors[-1] if errors else f"It ended with exit status {self.status}."


def work_of(log: Path) -> Work:
    """The state of a command from its log, which need not exist."""
    try:
        lines = log.read_text("utf-8", "replace").splitlines()
    except OSError:
        return Work()
    first = _FIRST.fullmatch(lines[0]) if lines else None
    if first is None:
        return Work()
    child = _started.get(log)
    if child is not None:
        child.poll()  # otherwise a finished process remains as a zombie
    import fcntl

    running, body, printed = False, lines[1:], 0.0
    try:
        printed = log.stat().st_mtime
        with log.open("rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        running = True
    except OSError:
        pass
    last = _LAST.fullmatch(body[-1]) if body else None
    marks = [line for line in body if line in (_PAUSED, _GOES_ON)]
    shown = tuple(line for line in body if line not in (_PAUSED, _GOES_ON) and not _LAST.fullmatch(line))
    status = int(last["status"]) if last and not running else None
    paused = running and bool(marks) and marks[-1] == _PAUSED
    return Work(
        *(first["command"], int(first["process"]), first["started"], shown, printed, marks.count(_PAUSED)),
        *(running, paused, status),
    )


def seconds_taken(log: Path) -> float | None:
    """Wall time of a command that succeeded, s; None if it did not, or was paused."""
    work = work_of(log)
    if work.status != 0 or work.pauses:
        return None
    return max(work.printed - datetime.fromisoformat(work.started).timestamp(), 0.0)


def start(words: Sequence[str], log: Path) -> None:
    """Start a command of ``tunnel`` that prints into a log."""
    child = _started.get(log)
    if work_of(log).running or (child is not None and child.poll() is None):
        raise TunnelError("is running already", where=words[0], remedy="wait for it, or stop it")
    log.write_bytes(b"")
    arguments = [sys.executable, "-m", "tunnel_lab.logged", str(log), *words]
    _started[log] = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 30.0
    while not work_of(log).command and _started[log].poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    if not work_of(log).command:
        remedy = "start it in a terminal, which says why"
        raise TunnelError("could not be started", where=words[0], remedy=remedy)


def pause(log: Path) -> None:
    """Suspend a command: it keeps its results and uses no processor time."""
    _send(log, "SIGSTOP", _PAUSED)


def go_on(log: Path) -> None:
    """Resume a suspended command."""
    _send(log, "SIGCONT", _GOES_ON)


def stop(log: Path) -> None:
    """End a command as Ctrl-C does: nothing is left half written."""
    for name in ("SIGINT", "SIGTERM"):
        _send(log, name)
        _send(log, "SIGCONT")
        deadline = time.monotonic() + _PATIENCE_S
        while work_of(log).running and time.monotonic() < deadline:
            time.sleep(0.02)


def stop_all() -> None:
    """End every command that this process started."""
    for log in _started:
        stop(log)


def _send(log: Path, name: str, mark: str = "") -> None:
    work = work_of(log)
    if not work.running:
        return
    if mark:
        with log.open("a") as stream:
            stream.write(f"{mark}\n")
    # the lock is held, so the number is still that of the command
    os.killpg(work.process, getattr(signal, name))


@dataclass(frozen=True)
class Runs:
    """The runs to which effects are fitted by hand.

    Args:
        campaign: folder of the campaign.
        state: state of the campaign's files; fits of another state are not used.
        left_out: ids of the left-out runs.
    """

    campaign: Path
    state: State
    left_out: tuple[str, ...] = ()


async def closure(runs: Runs, effects: Sequence[str], *, converged: bool) -> Closure:
    """The part of the gap that effects chosen by hand explain.

    Args:
        converged: whether to free the forms and continue the fit to convergence.

    Raises:
        TunnelError: when the campaign cannot be read, or an effect cannot be fitted to it.
    """
    words = tuple(sorted(effects))
    found: Closure = await _in_fitter(_answered, runs, "closure", words, converged=converged)
    return found


async def next_run(runs: Runs, first: Sequence[str], second: Sequence[str]) -> NextRun | None:
    """The run that would distinguish two sets of effects; None in normalised form; errors as in `closure`."""
    answers = tuple(sorted(first)), tuple(sorted(second))
    found: NextRun | None = await _in_fitter(_answered, runs, "next_run", *answers)
    return found


async def _in_fitter(work: Callable[Given, ResultT], *given: Given.args, **named: Given.kwargs) -> ResultT:
    try:
        return await asyncio.wrap_future(_fitter().submit(work, *given, **named))
    except BrokenProcessPool:
        _fitter.cache_clear()
        raise TunnelError("another process ended the fitting process", remedy="try again") from None


@cache
def _fitter() -> Worker:
    return Worker()


def end_fits() -> None:
    """End the process, also in the middle of a fit."""
    if _fitter.cache_info().currsize:
        _fitter().end()


@lru_cache(maxsize=2)
def _by_hand(runs: Runs) -> ByHand:
    from diagnosis.by_hand import ByHand
    from tunnel_sim.files.campaign_folder import read_campaign

    return ByHand(read_campaign(runs.campaign).without(runs.left_out))


def _answered(runs: Runs, method: str, *given: object, **named: object) -> Any:
    """The result of a method of `ByHand`, from the process of the fits."""
    return getattr(_by_hand(runs), method)(*given, **named)
