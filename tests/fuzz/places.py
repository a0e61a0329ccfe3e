"""Files that are no ordinary files."""

from __future__ import annotations

import os
from pathlib import Path

from tests.fuzz.values import Rng

_HUGE = 3 * 2**30


def estranged(path: Path, rng: Rng) -> None:
    """Put something else in the place of a file.

    Args:
        path: of an ordinary file, which is removed.
        rng: decides what stands there: nothing, a folder, a pipe, a link, an empty file or one of 3 GiB of zeros.
    """
    content = path.read_bytes()
    path.unlink()
    kind = rng.integers(9)
    if kind == 0:
        path.mkdir()
    elif kind == 1:
        os.mkfifo(path)
    elif kind == 2:
        path.symlink_to(path.name)
    elif kind == 3:
        path.symlink_to(("/dev/zero", "/dev/null", "/dev/stdin")[rng.integers(3)])
    elif kind == 4:
        path.symlink_to("missing")
    elif kind == 5:
        path.write_bytes(b"")
    elif kind == 6:
        with path.open("wb") as stream:
            stream.write(content)
            stream.truncate(_HUGE)
    elif kind == 7:
        path.write_bytes(b"\n" * 1000 + content)
