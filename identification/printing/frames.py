"""Quantities of a document as Polars frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import polars as pl

from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from pandas import DataFrame

Document = Mapping[str, Any]

_LONG = {
    "quantity": pl.String,
    "value": pl.Float64,
    "std": pl.Float64,
    "unit": pl.String,
    "low": pl.Float64,
    "high": pl.Float64,
}


def as_pandas(frame: pl.DataFrame) -> DataFrame:
    """A frame for pandas, by its columns: Polars' own way needs pyarrow.

    Raises:
        TunnelError: where pandas is not installed.
    """
    try:
        from pandas import DataFrame  # only here: an extra
    except ModuleNotFoundError as error:
        remedy = "pip install 'virtual-wind-tunnel[frames]'"
        raise TunnelError("pandas is not installed", remedy=remedy) from error
    return DataFrame(frame.to_dict(as_series=False))


def long_frame(quantities: Mapping[str, Document | None]) -> pl.DataFrame:
    """A row for each quantity.

    Args:
        quantities: value, std, unit and perhaps interval by name; None where there is none.

    Returns:
        Columns quantity, value, std, unit, and low and high, the ends of the 95 % interval; null where there is
        no quantity.
    """
    rows = []
    for name, given in quantities.items():
        row: dict[str, Any] = {"quantity": name}
        if given is not None:
            reach = 1.96 * given["std"]
            low, high = given.get("interval") or (given["value"] - reach, given["value"] + reach)
            row |= {key: given[key] for key in ("value", "std", "unit")} | {"low": low, "high": high}
        rows.append(row)
    return pl.DataFrame(rows, schema=_LONG)


def wide_frame(
    rows: Sequence[Document], plain: Mapping[str, type[pl.DataType]], quantities: Sequence[str]
) -> pl.DataFrame:
    """A row for each document, two columns for each quantity.

    Args:
        plain: keys whose values are taken as they are, with their types.
        quantities: keys of quantities, which have a value and a std, or are None.

    Returns:
        The plain columns, then for each quantity its value under its name and its standard deviation under the
        name with ``_std``; null where there is none.
    """
    columns: dict[str, list[Any]] = {name: [row[name] for row in rows] for name in plain}
    for name in quantities:
        given = [row[name] or {} for row in rows]
        columns[name] = [quantity.get("value") for quantity in given]
        columns[f"{name}_std"] = [quantity.get("std") for quantity in given]
    return pl.DataFrame(columns, schema={name: plain.get(name, pl.Float64) for name in columns})
