"""Linear algebra of information matrices: solve, invert, eliminate, extend."""

from __future__ import annotations

import numpy as np

from tunnel_sim.record import Array


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
    scale = np.sqrt(matrix.diagonal())
    if not scale.min() > 0.0:
        raise np.linalg.LinAlgError("an unknown has no influence on the reading")
    unit = scale if right.ndim == 1 else scale[:, None]
    if scale.size == 2:
        return _solve_two(float(matrix[0, 1] / (scale[0] * scale[1])), right / unit) / unit
    solution = np.linalg.solve(matrix / (scale[:, None] * scale), right / unit)
    return np.asarray(solution / unit)


def _solve_two(correlation: float, right: Array) -> Array:
    # A pair is the commonest system by far, and LAPACK's calling costs ten times its solution.
    pivot = 1.0 - correlation**2
    if not pivot > 0.0:
        raise np.linalg.LinAlgError("two unknowns have one influence")
    second = (right[1] - correlation * right[0]) / pivot
    return np.array((right[0] - correlation * second, second))


def inverse(information: Array) -> Array:
    """The inverse of an information matrix, symmetric to the last bit."""
    result = scaled_solve(information, np.eye(information.shape[0]))
    return np.asarray(0.5 * (result + result.T))


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
    extended = np.zeros((3, link.shape[1] + 1))
    extended[:2, :-1] = link
    extended[2, -1] = 1.0
    return extended
