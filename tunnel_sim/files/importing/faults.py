"""Faults of the libraries of the extra ``import`` as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tunnel_sim.vocabulary.errors import TunnelError, one_line


@contextmanager
def faults(kind: str, where: str) -> Iterator[None]:
    """Convert whatever a library raises on a malformed file, except `MemoryError`, to a `TunnelError`.

    Args:
        kind: what the file is not, with its article.

    Raises:
        TunnelError: instead of any other exception.
    """
    try:
        yield
    except (TunnelError, MemoryError):  # the guard reports memory
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
