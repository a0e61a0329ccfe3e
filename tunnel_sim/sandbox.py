"""Work on untrusted input in a process with limits of time and memory.

A damaged or hostile file may block a library for ever, make it request all memory, or end the process. JSON and
bytes go in and out, no pickles.
"""

from __future__ import annotations

import atexit
import json
import math
import os
import pkgutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.spawn import get_executable  # a program that embeds Python may have set it
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias, cast

from tunnel_sim.processes import ONE_THREAD
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.quantities import Seconds

Message: TypeAlias = tuple[dict[str, Any], Sequence[bytes | memoryview]]
"""Values that JSON can express, and contents."""
Work: TypeAlias = Callable[[dict[str, Any], list[bytes]], Message]
"""A function of a module, which may raise `TunnelError`."""

_SERVE = """
import json, sys
header = json.loads(sys.argv[1])
sys.path[:] = header["path"]
from tunnel_sim.sandbox import _serve
_serve(header)
"""
# number of threads; each reserves 64 MiB of the address space, which is limited
_FEW_ARENAS = {"MALLOC_ARENA_MAX": "2"}
_OUT_OF_MEMORY = 77  # exit status
# exit status if Linux or macOS ended the process at its time limit
_OUT_OF_TIME = -getattr(signal, "SIGXCPU", math.inf)
_START_S = 30.0  # a busy machine may need this long to start a process and to import
_CLOCK = 4.0  # wall time allowed, as a multiple of the allowed processor time


class LimitReached(Exception):
    """Work did not finish within its limits; the text gives the reason, such as ``takes more than 30 s``."""


