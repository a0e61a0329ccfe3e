"""The two files of trained networks: weights as safetensors, and their record as JSON beside them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.numpy import load

from tunnel_sim.files.reading import as_described, parse_json, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array


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
