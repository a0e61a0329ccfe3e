"""Figures and tables of a sweep's summary. matplotlib is imported inside the functions, never at import."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from identification.printing.numbers import SYMBOLS, concise, significant, unit
from tunnel_lab.plotting.style import COLOURS, MARKERS, WIDTH, figure, grid, log_axis, styled
from tunnel_lab.sweep.summary import AXES, OVERALL, SEVERITY, Line, Pace
from tunnel_lab.terminal.tables import table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from rich.table import Table

    from identification.estimate import Quantity
    from identification.statistics.proportion import Proportion

DRAWN: Mapping[str, str] = {"omega_n": "ωn", "zeta": "ζ", "cn_beta": "Cnβ", "cn_r": "Cnr"}
"""Quantities that have a panel; Izz, Cr and the sensor's zero are in the first table and the CSV."""
NAMES: Mapping[str, str] = {**DRAWN, **SYMBOLS, "sensor_zero": "zero"}
BRACKETS = "In brackets: the standard error in the last digits, from the number of trials; of shares 95 %."
_INTERVAL = 1.96
_TICKS = 5  # intervals between labels of six digits, such as 0.00075, that do not touch
_ASIDE = 0.012  # of the axis, between two estimators
_LOGARITHMIC = ("noise_std", "spring_stiffness")
_WIDE = 10.0  # ratio of the largest to the least value from which an axis is drawn logarithmic


def groups(lines: Iterable[Line]) -> dict[str, list[Line]]:
    """Lines grouped by figure.

    Returns:
        Lines by file name without its suffix, such as ``error-by-noise-std`` or ``error-by-coulomb-friction``.
    """
    found: dict[str, list[Line]] = {}
    for line in lines:
        if line.axis != OVERALL:
            what = line.effect.replace(" + ", "-and-") if line.axis == SEVERITY else line.axis
            found.setdefault(f"error-by-{what.replace('_', '-')}", []).append(line)
    return found


@styled
def error_figure(lines: Sequence[Line]) -> Figure | None:
    """RMSE and bias along one axis, a row of panels for each quantity, a colour for each estimator.

    Args:
        lines: of one axis, and of one effect where that is severity.

    Returns:
        The figure, with 95 % intervals from the number of trials; None where no quantity has a panel.
    """
    quantities = [name for name in DRAWN if any(line.quantity == name and line.score.rmse for line in lines)]
    if not quantities:
        return None
    estimators = list(dict.fromkeys(line.estimator for line in lines))
    fig = figure(WIDTH, 1.2 + 1.6 * len(quantities))
    panels = fig.subplots(len(quantities), 2, sharex=True, squeeze=False)
    logarithmic = _is_logarithmic(lines)
    for name, (left, right) in zip(quantities, panels, strict=True):
        mine = [line for line in lines if line.quantity == name and line.score.rmse and line.score.bias]
        for place, estimator in enumerate(estimators):
            shown = [line for line in mine if line.estimator == estimator and line.at is not None]
            aside = (place - (len(estimators) - 1) / 2.0) * _ASIDE
            at = _moved(shown, aside, logarithmic=logarithmic)
            _errorbars(left, at, [line.score.rmse for line in shown], place, estimator)
            _errorbars(right, at, [line.score.bias for line in shown], place, estimator)
        _dress(left, right, mine[0], name)
    for axes in panels[-1]:
        if logarithmic:
            log_axis(axes, "x")
        else:
            axes.locator_params(axis="x", nbins=_TICKS)
    for column in panels.T:
        fig.align_ylabels(column)
    one = lines[0]
    label = one.effect.replace("_", " ") if one.axis == SEVERITY else AXES[one.axis][0]
    fig.supxlabel(f"{label} [{one.at_unit}]", fontsize=9)
    handles, names = panels[0, 0].get_legend_handles_labels()
    fig.legend(handles, names, loc="outside upper center", ncols=min(4, len(names)))
    return fig


def _moved(lines: Sequence[Line], aside: float, *, logarithmic: bool) -> list[float]:
    """Where the lines stand on the axis, a little aside, so that intervals do not hide each other."""
    at = [float(line.at) for line in lines if line.at is not None]
    if logarithmic:
        return [x * (max(at) / min(at)) ** aside for x in at]
    return [x + aside * (max(at) - min(at)) for x in at]


