"""A campaign in progress, shown as a line for each run and as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from identification.printing.numbers import SYMBOLS
from tunnel_lab.envs.session import Knowledge, answers, probabilities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT = 960, 480
_DPI = 100


def line_of(known: Knowledge) -> str:
    """The last run and the estimate after it, in one line."""
    if known.last is None:
        return "new campaign"
    belief = known.belief
    found = ", ".join(
        f"{SYMBOLS[name]} = {value:.4g} ± {belief.std(name):.2g} 1/rad"
        for name, value in zip(("cn_beta", "cn_r"), belief.values, strict=False)
    )
    text = f"run {len(known.choices)}: {known.last.words}; {found}; rig time {known.rig_time / 60.0:.1f} min"
    if known.conditions.effects:
        chances = probabilities(known)
        best = int(np.argmax(chances))
        text += f"; {answers(known.conditions.effects)[best]} (probability {chances[best]:.2f})"
    return text if known.status == "ok" else f"{text}; {known.status}"


def picture(known: Knowledge, targets: tuple[float, float], probability: float) -> NDArray[np.uint8]:
    """The last record beside the standard deviations, or the probabilities, so far.

    Args:
        targets: relative standard deviations of Cnβ and Cnr, fractions.
        probability: that ends a diagnosis (a probability).

    Returns:
        RGB, shape (480, 960, 3).
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH / _DPI, HEIGHT / _DPI), dpi=_DPI, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # matplotlib types it in parts only
    left, right = figure.subplots(1, 2)
    _draw_record(left, known)
    if known.conditions.effects:
        _draw_probabilities(right, known, probability)
    else:
        _draw_spread(right, known, targets)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3], dtype=np.uint8)


def _draw_record(axes: Axes, known: Knowledge) -> None:
    from tunnel_lab.plotting.runs import WIND_OFF, WIND_ON

    axes.set_xlabel("time [s]")
    axes.set_ylabel("angle β [rad]")
    if known.last is None or not known.runs:
        axes.set_title("no run yet", fontsize=10)
        return
    run = known.runs[-1]
    colour = WIND_ON if run.wind_on else WIND_OFF
    axes.plot(run.record.time_s, run.record.yaw_rad, ".", markersize=2, color=colour)
    axes.set_title(f"run {len(known.choices)}: {known.last.words}", fontsize=10)


def _draw_spread(axes: Axes, known: Knowledge, targets: tuple[float, float]) -> None:
    from tunnel_lab.plotting.style import COLOURS

    history = known.beliefs
    for place, (name, target) in enumerate(zip(("cn_beta", "cn_r"), targets, strict=True)):
        spread = [100.0 * belief.relative_std(name) for belief in history]
        axes.semilogy(range(len(spread)), spread, "o-", color=COLOURS[place], label=SYMBOLS[name])
        axes.axhline(100.0 * target, color=COLOURS[place], linestyle="--", linewidth=1)
    axes.set_xlabel("informative runs")
    axes.set_ylabel("standard deviation [%]")
    axes.set_xticks(range(0, len(history), 1 + len(history) // 10))
    axes.legend(loc="upper right")
    axes.set_title(f"{known.rig_time / 60.0:.0f} min of rig time; dashed: the goal", fontsize=10)


def _draw_probabilities(axes: Axes, known: Knowledge, probability: float) -> None:
    from tunnel_lab.plotting.style import COLOURS

    names = [name.replace("_", "\n") for name in answers(known.conditions.effects)]
    axes.bar(names, probabilities(known), color=COLOURS[0])
    axes.axhline(probability, color=COLOURS[1], linestyle="--", linewidth=1)
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel("probability")
    axes.tick_params(axis="x", labelsize=7)
    axes.set_title(f"{known.rig_time / 60.0:.0f} min of rig time; dashed: the goal", fontsize=10)
