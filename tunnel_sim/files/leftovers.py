"""Temporary files and folders of killed commands: how they are named, and how they are removed.

While a file or folder is being written, it has the temporary name ``.NAME.MARK.partial`` next to its target. A
folder that is about to be replaced is renamed ``.NAME.MARK.replaced``. The mark contains the machine, the process
and its start time, so that another command can tell whether the writer is still running.
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
_NAME_SHOWN = 40  # characters of the target's name in the temporary name: file names are limited to 255 bytes


def temporary_names(target: Path) -> tuple[Path, Path]:
    """Unique temporary names next to a target.

    Args:
        target: file or folder to write.

    Returns:
        The name for the new content, and the name for the old content while it is being replaced.
    """
    pid = os.getpid()
    mark = f"{_machine()}-{pid}-{_start(pid) or 0}-{secrets.token_hex(3)}"
    return (
        target.with_name(f".{target.name[:_NAME_SHOWN]}.{mark}.{PARTIAL}"),
        target.with_name(f".{target.name}.{mark}.{REPLACED}"),
    )


def clear_leftovers(folder: Path) -> None:
    """Remove what killed commands left in a folder, and restore folders that they had set aside.

    Files of running processes and of other machines are kept. Files that cannot be removed are skipped.

    Args:
        folder: any folder; it need not exist.
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
    """As `clear_leftovers`, but only the first time that this process writes to the folder."""
    clear_leftovers(folder)


def discard(folder: Path, partial: Path) -> None:
    """Remove a folder that was set aside and is no longer needed.

    It is renamed to a ``.partial`` first, so that after an interrupted removal the rest is not restored.

    Args:
        folder: the folder; it need not exist.
        partial: an unused name from `temporary_names`.
    """
    if folder.exists():
        folder.rename(partial)
        shutil.rmtree(partial, ignore_errors=True)


def _restore(path: Path, target: Path) -> None:
    try:
        path.rename(target)
    except OSError:
        return  # another command was faster, or renaming is not permitted: nothing is lost


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
    """A hash that identifies this machine and, in a container, its process namespace."""
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
    """Whether the process named by a mark is still running; True where that cannot be determined."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # it is running and belongs to another user
    now = _start(pid)
    return now is None or start in (0, now)


def _start(pid: int) -> int | None:
    """Start time of a process in clock ticks since boot; None where it cannot be determined."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_bytes()
    except OSError:
        return None
    return int(stat.rpartition(b")")[2].split()[19])  # field 22 of proc(5); field 2 may contain spaces
