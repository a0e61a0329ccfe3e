"""Work with limits in a fork of this process, which takes milliseconds: the limited process takes half a second."""

from __future__ import annotations

import os
import traceback
import warnings
from collections.abc import Callable

from tunnel_sim import processes

SECONDS = 1.0
"""Of the processor, instead of what is allowed otherwise, s."""


def in_fork(
    work: Callable[[bytes], bytes], given: bytes, *, prepare: Callable[[], None], seconds: float, memory: int
) -> bytes:
    """As `processes.in_limited_process`, with less time.

    Raises:
        AssertionError: when the work raises anything: it is expected to answer.
        LimitReached: when it takes too much, or its process dies.
    """
    prepare()
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            warnings.simplefilter("ignore")
            processes._limit(min(seconds, SECONDS), memory)
            os.write(theirs, work(given))
            status = 0
        except MemoryError:
            status = 77
        except BaseException:
            os.write(theirs, traceback.format_exc()[-2000:].encode())
        finally:
            os._exit(status)
    os.close(theirs)
    with os.fdopen(ours, "rb") as stream:
        answer = stream.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status == 1:
        raise AssertionError(" ".join(answer.decode().splitlines()[-4:]))
    if status:
        raise processes.LimitReached(f"ended its process with {status}")
    return answer
