"""The runs of an import as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from identification.show.blocks import TextTable

if TYPE_CHECKING:
    from tunnel_sim.files.importing.records import Imported


def parts_table(imported: Imported) -> TextTable:
    """The runs of an import: samples, rate, begin and end, swing, and conditions."""
    sensor = imported.campaign.sensor
    swing = f"swing\n[{sensor.unit}]"
    used = [part.run for part in imported.parts if part.run is not None]
    joint = all(run.drive is not None and run.wind_speed == 0.0 for run in used)
    windless = joint or not sensor.freedom.windy
    wind = () if windless else ("V\n[m/s]",)
    headings = ("samples", "rate\n[Hz]", "from\n[s]", "to\n[s]", swing, *wind, "Kr\n[N m/rad]")
    rows = []
    for part in imported.parts:
        time, run = part.raw.cleaned.file_time_s[part.piece.first : part.piece.last], part.run
        cells = [f"{time.size}", "left out", *[""] * (len(headings) - 2)]
        if run is not None:
            spring = part.held.get("spring_stiffness", run.spring_stiffness)
            cells[1:] = [
                f"{run.record.sample_rate:.4g}",
                f"{time[0]:.3f}",
                f"{time[-1]:.3f}",
                f"±{0.5 * (part.reading.max() - part.reading.min()):.3g}",
                *([f"{run.wind_speed:g}"] if wind else []),
                "not stated" if spring is None else f"{spring:g}",
            ]
        rows.append((part.id, *cells))
    found = TextTable("Read", ("run", *headings), tuple(rows), right=headings)
    return sensor.freedom.texts(found, [part.id for part in imported.parts])
