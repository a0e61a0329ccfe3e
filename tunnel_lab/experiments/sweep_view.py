"""Summary of a sweep: error against noise, speed, spring and severity, by estimator, with intervals.

Errors are in % of the truth, or in the quantity's unit if a truth is zero. The values of the other axes are
pooled. Lines along noise, speed and spring use the cases without effects and without scatter, if the sweep has
any. Cases of severity 0 count as cases without effects.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import polars as pl

from identification.show.blocks import TextTable
from identification.show.numbers import significant, unit
from identification.show.quantity import INTERVAL
from identification.show.style import COLOURS, MARKERS, WIDTH, figure, grid, log_axis, styled
from tunnel_lab.experiments.estimate_rows import NOT_ASKED, not_given
from tunnel_lab.experiments.score_columns import (
    BIAS,
    COVERAGE,
    FAILED,
    LINE,
    NAMES,
    RMSE,
    RMSE_OVER_BOUND,
    ScoredRow,
    file_columns,
    meanings,
    not_given_notes,
    score_table,
    trials_of,
)
from tunnel_lab.experiments.sweep_work import SCATTER_COLUMNS
from tunnel_lab.experiments.view import ExperimentView
from tunnel_lab.terminal.arguments import NO_EFFECT
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.text_cells import as_text_cell

if TYPE_CHECKING:
    from matplotlib.figure import Figure


OVERALL = "all"
SEVERITY = "severity"
AXES = {
    "noise_std": ("noise", "rad"),
    "wind_speed": ("wind speed", "m/s"),
    "spring_stiffness": ("spring stiffness", "N m/rad"),
    "duration": ("duration", "s"),
    **{
        column: (f"scatter of {name}", "rad")
        if name == "zero"
        else (f"relative scatter of {name.removesuffix('_between_runs').replace('_', ' ')}", "1")
        for column, name in SCATTER_COLUMNS.items()
    },
}
"""Columns that a summary uses as axes, each with its name and unit."""
DRAWN: Mapping[str, str] = {"omega_n": "ωn", "zeta": "ζ", "cn_beta": "Cnβ", "cn_r": "Cnr"}
"""Quantities that have a panel; Izz, Cr and the sensor's zero are in the first table and the CSV."""
_TICKS = 5  # intervals between labels of six digits, such as 0.00075, that do not touch
_ASIDE = 0.012  # share of the axis, between two estimators
_LOGARITHMIC = ("noise_std", "spring_stiffness")
_WIDE = 10.0  # ratio of the largest to the least value above which an axis is logarithmic


@dataclass(frozen=True, eq=False)
class ScoreLine(ScoredRow):
    """The trials of an estimator for a quantity at a place on an axis, in % of the truth where it is not zero.

    Args:
        axis: a key of `AXES`, ``severity`` or ``all``.
        effect: the effect for the axis ``severity``; otherwise the pooled effects.
        at: the value on the axis, in its unit; None for ``all``.
        at_unit: unit of the axis.
    """

    axis: str
    effect: str
    at: float | None = None
    at_unit: str = ""

    def to_row(self) -> dict[str, Any]:
        """The line as plain values: every figure with its standard error or 95 % interval."""
        columns = {
            "failures": FAILED, "bias": BIAS, "rmse": RMSE, "rmse_over_bound": RMSE_OVER_BOUND,
            "coverage": COVERAGE,
        }  # fmt: skip
        return {
            "axis": self.axis, "effect": self.effect, "at": self.at, "at_unit": self.at_unit,
            "estimator": self.estimator, "quantity": self.quantity,
            "unit": getattr(self.score.bias, "unit", None), "count": self.score.count,
            **file_columns(self, columns, "_std"),
        }  # fmt: skip


