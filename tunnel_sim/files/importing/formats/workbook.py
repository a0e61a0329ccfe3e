"""Tables of Excel workbooks: sheets of records, sheets of conditions and cover sheets."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from tunnel_sim.files.importing.formats.cells import is_number
from tunnel_sim.files.importing.formats.layout import Layout, facts_in, find_layout
from tunnel_sim.files.importing.formats.text import contested, tables_of
from tunnel_sim.files.importing.tables import LEAST_ROWS, Table, by_run, hold_order
from tunnel_sim.files.readers import Reader, faults
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, library

_NAMED = 3  # number of sheets that a remark lists
_MOST_BELOW = 1000  # number of inspected rows without numbers below the first row of numbers
_HEAD = 400  # number of inspected rows of a sheet
_TEXTS = (
    "run",
    "drive_hold",
)  # columns of a sheet of conditions whose cells are texts, whatever they look like


@dataclass(frozen=True)
class _Sheet:
    """The first rows of a sheet as texts, and its layout; None if it has no column of numbers."""

    name: str
    rows: Sequence[Sequence[str]]
    layout: Layout | None

    @property
    def width(self) -> int:
        return len(self.rows[0]) if self.rows else 0

    @property
    def described(self) -> str:
        """The layout in words."""
        if self.layout is None:
            return "no numbers"
        headed = "names in the row above the numbers" if self.layout.headed else "no names of columns"
        return f"{counted(self.width, 'column')}, numbers from row {self.layout.first + 1}, {headed}"


def _read(content: bytes, where: str) -> list[Table]:
    """The tables of a workbook, one for each sheet, or one for each run in it."""
    fastexcel = library("fastexcel", "Excel", "import", where)
    with faults("an Excel workbook", where):
        _check_archive(content, where)
        book = fastexcel.read_excel(content)
        sheets = [_sheet(book, name, where) for name in book.sheet_names]
        records = [one for one in sheets if one.layout and len(one.rows) - one.layout.first >= LEAST_ROWS]
        others = [sheet for sheet in sheets if sheet not in records] if records else []
        alike: dict[str, list[str]] = {}
        for sheet in records or sheets:
            alike.setdefault(sheet.described, []).append(sheet.name)
        tables = [
            (sheet, table)
            for sheet in records or sheets
            for table in _tables(book, sheet, _of_sheets(alike[sheet.described], sheet))
        ]
        names = {_same(name) for sheet, table in tables for name in (sheet.name, table.part) if name}
        described: dict[str, dict[str, Any]] = {}
        covers: dict[str, float] = {}
        short = []
        for sheet in others:
            if rows := _described(book, sheet, names):
                described |= rows
            else:
                covers |= facts_in(["\t".join(filter(None, row)) for row in sheet.rows]) | _one_row(sheet)
            # The import reports that conditions without a run are not used.
            if not rows or len(rows) < len(tables):
                # the texts of a cover are read above, and are not columns of a record
                short += [
                    replace(table, part=sheet.name, remarks=table.remarks[:1])
                    for table in _tables(book, sheet, _of_sheets([sheet.name], sheet))
                ]
        several = len(book.sheet_names) > 1
        return [_with(table, sheet, described, covers, several) for sheet, table in tables] + short


def _of_sheets(names: Sequence[str], sheet: _Sheet) -> str:
    """A remark on the layout of several sheets."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    listed = ", ".join(f"'{name}'" for name in names[:_NAMED])
    return f"workbook: sheet{'s' if len(names) > 1 else ''} {listed}{more}, {sheet.described}"


def _check_archive(content: bytes, where: str) -> None:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
    size = sum(entry.file_size for entry in entries)
    check_count(size, limits.DATA_BYTES, "bytes once unpacked", where, "save fewer sheets, or as text")
    names = [entry.filename.lower() for entry in entries]
    if "xl/workbook.xml" not in names:
        raise TunnelError("is not an Excel workbook", where=where, remedy="save it as .xlsx, or as text")
    for part, what in (("vbaproject", "macros"), ("externallink", "links to other files")):
        if any(part in name for name in names):
            remedy = "save a copy with values only, as .xlsx or as text"
            raise TunnelError(f"the workbook holds {what}", where=where, remedy=remedy)


def _sheet(book: Any, name: str, where: str) -> _Sheet:
    sheet = book.load_sheet(name, header_row=None, dtypes="string", n_rows=_HEAD)
    check_count(sheet.width, limits.COLUMNS, "columns", where, "leave out columns that are not needed")
    frame = sheet.to_polars().iter_rows() if sheet.width else ()
    rows = [[cell or "" for cell in row] for row in frame]
    width = len(rows[0]) if rows else 0
    return _Sheet(name, rows, find_layout(rows, ["\t".join(row) for row in rows], ".", width))


