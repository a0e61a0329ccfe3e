"""Columns that a user gives: arrays, lists, and columns of pandas and Polars, as arrays of finite numbers."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line

Array = NDArray[np.float64]
_CUT = "leave such samples out of every column, or cut the record before them"
_SECOND = np.timedelta64(1, "s")


def read_only(values: ArrayLike) -> Array:
    """A read-only float64 copy, or the values themselves if they already are one."""
    if type(values) is np.ndarray and values.dtype == np.float64 and _is_constant(values):
        return values
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def _is_constant(values: np.ndarray) -> bool:
    owner = values if values.base is None else values.base
    return not values.flags.writeable and isinstance(owner, np.ndarray) and not owner.flags.writeable


def read_only_column(values: object, name: str, where: str, *, times: bool = False) -> Array:
    """A read-only float64 copy of a column of finite numbers, shape (n,), as `read_only` makes it.

    Args:
        name: name of the column, for messages.
        times: whether to accept dates and durations, as seconds from the first.

    Raises:
        TunnelError: for texts, truth values, complex numbers, missing values, and numbers that are not finite.
    """
    masked = np.count_nonzero(values.mask) if isinstance(values, np.ma.MaskedArray) else 0
    if masked:
        raise TunnelError(f"{name} has {masked} masked values", where=where, remedy=_CUT)
    given = _as_array(values, name, where)
    if given.ndim != 1:
        what = f"{name} has {given.ndim} dimensions, not 1"
        raise TunnelError(what, where=where, remedy="give one value for each sample")
    if given.dtype == object:
        given = _of_objects(given, name, where)
    if times and given.dtype.kind in "mM":
        given = (given - given[:1]) / _SECOND if given.dtype.kind == "M" else given / _SECOND
    if given.dtype.kind not in "iuf":
        kind = {"c": "complex numbers", "b": "truth values", "m": "durations", "M": "dates"}
        what = f"{name} holds {kind.get(given.dtype.kind, 'texts')}, not numbers"
        raise TunnelError(what, where=where, remedy="give floating-point numbers")
    array = read_only(given)
    # the extremes alone, without a temporary array; they are NaN if any value is
    if array.size and not max(-array.min(), array.max()) <= limits.LARGEST_NUMBER:
        wrong = np.flatnonzero(~(np.abs(array) <= limits.LARGEST_NUMBER))
        at = int(wrong[0])
        why = f"beyond {limits.LARGEST_NUMBER:g}" if np.isfinite(array[at]) else "not a finite number"
        what = f"{name} is {array[at]:g}, {why}, at index {at} ({wrong.size} such)"
        raise TunnelError(what, where=where, remedy=_CUT)
    return array


def _as_array(values: object, name: str, where: str) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (RuntimeError, TypeError, ValueError) as error:  # such as lists of unequal lengths
        what = f"{name} is not an array ({one_line(error, 60)})"
        raise TunnelError(what, where=where, remedy="give a list or an array of numbers") from None


def _of_objects(given: NDArray[Any], name: str, where: str) -> NDArray[Any]:
    """The array of objects: numbers, or dates with a time zone, for which NumPy has no type."""
    first = given[0] if given.size else None
    try:
        if hasattr(first, "tzinfo"):
            since = np.array([(one - first).total_seconds() for one in given])
            return np.round(1e9 * since).astype("timedelta64[ns]")
        if isinstance(first, timedelta):
            return given.astype("timedelta64[ns]")
        odd = next((one for one in given if isinstance(one, str | bytes | complex | bool | np.bool_)), None)
        if odd is None:
            return given.astype(np.float64)
    except (AttributeError, TypeError, ValueError):  # such as a missing value of pandas
        odd = next((one for one in given if not isinstance(one, int | float | np.number)), first)
    what = f"{name} holds {one_line(repr(odd), 30)}"
    raise TunnelError(what, where=where, remedy=f"give floating-point numbers; {_CUT}")
