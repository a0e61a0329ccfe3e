"""The figure of the study of `neural_posterior`, from the tables of `benchmarks.neural_posterior`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.show.style import figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Row = dict[str, Any]
_LABELS = {
    "zeta": "ζ",
    "omega_n": "ωn",
    "cn_beta": "Cnβ",
    "cn_r": "Cnr",
    "yaw_inertia": "Izz",
    "mechanical_damping": "Cr",
}
_BAND = 1.358  # 95 % point of Kolmogorov's statistic, times the root of the number


def rows_of(paths: Sequence[Path]) -> list[Row]:
    """The rows of tables."""
    return [json.loads(line) for path in paths for line in path.read_text(encoding="utf-8").splitlines()]


@styled
def study_figure(rows: Sequence[Row]) -> Figure:
    """Errors against the errors of output error, calibration, and the loss against the size of the training."""
    found = figure(12.0, 4.0)
    errors, calibration, curve = found.subplots(1, 3)
    _errors(errors, [row for row in rows if row.get("kind") == "single"])
    _calibration(calibration, [row["place"] for row in rows if "place" in row])
    points = sorted((row["curve"], row["loss"]) for row in rows if "curve" in row)
    curve.plot(*zip(*points, strict=True), "o-")
    curve.set_xlabel("readings of campaigns in the training")
    curve.set_ylabel("−ln of the density at the truth, per quantity")
    curve.set_title("error against training size")
    grid(curve)
    return found


def _errors(axes: Axes, rows: Sequence[Row]) -> None:
    for name, marker in (("cn_beta", "o"), ("cn_r", "s")):
        both = [row for row in rows if name in row["output_error"] and name in row["neural_posterior"]]
        pairs = np.array(
            [[abs(row[m][name]["error"]) for m in ("output_error", "neural_posterior")] for row in both]
        )
        axes.loglog(pairs[:, 0], pairs[:, 1], marker, ms=4, alpha=0.7, label=_LABELS[name])
    ends = np.array(axes.get_xlim())
    axes.plot(ends, ends, color="0.5", lw=1, label="equal")
    axes.plot(ends, 0.5 * ends, color="0.5", lw=1, ls="--", label="half")
    axes.set_xlabel("error of output error [1/rad]")
    axes.set_ylabel("error of neural_posterior [1/rad]")
    axes.set_title("one effect: absolute errors")
    axes.legend(frameon=False)
    grid(axes)


def _calibration(axes: Axes, places: Sequence[dict[str, float]]) -> None:
    for name, label in _LABELS.items():
        own = np.sort([place[name] for place in places if name in place])
        axes.plot(own, np.arange(1, own.size + 1) / own.size - own, lw=1.2, label=label)
    fewest = min(sum(name in place for place in places) for name in _LABELS)
    axes.axhspan(-_BAND / np.sqrt(fewest), _BAND / np.sqrt(fewest), color="0.9", zorder=0, label="95 % band")
    axes.set_xlabel("place of the truth in the posterior")
    axes.set_ylabel("share below, less that of a uniform one")
    axes.set_ylim(-0.1, 0.12)
    axes.set_title("simulation-based calibration")
    axes.legend(frameon=False, ncols=2, fontsize="small")
    grid(axes)
