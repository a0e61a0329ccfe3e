"""A further kind of file needs one reader and one line of the registry, or an entry point; it is planted here."""

import importlib.metadata
from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tunnel_sim import TunnelError
from tunnel_sim.files import readers
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.source import read_source
from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.files.readers import FileTable, Reader
from tunnel_sim.files.run_files import read_table


def angles(content: bytes) -> list[float]:
    """One angle on each line."""
    return [float(line) for line in content.split()]


LINES = Reader(
    "lines",
    100,
    read_run=lambda content, _where, _most: FileTable(
        pl.DataFrame({"yaw_rad": angles(content)}), ("yaw_rad",)
    ),
    read_tables=lambda content, _where: [Table((Channel("yaw", np.array(angles(content))),))],
)


@pytest.fixture(autouse=True)
def _places_are_read_again() -> Iterator[None]:
    readers._added_places.cache_clear()
    yield
    readers._added_places.cache_clear()


@pytest.fixture(autouse=True, params=["registry", "entry point"])
def _reader_of_lines(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """A reader of one angle on each line, in files of 100 bytes at most."""
    place = f"{__name__}:LINES"
    if request.param == "registry":
        monkeypatch.setattr(readers, "READERS", {**readers.READERS, ".lines": place})
    else:
        plug_in(monkeypatch, "lines", place)


def plug_in(monkeypatch: pytest.MonkeyPatch, ending: str, place: str) -> None:
    """Install a package that adds a reader."""
    points = EntryPoints((EntryPoint(ending, place, readers.ENTRY_POINTS),))
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: points.select(group=group))
    readers._added_places.cache_clear()


def test_its_files_are_read(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\n-0.2\n0.1\n")
    held = read_table(tmp_path / "r.lines", "here")
    assert (held.time_s, held.reading.tolist(), held.column) == (None, [0.3, -0.2, 0.1], "yaw_rad")


def test_its_values_are_checked_by_row(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\nnan\n")
    with pytest.raises(TunnelError, match="in row 2"):
        read_table(tmp_path / "r.lines", "here")


def test_its_limit_holds(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\n" * 30)
    with pytest.raises(TunnelError, match="120 bytes, more than 100"):
        read_table(tmp_path / "r.lines", "here")


def test_the_endings_of_run_files_are_those_of_their_readers() -> None:
    found = [ending for ending in readers.run_endings() if ending != ".lines"]
    assert found == list(readers.RUN_ENDINGS)


def test_messages_name_it(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match=r"use \.csv or \.parquet or \.lines"):
        read_table(tmp_path / "r.txt", "here")


def test_what_an_instrument_wrote_is_read_in_a_process_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "r.lines").write_text("0.3\n-0.2\n0.1\n")
    (table,) = read_source(tmp_path / "r.lines", ImportChoices()).tables
    assert table.channels[0].values.tolist() == [0.3, -0.2, 0.1]


@pytest.mark.parametrize("place", [f"{__name__}:angles", f"{__name__}:gone"])
def test_an_entry_point_that_is_not_a_reader_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, place: str
) -> None:
    plug_in(monkeypatch, "odd", place)
    (tmp_path / "r.odd").write_text("0.3")
    with pytest.raises(TunnelError, match=r"entry point tunnel\.readers: odd: cannot be loaded"):
        read_table(tmp_path / "r.odd", "here")