def summarise(results: pl.LazyFrame) -> list[ScoreLine]:
    """Score the results of a sweep.

    Returns:
        Lines: of all cases, then along each axis that has two values or more, by estimator and quantity.
    """
    absent = unanswered(results)
    columns = ("effect", "severity", *AXES, "truth", "value", "std", "bound", "status", "unit")
    asked = pl.col("value").is_not_null() | ~pl.col("status").is_in(NOT_ASKED)
    pairs = results.select("estimator", "quantity").unique(maintain_order=True).collect()
    lines: list[ScoreLine] = []
    for estimator, quantity in pairs.iter_rows():
        if quantity not in absent.get(estimator, ()):
            mine = (pl.col("estimator") == estimator) & (pl.col("quantity") == quantity)
            data = results.filter(mine & asked & pl.col("truth").is_not_null()).select(columns).collect()
            lines += lines_of(data, estimator, quantity) if len(data) else ()
    order = [OVERALL, *AXES, SEVERITY]
    return sorted(
        lines, key=lambda line: (order.index(line.axis), line.effect if line.axis == SEVERITY else "")
    )


def sweep_view(results: pl.LazyFrame, name: str) -> ExperimentView:
    """The view of the finished part of a sweep.

    Args:
        name: name of the sweep.
    """
    lines = summarise(results)
    along = groups(lines)
    texts = pl.col(pl.String).map_elements(as_text_cell, return_dtype=pl.String)
    csv = pl.DataFrame([line.to_row() for line in lines]).with_columns(texts).write_csv()
    tables = (overall_table(lines), *map(axis_table, along.values()))
    return ExperimentView(
        f"Sweep {name}",
        [*tables, meanings(LINE), *not_given_notes(unanswered(results))],
        {name: partial(error_figure, part) for name, part in along.items()},
        {"summary.csv": csv.encode()},
    )


def unanswered(results: pl.LazyFrame) -> dict[str, tuple[str, ...]]:
    """Quantities by estimator that it gives in no case, unless its status is a failure in all cases."""
    return not_given(results.filter(pl.col("truth").is_not_null()))


def lines_of(data: pl.DataFrame, estimator: str, quantity: str) -> Iterator[ScoreLine]:
    """The lines of a quantity of an estimator, from columns of `summarise`: of all cases, then along each axis."""
    plain = data.filter(pl.col("effect") == NO_EFFECT)
    base, effects = (plain, NO_EFFECT) if len(plain) else (data, "pooled")

    def line(part: pl.DataFrame, *place: Any) -> ScoreLine:
        percent = bool((part["truth"] != 0.0).all())
        return ScoreLine(estimator, quantity, (trials_of(part, percent=percent),), *place)

    yield line(_repeating(base), OVERALL, effects)
    for axis, (_, at_unit) in AXES.items():
        for at, part in _along(_repeating(base, but=axis), axis):
            yield line(part, axis, effects, at, at_unit)
    for effect in sorted(set(data["effect"]) - {NO_EFFECT}):
        both = _repeating(data.filter(pl.col("effect").is_in([effect, NO_EFFECT])))
        at_unit = effect_class(effect.partition(" + ")[0]).parameters()[0].unit
        for at, part in _along(both, SEVERITY):
            yield line(part, SEVERITY, effect, at, at_unit)


def _repeating(data: pl.DataFrame, but: str = "") -> pl.DataFrame:
    """The cases with runs that repeat exactly, except for the scatter ``but``; all cases if there are none."""
    found = data
    for column in SCATTER_COLUMNS:
        found = found if column == but else found.filter(found[column] == 0.0)
    return found if len(found) else data


def _along(data: pl.DataFrame, axis: str) -> list[tuple[float, pl.DataFrame]]:
    """The parts at each value of an axis, ascending; none where it has only one value, or rows lack it."""
    values = sorted(set(data[axis].drop_nulls()))
    if len(values) < 2 or data[axis].null_count():
        return []
    return [(value, data.filter(data[axis] == value)) for value in values]


def groups(lines: Iterable[ScoreLine]) -> dict[str, list[ScoreLine]]:
    """Lines by the name of their figure, such as ``error-by-noise-std`` or ``error-by-coulomb-friction``."""
    by_name: dict[str, list[ScoreLine]] = {}
    for line in lines:
        if line.axis != OVERALL:
            what = line.effect.replace(" + ", "-and-") if line.axis == SEVERITY else line.axis
            by_name.setdefault(f"error-by-{what.replace('_', '-')}", []).append(line)
    return by_name


