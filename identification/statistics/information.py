"""Linear algebra of information matrices: solve, invert, eliminate, extend."""

from __future__ import annotations

import numpy as np

from tunnel_sim.vocabulary.record import Array

_WORST_CONDITION = 1e13
_SMALLEST = (
    1e-290  # of a variance or an information: its square root and its inverse still have full precision
)


def eliminate(information: Array, score: Array, keep: int) -> tuple[Array, Array]:
    """The information and score of the first unknowns with the others eliminated (Schur complement).

    Args:
        information: shape (m, m).
        score: shape (m,).
        keep: how many unknowns to keep.

    Returns:
        Shapes (keep, keep) and (keep,).
    """
    cross = information[keep:, :keep]
    solved = scaled_solve(information[keep:, keep:], np.column_stack((cross, score[keep:])))
    return information[:keep, :keep] - cross.T @ solved[:, :keep], score[:keep] - cross.T @ solved[:, keep]


def scaled_solve(matrix: Array, right: Array) -> Array:
    """Solve a symmetric positive system after scaling its diagonal to one (units differ by decades).

    Args:
        matrix: shape (m, m).
        right: shape (m,) or (m, n).

    Returns:
        The solution, of the shape of ``right``.

    Raises:
        numpy.linalg.LinAlgError: when the matrix is singular.
    """
    diagonal = matrix.diagonal()
    if not diagonal.min() > 0.0:
        raise np.linalg.LinAlgError("an unknown does not influence the reading")
    scale = np.sqrt(diagonal)
    unit = scale if right.ndim == 1 else scale[:, None]
    if scale.size == 2:
        return _solve_two(float(matrix[0, 1] / (scale[0] * scale[1])), right / unit) / unit
    solution = np.linalg.solve(matrix / (scale[:, None] * scale), right / unit)
    return np.asarray(solution / unit)


def _solve_two(correlation: float, right: Array) -> Array:
    # Systems of two are by far the most common, and calling LAPACK costs ten times their solution.
    pivot = 1.0 - correlation**2
    if not pivot > 0.0:
        raise np.linalg.LinAlgError("two unknowns have the same influence")
    second = (right[1] - correlation * right[0]) / pivot
    return np.array((right[0] - correlation * second, second))


def inverse(information: Array) -> Array:
    """The inverse of an information matrix that `determined` has passed, symmetric to the last bit.

    Args:
        information: shape (m, m).

    Returns:
        Shape (m, m).

    Raises:
        numpy.linalg.LinAlgError: when the matrix is singular.
    """
    result = scaled_solve(information, np.eye(information.shape[0]))
    return np.asarray(0.5 * (result + result.T))


def determined(matrix: Array) -> bool:
    """Whether a symmetric matrix is positive definite to working precision, whatever the units of its unknowns.

    An information matrix is checked before it is inverted, and a covariance before it is used. If it fails, the
    data do not separate the unknowns, and a status says so instead of a number.

    Args:
        matrix: shape (m, m).

    Returns:
        False where an element is not finite, a diagonal one is not positive, or the matrix scaled to a unit
        diagonal has a condition number above 1e13: its inverse then holds less than three correct digits.
    """
    diagonal = matrix.diagonal()
    if not (np.isfinite(matrix).all() and diagonal.min() > _SMALLEST and diagonal.max() < 1.0 / _SMALLEST):
        return False
    scale = np.sqrt(diagonal)
    sizes = np.linalg.eigvalsh(matrix / scale[:, None] / scale)
    return bool(sizes[0] * _WORST_CONDITION > sizes[-1])


def embed(link: Array, *, with_zero: bool) -> Array:
    """A run's link extended by the common zero as last parameter.

    Args:
        link: from the shared parameters to (a, k), shape (2, p).
        with_zero: whether the zero is among the shared parameters.

    Returns:
        Shape (3, p + 1); the link itself without the zero.
    """
    if not with_zero:
        return link
    # Not SciPy's block_diag, whose checks would take half the time of a belief.
    extended = np.zeros((link.shape[0] + 1, link.shape[1] + 1))
    extended[:-1, :-1] = link
    extended[-1, -1] = 1.0
    return extended