class Sandbox:
    """A process of one thread for one piece of work after another; unusable once a limit is reached.

    Limits of processor time and memory need Linux or macOS (memory: Linux); elsewhere only the clock applies.

    Args:
        prepare: a function of a module, called before the limits apply; it loads the dependencies of the work.
        memory: maximum further memory, bytes.
        files: whether the work may open files.
    """

    def __init__(self, prepare: Callable[[], None], memory: int, *, files: bool) -> None:
        self._memory = memory
        header = {"path": [*map(str, sys.path)], "prepare": _name(prepare), "memory": memory, "files": files}
        self._process = subprocess.Popen(
            [os.fsdecode(get_executable()), "-W", "ignore", "-c", _SERVE, json.dumps(header)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | dict.fromkeys(ONE_THREAD, "1") | _FEW_ARENAS,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        self._asked, self._answers = cast(BinaryIO, self._process.stdin), cast(BinaryIO, self._process.stdout)
        self._owner = os.getpid()
        self._started = False
        atexit.register(self.end)

    def __enter__(self) -> Sandbox:
        """The process, to be ended on leaving."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self.end()

    @property
    def usable(self) -> bool:
        """Whether the process runs and belongs to this one: a fork must not use its parent's pipes."""
        return self._owner == os.getpid() and self._process.poll() is None

    def end(self) -> None:
        """End the process at once."""
        atexit.unregister(self.end)
        if self._owner == os.getpid():
            self._process.kill()
            self._process.wait()
        for stream in (self._asked, self._answers):
            with suppress(OSError):  # unsent data cannot be sent
                stream.close()

    def do(
        self, work: Work, given: dict[str, Any], parts: Sequence[bytes], seconds: Seconds
    ) -> tuple[dict[str, Any], list[bytes]]:
        """Do work of limited processor time on a message.

        Raises:
            LimitReached: when the work takes too long or too much memory, or its process dies.
            TunnelError: when the work refuses the message.
        """
        try:
            if not self._started:
                self._answer(None, _START_S)
                self._started = True
            head = {"work": _name(work), "given": given, "seconds": seconds}
            answer, contents = self._answer((head, parts), seconds)
        except BaseException:
            self.end()  # an unread reply would be mistaken for the next one
            raise
        if "refused" in answer:
            what, remedy = answer["refused"]
            raise TunnelError(what, remedy=remedy)
        return answer["given"], contents

    def _answer(self, message: Message | None, seconds: Seconds) -> tuple[dict[str, Any], list[bytes]]:
        """The next answer, after a message, if any."""
        late = threading.Event()

        def stop() -> None:
            late.set()
            self._process.kill()

        watch = threading.Timer(_CLOCK * seconds, stop)
        watch.daemon = True
        watch.start()
        try:
            if message is not None:
                _send(self._asked, *message)
            return _received(self._answers)
        except (EOFError, OSError):
            status = self._process.wait()
            if late.is_set() or status == _OUT_OF_TIME:
                raise LimitReached(f"takes more than {seconds:.3g} s") from None
            if status == _OUT_OF_MEMORY:
                raise LimitReached(f"takes more than {self._memory / 2**30:g} GiB of memory") from None
            raise LimitReached(f"ended its process with {status}") from None
        finally:
            watch.cancel()


def in_sandbox(
    work: Work, given: dict[str, Any], parts: Sequence[bytes], *, prepare: Callable[[], None],
    seconds: Seconds, memory: int,
) -> tuple[dict[str, Any], list[bytes]]:  # fmt: skip
    """Do work in a separate `Sandbox` that cannot open files; arguments as in `Sandbox` and `Sandbox.do`."""
    with Sandbox(prepare, memory, files=False) as sandbox:
        return sandbox.do(work, given, parts, seconds)


def _name(function: Callable[..., object]) -> str:
    return f"{function.__module__}:{function.__qualname__}"


def _serve(header: dict[str, Any]) -> None:
    """The limited process: do work on one message after another, until the pipe is closed."""
    asked, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the output of a library is not an answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the client ends this process
    pkgutil.resolve_name(header["prepare"])()
    limit(None, header["memory"], files=header["files"])
    _send(answers, {}, [])
    with suppress(EOFError):
        while True:
            request, parts = _received(asked)
            limit(request["seconds"])
            try:
                given, contents = pkgutil.resolve_name(request["work"])(request["given"], parts)
                _send(answers, {"given": given}, contents)
            except TunnelError as error:
                _send(answers, {"refused": [error.what, error.remedy]}, [])
            except MemoryError:
                os._exit(_OUT_OF_MEMORY)
    os._exit(0)


def limit(seconds: Seconds | None, memory: int | None = None, *, files: bool = True) -> None:
    """Limit the further resources of this process, if the system can; arguments as in `Sandbox`, None: no limit."""
    most: dict[str, int] = {"RLIMIT_CORE": 0} | ({} if files else {"RLIMIT_NOFILE": 0})
    if seconds is not None:
        most["RLIMIT_CPU"] = math.ceil(time.process_time() + seconds)  # the limit is in whole seconds
    if memory is not None:
        with suppress(OSError, AttributeError):
            used = int(Path("/proc/self/statm").read_bytes().split()[0]) * os.sysconf("SC_PAGE_SIZE")
            most["RLIMIT_AS"] = used + memory
    for name, value in most.items():
        with suppress(ImportError, AttributeError, ValueError, OSError):  # a lower limit may apply already
            import resource

            kind = getattr(resource, name)
            _, hard = resource.getrlimit(kind)
            resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def _send(stream: BinaryIO, head: dict[str, Any], parts: Sequence[bytes | memoryview]) -> None:
    """Send a line of JSON with the sizes of the parts, and the parts."""
    sizes = [memoryview(part).nbytes for part in parts]
    stream.write(json.dumps({"head": head, "sizes": sizes}).encode() + b"\n")
    for part in parts:
        stream.write(part)
    stream.flush()


def _received(stream: BinaryIO) -> tuple[dict[str, Any], list[bytes]]:
    """The data sent by `_send`; EOFError if the other process has ended."""
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    message = json.loads(line)
    parts = [stream.read(size) for size in message["sizes"]]
    if [len(part) for part in parts] != message["sizes"]:
        raise EOFError
    return message["head"], parts
