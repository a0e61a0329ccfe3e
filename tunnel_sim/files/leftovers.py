"""What a killed command leaves in a folder: names that say whose it is, and its removal.

While a file or folder is written it has a temporary name beside its own, ``.NAME.MARK.partial``. A folder that is
about to be replaced is set aside as ``.NAME.MARK.replaced``. The mark names the machine, the process and when the
process began, so that another command can tell whether the writer still runs.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
import socket
from functools import cache, lru_cache
from pathlib import Path

PARTIAL, REPLACED = "partial", "replaced"
_LEFTOVER = re.compile(
    r"\.(?P<name>.+)\.(?P<machine>[0-9a-f]{8})-(?P<pid>\d+)-(?P<start>\d+)-[0-9a-f]{6}\.(?P<kind>partial|replaced)"
)
_NAME_SHOWN = 40  # characters of the target's name in a partial's: names of files are limited to 255 bytes


def temporary_names(target: Path) -> tuple[Path, Path]:
    """Names beside a target that no other writer has.

    Args:
        target: file or folder to write.

    Returns:
        Where its new content is made, and where the old is set aside.
    """
    pid = os.getpid()
    mark = f"{_machine()}-{pid}-{_start(pid) or 0}-{secrets.token_hex(3)}"
    return (
        target.with_name(f".{target.name[:_NAME_SHOWN]}.{mark}.{PARTIAL}"),
        target.with_name(f".{target.name}.{mark}.{REPLACED}"),
    )


def clear_leftovers(folder: Path) -> None:
    """Remove what killed commands left in a folder, and put back what they had only set aside.

    Leftovers of processes that run, or that run on another machine, stay. So does whatever cannot be removed.

    Args:
        folder: any; need not exist.
    """
    try:
        names = [entry.name for entry in os.scandir(folder) if entry.name.startswith(".")]
    except OSError:
        return
    for name in names:
        found = _LEFTOVER.fullmatch(name)
        if found is None or found["machine"] != _machine() or _runs(int(found["pid"]), int(found["start"])):
            continue
        if found["kind"] == REPLACED and not os.path.lexists(folder / found["name"]):
            _restore(folder / name, folder / found["name"])
        else:
            _remove(folder / name)


@lru_cache(maxsize=64)
def clear_leftovers_once(folder: Path) -> None:
    """The same as `clear_leftovers`, but only the first time that this process writes to the folder.

    Args:
        folder: any; need not exist.
    """
    clear_leftovers(folder)


def discard(folder: Path, partial: Path) -> None:
    """Remove a folder that was set aside and is not needed any more.

    It takes the name of a partial first: were its removal interrupted, nobody would put back the rest.

    Args:
        folder: the folder; need not exist.
        partial: a free name from `temporary_names`.
    """
    if folder.exists():
        folder.rename(partial)
        shutil.rmtree(partial, ignore_errors=True)


def _restore(path: Path, target: Path) -> None:
    try:
        path.rename(target)
    except OSError:
        return  # another command was quicker, or it may not be done: nothing is lost


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


@cache
def _machine() -> str:
    """A mark of this machine and, in a container, of its numbering of processes."""
    parts = [socket.gethostname()]
    for path, read in (("/etc/machine-id", _text), ("/proc/self/ns/pid", os.readlink)):
        try:
            parts.append(read(path))
        except OSError:
            continue
    return hashlib.sha256("\0".join(parts).encode(errors="replace")).hexdigest()[:8]


def _text(path: str) -> str:
    return Path(path).read_text(encoding="utf-8", errors="replace").strip()


def _runs(pid: int, start: int) -> bool:
    """Whether the process that a mark names still runs; True where that cannot be known."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # it runs, and belongs to somebody else
    now = _start(pid)
    return now is None or start in (0, now)


def _start(pid: int) -> int | None:
    """Clock ticks from the start of the machine to that of a process; None where that cannot be known."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_bytes()
    except OSError:
        return None
    return int(stat.rpartition(b")")[2].split()[19])  # field 22 of proc(5); the second one may hold blanks
