"""The training set of a network, and networks that are stored."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load

from identification.neural.three_cycles import cycles_time, network_inputs
from tunnel_sim.files.reading import as_described, parse_json, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
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
        frequency_scale: ``logarithmic`` or ``linear``: how t3 and ωn enter the second network before their mean is
            removed.
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
        """t3 [s] or ωn [rad/s] as the second network takes it, any shape."""
        return np.log(values) if self.frequency_scale == LOGARITHMIC else np.asarray(values)

    def from_network(self, values: Array) -> Array:
        """ωn in rad/s from the second network's output, any shape."""
        return np.exp(values) if self.frequency_scale == LOGARITHMIC else np.asarray(values)


@dataclass(frozen=True, eq=False)
class TrainingPairs:
    """Inputs and targets of one network.

    Args:
        inputs: shape (N, inputs).
        targets: shape (N,).
    """

    inputs: Array
    targets: Array


def training_pairs(spec: DataSpec, which: str) -> TrainingPairs:
    """The training set of a network.

    Args:
        which: ``damping`` or ``frequency``.

    Returns:
        Inputs and targets before scaling.
    """
    if which == DAMPING:
        zeta = np.linspace(*spec.zeta_range, spec.zeta_count)
        return TrainingPairs(network_inputs(zeta), zeta)
    lowest, highest = spec.omega_range
    space = np.geomspace if spec.frequency_scale == LOGARITHMIC else np.linspace
    zeta, omega = (
        axis.ravel()
        for axis in np.meshgrid(
            np.linspace(*spec.zeta_range, spec.grid[0]), space(lowest, highest, spec.grid[1])
        )
    )
    return TrainingPairs(
        np.column_stack((zeta, spec.to_network(cycles_time(zeta, omega)))), spec.to_network(omega)
    )


def held_out_points(spec: DataSpec, rng: np.random.Generator) -> tuple[Array, Array]:
    """Damping ratios and frequencies [rad/s] that no training set holds, shapes (test_count,).

    Half of them are uniform in the logarithm, so that the low ends of the range are tested too.
    """
    found = []
    for low, high in (spec.zeta_range, spec.omega_range):
        even = rng.uniform(low, high, spec.test_count)
        logarithmic = np.exp(rng.uniform(np.log(low), np.log(high), spec.test_count))
        found.append(np.where(rng.random(spec.test_count) < 0.5, even, logarithmic))
    return found[0], found[1]


def read_stored(weights: Path) -> tuple[bytes, bytes]:
    """Read what ``tunnel train`` wrote.

    Args:
        weights: the safetensors file.

    Raises:
        TunnelError: when a file is missing, cannot be read or is too large.
    """
    remedy = "name the .safetensors file that tunnel train wrote, with its .json beside it"
    content = read_regular(weights, limits.WEIGHTS_BYTES, missing=remedy, readable=remedy)
    record = read_regular(weights.with_suffix(".json"), limits.JSON_BYTES, missing=remedy, readable=remedy)
    return content, record


def read_packaged(name: str) -> tuple[bytes, bytes]:
    """Weights and record that come with the package."""
    folder = resources.files("identification") / "neural" / "weights"
    return (folder / f"{name}.safetensors").read_bytes(), (folder / f"{name}.json").read_bytes()


@contextmanager
def open_stored(
    weights: bytes, record: bytes | str, where: str, *, estimator: str
) -> Iterator[tuple[Mapping[str, Array], dict[str, Any]]]:
    """The tensors and the record of two files; what they hold is checked inside the block.

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
        except SafetensorError as error:  # which has no base class but Exception
            raise ValueError(error) from None
        yield tensors, document
