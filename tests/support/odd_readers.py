"""A reader that misbehaves as the content asks, for the tests of the guard."""

from __future__ import annotations

import os

import numpy as np

from tunnel_sim import TunnelError
from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.files.readers import Reader

TABLES = [
    Table(
        (Channel("t", np.array([0.0, np.nan, -0.0, 5e-324])), Channel("φ\n\ud800", np.arange(6.0)[::2], "°")),
        "run 1",
        {"rate": float("inf"), "no": float("nan")},
        ("said",),
        headed=False,
        named=True,
    ),
    Table((Channel("whole", np.array([1, 2], dtype=np.int64)), Channel("empty", np.zeros(0)))),
]


def read(content: bytes, where: str) -> list[Table]:
    """As `Reader` describes."""
    if content == b"spin":
        while True:
            pass
    if content == b"die":
        os._exit(1)
    if content == b"fill":
        return [Table((Channel("much", np.ones(2**30)),))]
    if content == b"refuse":
        raise TunnelError("is odd", where=where, remedy="mend it")
    print("a library that talks", flush=True)
    return TABLES


ODD = Reader("an odd file", 100, read_tables=read)
