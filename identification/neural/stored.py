"""The two files of trained networks: weights as safetensors, and their record as JSON beside them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from tunnel_sim.files.reading import read_regular
from tunnel_sim.vocabulary import limits


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


def packaged(name: str) -> tuple[bytes, bytes]:
    """Weights and record that come with the package."""
    folder = resources.files("identification") / "neural" / "weights"
    return (folder / f"{name}.safetensors").read_bytes(), (folder / f"{name}.json").read_bytes()
