"""The location of the package's compiled libraries."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

from tunnel_sim.vocabulary.errors import TunnelError


def native_library(stem: str) -> Path:
    """The path of a compiled library of this package.

    Args:
        stem: its name without ``lib`` and suffix, such as ``vwt_plugin``.

    Returns:
        The file in the installed package, even when the Python sources run from a checkout.

    Raises:
        TunnelError: when the package was not built.
    """
    try:
        distribution = importlib.metadata.distribution("virtual-wind-tunnel")
    except importlib.metadata.PackageNotFoundError as error:
        raise TunnelError("the package is not installed", remedy="install it with 'pip install .'") from error
    folder = Path(str(distribution.locate_file("tunnel_sim/native")))
    for ending in (".so", ".dylib", ".dll"):
        path = folder / f"lib{stem}{ending}"
        if path.is_file():
            return path
    raise TunnelError(
        f"the compiled library {stem} is missing", where=str(folder), remedy="reinstall the package"
    )
