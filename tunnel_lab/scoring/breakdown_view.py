"""The breakdown map as tables and as a figure. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from identification.printing.numbers import significant
from tunnel_lab.plotting.common import styled
from tunnel_lab.scoring.breakdown import NO_EFFECT, Bias
from tunnel_lab.scoring.tables import NAMES
from tunnel_lab.terminal.tables import table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from rich.table import Table

    from tunnel_sim.vocabulary.record import Array

SHOWN = ("cn_beta", "cn_r")
ABOUT = (
    "Bias in % of the truth; in brackets in reported standard deviations. Severity: excess residual power after "
    "the nominal refit, in noise powers."
)
_SIDE_BY_SIDE = 3  # estimators in one table of a terminal of 80 columns
_TINY, _HUGE = 1e-3, 1e2  # % at the ends of the colours


def breakdown_tables(found: Sequence[Bias], quantity: str) -> list[Table]:
    """The bias of one quantity, with effects in rows and estimators in columns, three to a table."""
    mine = [one for one in found if one.quantity == quantity]
    estimators = list(dict.fromkeys(one.estimator for one in mine))
    cells = {(one.effect, one.severity, one.estimator): _cell(one) for one in mine}
    tables = []
    for first in range(0, len(estimators), _SIDE_BY_SIDE):
        some = estimators[first : first + _SIDE_BY_SIDE]
        one_table = table(f"Bias of {NAMES[quantity]} [%]", "effect", "×", *some, right=("×", *some))
        one_table.columns[0].no_wrap = True
        for effect, severity in dict.fromkeys((one.effect, one.severity) for one in mine):
            row = [cells[effect, severity, name] for name in some]
            one_table.add_row(Text(effect), f"{severity:g}" if severity else "", *row)
        tables.append(one_table)
    return tables


def _cell(one: Bias) -> str:
    relative, in_stds = one.score.relative_bias, one.score.bias_in_stds
    if relative is None:
        return "failed" if one.score.failures.count else "–"
    deviations = "–" if in_stds is None else _compact(in_stds.value)
    return f"{_compact(relative.value)} ({deviations}σ)"


def _compact(value: float) -> str:
    """Two digits and a sign."""
    size = abs(value)
    text = significant(size, 2) if 1e-3 <= size < 1e4 else f"{size:.0e}" if size else "0"
    return f"{'−' if value < 0 else '+'}{text}"


@styled
def breakdown_figure(found: Sequence[Bias]) -> Figure:
    """The bias as a colour map: in % above and in reported standard deviations below.

    Returns:
        Four panels, for Cnβ and Cnr, with effects in rows, estimators and severities in columns.
    """
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(one.estimator for one in found))
    effects = list(dict.fromkeys(one.effect for one in found))
    severities = sorted({one.severity for one in found if one.effect != NO_EFFECT})
    width = 4.0 + 0.95 * len(names) * len(severities)
    figure = Figure(figsize=(2.0 * max(width / 2.0, 5.0), 1.0 + 0.52 * len(effects)), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, in_percent in enumerate((True, False)):
        image = None
        for column, quantity in enumerate(SHOWN):
            values = _grid(found, quantity, effects, names, severities, in_percent=in_percent)
            image = _panel(panels[row, column], values)
            of = "% of the truth" if in_percent else "reported standard deviations"
            panels[row, column].set_title(f"bias of {NAMES[quantity]}, {of}", fontsize=10)
        if image is not None:
            figure.colorbar(image, ax=panels[row], shrink=0.7, label="size of the bias")
    labels = [f"{name}, {severity:g}×" for name in names for severity in severities]
    for axes in panels[1]:
        axes.set_xticks(range(len(labels)), labels, rotation=90, fontsize=8)
    for axes in panels[:, 0]:
        axes.set_yticks(range(len(effects)), [effect.replace("_", " ") for effect in effects], fontsize=8)
    return figure


def _grid(
    found: Sequence[Bias],
    quantity: str,
    effects: Sequence[str],
    names: Sequence[str],
    severities: Sequence[float],
    *,
    in_percent: bool,
) -> Array:
    """Biases by effect (rows) and by estimator and severity (columns); NaN where there is none."""
    values = np.full((len(effects), len(names), len(severities)), np.nan)
    for one in found:
        figure = one.score.relative_bias if in_percent else one.score.bias_in_stds
        if one.quantity != quantity or figure is None:
            continue
        row, column = effects.index(one.effect), names.index(one.estimator)
        if one.effect == NO_EFFECT:  # has no severity: shown in all columns of its estimator
            values[row, column, :] = figure.value
        else:
            values[row, column, severities.index(one.severity)] = figure.value
    return values.reshape(len(effects), -1)


def _panel(axes: Axes, values: Array) -> AxesImage:
    from matplotlib.colors import LogNorm

    image = axes.imshow(
        np.clip(np.abs(values), _TINY, _HUGE),
        norm=LogNorm(_TINY, _HUGE),
        cmap="cividis_r",
        aspect="auto",
    )
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            dark = abs(value) > 1.0
            axes.text(
                column, row, _compact(float(value)), ha="center", va="center", fontsize=6.5,
                color="white" if dark else "black",
            )  # fmt: skip
        else:
            axes.text(column, row, "failed", ha="center", va="center", fontsize=6, color="0.4")
    return image
