"""Files, and what may stand in the place of a file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from hypothesis import strategies as st

from tests.fuzz.values import Draw, one_in

_HUGE = 3 * 2**30
_LINKS = ("/dev/zero", "/dev/null", "/dev/stdin", "missing")


def _huge(path: Path, content: bytes) -> None:
    with path.open("wb") as stream:
        stream.write(content)
        stream.truncate(_HUGE)


PLACES: dict[str, Callable[[Path, bytes], object]] = {
    "nothing": lambda _path, _content: None,
    "a folder": lambda path, _content: path.mkdir(),
    "a pipe": lambda path, _content: os.mkfifo(path),
    "a link to itself": lambda path, _content: path.symlink_to(path.name),
    **{f"a link to {to}": lambda path, _content, to=to: path.symlink_to(to) for to in _LINKS},
    "nothing in it": lambda path, _content: path.write_bytes(b""),
    "3 GiB of zeros": _huge,
    "lines before it": lambda path, content: path.write_bytes(b"\n" * 1000 + content),
}


def written(path: Path, content: bytes, draw: Draw) -> Path:
    """Write a file; in one of fifty examples something else stands there instead."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if draw(one_in(50)):
        PLACES[draw(st.sampled_from(sorted(PLACES)))](path, content)
    else:
        path.write_bytes(content)
    return path
