"""The greatest share of a gap that the known effects could explain; if it is small, no set is the cause.

By linear theory a set of effects explains no more than all effects together, with all trials of every effect
and with deviations of every run in everything that may differ between runs. Computing this takes as long as
starting one fit of every effect; fitting the sets takes ten times as long.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.likelihood.starting_points import changes, misses_motion, starting_points
from diagnosis.search.scatter import may_scatter, usual, with_deviations
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import OwnNumbers
from tunnel_sim.vocabulary.record import Array

_NULL = 1e-9  # maximum singular value, relative to the largest, that counts as zero
_RANK = 1e-6  # the same limit for the columns of all effects, which are finite differences


def unexplained_floor(
    base: Fit, kinds: Sequence[type[Effect]], between_runs: Sequence[type[Effect]]
) -> float:
    """The share of the gap that remains with all effects fitted together, by linear theory.

    Args:
        base: the fit of the nominal model.
        kinds: the effects; their parameters per run count as if each effect acted alone.
        between_runs: the effects that may also differ between runs by chance.

    Returns:
        A fraction; 0 where linear theory is not valid because the fit misses the motion.
    """
    if misses_motion(base):
        return 0.0
    able = may_scatter(between_runs, base.problem.data)
    problem, point = with_deviations(base.problem, base.point, tuple(usual(base, kind) for kind in able))
    jacobian = sensitivities(problem, point, base.jacobian)
    bases = [orthonormal(own) for _, own in jacobian]

    def beside(change: Sequence[Array]) -> Array:
        """A change of all runs, concatenated; the runs' parameters are projected out."""
        parts = zip(change, bases, strict=True)
        return np.concatenate([one - basis @ (basis.T @ one) for one, basis in parts])

    common = range(jacobian[0][0].shape[1])
    columns = [beside([one[:, place] for one, _ in jacobian]) for place in common]
    columns += [beside(change) for kind in kinds for change in changes(base, kind)]
    scaled = [one / size for one in columns if np.isfinite(size := np.linalg.norm(one)) and size > 0.0]
    left = beside(base.residuals)
    if scaled:
        matrix = np.stack(scaled, axis=1)
        left = left - matrix @ np.linalg.lstsq(matrix, left, rcond=_RANK)[0]
    of_runs = sum(_closed_by_own_numbers(base, kind) for kind in kinds)
    return max(float(left @ left) - base.count - of_runs, 0.0) / (base.gap * base.count)


def _closed_by_own_numbers(base: Fit, kind: type[Effect]) -> float:
    """χ² explained by an effect's phase or instants in every run; 0 for an effect without them."""
    if not issubclass(kind, OwnNumbers):
        return 0.0
    return max((start.predicted_drop for start in starting_points(base, kind)), default=0.0)


def orthonormal(columns: Array) -> Array:
    """An orthonormal basis of columns of any rank, shape (n, rank)."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    vectors, values, _ = np.linalg.svd(columns / size, full_matrices=False)
    return np.asarray(vectors[:, values > _NULL * values[0]], np.float64)
