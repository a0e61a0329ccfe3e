"""Derivatives of motions from the compiled integrator, by the terms of the law (``mjcf/plugin/forward.h``)."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.moment_law import forward_library
from tunnel_sim.vocabulary.quantities import Laws
from tunnel_sim.vocabulary.record import Array


@functools.cache
def term_places() -> Mapping[str, int]:
    """The place of every term by its name."""
    library = forward_library()
    return {library.vwt_term_name(i).decode(): i for i in range(library.vwt_term_count())}


@functools.cache
def most_changes() -> int:
    """Greatest number of changes of a wind's or a drive's samples for which derivatives are computed."""
    return int(forward_library().vwt_most_changes())


def terms(law: Laws, runs: NDArray[np.void]) -> Array:
    """Values of the terms of plain runs, in units of kg, m, s and rad, shape (runs, terms).

    Args:
        runs: of `run_dtype`; the arrays behind its pointers must stay alive.
    """
    law, runs = np.ascontiguousarray(law, dtype=np.float64), np.ascontiguousarray(runs)
    values = np.zeros((len(runs), len(term_places())))
    forward_library().vwt_terms(len(runs), law.ctypes.data, runs.ctypes.data, values.ctypes.data)
    return values


@dataclass(frozen=True, eq=False)
class Slopes:
    """Motions and their derivatives by some terms of their law; 0 beyond the end of a run.

    Args:
        angle: angle of the rod's upper end, rad, shape (n, samples).
        rate: rate of the rod's upper end, rad/s, shape (n, samples).
        by_angle: derivatives of the angle, per unit of the terms, shape (n, columns, samples), NaN where they
            do not exist; or of the weighted sums, shape (n, columns, samples − 1). Derivatives along changes of
            samples come last.
        by_rate: derivatives of the rate, of the same shape; none for weighted sums.
        status: as from `integrate`, or −1 if a run has no derivatives.
    """

    angle: Array
    rate: Array
    by_angle: Array
    by_rate: Array | None
    status: int


def slopes(
    law: Laws,
    runs: NDArray[np.void],
    samples: int | NDArray[np.int64],
    columns: Sequence[int],
    weights: Array | None = None,
    changes: Sequence[Array] = (),
) -> Slopes:
    """Integrate plain runs, and their derivatives by some terms.

    Args:
        runs: as in `terms`.
        samples: number of samples of every run, or one number for all, the first at time 0.
        columns: places of the terms.
        weights: for derivatives of weighted sums of first and last angle and first and last rate of each
            interval between samples, shape (n, 4, 1) or (n, 4, samples − 1); None: derivatives of angle and
            rate.
        changes: changes of the runs' samples along which derivatives are also computed, by run, at most
            `most_changes`: of the wind, m/s, shape (changes, samples), or of the drive's values and then their
            slopes, shape (changes, 2 samples). In a run without wind samples or drive these derivatives are
            NaN.
    """
    law, runs = np.ascontiguousarray(law, dtype=np.float64), np.ascontiguousarray(runs)
    runs["samples"], size = samples, int(np.max(samples))
    further = len(changes[0]) if changes else 0
    places = [*columns, *(len(term_places()) + change for change in range(further))]
    chosen = np.ascontiguousarray(places, dtype=np.intc)
    moved = [np.ascontiguousarray(change, dtype=np.float64) for change in changes]
    at = np.array([change.ctypes.data for change in moved], dtype=np.uintp) if moved else None
    angle, rate = np.zeros((len(runs), size)), np.zeros((len(runs), size))
    weights = None if weights is None else np.ascontiguousarray(weights, dtype=np.float64)
    by_angle = np.zeros((len(runs), chosen.size, size - (weights is not None)))
    by_rate = None if weights is not None else np.zeros_like(by_angle)
    given = [_rows(array) for array in (weights, angle, rate, by_angle, by_rate)]
    status = forward_library().vwt_slopes(
        len(runs), law.ctypes.data, runs.ctypes.data, size, chosen.size, chosen.ctypes.data,
        _address(at), _address(given[0]), 1 if weights is None else weights.shape[2], *map(_address, given[1:]),
    )  # fmt: skip
    return Slopes(angle, rate, by_angle, by_rate, int(status))


def _rows(array: Array | None) -> NDArray[np.uintp] | None:
    """The addresses of an array's rows."""
    if array is None:
        return None
    return (array.ctypes.data + np.arange(len(array)) * array.strides[0]).astype(np.uintp)


def _address(array: NDArray[np.uintp] | None) -> int | None:
    return None if array is None else array.ctypes.data
