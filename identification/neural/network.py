"""A feed-forward network of tanh layers with a linear output, in NumPy: value, input gradient, weight Jacobian.

Source of the architecture: the paper, section II.B (100-5-5-1 and 2-2-5-1); inputs and output are scaled to zero
mean, the second network's inputs to unit deviation as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class Scaling:
    """An affine scaling to zero mean and unit deviation.

    Args:
        mean: shape (n,).
        deviation: shape (n,); 1 where only the mean is removed.
    """

    mean: tuple[float, ...]
    deviation: tuple[float, ...]

    @classmethod
    def of(cls, values: Array) -> Scaling:
        """The scaling of training values, shape (N, n)."""
        return cls(tuple(values.mean(axis=0).tolist()), tuple(values.std(axis=0).tolist()))

    def apply(self, values: Array) -> Array:
        """Scaled values, same shape."""
        return np.asarray((values - np.array(self.mean)) / np.array(self.deviation))


@dataclass(frozen=True, eq=False)
class Network:
    """A trained network with the posterior of its weights.

    Args:
        sizes: units per layer, inputs first, one output.
        weights: matrix (row by row) and bias of each layer in turn, shape (n,).
        directions: eigenvectors of the data's information that stand out of the prior, shape (k, n).
        precision: posterior precision along each of them, shape (k,).
        prior_precision: of the weights along all others, 2α; dimensionless, as the scaled quantities are.
    """

    sizes: tuple[int, ...]
    weights: Array
    inputs: Scaling
    output: Scaling
    directions: Array
    precision: Array
    prior_precision: float

    def value(self, inputs: Array) -> Array:
        """The outputs, shape (N,), in their unit, for rows of inputs, shape (N, inputs)."""
        hidden = self.inputs.apply(inputs)
        layers = split(self.weights, self.sizes)
        for matrix, bias in layers[:-1]:
            hidden = np.tanh(hidden @ matrix.T + bias)
        matrix, bias = layers[-1]
        scaled = (hidden @ matrix.T + bias)[:, 0]
        return np.asarray(scaled * self.output.deviation[0] + self.output.mean[0])

    def input_gradient(self, inputs: Array) -> Array:
        """Derivative of the output by its inputs at one point, shape (inputs,): the same shape."""
        return self._backward(inputs)[0]

    def posterior_std(self, inputs: Array) -> float:
        """Standard deviation of the output from the weights' posterior at one point, in the output's unit.

        Args:
            inputs: shape (inputs,).

        Returns:
            √(gᵀ A⁻¹ g) with g the output's derivative by the weights and A = 2βJᵀJ + 2α (MacKay 1992).
        """
        jacobian = self._backward(inputs)[1]
        along = self.directions @ jacobian
        rest = jacobian - self.directions.T @ along
        variance = float(np.sum(along**2 / self.precision)) + float(rest @ rest) / self.prior_precision
        return float(np.sqrt(variance)) * self.output.deviation[0]

    def _backward(self, inputs: Array) -> tuple[Array, Array]:
        # Derivatives of the output by the inputs, in units, and of the scaled output by the weights.
        layers = split(self.weights, self.sizes)
        activations = [self.inputs.apply(inputs)]
        for matrix, bias in layers[:-1]:
            activations.append(np.tanh(matrix @ activations[-1] + bias))
        slope: Array = np.ones(1)
        parts: list[Array] = []
        for (matrix, _), before in zip(reversed(layers), reversed(activations), strict=True):
            parts[:0] = [np.outer(slope, before).ravel(), slope]
            slope = matrix.T @ slope
            if before is not activations[0]:
                slope = slope * (1.0 - before**2)
        by_inputs = slope / np.array(self.inputs.deviation) * self.output.deviation[0]
        return by_inputs, np.concatenate(parts)


def parameter_count(sizes: Sequence[int]) -> int:
    """Number of weights and biases.

    Args:
        sizes: units per layer.
    """
    return sum((before + 1) * after for before, after in pairwise(sizes))


def split(weights: Array, sizes: Sequence[int]) -> list[tuple[Array, Array]]:
    """The vector of weights as matrices and biases.

    Args:
        weights: shape (n,).
        sizes: units per layer.

    Returns:
        Matrix (after, before) and bias (after,) of each layer; views.
    """
    layers, place = [], 0
    for before, after in pairwise(sizes):
        matrix = weights[place : place + before * after].reshape(after, before)
        place += before * after
        layers.append((matrix, weights[place : place + after]))
        place += after
    return layers
