"""All figures of a diagnosis, by name."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.policy import LISTED_PROBABILITY
from diagnosis.printing import plain, probability
from identification.printing import coefficient_label
from tunnel_lab.plotting.style import (
    COLOURS,
    INTERVAL,
    MARKERS,
    figure,
    figure_text,
    grid,
    limit_to_known,
    log_axis,
    styled,
)
from tunnel_lab.report import where
from tunnel_lab.report.drawing import (
    ACCENT,
    AFTER,
    BEFORE,
    INK,
    LINE,
    NARROW,
    NOISE,
    PAPER,
    QUIET,
    SIGMAS,
    Document,
    array,
    drawn_label,
    faded,
    misfit_scale,
)
from tunnel_lab.report.fit import fit_figure, fit_sheets
from tunnel_lab.report.waterfall import waterfall_figure
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 8
"""Most answers drawn."""
_LOW = 2.1  # inches: a map on the printed summary
_LABEL = 24  # characters in a line of a label
_LEAST_NOISE = 0.03  # noise variances, three standard deviations: where the document has no maps
_MOST_CURVES = len(COLOURS)
_LONG = 30  # characters of a label
_LEGEND, _HANDLE = 62, 8  # characters: the width of the figure, and the line beside a label
_AXES = {"angle": "angle [rad]", "rate": "rate [rad/s]", "time": "time since the start [s]"}


def diagnosis_figures(document: Document) -> dict[str, Figure]:
    """All figures of a diagnosis.

    Args:
        document: the diagnosis as JSON's types; without ``maps`` those that need them are left out.

    Returns:
        Figures by name, in the order of the report.
    """
    figures = _first_figures(document)
    if document.get("maps"):
        figures["fit"] = fit_figure(document)
        figures["where-runs"] = where.runs_figure(document)
        figures["where-profiles"] = where.profiles_figure(document)
        figures["where-spectrum"] = where.spectrum_figure(document)
        figures["where-backbones"] = backbone_figure(document)
        figures["where-phase-plane"] = where.phase_plane_figure(document)
        figures["where-moment"] = where.moment_figure(document)
    figures["which"] = candidates_figure(document)
    figures["how-far"] = closure_figure(document)
    figures["law"] = law_figure(document)
    figures["coefficients"] = coefficients_figure(document)
    return {name: figure for name, figure in figures.items() if figure is not None}


def summary_figures(document: Document) -> dict[str, Figure]:
    """The figures of the printed summary.

    Returns:
        Figures by name, with the fit over the data in several heights, of which the page shows one.
    """
    first = {name: fig for name, fig in _first_figures(document, _LOW).items() if fig is not None}
    return first | fit_sheets(document)


def _first_figures(document: Document, height: float = where.PLACE_HEIGHT) -> dict[str, Figure | None]:
    """Where the gap is, in a map of some height in inches, and how far it closes."""
    located = document.get("maps") and document["causes"]
    place = where.place_figure(document, height) if located else None
    return {"place": place, "waterfall": waterfall_figure(document)}


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
    fig = figure(NARROW, 0.7 + 0.3 * len(shown) + 0.15 * sum(name.count("\n") for name in names))
    axes = fig.add_subplot()
    values = [candidate["probability"] for candidate in shown]
    axes.barh(range(len(shown)), values, color=[ACCENT, *[QUIET] * (len(shown) - 1)], height=0.6)
    for index, value in enumerate(values):
        axes.text(value + 0.01, index, probability(value), va="center")
    axes.set_yticks(range(len(shown)), names)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.12)
    axes.set_xticks(np.linspace(0.0, 1.0, 6))
    axes.set_xlabel("probability")
    grid(axes, "x")
    return fig


@styled
def closure_figure(document: Document) -> Figure:
    """Root mean square misfit of every run before and after the causes are added.

    Returns:
        A pair of points per run; the second is filled where the run was held out of the fit.
    """
    runs = document["gap"]["runs"]
    fig = figure(NARROW, 1.2 + 0.22 * max(len(runs), 4))
    axes = fig.add_subplot()
    rows = np.arange(len(runs))
    unit, size = misfit_scale(document)
    before = np.array([size(run["before"]) for run in runs])
    after = np.array([size(run["after"]) for run in runs])
    stds = [run["std"] for run in (document.get("maps") or {"runs": []})["runs"]]
    axes.axvspan(
        0.0, size(SIGMAS * max(stds) if stds else _LEAST_NOISE), color=NOISE, lw=0, label="noise (3σ)"
    )
    axes.set_xlim(0.0, 1.05 * float(max(before.max(), after.max())) or 1.0)
    axes.set_xlabel(f"root mean square misfit [{unit}]")
    axes.hlines(rows, after, before, color=LINE, linewidth=2.5)
    axes.plot(before, rows, "s", color=BEFORE, ms=5, clip_on=False, label="nominal model")
    if not np.array_equal(before, after):
        held_out = np.array([run["held_out"] for run in runs])
        for chosen, face, words in ((held_out, AFTER, "held out"), (~held_out, PAPER, "fitted")):
            if chosen.any():
                label = f"with the causes, run {words}"
                axes.plot(
                    after[chosen], rows[chosen], "o", color=AFTER, mfc=face, ms=5, clip_on=False, label=label
                )
    axes.set_yticks(rows, [figure_text(run["id"]) for run in runs])
    axes.invert_yaxis()
    fig.legend(loc="outside upper left", ncols=2)
    grid(axes)
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
    fig = figure(NARROW, 0.3 + 1.3 * len(names))
    for place, name in enumerate(names, 1):
        axes = fig.add_subplot(len(names), 1, place)
        for row, (values, colour, marker) in enumerate(((before, BEFORE, "s"), (after, AFTER, "o"))):
            std = values[name]["std"]
            axes.errorbar(
                values[name]["value"], row, xerr=None if std is None else INTERVAL * std, color=colour,
                marker=marker, ms=6, capsize=4,
            )  # fmt: skip
        axes.set_yticks([0, 1], ["before", "after"])
        axes.set_ylim(1.6, -0.6)
        axes.set_xlabel(coefficient_label(name, before[name]["unit"]))
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
    return fig


@styled
def backbone_figure(document: Document) -> Figure:
    """Frequency and damping of the runs that show the gap against amplitude, with 95 % bands.

    Args:
        document: a diagnosis with its maps.

    Returns:
        Two panels: frequency relative to the nominal model's, and damping ratio minus the nominal model's.
    """
    maps = document["maps"]
    curves = [curve for curve in maps["backbones"] if len(curve["time_s"]) > 1]
    named = [curve for curve in curves if curve["id"] in document["where"]["runs"]]
    # the runs that show the gap first, in the campaign's order, and then the rest for comparison
    chosen = (named + [curve for curve in curves if curve not in named])[:_MOST_CURVES]
    labels = {run["id"]: drawn_label(run) for run in maps["runs"]}
    fig = figure(NARROW, 7.0)
    frequency, damping = fig.subplots(2, 1)
    shifts, changes = [], []
    for index, curve in enumerate(chosen):
        amplitude = array(curve["amplitude_rad"])
        nominal = curve["nominal_frequency_hz"]
        style = {"color": COLOURS[index], "marker": MARKERS[(index + index // len(MARKERS)) % len(MARKERS)]}
        shift = 100.0 * (array(curve["frequency_hz"]) / nominal - 1.0)
        shift_std = 100.0 * array(curve["frequency_std"]) / nominal
        _curve(frequency, amplitude, shift, shift_std, style)
        change = 1e3 * (array(curve["zeta"]) - curve["nominal_zeta"])
        change_std = 1e3 * array(curve["zeta_std"])
        _curve(damping, amplitude, change, change_std, style, labels[curve["id"]])
        shifts.append((shift, shift_std))
        changes.append((change, change_std))
    for axes, name in ((frequency, "frequency minus\nthe nominal one [%]"),
                       (damping, "damping ratio minus\nthe nominal one [10⁻³]")):  # fmt: skip
        axes.axhline(0.0, color=INK, linewidth=1.0)
        axes.set_xlabel("amplitude [rad]")
        axes.set_ylabel(name)
        grid(axes)
    for axes, pairs in ((frequency, shifts), (damping, changes)):
        if pairs:
            limit_to_known(axes, *(np.concatenate(column) for column in zip(*pairs, strict=True)))
            log_axis(axes, "x")
    if chosen:
        longest = max(len(labels[curve["id"]]) for curve in chosen)
        columns = min(3, _LEGEND // (longest + _HANDLE)) or 1
        fig.legend(loc="outside lower center", ncols=columns, fontsize="x-small" if longest > _LONG else None)
    return fig


def _curve(
    axes: Axes, x: Array, y: Array, std: Array, style: dict[str, Any], label: str | None = None
) -> None:
    order = np.argsort(x)
    colour, marker = style["color"], str(style["marker"])
    band = INTERVAL * std[order]
    axes.fill_between(x[order], y[order] - band, y[order] + band, color=colour, alpha=0.15, linewidth=0)
    axes.plot(x[order], y[order], color=colour, marker=marker, ms=3.5, lw=1.0, label=label)


@styled
def law_figure(document: Document) -> Figure | None:
    """The law without a formula.

    Returns:
        A curve with its 95 % band, or a map in which white cells are within it; None where there is none.
    """
    curve = (document.get("closable") or {}).get("curve")
    if curve is None:
        return None
    shape = [len(axis) for axis in curve["places"]]
    values, std = (np.reshape(curve[name], shape) for name in ("values", "std"))
    unit = "rad" if curve["unit"] == "rad" else "N m" if curve["unit"] == "N m" else "rad/s²"
    name = f"{'error of the reading' if unit == 'rad' else 'missing moment'} [{unit}]"
    fig = figure(NARROW, 3.2)
    axes = fig.add_subplot()
    axes.set_xlabel(_AXES[curve["over"][0]])
    if len(shape) == 1:
        (place,) = curve["places"]
        axes.fill_between(
            place, values - INTERVAL * std, values + INTERVAL * std, color=AFTER, alpha=0.25, lw=0
        )
        axes.plot(place, values, color=AFTER)
        axes.set_ylabel(name)
        grid(axes)
        return fig
    reach = float(np.max(np.abs(values))) or 1.0
    shown = np.where(np.abs(values) > INTERVAL * std, values, np.nan)
    mesh = axes.pcolormesh(
        *curve["places"],
        shown.T,
        cmap=faded(AFTER, BEFORE),
        vmin=-reach,
        vmax=reach,
        shading="nearest",
    )
    axes.set_ylabel(_AXES[curve["over"][1]])
    fig.colorbar(mesh, ax=axes, label=name)
    return fig
