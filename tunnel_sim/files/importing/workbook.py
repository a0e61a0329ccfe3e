"""Excel workbooks: every sheet that holds columns of numbers."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

from tunnel_sim.files.importing.tables import Table, hold_order
from tunnel_sim.files.importing.text import find_layout, is_number, tables_of
from tunnel_sim.files.readers import Reader, faults
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, library

_HEAD = 400


def _read(content: bytes, where: str) -> list[Table]:
    """The tables of a workbook, one for each sheet; arguments as in `Reader`."""
    fastexcel = library("fastexcel", "Excel", "import", where)
    tables = []
    with faults("an Excel workbook", where):
        _check_archive(content, where)
        book = fastexcel.read_excel(content)
        rows = {
            name: _rows(book.load_sheet(name, header_row=None, dtypes="string", n_rows=_HEAD), where)
            for name in book.sheet_names
        }
        described: dict[str, dict[str, Any]] = {}
        for name in list(rows):
            if found := _descriptions(book, name, rows[name]):
                described |= found
                del rows[name]
        for name, sheet in rows.items():
            tables += _tables(book, name, sheet, described.get(name, {}))
    return tables


def _rows(sheet: Any, where: str) -> list[list[str]]:
    check_count(sheet.width, limits.COLUMNS, "columns", where, "leave out columns that are not needed")
    return [[cell or "" for cell in row] for row in sheet.to_polars().iter_rows()] if sheet.width else []


def _descriptions(book: Any, name: str, rows: Sequence[Sequence[str]]) -> dict[str, dict[str, Any]]:
    """What a sheet with a column ``sheet`` says about other sheets: cells by heading, by name of the sheet."""
    heading = [cell.strip().lower() for cell in rows[0]] if rows else []
    if "sheet" not in heading:
        return {}
    # As texts, numbers would lose digits.
    kinds = {
        i: "string" if key in ("sheet", "run", "drive_hold") else "float" for i, key in enumerate(heading)
    }
    body = book.load_sheet(name, header_row=None, skip_rows=1, dtypes=kinds).to_polars()
    found = [dict(zip(heading, row, strict=True)) for row in body.iter_rows()]
    return (
        {row["sheet"]: row for row in found} if all(row["sheet"] in book.sheet_names for row in found) else {}
    )


def _tables(book: Any, name: str, rows: Sequence[Sequence[str]], described: Mapping[str, Any]) -> list[Table]:
    """The tables of a sheet: one, or one for each run."""
    width = len(rows[0]) if rows else 0
    layout = find_layout(rows, ["\t".join(row) for row in rows], ".", width)
    if layout is None:
        return []
    numeric = [any(is_number(row[i]) for row in rows[layout.first :]) for i in range(width)]
    kinds = {i: "float" if number and i != layout.runs else "string" for i, number in enumerate(numeric)}
    body = book.load_sheet(name, header_row=None, skip_rows=layout.first, dtypes=kinds).to_polars()
    heading = "names in the row above the numbers" if layout.headed else "no names of columns"
    said = f"workbook: sheet '{name}', {width} columns, numbers from row {layout.first + 1}, {heading}"
    facts = {key: cell for key, cell in described.items() if isinstance(cell, float)}
    if hold := described.get("drive_hold"):
        facts["drive_hold"] = hold_order(hold)
    run = described.get("run") or ""
    part = run or (name if len(book.sheet_names) > 1 else "")
    labels = None if layout.runs is None else body.to_series(layout.runs)
    table = Table((), part, {**layout.facts, **facts}, (said,), named=bool(run))
    return tables_of(body, layout, ".", labels, table)


def _check_archive(content: bytes, where: str) -> None:
    """Refuse a workbook that unpacks to too much, or that brings programs or links along."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
    size = sum(entry.file_size for entry in entries)
    check_count(size, limits.DATA_BYTES, "bytes once unpacked", where, "save fewer sheets, or as text")
    names = [entry.filename.lower() for entry in entries]
    if "xl/workbook.xml" not in names:
        raise TunnelError("is not an Excel workbook", where=where, remedy="save it as .xlsx, or as text")
    for part, what in (("vbaproject", "macros"), ("externallink", "links to other files")):
        if any(part in name for name in names):
            raise TunnelError(
                f"the workbook holds {what}",
                where=where,
                remedy="save a copy with values only, as .xlsx or as text",
            )


WORKBOOK = Reader("an Excel workbook", limits.DATA_BYTES, (b"PK\x03\x04",), read_tables=_read)
"""Excel workbooks."""
