"""``python -m tunnel_lab.logged LOG WORDS…``: a command of ``tunnel`` with its output in a log.

The bench starts its commands this way and follows them by the log (`tunnel_lab.bench.work`). The process locks the
log while it runs.
"""

from __future__ import annotations

import fcntl
import os
import shlex
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

_SETS_EVERY_S = 0.5


def run_logged(log: Path, words: Sequence[str]) -> int:
    """Run a command; the first line of its log has the command and the process, the last line the exit status.

    Args:
        log: an existing file.
        words: words after ``tunnel``.

    Returns:
        The exit status.
    """
    stream = log.open("a")
    fcntl.flock(stream, fcntl.LOCK_EX)
    for descriptor in (1, 2):
        os.dup2(stream.fileno(), descriptor)
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    print(f"$ {shlex.join(['tunnel', *words])} (process {os.getpid()}, started {now})", flush=True)
    from tunnel_lab.cli import main  # after the first line, for which the bench waits
    from tunnel_lab.terminal.progress import print_sets

    print_sets(_SETS_EVERY_S)
    sys.argv[1:] = words
    status = main()
    sys.stdout.flush()
    print(f"exit status {status}", flush=True)
    return status


if __name__ == "__main__":
    sys.exit(run_logged(Path(sys.argv[1]), sys.argv[2:]))
