"""Files that are written whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from tunnel_sim.errors import TunnelError


def output_folder(folder: Path) -> Path:
    """Make a folder to write to, with its parents.

    Args:
        folder: where the output goes; may exist.

    Returns:
        The same folder.

    Raises:
        TunnelError: when it is a file, or cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _unwritable(folder, error) from error
    return folder


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all: to a temporary neighbour, then renamed over the target.

    Args:
        path: the file; replaced when it exists.
        content: what it will hold.

    Returns:
        The same path.

    Raises:
        TunnelError: when the folder does not exist or cannot be written to.
    """
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
        temporary = Path(name)
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
    return path


def write_json(path: Path, document: Mapping[str, object]) -> Path:
    """Write a JSON document whole or not at all.

    Args:
        path: the file; replaced when it exists.
        document: plain values only; NaN and infinity are refused, being no JSON.

    Returns:
        The same path.

    Raises:
        TunnelError: when the file cannot be written.
        ValueError: when the document holds NaN or infinity.
    """
    return write_whole(path, json_text(document).encode())


def json_text(document: Mapping[str, object]) -> str:
    """A JSON document as text.

    Args:
        document: plain values only.

    Returns:
        Indented JSON ending in a line feed.
    """
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _umask() -> int:
    """The process's umask; it can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def _unwritable(path: Path, error: OSError) -> TunnelError:
    """The one line for a path that cannot be written."""
    reason = (error.strerror or str(error)).lower()
    return TunnelError(
        f"cannot be written ({reason})", where=str(path), remedy="name a file or folder that can be written"
    )
