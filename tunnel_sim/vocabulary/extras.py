"""Libraries that the extras bring: which command needs which, and one line where one is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from tunnel_sim.vocabulary.errors import TunnelError

EXTRAS = {
    "import": ("fastexcel", "xlsxwriter", "h5py", "nptdms"),
    "film": ("imageio", "imageio_ffmpeg"),
    "cluster": ("dask", "distributed"),
    "bench": ("nicegui",),
    "docs": ("sphinx", "furo", "myst_nb"),
    "train": ("stable_baselines3",),
}
"""The modules of each extra of ``pyproject.toml``."""


def library(name: str, use: str, extra: str, where: str = "") -> Any:
    """A library of an extra.

    Args:
        name: of its module.
        use: what needs it, for the message.
        extra: one of `EXTRAS`.

    Raises:
        TunnelError: when it is not installed; the remedy is the command that installs it.
    """
    try:
        return import_module(name)
    except ImportError:
        raise TunnelError(
            f"{use} needs the package {name.partition('.')[0]}",
            where=where,
            remedy=f"run: pip install 'virtual-wind-tunnel[{extra}]'",
        ) from None
