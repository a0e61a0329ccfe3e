"""The paper's networks in NumPy: their training sets, values, gradients and posteriors, and the files of weights.

Source of the architecture: the paper, section II.B (100-5-5-1 and 2-2-5-1); tanh layers with a linear output.
Weights are stored as safetensors, with the training record beside them as JSON, without pickle.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import pairwise
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.three_cycles import cycles_time, network_inputs
from tunnel_sim.files.reading import as_described, parse_json, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.quantities import RadPerS, Seconds, Vector
from tunnel_sim.vocabulary.record import Array

DAMPING, FREQUENCY = "damping", "frequency"
SIZES = {DAMPING: (100, 5, 5, 1), FREQUENCY: (2, 2, 5, 1)}
LOGARITHMIC, LINEAR = "logarithmic", "linear"


@dataclass(frozen=True)
class DataSpec:
    """Range and number of the impulse responses.

    Args:
        zeta_range: damping ratios, the paper's 0.001 to 0.35 (1).
        omega_range: natural frequencies, the paper's 0.4 to 26 rad/s.
        zeta_count: number of damping ratios of the first network's set, evenly spaced.
        grid: numbers of damping ratios and of natural frequencies of the second network's set.
        frequency_scale: form in which t3 and ωn enter the second network before their mean is removed.
        test_count: number of responses of the test set, drawn at random over the range.
    """

    zeta_range: tuple[float, float] = (0.001, 0.35)
    omega_range: tuple[float, float] = (0.4, 26.0)
    zeta_count: int = 300
    grid: tuple[int, int] = (12, 40)
    frequency_scale: str = LOGARITHMIC
    test_count: int = 4000

    @classmethod
    def from_json_dict(cls, data: dict[str, Any]) -> DataSpec:
        """From the fields by name; raises ValueError, TypeError or KeyError for a malformed document."""
        pairs = {name: tuple(data[name]) for name in ("zeta_range", "omega_range", "grid")}
        for low, high in (pairs["zeta_range"], pairs["omega_range"], pairs["grid"]):
            if not (0.0 < float(low) < inf and 0.0 < float(high) < inf):
                raise ValueError("an empty range")
        if data["frequency_scale"] not in (LOGARITHMIC, LINEAR):
            raise ValueError("an unknown scale")
        return cls(**{**data, **pairs})

    def to_network(self, values: Array) -> Array:
        """t3 [s] or ωn [rad/s] in the form used by the second network, any shape."""
        return np.log(values) if self.frequency_scale == LOGARITHMIC else np.asarray(values)


def training_pairs(spec: DataSpec, which: str) -> tuple[Array, Array]:
    """Inputs, shape (N, inputs), and targets, shape (N,), of the training set of ``damping`` or ``frequency``."""
    if which == DAMPING:
        zeta = np.linspace(*spec.zeta_range, spec.zeta_count)
        return network_inputs(zeta), zeta
    space = np.geomspace if spec.frequency_scale == LOGARITHMIC else np.linspace
    axes = np.linspace(*spec.zeta_range, spec.grid[0]), space(*spec.omega_range, spec.grid[1])
    zeta, omega = (axis.ravel() for axis in np.meshgrid(*axes))
    return np.column_stack((zeta, spec.to_network(cycles_time(zeta, omega)))), spec.to_network(omega)


def held_out_points(spec: DataSpec, rng: np.random.Generator) -> tuple[Array, Array]:
    """Damping ratios and frequencies [rad/s] outside every training set, shapes (test_count,).

    Half of the points are uniform in the logarithm, so that the low ends of the range are tested too.
    """
    found = []
    for low, high in (spec.zeta_range, spec.omega_range):
        even = rng.uniform(low, high, spec.test_count)
        logarithmic = np.exp(rng.uniform(np.log(low), np.log(high), spec.test_count))
        found.append(np.where(rng.random(spec.test_count) < 0.5, even, logarithmic))
    return found[0], found[1]


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
        weights: matrix (row by row) and bias of each layer in turn, shape (n,).
        directions: eigenvectors of the data's information that are significant compared with the prior, shape
            (k, n).
        precision: posterior precision along each of them, shape (k,).
        prior_precision: of the weights along all other directions, 2α; dimensionless, like the scaled quantities.
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
        layers = split_weights(self.weights, self.sizes)
        for matrix, bias in layers[:-1]:
            hidden = np.tanh(hidden @ matrix.T + bias)
        matrix, bias = layers[-1]
        scaled = (hidden @ matrix.T + bias)[:, 0]
        return np.asarray(scaled * self.output.deviation[0] + self.output.mean[0])

    def input_gradient(self, inputs: Array) -> Array:
        """Derivative of the output with respect to its inputs at one point, shape (inputs,): the same shape."""
        return self._backward(inputs)[0]

    def posterior_std(self, inputs: Array) -> float:
        """√(gᵀ A⁻¹ g) at one point of shape (inputs,), in the output's unit; A = 2βJᵀJ + 2α (MacKay 1992)."""
        jacobian = self._backward(inputs)[1]
        along = self.directions @ jacobian
        rest = jacobian - self.directions.T @ along
        variance = float(np.sum(along**2 / self.precision)) + float(rest @ rest) / self.prior_precision
        return float(np.sqrt(variance)) * self.output.deviation[0]

    def _backward(self, inputs: Array) -> tuple[Array, Array]:
        # Derivatives of the output by the inputs, in units, and of the scaled output by the weights.
        layers = split_weights(self.weights, self.sizes)
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
    """Number of weights and biases of the units per layer."""
    return sum((before + 1) * after for before, after in pairwise(sizes))


