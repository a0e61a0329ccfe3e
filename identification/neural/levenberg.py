"""Full-batch Levenberg–Marquardt in torch float64, with MacKay's evidence for the regularisation.

MacKay's evidence for the regularisation of a network, as Foresee and Hagan use it. The paper's F_reg = γ F_e + (1
− γ) F_w (eq. 14), with F_e the sum of squared errors (eq. 13) and F_w the mean square of the n weights (eq. 15),
is up to a factor

    F = β E_D + α E_W,   E_D = Σ e²,   E_W = Σ w²,   performance ratio γ = β / (β + α n).

With 1/(2β) the variance of the errors and 1/(2α) that of the weights, and λ the eigenvalues of JᵀJ,

    effective number of parameters   γ = Σ βλ / (βλ + α),
    α = γ / (2 E_W),   β = (N − γ) / (2 E_D).

Sources: D. J. C. MacKay, Neural Computation 4 (1992) 415–447, doi 10.1162/neco.1992.4.3.415; F. D. Foresee and
M. T. Hagan, Proc. ICNN'97, 1930–1935, doi 10.1109/ICNN.1997.614194.

Full-batch Levenberg–Marquardt with the evidence's regularisation, in torch float64. Each step solves (βJᵀJ + (α +
μ)I) δ = −(βJᵀe + αw) by the singular values of J, so that γ remains accurate where β is large. A step that lowers
F = βE_D + αE_W is accepted and μ divided by ten; otherwise it is repeated with ten times the μ. After every step α
and β are re-estimated. Sources: Hagan and Menhaj, IEEE Trans. Neural Networks 5 (1994) 989–993, doi
10.1109/72.329697, and those of `identification.neural.levenberg`.

With one thread and a fixed order of operations, the same start gives identical weights on the same machine and
version of torch.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, cast

import numpy as np

from identification.neural.networks import Network, Scaling, parameter_count, split_weights
from identification.neural.training_set import TrainingPairs
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from torch import Tensor


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


def updated_hyperparameters(
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


_FIRST = Hyperparameters(0.01, 1.0)
_FIRST_DAMPING = 5e-3
_LARGEST_DAMPING = 1e10  # of β: steps are then of the order of rounding errors
_SMALLEST_DAMPING = 1e-20  # of β
_FACTOR = 10.0
_STANDS_OUT = 1e-4  # directions with βλ/α below this are left to the prior


@dataclass(frozen=True, eq=False)
class Progress:
    """The state of a training, sufficient to resume it.

    Args:
        weights: shape (n,).
        held: α and β.
        damping: μ; dimensionless.
        iteration: number of steps taken.
        finished: whether no step lowers F any longer.
    """

    weights: Array
    held: Hyperparameters = _FIRST
    damping: float = _FIRST_DAMPING
    iteration: int = 0
    finished: bool = False


@dataclass(frozen=True, eq=False)
class Problem:
    """Scaled training pairs.

    Args:
        sizes: units per layer.
        inputs: scaled, shape (N, inputs).
        targets: scaled, shape (N,).
    """

    sizes: tuple[int, ...]
    inputs: Array
    targets: Array
    input_scaling: Scaling
    output_scaling: Scaling

    @classmethod
    def of(cls, pairs: TrainingPairs, sizes: tuple[int, ...], *, unit_deviation: bool) -> Problem:
        """Scale pairs: zero mean, and unit deviation of the inputs where asked for; of the targets always."""
        inputs, output = Scaling.of(pairs.inputs), Scaling.of(pairs.targets[:, None])
        if not unit_deviation:
            inputs = replace(inputs, deviation=(1.0,) * len(inputs.deviation))
        targets = output.apply(pairs.targets[:, None])[:, 0]
        return cls(sizes, inputs.apply(pairs.inputs), targets, inputs, output)


@dataclass(frozen=True)
class TrainingResult:
    """The result of a training.

    Args:
        held: α and β.
        effective_parameters: γ, a number of parameters.
        rms_error: of the training pairs, scaled (1).
        log_evidence: of α and β, (1).
    """

    held: Hyperparameters
    effective_parameters: float
    rms_error: float
    log_evidence: float


def first_weights(sizes: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Random weights of variance one over the number of a unit's inputs, and biases of deviation 0.3.

    Args:
        sizes: units per layer.
    """
    parts = []
    for before, after in pairwise(sizes):
        parts.append(rng.standard_normal(before * after) / np.sqrt(before))
        parts.append(0.3 * rng.standard_normal(after))
    return np.concatenate(parts)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread inside the context."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _layers(weights: Tensor, sizes: tuple[int, ...]) -> list[tuple[Tensor, Tensor]]:
    # Slicing and reshaping are the same in torch and NumPy.
    return cast("list[tuple[Tensor, Tensor]]", split_weights(cast("Array", weights), sizes))


