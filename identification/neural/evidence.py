"""MacKay's evidence for the regularisation of a network, as Foresee and Hagan use it.

The paper's F_reg = γ F_e + (1 − γ) F_w (eq. 14), with F_e the sum of squared errors (eq. 13) and F_w the mean
square of the n weights (eq. 15), is up to a factor

    F = β E_D + α E_W,   E_D = Σ e²,   E_W = Σ w²,   performance ratio γ = β / (β + α n).

With 1/(2β) the variance of the errors and 1/(2α) that of the weights, and λ the eigenvalues of JᵀJ,

    effective number of parameters   γ = Σ βλ / (βλ + α),
    α = γ / (2 E_W),   β = (N − γ) / (2 E_D).

Sources: D. J. C. MacKay, Neural Computation 4 (1992) 415–447, doi 10.1162/neco.1992.4.3.415; F. D. Foresee and
M. T. Hagan, Proc. ICNN'97, 1930–1935, doi 10.1109/ICNN.1997.614194.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class Hyperparameters:
    """The weights of the data and of the prior.

    Args:
        alpha: α, of the squared network weights; dimensionless, for scaled quantities.
        beta: β, of the squared errors; dimensionless, for scaled quantities.
    """

    alpha: float
    beta: float

    def performance_ratio(self, weights: int) -> float:
        """The paper's γ of eq. 14.

        Args:
            weights: number n of weights and biases.
        """
        return self.beta / (self.beta + self.alpha * weights)

    def effective_parameters(self, eigenvalues: Array) -> float:
        """γ, the effective number of parameters determined by the data.

        Args:
            eigenvalues: λ of JᵀJ, those that are not zero, shape (k,).
        """
        return float(np.sum(self.beta * eigenvalues / (self.beta * eigenvalues + self.alpha)))


def updated(
    held: Hyperparameters, eigenvalues: Array, squared_errors: float, squared_weights: float, samples: int
) -> Hyperparameters:
    """One re-estimation of α and β by the evidence.

    Args:
        eigenvalues: λ of JᵀJ, those that are not zero, shape (k,).
        squared_errors: E_D, in squared units of the scaled output.
        squared_weights: E_W, (1).
        samples: number N of training pairs.
    """
    gamma = held.effective_parameters(eigenvalues)
    tiny, epsilon = np.finfo(np.float64).tiny, np.finfo(np.float64).eps
    left = max(samples - gamma, epsilon * samples)  # γ is below N, but rounding may make it N
    return Hyperparameters(
        gamma / (2.0 * max(squared_weights, tiny)), left / (2.0 * max(squared_errors, tiny))
    )


def log_evidence(
    held: Hyperparameters,
    eigenvalues: Array,
    squared_errors: float,
    squared_weights: float,
    counts: tuple[int, int],
) -> float:
    """Logarithm of p(targets | α, β) by Laplace's approximation; exact for a network linear in its weights.

    Args:
        eigenvalues: λ of JᵀJ at the optimum, those that are not zero, shape (k,).
        squared_errors: E_D there, in squared units of the scaled output.
        squared_weights: E_W there, (1).
        counts: numbers N of training pairs and n of weights.

    Returns:
        The logarithm; larger is better, among trainings on the same data.
    """
    samples, weights = counts
    determinant = float(np.sum(np.log(2.0 * (held.beta * eigenvalues + held.alpha))))
    determinant += (weights - eigenvalues.size) * float(np.log(2.0 * held.alpha))
    return (
        -held.beta * squared_errors
        - held.alpha * squared_weights
        + 0.5 * weights * float(np.log(2.0 * held.alpha))
        + 0.5 * samples * float(np.log(held.beta / np.pi))
        - 0.5 * determinant
    )
