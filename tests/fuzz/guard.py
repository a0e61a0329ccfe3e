"""What an input may cost, and which answers are allowed: none, or a `TunnelError` of one line."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from tunnel_sim import sandbox
from tunnel_sim.vocabulary.errors import TunnelError

LIMIT_S = 60.0
"""Processor time of an example; a diagnosis of a small campaign takes up to half of it."""
WAITING = 10.0
"""So many times the limit may pass on the clock of a loaded machine; after it, the example waits for something."""
MEMORY = 2 * 2**30
"""Memory that an example may take, bytes."""


class Hang(BaseException):
    """An example takes too long; raised where it is."""


@contextmanager
def answers_or_refuses(limit: float = LIMIT_S, waiting: float = WAITING) -> Iterator[Path]:
    """An empty folder to work in: silent, with limits, and ended by nothing but a refusal of one line.

    Args:
        limit: of processor time, s.
        waiting: times the limit that may pass on the clock.

    Raises:
        Hang: where a limit is passed.
        AssertionError: where a refusal is not one printable line.
    """
    with ExitStack() as stack:
        folder = Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="fuzz-", ignore_cleanup_errors=True))
        )
        stack.enter_context(redirect_stdout(StringIO()))
        stack.enter_context(redirect_stderr(StringIO()))
        stack.callback(_close_figures)
        stack.enter_context(_limited_memory())
        stack.enter_context(_alarm(signal.ITIMER_PROF, signal.SIGPROF, limit))
        stack.enter_context(_alarm(signal.ITIMER_REAL, signal.SIGALRM, waiting * limit))
        try:
            yield folder
        except TunnelError as error:
            if not str(error).isprintable():
                raise AssertionError(f"a refusal of several lines: {error!r}") from error


@contextmanager
def _alarm(timer: int, number: int, seconds: float) -> Iterator[None]:
    def over(_number: int, _frame: object) -> None:
        raise Hang(f"more than {seconds:g} s" + " on the clock" * (timer == signal.ITIMER_REAL))

    before = signal.signal(number, over)
    signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        signal.setitimer(timer, 0.0)
        signal.signal(number, before)


@contextmanager
def _limited_memory() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _close_figures() -> None:
    """Close what a failed example has left open."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")


def in_fork(
    work: sandbox.Work, given: dict[str, Any], parts: Sequence[bytes], *, prepare: Callable[[], None],
    seconds: float, memory: int,
) -> tuple[dict[str, Any], list[bytes]]:  # fmt: skip
    """As `sandbox.in_sandbox` in milliseconds; the work is expected to raise nothing but a refusal."""
    prepare()
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            warnings.simplefilter("ignore")
            sandbox.limit(seconds, memory, files=False)
            try:
                answer = {"given": work(given, [*parts])[0]}
            except TunnelError as error:
                answer = {"refused": [error.what, error.remedy]}
            os.write(theirs, json.dumps(answer).encode())
            status = 0
        except MemoryError:
            status = 77
        except BaseException as error:
            os.write(theirs, repr(error)[-2000:].encode())
        finally:
            os._exit(status)
    os.close(theirs)
    with os.fdopen(ours, "rb") as stream:
        said = stream.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status != 1, said.decode()
    if status:
        raise sandbox.LimitReached(f"ended its process with {status}")
    found = json.loads(said)
    if "refused" in found:
        raise TunnelError(found["refused"][0], remedy=found["refused"][1])
    return found["given"], []
