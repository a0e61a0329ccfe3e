"""An estimate as a command prints it: tables, then notes."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from identification.printing import estimate_tables
from tunnel_lab.terminal import tables

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign


DIAGNOSE = "run the diagnosis"
"""How notes end whose remedy is the diagnosis."""


def show_estimate(
    campaign: Campaign, estimate: Estimate, *, windows: bool, source: Path | None = None
) -> None:
    """Print an estimate.

    Args:
        source: what the campaign was read from, for commands to copy; None: nowhere.
    """
    document = estimate.to_json_dict()
    coefficients = tables.rich_table(estimate_tables.coefficients_table(document))
    tables.show_tables(coefficients, tables.runs_table(campaign, estimate))
    if windows:
        tables.show_tables(*map(tables.windows_table, estimate.runs))
    tables.say(tables.BRACKETS)
    command = DIAGNOSE if source is None else f"run: tunnel diagnose {shlex.quote(str(source))}"
    for line in (*map(str, estimate.remarks), *estimate_tables.status_lines(document)):
        tables.say(f"Note: {line.replace(DIAGNOSE, command)}")
