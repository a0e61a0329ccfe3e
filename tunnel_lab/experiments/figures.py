"""The figures of estimates against their truth: from the rows of a table to bias, error, coverage and failures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from identification.estimate import Quantity
from identification.printing import SYMBOLS
from identification.scoring import Score, Trials
from identification.show.blocks import Paragraph
from identification.statistics import Proportion
from tunnel_sim.vocabulary.record import read_only

NAMES: Mapping[str, str] = {**SYMBOLS, "zeta": "ζ", "omega_n": "ωn", "sensor_zero": "zero"}
"""How quantities are written."""


def trials_of(rows: pl.DataFrame, *, percent: bool = False) -> Trials:
    """The trials of one estimator and one quantity.

    Args:
        rows: with ``truth``, ``value``, ``std``, ``bound`` and ``unit``.
        percent: whether in % of the truths, none of which is then zero.
    """
    given = rows.filter(pl.col("value").is_not_null())
    truth, value, std = (given[name].to_numpy() for name in ("truth", "value", "std"))
    bounded = len(given) > 0 and not given["bound"].null_count()
    scale = 100.0 / np.abs(truth) if percent else np.ones(truth.size)
    return Trials(
        error=read_only((value - truth) * scale),
        std=read_only(std * scale),
        truth=read_only(truth * scale),
        bound=read_only(given["bound"].to_numpy() * scale) if bounded else None,
        failures=len(rows) - len(given),
        unit="%" if percent else rows["unit"][0],
    )


def figure_columns(
    judged: Score, figures: Mapping[str, str], shares: Mapping[str, str], error: str
) -> dict[str, float | None]:
    """Figures of a score as columns of a table.

    Args:
        figures: columns by the attribute of the score; the standard error is beside it.
        shares: columns of the shares likewise, with the ends of the 95 % interval beside.
        error: ending of the columns of standard errors.
    """
    columns: dict[str, float | None] = {}
    for name, column in figures.items():
        found: Quantity | None = getattr(judged, name)
        columns[column], columns[column + error] = (None, None) if found is None else (found.value, found.std)
    for name, column in shares.items():
        share: Proportion | None = getattr(judged, name)
        low, high = (None, None) if share is None else share.interval
        columns |= {
            column: None if share is None else share.value,
            f"{column}_low": low,
            f"{column}_high": high,
        }
    return columns


def share_text(share: Proportion | None) -> str:
    """A share with its 95 % interval, in %."""
    if share is None:
        return "–"
    low, high = share.interval
    return f"{100 * share.value:.3g} ({100 * low:.0f}–{100 * high:.0f})"


def not_given_notes(absent: Mapping[str, tuple[str, ...]]) -> list[Paragraph]:
    """Quantities that estimators do not give, a paragraph for each estimator.

    Args:
        absent: names of quantities by estimator.
    """
    return [
        Paragraph(f"Not given by {name}: {', '.join(NAMES[one] for one in some)}.")
        for name, some in absent.items()
    ]
