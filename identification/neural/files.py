"""Weights as safetensors, with the training record beside them as JSON, without pickle.

The packaged ones are ``paper.safetensors`` and ``paper.json`` in ``identification/neural/weights``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save

from identification.neural.network import Network, Scaling, parameter_count
from identification.neural.networks import Errors, Networks
from identification.neural.stored import opened, packaged, read_stored
from identification.neural.training_set import DAMPING, FREQUENCY, SIZES, DataSpec
from tunnel_sim.vocabulary.record import Array

SHIPPED = "paper"
_FIELDS = ("weights", "directions", "precision", "prior_precision", "inputs", "output")


def weights_bytes(damping: Network, frequency: Network) -> bytes:
    """Both networks with their posteriors and scalings as safetensors.

    Args:
        damping: the first.
    """
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
    """Read networks written by ``tunnel train``.

    Args:
        weights: the safetensors file; its record is the ``.json`` of the same name beside it.

    Raises:
        TunnelError: when a file is missing or malformed, or the two do not belong together.
    """
    return networks_of(*read_stored(weights), str(weights))


@cache
def shipped_networks() -> Networks:
    """The packaged networks."""
    return networks_of(*packaged(SHIPPED), SHIPPED)


def shipped_record() -> dict[str, Any]:
    """The training record of the packaged networks."""
    found: dict[str, Any] = json.loads(packaged(SHIPPED)[1])
    return found


def networks_of(weights: bytes, record: bytes | str, where: str) -> Networks:
    """Networks from the contents of their two files.

    Args:
        weights: safetensors.
        record: JSON.

    Raises:
        TunnelError: when they are malformed, or do not belong together.
    """
    with opened(weights, record, where, estimator="neural_network") as (tensors, document):
        spec, errors = DataSpec.from_json_dict(document["data"]), Errors.from_json_dict(document["errors"])
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