def split_weights(weights: Vector, sizes: Sequence[int]) -> list[tuple[Array, Array]]:
    """Matrix (after, before) and bias (after,) of each layer, as views."""
    layers, place = [], 0
    for before, after in pairwise(sizes):
        matrix = weights[place : place + before * after].reshape(after, before)
        place += before * after
        layers.append((matrix, weights[place : place + after]))
        place += after
    return layers


@dataclass(frozen=True)
class NetworkErrors:
    """The errors of the networks over their range, noise-free.

    Args:
        zeta: largest absolute error of ζ, (1).
        zeta_rms: root mean square error of ζ, (1).
        zeta_relative: largest error of ζ over ζ, ratio.
        omega_relative: largest error of ωn over ωn, ratio.
        omega_relative_rms: root mean square of ωn's relative error, ratio.
    """

    zeta: float
    zeta_rms: float
    zeta_relative: float
    omega_relative: float
    omega_relative_rms: float

    @classmethod
    def from_json_dict(cls, data: dict[str, Any]) -> NetworkErrors:
        """From the fields by name; raises ValueError or TypeError for a malformed document."""
        if not all(isinstance(value, float | int) and isfinite(value) for value in data.values()):
            raise ValueError("an error that is not a finite number")
        return cls(**data)


@dataclass(frozen=True, eq=False)
class Networks:
    """Both networks: 100-5-5-1 from shape to ζ, and 2-2-5-1 from ζ and t3 to ωn."""

    damping: Network
    frequency: Network
    spec: DataSpec
    errors: NetworkErrors

    def zeta(self, inputs: Array) -> Array:
        """ζ of normalised shapes, shape (n, 100): shape (n,)."""
        return self.damping.value(inputs)

    def omega_n(self, zeta: Vector, t3: Array) -> Array:
        """ωn in rad/s.

        Args:
            t3: time of three damped cycles, s, shape (n,).
        """
        found = self.frequency.value(np.column_stack((zeta, self.spec.to_network(t3))))
        return np.exp(found) if self.spec.frequency_scale == LOGARITHMIC else np.asarray(found)

    def omega_slopes(self, zeta: float, t3: Seconds) -> tuple[float, float]:
        """∂ωn/∂ζ [rad/s] and ∂ωn/∂t3 [rad/s²].

        Args:
            zeta: damping ratio.
        """
        point = np.array([zeta, float(self.spec.to_network(np.array(t3)))])
        by_zeta, by_time = self.frequency.input_gradient(point)
        if self.spec.frequency_scale == "linear":
            return float(by_zeta), float(by_time)
        omega = float(self.omega_n(np.array([zeta]), np.array([t3]))[0])
        return float(by_zeta) * omega, float(by_time) * omega / t3

    def own_stds(self, zeta: float, t3: Seconds) -> tuple[float, float]:
        """Standard deviations due to the networks: of ζ and, relative, of ωn.

        They combine the posterior of the weights, at the noise-free response of this ζ, and the largest error of
        the test set as the half-width of a rectangular distribution (GUM 4.3.7).

        Args:
            zeta: damping ratio.
        """
        inside = float(np.clip(zeta, *self.spec.zeta_range))
        of_zeta = self.damping.posterior_std(network_inputs(np.array([inside]))[0])
        point = np.array([inside, float(self.spec.to_network(np.array(t3)))])
        of_omega = self.frequency.posterior_std(point)
        if self.spec.frequency_scale == "linear":
            of_omega /= float(self.omega_n(np.array([zeta]), np.array([t3]))[0])
        floor, omega_floor = self.errors.zeta / np.sqrt(3.0), self.errors.omega_relative / np.sqrt(3.0)
        return float(np.hypot(of_zeta, floor)), float(np.hypot(of_omega, omega_floor))

    def trained_for(self, zeta: float, omega_n: RadPerS) -> bool:
        """Whether ζ and ωn are in the training range.

        Args:
            zeta: damping ratio.
        """
        (low, high), (slow, fast) = self.spec.zeta_range, self.spec.omega_range
        return low <= zeta <= high and slow <= omega_n <= fast