def outputs_and_jacobian(weights: Tensor, sizes: tuple[int, ...], inputs: Tensor) -> tuple[Tensor, Tensor]:
    """The network's outputs and their derivatives by the weights, in closed form.

    Args:
        weights: shape (n,).
        sizes: units per layer.
        inputs: scaled, shape (N, inputs).

    Returns:
        Outputs, shape (N,), and Jacobian, shape (N, n).
    """
    import torch

    layers = _layers(weights, sizes)
    activations = [inputs]
    for matrix, bias in layers[:-1]:
        activations.append(torch.tanh(activations[-1] @ matrix.T + bias))
    matrix, bias = layers[-1]
    outputs = (activations[-1] @ matrix.T + bias)[:, 0]
    slope = torch.ones((inputs.shape[0], 1), dtype=inputs.dtype)
    parts: list[Tensor] = []
    for (matrix, _), before in zip(reversed(layers), reversed(activations), strict=True):
        parts[:0] = [(slope[:, :, None] * before[:, None, :]).flatten(1), slope]
        if before is not inputs:
            slope = (slope @ matrix) * (1.0 - before**2)
    return outputs, torch.cat(parts, dim=1)


def outputs_only(weights: Tensor, sizes: tuple[int, ...], inputs: Tensor) -> Tensor:
    """The network's outputs, shape (N,); arguments as in `outputs_and_jacobian`."""
    import torch

    layers = _layers(weights, sizes)
    hidden = inputs
    for matrix, bias in layers[:-1]:
        hidden = torch.tanh(hidden @ matrix.T + bias)
    matrix, bias = layers[-1]
    return (hidden @ matrix.T + bias)[:, 0]


def advance_training(progress: Progress, problem: Problem) -> Progress:
    """One step of Levenberg–Marquardt, after a re-estimation of α and β.

    Returns:
        The new state; ``finished`` where no step lowers F.
    """
    import torch

    inputs, targets = torch.from_numpy(problem.inputs), torch.from_numpy(problem.targets)
    weights = torch.from_numpy(progress.weights)
    outputs, jacobian = outputs_and_jacobian(weights, problem.sizes, inputs)
    errors = outputs - targets
    singular, right = torch.linalg.svd(jacobian, full_matrices=False)[1:]
    eigenvalues = singular**2
    squared_errors, squared_weights = float(errors @ errors), float(weights @ weights)
    held = progress.held
    if progress.iteration:
        held = updated_hyperparameters(
            held, eigenvalues.numpy(), squared_errors, squared_weights, problem.targets.size
        )
    gradient = held.beta * (jacobian.T @ errors) + held.alpha * weights
    along = right @ gradient
    rest = gradient - right.T @ along
    cost = held.beta * squared_errors + held.alpha * squared_weights
    damping = max(progress.damping, _SMALLEST_DAMPING * held.beta)
    while damping < _LARGEST_DAMPING * held.beta:
        step = right.T @ (along / (held.beta * eigenvalues + held.alpha + damping))
        moved = weights - step - rest / (held.alpha + damping)
        left = outputs_only(moved, problem.sizes, inputs) - targets
        if float(held.beta * (left @ left) + held.alpha * (moved @ moved)) < cost:
            return Progress(moved.numpy(), held, damping / _FACTOR, progress.iteration + 1)
        damping *= _FACTOR
    return replace(progress, held=held, iteration=progress.iteration + 1, finished=True)


def conclude_training(progress: Progress, problem: Problem) -> tuple[Network, TrainingResult]:
    """The trained network with its posterior, and the result of the training."""
    import torch

    weights = torch.from_numpy(progress.weights)
    outputs, jacobian = outputs_and_jacobian(weights, problem.sizes, torch.from_numpy(problem.inputs))
    errors = outputs.numpy() - problem.targets
    singular, right = torch.linalg.svd(jacobian, full_matrices=False)[1:]
    eigenvalues, held = singular.numpy() ** 2, progress.held
    kept = held.beta * eigenvalues > _STANDS_OUT * held.alpha
    network = Network(
        sizes=problem.sizes,
        weights=progress.weights,
        inputs=problem.input_scaling,
        output=problem.output_scaling,
        directions=np.ascontiguousarray(right.numpy()[kept]),
        precision=2.0 * (held.beta * eigenvalues[kept] + held.alpha),
        prior_precision=2.0 * held.alpha,
    )
    squares = float(errors @ errors), float(progress.weights @ progress.weights)
    counts = problem.targets.size, parameter_count(problem.sizes)
    return network, TrainingResult(
        held,
        held.effective_parameters(eigenvalues),
        float(np.sqrt(squares[0] / errors.size)),
        log_evidence(held, eigenvalues, *squares, counts),
    )
