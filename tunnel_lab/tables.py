"""Estimates as tables for a terminal: every number with its unit, every estimate with its deviation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from tunnel_lab.formatting import in_stds, significant, with_std

if TYPE_CHECKING:
    from identification.estimate import Estimate, Quantity, RunEstimate
    from tunnel_sim.campaign import Campaign

SYMBOLS: Mapping[str, str] = {
    "cn_beta": "Cnβ",
    "cn_r": "Cnr",
    "yaw_inertia": "Izz",
    "mechanical_damping": "Cr",
}
"""How the paper writes the quantities of an estimate, by their name in its JSON."""


class _Console(Console):
    """A console that leaves it to ``main`` to end when the reader of a pipe goes away."""

    def on_broken_pipe(self) -> None:
        """Pass the error on; Rich itself would exit with status 1."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """A console that colours nothing by guesswork.

    Args:
        stderr: print to standard error, where progress and status lines go.

    Returns:
        The console.
    """
    return _Console(stderr=stderr, highlight=False)


def table(title: str, *columns: str, right: Sequence[str] = ()) -> Table:
    """An empty table in the house's style.

    Args:
        title: above it.
        columns: headings, units included.
        right: those headings whose columns are aligned to the right.

    Returns:
        The table.
    """
    result = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        # As text, not markup: units stand in brackets.
        result.add_column(Text(column), justify="right" if column in right else "left", no_wrap=True)
    return result


def coefficients_table(estimate: Estimate) -> Table:
    """The campaign's coefficients, those that could be had.

    Args:
        estimate: of any campaign.

    Returns:
        A table; without rows when the campaign gives normalised form only.
    """
    result = table(f"{estimate.campaign} by {estimate.estimator}", "quantity", "estimate ± std", "unit")
    for name, symbol in SYMBOLS.items():
        quantity: Quantity | None = getattr(estimate, name)
        if quantity is not None:
            result.add_row(symbol, with_std(quantity.value, quantity.std), quantity.unit)
    if estimate.wind_off_inertia is not None:
        quantity = estimate.wind_off_inertia
        result.add_row("Izz, gradient of Kr over ωn²", with_std(quantity.value, quantity.std), quantity.unit)
    return result


def truth_table(estimates: Sequence[Estimate], truth: Mapping[str, float]) -> Table:
    """What each estimator says, beside what was injected.

    Args:
        estimates: of one simulated campaign, one per estimator.
        truth: injected values by name, each in the unit of the estimate's quantity of that name.

    Returns:
        A table with a row for each estimator and quantity.
    """
    result = table(
        "Estimate against the injected truth",
        *("estimator", "quantity", "truth", "estimate ± std", "unit", "error", "error/std"),
        right=("truth", "error", "error/std"),
    )
    for estimate in estimates:
        for name, value in truth.items():
            quantity: Quantity | None = getattr(estimate, name)
            first = estimate.estimator if name == next(iter(truth)) else ""
            if quantity is None:
                result.add_row(
                    first, SYMBOLS[name], significant(value), estimate.status.name.lower(), "", "", ""
                )
                continue
            error = quantity.value - value
            result.add_row(
                first,
                SYMBOLS[name],
                significant(value),
                with_std(quantity.value, quantity.std),
                quantity.unit,
                f"{100.0 * error / abs(value):+.2f} %" if value else "",
                in_stds(error, quantity.std),
            )
        result.add_section()
    return result


def runs_table(campaign: Campaign, estimate: Estimate) -> Table:
    """Natural frequency and damping ratio of every run.

    Args:
        campaign: what was identified.
        estimate: its estimate, runs in the same order.

    Returns:
        A table with a row for each run.
    """
    result = table(
        "Runs",
        *("run", "Kr [N m/rad]", "V [m/s]", "ωn ± std [rad/s]", "ζ ± std [1]", "status"),
        right=("Kr [N m/rad]", "V [m/s]"),
    )
    for run, found in zip(campaign.runs, estimate.runs, strict=True):
        result.add_row(
            escape(run.id),
            "not stated" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
            f"{run.wind_speed:g}",
            _text(found.omega_n),
            _text(found.zeta),
            found.status.name.lower().replace("_", " "),
        )
    return result


def windows_table(run: RunEstimate) -> Table:
    """The run seen through consecutive windows, as in the paper's Table III.

    Args:
        run: an estimate of one run.

    Returns:
        A table with a row for each window, the largest amplitude first.
    """
    result = table(
        f"{escape(run.id)}: windows of three cycles",
        *("from [s]", "to [s]", "amplitude ± std [rad]", "ζ ± std [1]", "ωn ± std [rad/s]"),
        right=("from [s]", "to [s]"),
    )
    for window in run.windows:
        result.add_row(
            f"{window.start_s:.2f}",
            f"{window.start_s + window.duration_s:.2f}",
            _text(window.amplitude),
            _text(window.zeta),
            _text(window.omega_n),
        )
    return result


def status_lines(estimate: Estimate) -> list[str]:
    """What the estimate and its runs have to say, each thing once.

    Args:
        estimate: of any campaign.

    Returns:
        A line for each status other than "identified", with the runs it concerns and the remedy.
    """
    runs: dict[str, list[str]] = {status.value: [] for status in estimate.statuses if status.name != "OK"}
    for run in estimate.runs:
        for status in run.statuses:
            if status.name != "OK":
                runs.setdefault(status.value, []).append(run.id)
    return [
        f"{text} ({', '.join(ids)})" if ids and len(ids) < len(estimate.runs) else text
        for text, ids in runs.items()
    ]


def _text(quantity: Quantity | None) -> str:
    """A quantity whose unit stands in the heading."""
    return "–" if quantity is None else with_std(quantity.value, quantity.std)
