"""All figures of a diagnosis, by name: its answer, the explained part of the gap, and the coefficients."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.finding import Picture
from diagnosis.findings.misfit import run_labels
from diagnosis.findings.terms import answer_name
from diagnosis.findings.whole import Findings
from diagnosis.words.answers import ranked
from identification.show.drawing import (
    ACCENT,
    INK,
    NARROW,
    QUIET,
    array,
)
from identification.show.numbers import plain, probability
from identification.show.style import (
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
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 8
"""Most answers drawn."""
_LOW = 2.1  # inches: a map on the printed summary
_LABEL = 24  # characters in a line of a label


_MOST_CURVES = len(COLOURS)
_LONG = 30  # characters of a label
_LEGEND, _HANDLE = 62, 8  # characters: the width of the figure, and the line beside a label
#: By independent variable of a law: the label of its axis, and the factor on radians or seconds.


def diagnosis_figures(answer: Findings) -> dict[str, Figure]:
    """All figures of a diagnosis by name, in the order of the report; those of ``maps`` only where present."""
    figures = {name: make(answer) for name, make in _makers(answer).items()}
    return {name: figure for name, figure in figures.items() if figure is not None}


def diagnosis_figure(answer: Findings, name: str) -> Figure | None:
    """One of `diagnosis_figures`; None where there is no such figure."""
    make = _makers(answer).get(name)
    return None if make is None else make(answer)


def _makers(answer: Findings) -> dict[str, Callable[[Findings], Figure | None]]:
    """By name, in the order of the report, what draws each figure, or finds that there is none."""
    makers: dict[str, Callable[[Findings], Figure | None]] = {}
    if answer.maps and answer.causes:
        makers["place"] = where.place_figure
    if answer.maps:
        makers |= {
            "fit": where.fit_figure,
            "where-runs": where.runs_figure,
            "where-profiles": where.profiles_figure,
            "where-spectrum": where.spectrum_figure,
            "where-backbones": backbone_figure,
            "where-phase-plane": where.phase_plane_figure,
            "where-moment": where.moment_figure,
        }
    makers |= {name: partial(_drawn, drawn) for name, drawn in answer.pictures.items()}
    return makers | {
        "which": candidates_figure,
    }


def _drawn(picture: Picture, _: Findings) -> Figure | None:
    return picture.draw()


def summary_figures(answer: Findings) -> dict[str, Figure]:
    """The figures of the printed summary; the fit over the data in several heights, one of which is shown."""
    located = answer.maps and answer.causes
    place = where.place_figure(answer, _LOW) if located else None
    figures = {"place": place, "waterfall": diagnosis_figure(answer, "waterfall")}
    return {name: figure for name, figure in figures.items() if figure is not None} | where.fit_sheets(answer)


@styled
def candidates_figure(answer: Findings) -> Figure | None:
    """The answers that are not improbable; None for fewer than two, where words suffice."""
    least = answer.settings.words.answer_drawn
    shown = [c for c in ranked(answer)[:SHOWN] if c.probability >= least]
    if len(shown) < 2:
        return None
    names = [textwrap.fill(plain(answer_name(candidate.effect)), _LABEL) for candidate in shown]
    fig = figure(NARROW, 0.7 + 0.3 * len(shown) + 0.15 * sum(name.count("\n") for name in names))
    axes = fig.add_subplot()
    values = [candidate.probability for candidate in shown]
    colours = [ACCENT if candidate is answer.candidates[0] else QUIET for candidate in shown]
    axes.barh(range(len(shown)), values, color=colours, height=0.6)
    for index, value in enumerate(values):
        axes.text(value + 0.01, index, probability(value), va="center")
    axes.set_yticks(range(len(shown)), names)
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.12), xticks=np.linspace(0.0, 1.0, 6), xlabel="probability")
    grid(axes, "x")
    return fig


@styled
def backbone_figure(answer: Findings) -> Figure:
    """Frequency and damping against amplitude, relative to the nominal model's, with 95 % bands."""
    maps = answer.figure_data
    curves = [curve for curve in maps["backbones"] if len(curve["time_s"]) > 1]
    named = [curve for curve in curves if curve["id"] in answer.where.runs]
    # first the runs that show the gap, in the campaign's order, then the others for comparison
    chosen = (named + [curve for curve in curves if curve not in named])[:_MOST_CURVES]
    labels = {
        run["id"]: figure_text(label) for run, label in zip(maps["runs"], run_labels(maps), strict=True)
    }
    fig = figure(NARROW, 7.0)
    frequency, damping = fig.subplots(2, 1)
    drawn: dict[Axes, list[tuple[Array, Array]]] = {frequency: [], damping: []}
    for index, curve in enumerate(chosen):
        order = np.argsort(array(curve["amplitude_rad"]))
        x, nominal = np.degrees(array(curve["amplitude_rad"])[order]), curve["nominal_frequency_hz"]
        colour, marker = COLOURS[index], MARKERS[(index + index // len(MARKERS)) % len(MARKERS)]
        shift = 100.0 * (array(curve["frequency_hz"]) / nominal - 1.0)
        change = 1e3 * (array(curve["zeta"]) - curve["nominal_zeta"])
        for axes, y, std, label in (
            (frequency, shift, 100.0 * array(curve["frequency_std"]) / nominal, None),
            (damping, change, 1e3 * array(curve["zeta_std"]), labels[curve["id"]]),
        ):
            drawn[axes].append((y, std))
            y, band = y[order], INTERVAL * std[order]
            axes.fill_between(x, y - band, y + band, color=colour, alpha=0.15, linewidth=0)
            axes.plot(x, y, color=colour, marker=marker, ms=3.5, lw=1.0, label=label)
    frequency.set_ylabel("frequency minus\nthe nominal one [%]")
    damping.set_ylabel("damping ratio minus\nthe nominal one [10⁻³]")
    for axes, pairs in drawn.items():
        axes.axhline(0.0, color=INK, linewidth=1.0)
        axes.set_xlabel("amplitude [°]")
        grid(axes)
        if pairs:
            limit_to_known(axes, *(np.concatenate(column) for column in zip(*pairs, strict=True)))
            log_axis(axes, "x")
    if chosen:
        longest = max(len(labels[curve["id"]]) for curve in chosen)
        columns = min(3, _LEGEND // (longest + _HANDLE)) or 1
        fig.legend(loc="outside lower center", ncols=columns, fontsize="x-small" if longest > _LONG else None)
    return fig
