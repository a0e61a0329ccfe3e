"""The breakdown map as tables and as figures. matplotlib is imported inside the functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from identification.printing.numbers import significant
from tunnel_lab.plotting.style import figure, styled
from tunnel_lab.scoring.breakdown import Bias
from tunnel_lab.scoring.tables import NAMES
from tunnel_lab.terminal.tables import table

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure
    from rich.table import Table

SHOWN = ("cn_beta", "cn_r")
ABOUT = (
    "Bias in % of the truth; in brackets in reported standard deviations. Severity: excess residual power after "
    "the nominal refit, in noise powers."
)
_SIDE_BY_SIDE = 3  # estimators in one table of a terminal of 80 columns
_DECADES = 2.0  # of standard deviations above one, at the ends of the colours
_DARK = 1.2  # decades from which white text is legible


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
def breakdown_figure(frame: pl.DataFrame, quantity: str) -> Figure:
    """The biases of one quantity that exceed one reported standard deviation.

    Args:
        frame: of `breakdown_frame`.
        quantity: ``cn_beta`` or another of the frame.

    Returns:
        Effects in rows and estimators in columns, each with its severities side by side. The colour is the bias
        in reported standard deviations, the number the bias in %; smaller biases stay empty.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Rectangle

    cells = exceeding(frame, quantity)
    mine = frame.filter(frame["quantity"] == quantity)
    effects, names = (mine[key].unique(maintain_order=True).to_list() for key in ("effect", "estimator"))
    severities = sorted(set(mine["severity_noise_powers"]) - {0.0})
    fig = figure(1.6 + 0.42 * len(names) * max(len(severities), 2), 1.3 + 0.2 * len(effects))
    axes = fig.add_subplot()
    colours = ScalarMappable(Normalize(-_DECADES, _DECADES), "RdBu_r")
    for (effect, severity, name), (percent, stds) in cells.items():
        width = 1.0 / len(severities) if severity else 1.0
        place = severities.index(severity) * width if severity else 0.0
        shade = float(np.sign(stds) * np.log10(abs(stds)))
        corner = (names.index(name) + place, effects.index(effect) - 0.5)
        axes.add_patch(
            Rectangle(corner, width, 1.0, color=colours.to_rgba(np.array([shade]))[0], linewidth=0.0)
        )
        axes.text(
            corner[0] + 0.5 * width, effects.index(effect), _compact(percent), ha="center", va="center",
            fontsize=6, color="white" if abs(shade) > _DARK else "black",
        )  # fmt: skip
    for edge in range(1, len(names)):
        axes.axvline(edge, color="0.75", linewidth=0.6)
    for edge in range(1, len(effects)):
        axes.axhline(edge - 0.5, color="0.9", linewidth=0.4, zorder=0)
    labels = [name.replace("_", "\n") for name in names]
    axes.set_xticks(np.arange(len(names)) + 0.5, labels)
    axes.set_yticks(range(len(effects)), [effect.replace("_", " ") for effect in effects])
    axes.set(xlim=(0.0, len(names)), ylim=(len(effects) - 0.5, -0.5))
    axes.tick_params(length=0)
    each = ", ".join(f"{severity:g}" for severity in severities)
    axes.set_title(
        f"Bias of {NAMES[quantity]} in % where it exceeds one σ; from left to right: {each} × noise power"
    )
    bar = fig.colorbar(colours, ax=axes, location="bottom", aspect=60, shrink=0.6)
    bar.set_ticks([-2, -1, 0, 1, 2], labels=["≤ −100", "−10", "±1", "10", "≥ 100"])
    bar.set_label("bias in reported standard deviations σ")
    return fig


def exceeding(frame: pl.DataFrame, quantity: str) -> dict[tuple[str, float, str], tuple[float, float]]:
    """Biases that are larger than one reported standard deviation.

    Args:
        frame: of `breakdown_frame`.

    Returns:
        By effect, severity in noise powers (a ratio) and estimator: the bias in % of the truth and in reported
        standard deviations (a ratio).
    """
    found = {}
    for row in frame.filter(frame["quantity"] == quantity).iter_rows(named=True):
        percent, stds = row["bias_percent"], row["bias_in_stds"]
        if percent is not None and stds is not None and abs(stds) > 1.0:
            found[row["effect"], row["severity_noise_powers"], row["estimator"]] = (percent, stds)
    return found
