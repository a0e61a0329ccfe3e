"""What installed packages add: effects, readers and estimators, each by an entry point of its group."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tunnel_sim.vocabulary.errors import TunnelError, one_line

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


def added_to(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group, by name.

    Args:
        group: such as ``tunnel.effects``.
    """
    from importlib.metadata import entry_points  # only here: every command would wait for it

    return {point.name: point for point in entry_points(group=group)}


@contextmanager
def loading(group: str, name: str) -> Iterator[None]:
    """Say in one line whatever a foreign package does wrong while it is loaded within the block.

    Args:
        group: of the entry point.
        name: of the entry point.

    Raises:
        TunnelError: instead of any exception.
    """
    try:
        yield
    except Exception as error:
        said = str(error) if isinstance(error, TunnelError) else f"{type(error).__name__}: {error}"
        raise TunnelError(
            f"cannot be loaded ({one_line(said)})",
            where=f"entry point {group}: {name}",
            remedy="correct or uninstall its package",
        ) from error
