"""What an import has read, as a table and notes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from identification.printing.table import TextTable
from tunnel_lab.terminal import tables

if TYPE_CHECKING:
    from tunnel_sim.files.importing.records import Imported, Part


def show_import(imported: Imported) -> None:
    """Print what was read, and how."""
    tables.show_tables(tables.rich_table(parts_table(imported)))
    for line in imported.remarks():
        tables.say(f"Note: {line}")


def parts_table(imported: Imported) -> TextTable:
    """The runs of an import, a row for each.

    Returns:
        The file where there are several, samples, rate, the stretch of the record, the swing and the conditions.
    """
    unit = imported.campaign.sensor.unit
    headings = (
        "samples",
        "rate\n[Hz]",
        "from\n[s]",
        "to\n[s]",
        f"swing\n[{unit}]",
        "V\n[m/s]",
        "Kr\n[N m/rad]",
    )
    several = len(imported.sources) > 1
    rows = tuple(
        (part.id, *([part.raw.source.name] if several else []), *_figures(part)) for part in imported.parts
    )
    return TextTable("Read", ("run", *(["file"] if several else []), *headings), rows, right=headings)


def _figures(part: Part) -> tuple[str, ...]:
    time = part.raw.cleaned.time_s[part.piece.first : part.piece.last]
    run = part.run
    if run is None:
        return (f"{time.size}", "left out", "", "", "", "", "")
    return (
        f"{time.size}",
        f"{run.record.sample_rate:.4g}",
        f"{time[0]:.2f}",
        f"{time[-1]:.2f}",
        f"±{0.5 * (part.reading.max() - part.reading.min()):.3g}",
        f"{run.wind_speed:g}",
        "not stated" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
    )
