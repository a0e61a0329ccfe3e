"""The trained networks as safetensors, with their record beside them as JSON, without pickle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save

from identification.neural.posterior.network import shapes
from identification.neural.stored import opened, packaged, read_stored
from tunnel_sim.vocabulary.record import Array

SHIPPED = "posterior"
KINDS = ("record", "campaign")


@dataclass(frozen=True, eq=False)
class Trained:
    """One network with its threshold.

    Args:
        weights: as `network.shapes`, and the scalings.
        centre: mean context of the training samples, shape (c,).
        precision: inverse covariance of it, shape (c, c).
        threshold: squared distance above which a sample is unlike anything trained on.
        effects: names of the effects in the order of their probabilities.
    """

    weights: Mapping[str, Array]
    centre: Array
    precision: Array
    threshold: float
    effects: tuple[str, ...]

    def distance(self, context: Array) -> Array:
        """Squared Mahalanobis distance of contexts from the training samples, shape (b,)."""
        away = context - self.centre
        return np.asarray(np.einsum("bi,ij,bj->b", away, self.precision, away))


def to_bytes(networks: Mapping[str, Trained]) -> bytes:
    """Both networks as safetensors, in single precision."""
    tensors: dict[str, Array] = {}
    for kind in KINDS:
        one = networks[kind]
        values = {**one.weights, "unlike.centre": one.centre, "unlike.precision": one.precision}
        tensors |= {
            f"{kind}/{name}": np.ascontiguousarray(value, np.float32) for name, value in values.items()
        }
    return save(tensors)


def read_trained(path: Path) -> dict[str, Trained]:
    """Read networks that ``tunnel train`` wrote.

    Args:
        path: the safetensors file; its record is the ``.json`` of the same name beside it.

    Raises:
        TunnelError: when a file is missing or malformed, or the two do not belong together.
    """
    return trained_of(*read_stored(path), str(path))


@cache
def shipped() -> dict[str, Trained]:
    """The packaged networks."""
    return trained_of(*packaged(SHIPPED), SHIPPED)


def trained_of(weights: bytes, record: bytes, where: str) -> dict[str, Trained]:
    """Networks from the contents of their two files.

    Raises:
        TunnelError: when they are malformed, or do not belong together.
    """
    with opened(weights, record, where, estimator="neural_posterior") as (tensors, document):
        return {kind: _one(tensors, kind, document) for kind in KINDS}


def _one(tensors: Mapping[str, Array], kind: str, document: Mapping[str, Any]) -> Trained:
    own = {
        name.removeprefix(f"{kind}/"): np.asarray(value, dtype=np.float64)
        for name, value in tensors.items()
        if name.startswith(f"{kind}/")
    }
    stated = document["networks"][kind]
    expected = shapes(
        *(stated["sizes"][name] for name in ("rivals", "features", "runs", "quantities", "effects"))
    )
    for name, shape in expected.items():
        if own[name].shape != shape:
            raise ValueError(name)
    if not all(np.all(np.isfinite(value)) for value in own.values()):
        raise ValueError(kind)
    centre, precision = own.pop("unlike.centre"), own.pop("unlike.precision")
    return Trained(own, centre, precision, float(stated["threshold"]), tuple(document["effects"]))
