"""The numbers of the folded parts of the page, formatted from the document: places, steps, runs and lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnosis.names import plain
from diagnosis.printing import held_out_excess
from identification.printing.numbers import significant
from tunnel_lab.diagnosis_view.view import CONDITIONS, UNDETERMINED_PLACE, excess, minus, percent
from tunnel_sim.vocabulary.campaign import Campaign

Document = Mapping[str, Any]


def place_rows(document: Document) -> list[tuple[str, str]]:
    """Where the gap is, field by field."""
    where = document["where"]
    return [
        ("Runs that show it", ", ".join(where["runs"]) or "–"),
        ("Time", interval(where["time_s"], "s")),
        ("Amplitude", interval(where["amplitude_rad"], "rad")),
        ("Frequency", interval(where["frequency_hz"], "Hz")),
        ("Channel", where["channel"] or UNDETERMINED_PLACE),
        ("Condition", CONDITIONS.get(where["condition"], str(where["condition"]))),
    ]


def interval(values: list[float] | None, unit: str) -> str:
    """An interval in words.

    Args:
        values: its ends, or None.

    Returns:
        Text such as ``0.00 to 4.20 s``; a dash where there is none.
    """
    if values is None:
        return "–"
    return f"{significant(values[0], 3)} to {significant(values[1], 3)} {unit}"


def step_rows(document: Document) -> list[dict[str, str]]:
    """The gap as the causes are added.

    Returns:
        What is added, what is left, and what is left without it alone; none where no cause is named.
    """
    steps, without = document.get("waterfall", []), document.get("without", {})
    return [
        {
            "name": plain(step["effect"] or "nominal model"),
            "left": minus(held_out_excess(step["excess"])),
            "without": minus(held_out_excess(without[step["effect"]])) if step["effect"] in without else "",
        }
        for step in (steps if len(steps) > 1 else ())
    ]


def run_rows(document: Document, campaign: Campaign) -> list[dict[str, str]]:
    """Every run with its conditions and excess before and after.

    Returns:
        Formatted rows in the campaign's order.
    """
    gap = {run["id"]: run for run in document["gap"]["runs"]}
    rows = []
    for run in campaign.runs:
        own = gap.get(run.id)
        rows.append(
            {
                "id": run.id,
                "spring": "–" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
                "wind": f"{run.wind_speed:g}" if run.wind_on else "off",
                "duration": f"{run.record.duration:.3g}",
                "rate": f"{run.record.sample_rate:.4g}",
                "before": "–" if own is None else excess(own["before"]),
                "after": "–" if own is None else excess(own["after"]),
                "named": "yes" if run.id in document["where"]["runs"] else "",
            }
        )
    return rows


def line_rows(document: Document) -> list[dict[str, str]]:
    """Narrow lines in the residuals.

    Returns:
        Run, frequency, amplitude and share, formatted.
    """
    return [
        {
            "run": line["run"],
            "frequency": significant(line["frequency_hz"], 4),
            "amplitude": significant(1e3 * line["amplitude_rad"], 2),
            "share": percent(min(line["share"], 1.0)),
        }
        for line in (document.get("maps") or {}).get("lines", [])
    ]
