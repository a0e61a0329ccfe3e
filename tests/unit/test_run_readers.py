"""A further kind of run file needs one module and one line of the registry; the module is planted here."""

import sys
from pathlib import Path
from types import ModuleType

import polars as pl
import pytest

from tunnel_sim import TunnelError
from tunnel_sim.files import run_files
from tunnel_sim.files.run_files import read_table
from tunnel_sim.files.run_table import FileTable


@pytest.fixture(autouse=True)
def _reader_of_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader of one angle on each line, in files of 100 bytes at most."""
    reader = ModuleType("reader_of_lines")

    def read(content: bytes, _where: str, _most: int) -> FileTable:
        return FileTable(pl.DataFrame({"yaw_rad": [float(line) for line in content.split()]}), ("yaw_rad",))

    vars(reader).update(LIMIT=100, read=read)
    monkeypatch.setitem(sys.modules, reader.__name__, reader)
    monkeypatch.setattr(run_files, "READERS", {**run_files.READERS, ".lines": reader.__name__})


def test_its_files_are_read(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\n-0.2\n0.1\n")
    time_s, reading, column = read_table(tmp_path / "r.lines", "here")
    assert (time_s, reading.tolist(), column) == (None, [0.3, -0.2, 0.1], "yaw_rad")


def test_its_values_are_checked_by_row(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\nnan\n")
    with pytest.raises(TunnelError, match="in row 2"):
        read_table(tmp_path / "r.lines", "here")


def test_its_limit_holds(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\n" * 30)
    with pytest.raises(TunnelError, match="120 bytes, more than 100"):
        read_table(tmp_path / "r.lines", "here")


def test_messages_name_it(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"use \.csv or \.parquet or \.lines"):
        read_table(tmp_path / "r.txt", "here")
