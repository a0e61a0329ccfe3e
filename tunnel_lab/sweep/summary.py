"""Summary of a sweep: error against noise, speed, spring and severity, per estimator, with intervals.

Errors are in % of the truth, or in the quantity's unit where a truth is zero. The values of the other axes are
pooled. Lines along noise, speed and spring use the cases without effects where the sweep has such cases, which
are also severity 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.scoring.accuracy import Score, Trials, score
from identification.statistics.proportion import Proportion
from tunnel_lab.sweep.product import NO_EFFECT
from tunnel_lab.sweep.store import TIMINGS, Store
from tunnel_sim.effects import effect_class
from tunnel_sim.files.reading import as_described
from tunnel_sim.vocabulary.errors import TunnelError, shown
from tunnel_sim.vocabulary.record import read_only

if TYPE_CHECKING:
    import polars as pl

OVERALL = "all"
SEVERITY = "severity"
AXES = {
    "noise_std": ("noise", "rad"),
    "wind_speed": ("wind speed", "m/s"),
    "spring_stiffness": ("spring stiffness", "N m/rad"),
    "duration": ("duration", "s"),
}
"""Columns that a summary uses as axes, each with its name and unit."""
NOT_ASKED = (
    "ok",
    "model_departs",
    "noise_disagrees",
    "no_stiffness",
    "no_wind_on",
    "no_wind_off_pair",
    "stiffness_not_separable",
    "damping_not_separable",
    "no_reference_size",
)
"""Statuses of values that the runs cannot give; these are not failures of the estimator."""


@dataclass(frozen=True)
class Line:
    """The score of an estimator for a quantity at a place on an axis.

    Args:
        axis: a key of `AXES`, ``severity`` or ``all``.
        effect: the effect whose severity it is; otherwise the pooled effects.
        at: the value on the axis, in its unit; None for ``all``.
        at_unit: unit of the axis.
        quantity: its name; ``omega_n`` and ``zeta`` are those of single runs.
        score: bias, RMSE, coverage and failures, in the score's unit.
    """

    axis: str
    effect: str
    at: float | None
    at_unit: str
    estimator: str
    quantity: str
    score: Score

    def to_row(self) -> dict[str, Any]:
        """The line as plain values: every figure with its standard error or 95 % interval."""
        bias, rmse, coverage = self.score.bias, self.score.rmse, self.score.coverage
        return {
            "axis": self.axis, "effect": self.effect, "at": self.at, "at_unit": self.at_unit,
            "estimator": self.estimator, "quantity": self.quantity,
            "unit": None if bias is None else bias.unit, "count": self.score.count,
            **_share("failures", self.score.failures),
            "bias": bias and bias.value, "bias_std": bias and bias.std,
            "rmse": rmse and rmse.value, "rmse_std": rmse and rmse.std,
            **_share("coverage", coverage),
        }  # fmt: skip


def _share(name: str, share: Proportion | None) -> dict[str, float | None]:
    low, high = (None, None) if share is None else share.interval
    return {name: None if share is None else share.value, f"{name}_low": low, f"{name}_high": high}


def summarise(store: Store) -> list[Line]:
    """Score the finished part of a sweep.

    Args:
        store: at least one shard finished.

    Returns:
        Lines: of all cases, then along each axis that has two values or more, by estimator and quantity.

    Raises:
        TunnelError: when nothing is finished, or the sweep has no estimators.
    """
    import polars as pl

    frame = store.scan()
    if not store.sweep.document.estimators:
        raise TunnelError(
            "the sweep has no estimators", where=str(store.folder), remedy="there is no estimate to summarise"
        )
    pairs = frame.select("estimator", "quantity").unique(maintain_order=True).collect()
    columns = ("effect", "severity", *AXES, "truth", "value", "std", "status", "unit")
    found: list[Line] = []
    for estimator, quantity in pairs.iter_rows():
        mine = (pl.col("estimator") == estimator) & (pl.col("quantity") == quantity)
        asked = pl.col("value").is_not_null() | ~pl.col("status").is_in(NOT_ASKED)
        data = frame.filter(mine & asked & pl.col("truth").is_not_null()).select(columns).collect()
        if len(data):
            found += _lines(data, estimator, quantity)
    order = [OVERALL, *AXES, SEVERITY]
    return sorted(
        found, key=lambda line: (order.index(line.axis), line.effect if line.axis == SEVERITY else "")
    )


def _lines(data: pl.DataFrame, estimator: str, quantity: str) -> Iterator[Line]:
    import polars as pl

    plain = data.filter(pl.col("effect") == NO_EFFECT)
    base, effects = (plain, NO_EFFECT) if len(plain) else (data, "pooled")
    yield Line(OVERALL, effects, None, "", estimator, quantity, _score(base))
    for axis, (_, unit) in AXES.items():
        for at, part in _along(base, axis):
            yield Line(axis, effects, at, unit, estimator, quantity, _score(part))
    for effect in sorted(set(data["effect"]) - {NO_EFFECT}):
        both = data.filter(pl.col("effect").is_in([effect, NO_EFFECT]))
        unit = effect_class(effect.partition(" + ")[0]).parameters()[0].unit
        for at, part in _along(both, SEVERITY):
            yield Line(SEVERITY, effect, at, unit, estimator, quantity, _score(part))


def _along(data: pl.DataFrame, axis: str) -> list[tuple[float, pl.DataFrame]]:
    """The parts at each value of an axis, ascending; none where it has one value, or rows without."""
    values = sorted(set(data[axis].drop_nulls()))
    if len(values) < 2 or data[axis].null_count():
        return []
    return [(value, data.filter(data[axis] == value)) for value in values]


def _score(data: pl.DataFrame) -> Score:
    """In % of the truth, or in the quantity's unit where a truth is zero."""
    truth = data["truth"].to_numpy()
    relative = bool(np.all(truth != 0.0))
    kept = data["value"].is_not_null().to_numpy()
    given = data.filter(data["value"].is_not_null())
    scale = 100.0 / np.abs(truth[kept]) if relative else np.ones(int(kept.sum()))
    return score(
        Trials(
            error=read_only((given["value"].to_numpy() - truth[kept]) * scale),
            std=read_only(given["std"].to_numpy() * scale),
            truth=read_only(truth[kept] * scale),
            bound=None,
            failures=int((~kept).sum()),
            unit="%" if relative else data["unit"][0],
        )
    )


@dataclass(frozen=True)
class Pace:
    """Time of one step of the work.

    Args:
        step: ``simulate``, an estimator's name or ``pack``.
        middle: median over the shards, s per run.
        low: their lower quartile, s per run.
        high: their upper quartile, s per run.
    """

    step: str
    middle: float
    low: float
    high: float


def paces(store: Store) -> Sequence[Pace]:
    """Times of the steps of a sweep per run; they are not comparable under different machine load.

    Args:
        store: at least one shard finished.

    Raises:
        TunnelError: when the timings are damaged.
    """
    import polars as pl

    each = pl.col("seconds") / pl.col("runs")
    wanted = [each.quantile(share, "linear").alias(str(share)) for share in (0.5, 0.25, 0.75)]
    folder = shown(store.folder / TIMINGS)
    with as_described("cannot be read as a sweep's timings", folder, "remove it: no result depends on it"):
        table = store.timings().group_by("step", maintain_order=True).agg(*wanted)
        return [Pace(str(step), float(a), float(b), float(c)) for step, a, b, c in table.iter_rows()]