def _tables(book: Any, sheet: _Sheet, said: str) -> list[Table]:
    """The tables of a sheet of numbers; their parts name their runs. None if the sheet has no numbers."""
    layout = sheet.layout
    if layout is None:
        return []
    numeric = [any(is_number(row[i]) for row in sheet.rows[layout.first :]) for i in range(sheet.width)]
    kinds = {i: "float" if n and i != layout.runs else "string" for i, n in enumerate(numeric)}
    body = book.load_sheet(sheet.name, header_row=None, skip_rows=layout.first, dtypes=kinds).to_polars()
    labels = None if layout.runs is None else body.to_series(layout.runs)
    table, written = Table((), facts=layout.facts, remarks=(said,)), None
    empty = body.select(pl.all_horizontal(pl.all().is_null())).to_series()
    if empty.any():  # they may hold texts: other headings, or statements about the rows below
        written = book.load_sheet(
            sheet.name, header_row=None, skip_rows=layout.first, dtypes="string"
        ).to_polars()
        rows = written.filter(empty).head(_MOST_BELOW).iter_rows() if written.height == empty.len() else ()
        lines = ["\t".join(filter(None, row)) for row in rows]
        table = replace(table, facts=contested(layout.facts, lines))
    tables = tables_of(body, layout, ".", labels, table, written)
    return [part for table in tables if table.channels for part in by_run(table)]


def _described(book: Any, sheet: _Sheet, names: set[str]) -> dict[str, dict[str, Any]]:
    """Statements of a sheet about other sheets, or about their runs, by the name in each row; empty: none.

    Args:
        names: names of the sheets and runs with records, in lower case.
    """
    for column in range(sheet.width):
        cells = [_same(row[column]) for row in sheet.rows]
        first = next((i for i, cell in enumerate(cells) if cell in names), 0)
        named = {i: cell for i, cell in enumerate(cells) if i >= first and cell}
        if first and all(cell in names for cell in named.values()):
            break
    else:
        return {}
    heading = [cell.strip() for cell in sheet.rows[first - 1]]
    below = [sheet.rows[i] for i in named]
    numbers = {i for i in range(sheet.width) if all(is_number(row[i]) or not row[i] for row in below)}
    numbers -= {i for i, key in enumerate(heading) if key.lower() in _TEXTS}
    kinds = {i: "float" if i in numbers else "string" for i in range(sheet.width)}
    # Loaded again, as numbers: texts would lose digits.
    body = book.load_sheet(sheet.name, header_row=None, skip_rows=first, dtypes=kinds).to_polars()
    rows = [dict(zip(heading, row, strict=True)) for row in body.iter_rows()]
    found = {}
    for i, name in named.items():
        row = rows[i - first]
        del row[heading[column]]
        found[name] = row
    return found


def _one_row(sheet: _Sheet) -> dict[str, float]:
    """The numbers of a sheet with one row of numbers below their names."""
    layout = sheet.layout
    if layout is None or not layout.headed or len(sheet.rows) - layout.first != 1:
        return {}
    cells = zip(layout.names, layout.units, sheet.rows[layout.first], strict=False)
    return {
        f"{name} ({unit})" if unit else name: float(cell)
        for name, unit, cell in cells
        if name and is_number(cell)
    }


def _with(
    table: Table,
    sheet: _Sheet,
    described: Mapping[str, Mapping[str, Any]],
    covers: Mapping[str, float],
    several: bool,
) -> Table:
    """A table with the statements that other sheets make about it, by its name there."""
    stated = described.get(_same(table.part)) or described.get(_same(sheet.name)) or {}
    facts: dict[str, float] = {}
    run = ""
    for key, cell in stated.items():
        if isinstance(cell, float):
            facts[key] = cell
        elif key.lower() == "drive_hold" and cell:
            facts["drive_hold"] = hold_order(cell)
        elif key.lower() == "run" and cell and not table.named:
            run = cell
        elif cell:  # such as "12,5 m/s"
            facts |= facts_in([f"{key}\t{cell}"])
    part = run or "-".join(filter(None, (sheet.name if several else "", table.part)))
    return replace(table, part=part, facts={**covers, **table.facts, **facts}, named=table.named or bool(run))


def _same(name: str) -> str:
    return name.strip().lower()


WORKBOOK = Reader("an Excel workbook", limits.DATA_BYTES, (b"PK\x03\x04",), read_tables=_read)
