"""The score of a blind check as figures. matplotlib is imported inside the functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from diagnosis.names import plain
from tunnel_lab.diagnosis_view.blind_page import confusion
from tunnel_lab.diagnosis_view.figures_common import AFTER, BEFORE, INK, PAPER, QUIET
from tunnel_lab.plotting.common import WIDTH, figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from diagnosis.blind import Score
    from diagnosis.blind.smooth import SmoothCalibration
    from diagnosis.blind.statistics import CalibrationBin

_CELL, _NAMES, _RIGHT = 0.19, 1.6, 1.0  # inches: a cell, the names beside the rows, the shares
_DARK = 0.55  # share of the colour from which white text is legible


@styled
def calibration_figure(score: Score) -> Figure:
    """How often statements are true, against the probability stated.

    Returns:
        A panel of the answers, in bins with Wilson's intervals of 95 %; and, where the answers state them, one of
        the probabilities that each effect is among the causes, without bins.
    """
    error, bins = score.calibration()
    inclusion = score.inclusion()
    fig = figure(WIDTH if inclusion else 0.55 * WIDTH, 4.0)
    panels = fig.subplots(1, 2 if inclusion else 1, squeeze=False)[0]
    _answers(panels[0], bins, error)
    if inclusion is not None:
        _inclusion(panels[1], inclusion)
    for axes in panels:
        axes.plot(
            [0.0, 1.0], [0.0, 1.0], color=QUIET, linewidth=1.0, linestyle="--", label="calibrated", zorder=1
        )
        axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        grid(axes)
    labels = dict(
        pair[::-1] for axes in panels for pair in zip(*axes.get_legend_handles_labels(), strict=True)
    )
    fig.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=4)
    return fig


def _answers(axes: Axes, bins: tuple[CalibrationBin, ...], error: float) -> None:
    mean = np.array([one.mean for one in bins])
    share = np.array([one.right.value for one in bins], np.float64)
    ends = np.array([one.right.interval for one in bins]).reshape(-1, 2)
    spans = np.maximum([share - ends[:, 0], ends[:, 1] - share], 0.0)
    number = sum(one.right.total for one in bins)
    axes.errorbar(
        mean, share, yerr=spans, fmt="o-", color=AFTER, ms=4, lw=0.8, label=f"{number} answers, 95 %"
    )
    for one, x, y in zip(bins, mean, share, strict=True):
        side = -1 if y > x else 1  # below the points that lie high, where the interval is short
        axes.annotate(
            str(one.right.total), (x, y), (5, 5 * side), textcoords="offset points", fontsize=7, va="center"
        )
    axes.set(xlabel="stated probability of the answer", ylabel="share of answers that are right")
    axes.set_title(f"{number} answers: expected calibration error {error:.3f}")


def _inclusion(axes: Axes, found: SmoothCalibration) -> None:
    axes.fill_between(
        found.stated, found.low, found.high, color=AFTER, alpha=0.2, linewidth=0.0, label="95 %"
    )
    axes.plot(found.stated, found.observed, color=AFTER, label=f"{found.statements} statements")
    axes.set(xlabel="stated probability that an effect acts", ylabel="share of effects that do")
    axes.set_title(f"{found.statements} effects: smooth calibration error {found.error:.3f}")


@styled
def confusion_figure(score: Score) -> Figure:
    """What was answered, by the true causes.

    Returns:
        Truths in rows and answers in columns, by the same numbers; the colour is the share of the row and the
        number a count. What is answered as it is stands on the diagonal, in blue.
    """
    from matplotlib.patches import Rectangle

    truths, columns, counts = confusion(score)
    right = score.right_by_truth()
    rows = [*columns, *(name for name in truths if name not in columns)]  # to name the columns
    fig = figure(_NAMES + _CELL * len(columns) + _RIGHT, 0.9 + _CELL * len(rows))
    axes = fig.add_subplot()
    for name, own_counts in zip(truths, counts.tolist(), strict=True):
        row, total = rows.index(name), sum(own_counts)
        for column, count in enumerate(own_counts):
            if not count:
                continue
            own = columns[column] == {"withheld": "unknown"}.get(name, name)
            share = count / total
            corner = (column - 0.5, row - 0.5)
            axes.add_patch(
                Rectangle(corner, 1.0, 1.0, color=AFTER if own else BEFORE, alpha=share, linewidth=0.0)
            )
            axes.text(
                column, row, str(count), ha="center", va="center", fontsize=6.5,
                color=PAPER if share > _DARK else INK,
            )  # fmt: skip
        found = right[name]
        low, high = (100.0 * end for end in found.interval)
        axes.text(
            len(columns),
            row,
            f"{found.count}/{found.total}  ({low:.0f}–{high:.0f} %)",
            va="center",
            fontsize=7,
        )
    numbers = {name: index for index, name in enumerate(columns, 1)}
    axes.set_yticks(range(len(rows)), [f"{plain(name)}  {numbers.get(name, '')}".rstrip() for name in rows])
    axes.set_xticks(range(len(columns)), [str(number) for number in numbers.values()])
    axes.xaxis.tick_top()
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5), ylabel="truth")
    axes.set_xlabel("answer, by number")
    axes.text(len(columns), -1.0, "right of all (95 %)", va="center", fontsize=7)
    axes.xaxis.set_label_position("top")
    axes.tick_params(length=0)
    for edge in range(1, max(len(rows), len(columns))):
        axes.axhline(edge - 0.5, color="0.9", linewidth=0.4, zorder=0)
        axes.axvline(edge - 0.5, color="0.9", linewidth=0.4, zorder=0)
    return fig
