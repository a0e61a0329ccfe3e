"""Excel workbooks: every sheet that holds columns of numbers."""

from __future__ import annotations

import io
import zipfile

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.faults import faults
from tunnel_sim.files.importing.layout import find_layout
from tunnel_sim.files.importing.source import Table
from tunnel_sim.files.importing.text import channels_of
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.extras import library

LIMIT = limits.DATA_BYTES
"""Largest file, bytes."""
MAGIC = (b"PK\x03\x04",)
"""How such a file begins."""
KIND = "an Excel workbook"
"""As messages name it."""
_HEAD = 400


def read(content: bytes, where: str, _choices: ImportChoices) -> tuple[list[Table], dict[str, str]]:
    """The tables of a workbook, one for each sheet; arguments as in `source.Reader`."""
    fastexcel = library("fastexcel", "Excel", "import", where)
    tables = []
    with faults(KIND, where):
        _check_archive(content, where)
        book = fastexcel.read_excel(content)
        for name in book.sheet_names:
            head = book.load_sheet(name, header_row=None, dtypes="string", n_rows=_HEAD)
            check_count(head.width, limits.COLUMNS, "columns", where, "leave out columns that are not needed")
            rows = (
                [[cell or "" for cell in row] for row in head.to_polars().iter_rows()] if head.width else []
            )
            layout = find_layout(rows, ["\t".join(row) for row in rows], ".", head.width)
            if layout is None:
                continue
            kinds = dict.fromkeys(range(head.width), "float")
            body = book.load_sheet(name, header_row=None, skip_rows=layout.first, dtypes=kinds)
            heading = "names in the row above the numbers" if layout.headed else "no names of columns"
            said = f"workbook: sheet '{name}', {head.width} columns, numbers from row {layout.first + 1}, {heading}"
            part = name if len(book.sheet_names) > 1 else ""
            channels = channels_of(body.to_polars(), layout)
            tables.append(Table(channels, part, layout.facts, (said,), layout.headed))
    return tables, {}


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