@styled
def error_figure(lines: Sequence[ScoreLine]) -> Figure | None:
    """RMSE and bias along one axis, a row of panels for each quantity, a colour for each estimator.

    Returns:
        The figure, with 95 % intervals from the number of trials; None if no quantity has a panel.
    """
    quantities = [name for name in DRAWN if any(line.quantity == name and line.score.rmse for line in lines)]
    if not quantities:
        return None
    estimators = list(dict.fromkeys(line.estimator for line in lines))
    fig = figure(WIDTH, 1.2 + 1.6 * len(quantities))
    panels = fig.subplots(len(quantities), 2, sharex=True, squeeze=False)
    first, values = lines[0], [line.at for line in lines if line.at is not None]
    logarithmic = first.axis in _LOGARITHMIC and min(values) > 0.0 and max(values) / min(values) >= _WIDE
    for name, (errors, biases) in zip(quantities, panels, strict=True):
        mine = [line for line in lines if line.quantity == name and line.score.rmse and line.score.bias]
        for place, estimator in enumerate(estimators):
            drawn = [line for line in mine if line.estimator == estimator and line.at is not None]
            if not drawn:
                continue
            at = [float(line.at) for line in drawn if line.at is not None]
            aside = (place - (len(estimators) - 1) / 2.0) * _ASIDE  # keeps intervals from hiding each other
            if logarithmic:
                at = [x * (max(at) / min(at)) ** aside for x in at]
            else:
                at = [x + aside * (max(at) - min(at)) for x in at]
            for axes, figures in (
                (errors, [line.score.rmse for line in drawn]),
                (biases, [line.score.bias for line in drawn]),
            ):
                axes.errorbar(
                    at, [found.value for found in figures if found],
                    yerr=[INTERVAL * found.known_std for found in figures if found],
                    color=COLOURS[place % len(COLOURS)], marker=MARKERS[place % len(MARKERS)], markersize=4.0,
                    linewidth=1.0, label=estimator.replace("_", " "),
                )  # fmt: skip
        scale = mine[0].score.rmse.unit if mine[0].score.rmse else ""
        per = "% of truth" if scale == "%" else scale
        log_axis(errors, "y")
        biases.axhline(0.0, color="0.4", linewidth=0.8, zorder=0)
        errors.set_ylabel(f"{NAMES[name]}: RMSE [{per}]")
        biases.set_ylabel(f"bias [{per}]")
        for axes in (errors, biases):
            grid(axes)
    for axes in panels[-1]:
        if logarithmic:
            log_axis(axes, "x")
        else:
            axes.locator_params(axis="x", nbins=_TICKS)
    for column in panels.T:
        fig.align_ylabels(column)
    fig.supxlabel(f"{_label(first)} [{first.at_unit}]", fontsize=9)
    handles, names = panels[0, 0].get_legend_handles_labels()
    fig.legend(handles, names, loc="outside upper center", ncols=min(4, len(names)))
    return fig


def _label(line: ScoreLine) -> str:
    return line.effect.replace("_", " ") if line.axis == SEVERITY else AXES[line.axis][0]


def overall_table(lines: Iterable[ScoreLine]) -> TextTable:
    """Bias, RMSE, coverage and failures of each estimator and quantity over the cases of `_repeating`.

    The title names these cases.
    """
    every = list(lines)
    kept = [line for line in every if line.axis == OVERALL]
    pooled = "without effects" if all(line.effect == NO_EFFECT for line in kept) else "with effects pooled"
    # if only some cases have scatter, the table has only the others
    scattering = {line.at for line in every if line.axis in SCATTER_COLUMNS and line.at is not None}
    repeating = " and without scatter" if 0.0 in scattering else ""
    title = f"All cases {pooled}{repeating}"
    return score_table(title, LINE, (({"estimator": line.estimator}, line) for line in kept))


def axis_table(lines: Sequence[ScoreLine]) -> TextTable:
    """The errors along one axis, of the quantities that have a panel in the figures."""
    label, order = _label(lines[0]), [line.estimator for line in lines]
    drawn = [line for line in lines if line.quantity in DRAWN and line.at is not None]
    drawn.sort(key=lambda line: (line.at, order.index(line.estimator), list(DRAWN).index(line.quantity)))
    head = f"{label} {unit(lines[0].at_unit)}"
    places = ({head: significant(line.at or 0.0), "estimator": line.estimator} for line in drawn)
    return score_table(f"Error against {label}", LINE, zip(places, drawn, strict=True))
