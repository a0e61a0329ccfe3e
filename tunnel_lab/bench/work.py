"""A command of ``tunnel`` in a process of its own, which outlives a page and a crash of the server.

Its log says everything about it: the command and the process in the first line, what the command prints, and its
exit status in the last line. The process holds a lock on the log, so that any server sees whether it still runs.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tunnel_sim.vocabulary.errors import TunnelError

_FIRST = re.compile(r"\$ (?P<command>.*) \(process (?P<process>\d+), started (?P<started>\S+)\)")
_LAST = re.compile(r"exit status (?P<status>-?\d+)")
_PAUSED, _GOES_ON = "paused", "goes on"
_PATIENCE_S = 3.0  # for a command to end by itself
_started: dict[Path, subprocess.Popen[bytes]] = {}


@dataclass(frozen=True)
class Work:
    """What a log says about a command.

    Args:
        command: as one would type it; empty where there is no log.
        process: number of the process (count).
        started: date and time, ISO 8601.
        lines: printed so far.
        running: whether the process is alive.
        paused: whether it has been suspended.
        status: exit status; None while it runs, and where it ended without one.
    """

    command: str = ""
    process: int = 0
    started: str = ""
    lines: tuple[str, ...] = ()
    running: bool = False
    paused: bool = False
    status: int | None = None

    @property
    def error(self) -> str:
        """The line that says why it ended without a result; empty where it did not."""
        if not self.command or self.running or self.status in (0, None):
            return (
                "" if self.running or not self.command or self.status == 0 else "It was ended from outside."
            )
        said = [line.removeprefix("tunnel: ") for line in self.lines if line.startswith("tunnel: ")]
        return said[-1] if said else f"It ended with exit status {self.status}."


def work_of(log: Path) -> Work:
    """The state of a command by its log.

    Args:
        log: the file; it need not exist.
    """
    try:
        lines = log.read_text("utf-8", "replace").splitlines()
    except OSError:
        return Work()
    first = _FIRST.fullmatch(lines[0]) if lines else None
    if first is None:
        return Work()
    running, body = _is_locked(log), lines[1:]
    last = _LAST.fullmatch(body[-1]) if body else None
    marks = [line for line in body if line in (_PAUSED, _GOES_ON)]
    shown = tuple(line for line in body if line not in (_PAUSED, _GOES_ON) and not _LAST.fullmatch(line))
    status = int(last["status"]) if last and not running else None
    paused = running and bool(marks) and marks[-1] == _PAUSED
    return Work(first["command"], int(first["process"]), first["started"], shown, running, paused, status)


def start(words: Sequence[str], log: Path) -> None:
    """Start a command, unless it is running.

    Args:
        words: after ``tunnel``.
        log: where it prints; replaced.

    Raises:
        TunnelError: when the command is running already.
    """
    child = _started.get(log)
    if work_of(log).running or (child is not None and child.poll() is None):
        raise TunnelError("is running already", where=words[0], remedy="wait for it, or stop it")
    log.write_bytes(b"")
    arguments = [sys.executable, "-m", __name__, str(log), *words]
    _started[log] = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 30.0
    while not work_of(log).command and _started[log].poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    if not work_of(log).command:
        raise TunnelError(
            "could not be started", where=words[0], remedy="start it in a terminal, which says why"
        )


def pause(log: Path) -> None:
    """Suspend a command: it keeps everything that it has found, and takes no time of the processor."""
    _send(log, "SIGSTOP", _PAUSED)


def go_on(log: Path) -> None:
    """Let a suspended command go on where it was."""
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
    """End every command that this process has started."""
    for log in _started:
        stop(log)


def _send(log: Path, name: str, mark: str = "") -> None:
    work = work_of(log)
    if not work.running:
        return
    if mark:
        with log.open("a") as stream:
            stream.write(f"{mark}\n")
    os.killpg(work.process, getattr(signal, name))  # the lock is held, so the number is still its own


def _is_locked(log: Path) -> bool:
    child = _started.get(log)
    if child is not None:
        child.poll()  # else a process that has ended stays in the table
    import fcntl

    try:
        with log.open("rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def _run(log: Path, words: Sequence[str]) -> int:
    """Run a command with everything it prints in the log, and the lock on it."""
    import fcntl
    import shlex
    from datetime import datetime

    stream = log.open("a")
    fcntl.flock(stream, fcntl.LOCK_EX)
    for descriptor in (1, 2):
        os.dup2(stream.fileno(), descriptor)
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    print(f"$ {shlex.join(['tunnel', *words])} (process {os.getpid()}, started {now})", flush=True)
    from tunnel_lab.cli import main

    status = main(words)
    sys.stdout.flush()
    print(f"exit status {status}", flush=True)
    return status


if __name__ == "__main__":
    sys.exit(_run(Path(sys.argv[1]), sys.argv[2:]))
