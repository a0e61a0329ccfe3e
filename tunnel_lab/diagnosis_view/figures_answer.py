"""Which effect, how far the gap closes, and the coefficients before and after."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.names import plain
from diagnosis.policy import LISTED_PROBABILITY
from identification.printing.numbers import coefficient_label
from tunnel_lab.diagnosis_view.figures_common import (
    ACCENT,
    AFTER,
    BEFORE,
    LINE,
    PAPER,
    QUIET,
    SIGMAS,
    SOFT,
    Document,
    array,
    noise_axis,
)
from tunnel_lab.plotting.common import WIDTH, figure, figure_text, grid, styled, with_breaks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tunnel_sim.vocabulary.campaign import Campaign

SHOWN = 8
"""Most answers drawn."""
_DRAWN_TRACES = 2
_LABEL = 40  # characters in a line of a label
_LEAST_NOISE = 0.03  # noise variances, three standard deviations: where the document has no maps


@styled
def candidates_figure(document: Document) -> Figure | None:
    """The answers by probability.

    Returns:
        A bar for each answer that is not improbable; None where there are fewer than two, which words say better.
    """
    shown = [c for c in document["candidates"][:SHOWN] if c["probability"] >= LISTED_PROBABILITY]
    if len(shown) < 2:
        return None
    names = [textwrap.fill(plain(candidate["effect"]), _LABEL) for candidate in shown]
    fig = figure(WIDTH, 0.7 + 0.3 * len(shown) + 0.15 * sum(name.count("\n") for name in names))
    axes = fig.add_subplot()
    values = [candidate["probability"] for candidate in shown]
    axes.barh(range(len(shown)), values, color=[ACCENT, *[QUIET] * (len(shown) - 1)], height=0.6)
    for index, value in enumerate(values):
        axes.text(value + 0.01, index, _percent(value), va="center")
    axes.set_yticks(range(len(shown)), names)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.12)
    axes.set_xticks(np.linspace(0.0, 1.0, 6), [f"{v:.0%}" for v in np.linspace(0.0, 1.0, 6)])
    axes.set_xlabel("probability")
    grid(axes, "x")
    return fig


def _percent(value: float) -> str:
    return "> 99.9 %" if value >= 0.9995 else f"{100.0 * value:.1f} %"


@styled
def closure_figure(document: Document) -> Figure:
    """Excess of every run before and after the causes are added, on a logarithmic scale from below the noise.

    Returns:
        A pair of points per run; the second is filled where the run was held out of the fit.
    """
    runs = document["gap"]["runs"]
    fig = figure(WIDTH, 1.2 + 0.22 * max(len(runs), 4))
    axes = fig.add_subplot()
    rows = np.arange(len(runs))
    before = np.array([run["before"] for run in runs])
    after = np.array([run["after"] for run in runs])
    stds = [run["std"] for run in (document.get("maps") or {"runs": []})["runs"]]
    noise = SIGMAS * max(stds) if stds else _LEAST_NOISE
    floor = noise_axis(axes, noise, float(max(before.max(), after.max())))
    shown, left = np.maximum(before, floor), np.maximum(after, floor)
    axes.hlines(rows, left, shown, color=LINE, linewidth=2.5)
    axes.plot(shown, rows, "s", color=BEFORE, ms=5, label="nominal model")
    if not np.array_equal(before, after):
        held_out = np.array([run["held_out"] for run in runs])
        for chosen, face, words in ((held_out, AFTER, "held out"), (~held_out, PAPER, "fitted")):
            if chosen.any():
                label = f"with the causes, run {words}"
                axes.plot(left[chosen], rows[chosen], "o", color=AFTER, mfc=face, ms=5, label=label)
    axes.set_yticks(rows, [figure_text(run["id"]) for run in runs])
    axes.invert_yaxis()
    fig.legend(loc="outside upper left", ncols=4)
    grid(axes)
    return fig


@styled
def traces_figure(document: Document, campaign: Campaign) -> Figure | None:
    """Reading and residuals of the runs with the largest gap.

    Args:
        document: a diagnosis with its maps.

    Returns:
        A column per run: the reading above, the residual before and after below; None without traces.
    """
    traces = document["maps"]["traces"]
    records = {run.id: run.record for run in campaign.runs}
    traces = [trace for trace in traces if trace["id"] in records][:_DRAWN_TRACES]
    if not traces:
        return None
    fig = figure(WIDTH, 3.8)
    panels = fig.subplots(2, len(traces), sharex="col", squeeze=False, height_ratios=(1.0, 1.2))
    for column, trace in enumerate(traces):
        top, bottom = panels[0, column], panels[1, column]
        record = records[trace["id"]]
        thin = slice(None, None, max(1, record.yaw_rad.size // 1500))
        time, reading = with_breaks(record.time_s[thin] - record.time_s[0], record.yaw_rad[thin])
        top.plot(time, reading, color=SOFT, linewidth=0.7)
        top.set_title(f"{figure_text(trace['id'])}: reading [rad]")
        for name, colour, label in (
            ("before_rad", BEFORE, "nominal model"), ("after_rad", AFTER, "with the causes")
        ):  # fmt: skip
            if trace[name] is not None:
                when, residual = with_breaks(array(trace["time_s"]), 1e3 * array(trace[name]))
                bottom.plot(when, residual, color=colour, linewidth=0.8, label=label)
        bottom.set_title("residual [10⁻³ rad]")
        bottom.set_xlabel("time since the start of the record [s]")
        bottom.margins(x=0.01)
        grid(top)
        grid(bottom)
    handles, labels = panels[1, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=2)
    return fig


@styled
def coefficients_figure(document: Document) -> Figure | None:
    """The coefficients before and after, with 95 % intervals.

    Returns:
        A panel per coefficient that the runs determine; None where there is none.
    """
    before, after = (document["coefficients"][key] for key in ("before", "after"))
    names = [
        name
        for name in before
        if name in after and all(given[name].get("determined", True) for given in (before, after))
    ]
    if not names:
        return None
    fig = figure(WIDTH, 1.7)
    for place, name in enumerate(names, 1):
        axes = fig.add_subplot(1, len(names), place)
        for row, (values, colour, marker) in enumerate(((before, BEFORE, "s"), (after, AFTER, "o"))):
            std = values[name]["std"]
            axes.errorbar(
                values[name]["value"], row, xerr=None if std is None else 1.96 * std, color=colour,
                marker=marker, ms=6, capsize=4,
            )  # fmt: skip
        axes.set_yticks([0, 1], ["before", "after"])
        axes.set_ylim(1.6, -0.6)
        axes.set_xlabel(coefficient_label(name, before[name]["unit"]))
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
    return fig
