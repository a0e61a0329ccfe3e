"""An estimate as a command prints it: tables, then notes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tunnel_lab.terminal import tables

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign


def show_estimate(campaign: Campaign, estimate: Estimate, *, windows: bool) -> None:
    """Print an estimate."""
    tables.show_tables(tables.coefficients_table(estimate), tables.runs_table(campaign, estimate))
    if windows:
        tables.show_tables(*map(tables.windows_table, estimate.runs))
    tables.say(tables.BRACKETS)
    for remark in estimate.remarks:
        tables.say(f"Note: {remark}")
    for line in tables.status_lines(estimate):
        tables.say(f"Note: {line}")
