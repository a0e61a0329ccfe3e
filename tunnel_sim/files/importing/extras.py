"""The libraries of the extra ``import``, and their faults as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from tunnel_sim.vocabulary.errors import TunnelError, one_line


def library(name: str, kind: str, where: str) -> Any:
    """A library that reads or writes a format.

    Args:
        name: of its module.
        kind: the format, for messages.
        where: the file.

    Raises:
        TunnelError: when it is not installed; the remedy is the command that installs it.
    """
    try:
        return import_module(name)
    except ImportError:
        raise TunnelError(
            f"{kind} needs the package {name}",
            where=where,
            remedy="run: pip install 'virtual-wind-tunnel[import]'",
        ) from None


@contextmanager
def faults(kind: str, where: str) -> Iterator[None]:
    """Convert whatever a library raises on a malformed file to a `TunnelError`.

    Args:
        kind: what the file is not, with its article.
        where: the file.

    Raises:
        TunnelError: instead of any other exception.
    """
    try:
        yield
    except TunnelError:
        raise
    except BaseException as error:
        # A panic of a library in Rust is not a subclass of Exception, and has no name to import.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        raise TunnelError(
            f"is not {kind} that can be read ({one_line(error, 60)})",
            where=where,
            remedy="export it again, or as text",
        ) from None
