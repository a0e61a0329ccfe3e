"""All figures of a diagnosis, by name: its answer, the explained part of the gap, and the coefficients."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.findings.finding import Picture
from diagnosis.findings.misfit import excess_std, misfit_scale, run_labels
from diagnosis.findings.terms import answer_name
from diagnosis.findings.whole import Findings
from diagnosis.words.answers import ranked
from diagnosis.words.cards import WITHIN_THE_NOISE
from identification.printing import coefficient_label
from identification.show.drawing import (
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
    array,
)
from identification.show.numbers import plain, probability, significant
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
_STEP_LABEL, _LABEL = 20, 24  # characters in a line of a label
_LEAST_EXCESS, _LEAST_NOISE = (
    1e-3,
    0.03,
)  # of an excess and of three standard deviations: for a document without maps
_VISIBLE = 0.01  # of the axis: a narrower band is invisible, and has no key
_BESIDE = 7.0  # points between a mark and its text
_MARK = 5.0  # points: the mark of the residual gap without one cause
_BEFORE_ZERO = 0.03  # of the axis: keeps a mark at zero clear of the labels
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
    makers["waterfall"] = waterfall_figure
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
        "how-far": closure_figure,
        "coefficients": coefficients_figure,
    }


def _drawn(picture: Picture, _: Findings) -> Figure | None:
    return picture.draw()


def summary_figures(answer: Findings) -> dict[str, Figure]:
    """The figures of the printed summary; the fit over the data in several heights, one of which is shown."""
    located = answer.maps and answer.causes
    place = where.place_figure(answer, _LOW) if located else None
    figures = {"place": place, "waterfall": waterfall_figure(answer)}
    return {name: figure for name, figure in figures.items() if figure is not None} | where.fit_sheets(answer)


@styled
def waterfall_figure(answer: Findings) -> Figure | None:
    """The residual gap as the causes are added one after another; None where no cause is named.

    A dot for the nominal gap, a bar for each cause from the residual before it to the residual after it, and a dot
    for the rest, on a linear scale of the root mean square misfit.
    """
    steps = answer.waterfall.steps
    if len(steps) < 2:
        return None
    unit, size = misfit_scale(answer)
    misfits = np.array([size(step.excess) for step in steps], np.float64)
    without = {name: size(value) for name, value in answer.waterfall.without.items()}
    alone = [without.get(step.effect or "", np.nan) if len(without) > 1 else np.nan for step in steps]
    fig = figure(NARROW, 1.2 + 0.36 * (misfits.size + 1))
    axes = fig.add_subplot()
    rows, upper = np.arange(misfits.size + 1), np.maximum(misfits[:-1], misfits[1:])
    lower = np.minimum(misfits[:-1], misfits[1:])
    colours = [AFTER if after <= before else BEFORE for before, after in pairwise(misfits)]
    axes.vlines(misfits, rows[:-1], rows[1:], color=QUIET, linewidth=0.8, zorder=0.9)
    axes.barh(rows[1:-1], upper - lower, left=lower, color=colours, height=0.55)
    for row, value, colour in ((0, misfits[0], BEFORE), (rows[-1], misfits[-1], ACCENT)):
        axes.plot(value, row, "o", color=colour, ms=8, clip_on=False)
    if np.isfinite(alone).any():
        label = "without this cause alone"
        axes.plot(alone, rows[:-1], "o", color=INK, mfc=PAPER, ms=_MARK, label=label)
    names = [textwrap.fill(f"+ {plain(answer_name(step.effect or ''))}", _STEP_LABEL) for step in steps[1:]]
    axes.set_yticks(rows, ["nominal model", *names, "the rest"])
    axes.set(ylim=(misfits.size + 0.5, -0.5), xlabel=f"root mean square misfit [{unit}]")
    axes.locator_params(axis="x", nbins=6)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.axvline(0.0, color=QUIET, linewidth=0.8, zorder=0.8)
    grid(axes, "x")
    shown = [
        f"{significant(value, 3) if value else '0'}{unit if unit == '°' else ''}"
        for value in misfits.tolist()
    ]
    if answer.rest is not None and not answer.rest.significant:
        shown[-1] = WITHIN_THE_NOISE
    elif answer.rest is not None:
        shown[-1] += ", material" if answer.rest.material else ", immaterial"
    # The residual after the last cause is given in the row of the rest.
    words = [shown[0], *(f"leaves {text}" for text in shown[1:-1]), "", shown[-1]]
    _place_texts(axes, words, [misfits[0], *upper, misfits[-1]], [*alone, np.nan])
    noise = size(SIGMAS * (excess_std(answer) or _LEAST_EXCESS))
    seen = noise > _VISIBLE * axes.get_xlim()[1]
    axes.axvspan(0.0, noise, color=NOISE, linewidth=0, zorder=0.3, label="noise (3σ)" if seen else None)
    if seen or np.isfinite(alone).any():  # a key aligned with the axis above it
        axes.legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderpad=0.0, borderaxespad=0.3,
            handlelength=1.2, columnspacing=1.4,
        )  # fmt: skip
    return fig


def _place_texts(axes: Axes, words: Sequence[str], ends: Sequence[float], marks: Sequence[float]) -> None:
    """Write texts to the right of their bars or dots, clear of the marks, and extend the axis to hold all texts.

    Args:
        words: the text of each row.
        ends: right end of each row's bar or dot, in data units.
        marks: another mark in the row, in data units; NaN: none.
    """
    axes.figure.draw_without_rendering()  # type: ignore[union-attr]  # sizes are known only after the layout
    points = 72.0 / axes.figure.dpi
    whole = points * axes.get_window_extent().width
    texts = [
        axes.annotate(text, (end, row), (_BESIDE, 0), textcoords="offset points", va="center")
        for row, (text, end) in enumerate(zip(words, ends, strict=True))
    ]
    widths = [_BESIDE + points * text.get_window_extent().width for text in texts]
    beside = np.fmax(ends, marks)  # position of a text that has to clear the mark
    free = (1.0 + _BEFORE_ZERO) * (1.0 - np.array(widths) / whole) - _BEFORE_ZERO
    reach = float(max(np.max(beside / free), 1.05 * np.max(beside))) or 1.0
    axes.set_xlim(-_BEFORE_ZERO * reach, reach)
    point = (1.0 + _BEFORE_ZERO) * reach / whole
    for row, (text, end, mark) in enumerate(zip(texts, ends, marks, strict=True)):
        if end + (_BESIDE - _MARK) * point < mark < end + (widths[row] + _MARK) * point:
            text.xy = (mark, row)


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
def closure_figure(answer: Findings) -> Figure:
    """Misfit of every run before and after the causes are added; filled marks for runs held out of the fit."""
    runs = answer.gap.runs
    fig = figure(NARROW, 1.2 + 0.22 * max(len(runs), 4))
    axes = fig.add_subplot()
    rows = np.arange(len(runs))
    unit, size = misfit_scale(answer)
    before = np.array([size(run.before) for run in runs])
    after = np.array([size(run.after) for run in runs])
    stds = [run["std"] for run in answer.figure_data.get("runs", [])]
    noise = size(SIGMAS * max(stds) if stds else _LEAST_NOISE)
    axes.axvspan(0.0, noise, color=NOISE, lw=0, label="noise (3σ)")
    most = 1.05 * float(max(before.max(), after.max())) or 1.0
    axes.set(xlim=(0.0, most), xlabel=f"root mean square misfit [{unit}]")
    axes.hlines(rows, after, before, color=LINE, linewidth=2.5)
    axes.plot(before, rows, "s", color=BEFORE, ms=5, clip_on=False, label="nominal model")
    if not np.array_equal(before, after):
        held_out = np.array([run.held_out for run in runs])
        for chosen, face, words in ((held_out, AFTER, "held out"), (~held_out, PAPER, "fitted")):
            if chosen.any():
                points, label = (after[chosen], rows[chosen]), f"with the causes, run {words}"
                axes.plot(*points, "o", color=AFTER, mfc=face, ms=5, clip_on=False, label=label)
    axes.set_yticks(rows, [figure_text(run.id) for run in runs])
    axes.invert_yaxis()
    fig.legend(loc="outside upper left", ncols=2)
    grid(axes)
    return fig


@styled
def coefficients_figure(answer: Findings) -> Figure | None:
    """The coefficients that the runs determine, before and after, with 95 % intervals; None without any."""
    before, after = answer.coefficients.before, answer.coefficients.after
    both = [name for name in before if name in after]
    names = [n for n in both if before[n].determined and after[n].determined]
    if not names:
        return None
    fig = figure(NARROW, 0.3 + 1.3 * len(names))
    for place, name in enumerate(names, 1):
        axes = fig.add_subplot(len(names), 1, place)
        for row, (values, colour, marker) in enumerate(((before, BEFORE, "s"), (after, AFTER, "o"))):
            std = values[name].std
            axes.errorbar(
                values[name].value, row, xerr=None if std is None else INTERVAL * std, color=colour,
                marker=marker, ms=6, capsize=4,
            )  # fmt: skip
        axes.set_yticks([0, 1], ["before", "after"])
        axes.set(ylim=(1.6, -0.6), xlabel=coefficient_label(name, before[name].unit))
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
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