def held_out_errors(networks: Networks, rng: np.random.Generator) -> NetworkErrors:
    """Errors on responses outside the training set; the second network uses the ζ of the first."""
    zeta, omega = held_out_points(networks.spec, rng)
    found = networks.zeta(network_inputs(zeta))
    error = found - zeta
    relative = networks.omega_n(found, cycles_time(zeta, omega)) / omega - 1.0
    return NetworkErrors(
        zeta=float(np.abs(error).max()),
        zeta_rms=float(np.sqrt(np.mean(error**2))),
        zeta_relative=float(np.abs(error / zeta).max()),
        omega_relative=float(np.abs(relative).max()),
        omega_relative_rms=float(np.sqrt(np.mean(relative**2))),
    )


def read_stored(weights: Path) -> tuple[bytes, bytes]:
    """Weights and record from ``tunnel train``: a safetensors file, and the ``.json`` of the same name."""
    remedy = "name the .safetensors file that tunnel train wrote, with its .json beside it"
    content = read_regular(weights, limits.WEIGHTS_BYTES, missing=remedy, readable=remedy)
    beside = weights.with_suffix(".json")
    return content, read_regular(beside, limits.JSON_BYTES, missing=remedy, readable=remedy)


def read_packaged(name: str) -> tuple[bytes, bytes]:
    """Weights and record that come with the package."""
    folder = resources.files("identification") / "neural" / "weights"
    return (folder / f"{name}.safetensors").read_bytes(), (folder / f"{name}.json").read_bytes()


@contextmanager
def open_stored(
    weights: bytes, record: bytes | str, where: str, *, estimator: str
) -> Iterator[tuple[Mapping[str, Array], dict[str, Any]]]:
    """The tensors and the record of two files; their contents are checked inside the block.

    Raises:
        TunnelError: when they are malformed, or do not belong together.
    """
    remedy = f"train them again with tunnel train --estimator {estimator}"
    document = parse_json(record, where, remedy)
    with as_described(f"not the weights and training record of {estimator}", where, remedy):
        if document["weights_sha256"] != hashlib.sha256(weights).hexdigest():
            raise TunnelError(
                "weights and training record do not belong together", where=where, remedy=remedy
            )
        try:
            tensors = load(weights)
        except SafetensorError as error:  # its only base class is Exception
            raise ValueError(error) from None
        yield tensors, document


SHIPPED = "paper"
_FIELDS = ("weights", "directions", "precision", "prior_precision", "inputs", "output")


def weights_bytes(damping: Network, frequency: Network) -> bytes:
    """Both networks with their posteriors and scalings as safetensors."""
    tensors: dict[str, Array] = {}
    for name, network in ((DAMPING, damping), (FREQUENCY, frequency)):
        values = {
            "weights": network.weights,
            "directions": network.directions,
            "precision": network.precision,
            "prior_precision": np.array([network.prior_precision]),
            "inputs": np.array([network.inputs.mean, network.inputs.deviation]),
            "output": np.array([network.output.mean, network.output.deviation]),
        }
        tensors |= {f"{name}.{field}": np.ascontiguousarray(values[field]) for field in _FIELDS}
    return save(tensors)


def read_networks(weights: Path) -> Networks:
    """Read networks written by ``tunnel train``, as `read_stored` does."""
    return networks_of(*read_stored(weights), str(weights))


@cache
def shipped_networks() -> Networks:
    """The packaged networks."""
    return networks_of(*read_packaged(SHIPPED), SHIPPED)


def shipped_record() -> dict[str, Any]:
    """The training record of the packaged networks."""
    found: dict[str, Any] = json.loads(read_packaged(SHIPPED)[1])
    return found


def networks_of(weights: bytes, record: bytes | str, where: str) -> Networks:
    """Networks from safetensors and the JSON of their training record."""
    with open_stored(weights, record, where, estimator="neural_network") as (tensors, document):
        spec = DataSpec.from_json_dict(document["data"])
        errors = NetworkErrors.from_json_dict(document["errors"])
        return Networks(_network(tensors, DAMPING), _network(tensors, FREQUENCY), spec, errors)


def _network(tensors: Mapping[str, Array], name: str) -> Network:
    values = {field: np.asarray(tensors[f"{name}.{field}"], dtype=np.float64) for field in _FIELDS}
    count = parameter_count(SIZES[name])
    if values["weights"].shape != (count,) or values["directions"].shape != (values["precision"].size, count):
        raise ValueError(name)
    if not all(np.all(np.isfinite(value)) for value in values.values()):
        raise ValueError(name)
    ends = {"inputs": (2, SIZES[name][0]), "output": (2, 1), "prior_precision": (1,)}
    if any(values[field].shape != shape for field, shape in ends.items()):
        raise ValueError(name)
    scales = (values["inputs"][1], values["output"][1], values["precision"], values["prior_precision"])
    if not all(np.all(scale > 0.0) for scale in scales):
        raise ValueError(name)
    inputs, output = (
        Scaling(tuple(values[end][0].tolist()), tuple(values[end][1].tolist()))
        for end in ("inputs", "output")
    )
    return Network(
        sizes=SIZES[name],
        weights=values["weights"],
        inputs=inputs,
        output=output,
        directions=values["directions"],
        precision=values["precision"],
        prior_precision=float(values["prior_precision"][0]),
    )