def _errorbars(
    axes: Axes, at: Sequence[float], figures: Sequence[Quantity | None], place: int, label: str
) -> None:
    pairs = [(x, found) for x, found in zip(at, figures, strict=True) if found is not None]
    if not pairs:
        return
    axes.errorbar(
        [x for x, _ in pairs],
        [found.value for _, found in pairs],
        yerr=[_INTERVAL * found.std for _, found in pairs],
        color=COLOURS[place % len(COLOURS)],
        marker=MARKERS[place % len(MARKERS)],
        markersize=4.0,
        linewidth=1.0,
        label=label.replace("_", " "),
    )


def _dress(left: Axes, right: Axes, one: Line, name: str) -> None:
    scale = one.score.rmse.unit if one.score.rmse else ""
    per = "% of truth" if scale == "%" else scale
    log_axis(left, "y")
    right.axhline(0.0, color="0.4", linewidth=0.8, zorder=0)
    left.set_ylabel(f"{NAMES[name]}: RMSE [{per}]")
    right.set_ylabel(f"bias [{per}]")
    for axes in (left, right):
        grid(axes)


def _is_logarithmic(lines: Sequence[Line]) -> bool:
    at = [line.at for line in lines if line.at is not None]
    return lines[0].axis in _LOGARITHMIC and min(at) > 0.0 and max(at) / min(at) >= _WIDE


def overall_table(lines: Iterable[Line]) -> Table:
    """Bias, RMSE, coverage and failures of each estimator and quantity over all cases."""
    kept = [line for line in lines if line.axis == OVERALL]
    said = "without effects" if all(line.effect == "none" for line in kept) else "effects pooled"
    result = table(
        f"All cases, {said}", "estimator", "quantity", "trials", "bias", "RMSE", "in 95 % interval", "failed",
        right=("trials",),
    )  # fmt: skip
    last = ""
    for line in kept:
        if last not in ("", line.estimator):
            result.add_section()
        last = line.estimator
        one = line.score
        result.add_row(
            line.estimator, NAMES[line.quantity], str(one.count), _figure(one.bias), _figure(one.rmse),
            _percent(one.coverage), _percent(one.failures),
        )  # fmt: skip
    return result


def axis_table(lines: Sequence[Line]) -> Table:
    """RMSE along one axis, a column for each quantity that has a panel in the figures.

    Args:
        lines: of one axis, and of one effect where that is severity.
    """
    one = lines[0]
    label = one.effect.replace("_", " ") if one.axis == SEVERITY else AXES[one.axis][0]
    quantities = [name for name in DRAWN if any(line.quantity == name for line in lines)]
    heads = [f"RMSE {NAMES[name]}" for name in quantities]
    result = table(f"Error against {label}", f"{label} {unit(one.at_unit)}", "estimator", *heads)
    cells = {(line.at, line.estimator, line.quantity): line.score.rmse for line in lines}
    for at in sorted({line.at for line in lines if line.at is not None}):
        if result.row_count:
            result.add_section()
        for estimator in dict.fromkeys(line.estimator for line in lines):
            figures = [_figure(cells.get((at, estimator, name))) for name in quantities]
            result.add_row(significant(at), estimator, *figures)
    return result


def pace_table(found: Sequence[Pace]) -> Table:
    """Times of the steps."""
    result = table("Time per run", "step", "median [ms]", "quartiles [ms]", right=("median [ms]",))
    for one in found:
        middle, low, high = (significant(1e3 * value, 3) for value in (one.middle, one.low, one.high))
        result.add_row(one.step, middle, f"{low} to {high}")
    return result


def _figure(found: Quantity | None) -> str:
    return "–" if found is None else f"{concise(found.value, found.std)} {found.unit}"


def _percent(share: Proportion | None) -> str:
    if share is None:
        return "–"
    low, high = share.interval
    return f"{100.0 * share.value:.1f} % ({100.0 * low:.1f} to {100.0 * high:.1f})"
