"""The checkpoint of a training as safetensors, with the specification it belongs to."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.evidence import Hyperparameters
from identification.neural.levenberg import Progress
from identification.neural.network import parameter_count
from identification.neural.training_set import SIZES
from tunnel_sim.files.json_text import json_line
from tunnel_sim.files.reading import parse_json, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_LARGEST = 1e20
"""Largest weight, α, β and μ, and one over the smallest α and β: with these no product of a step overflows."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The progress of a training.

    Args:
        ended: finished trainings, network by network and start by start.
        running: the current training; None between two.
    """

    ended: tuple[Progress, ...] = ()
    running: Progress | None = None

    def to_bytes(self, spec: dict[str, Any]) -> bytes:
        """As safetensors.

        Args:
            spec: of the training, as JSON; the checkpoint is valid only for the same one.
        """
        kept = [*self.ended, *([] if self.running is None else [self.running])]
        tensors = {f"weights.{number}": one.weights for number, one in enumerate(kept)}
        state = [
            [one.held.alpha, one.held.beta, one.damping, one.iteration, one.finished] for one in kept
        ]  # Python writes floats so that they are read back exactly
        document = {"spec": spec, "state": state, "ended": len(self.ended)}
        return save(tensors or {"none": np.zeros(1)}, {"training": json_line(document)})

    @classmethod
    def from_bytes(cls, content: bytes, spec: dict[str, Any]) -> Checkpoint | None:
        """The inverse of `to_bytes`.

        Args:
            spec: of the training to be resumed, as JSON.

        Returns:
            The progress; None where it is not a checkpoint of that specification.
        """
        try:
            # A safetensors file is the length of its header, the header as JSON, and the tensors.
            header = parse_json(content[8 : 8 + int.from_bytes(content[:8], "little")], "header", "")
            document = parse_json(header["__metadata__"]["training"], "training", "")
            if document["spec"] != json.loads(json_line(spec)):
                return None
            tensors = load(content)
            kept = [_progress(tensors[f"weights.{at}"], one) for at, one in enumerate(document["state"])]
            ended = document["ended"]
            if not isinstance(ended, int) or not max(0, len(kept) - 1) <= ended <= len(kept):
                return None
        except (SafetensorError, TunnelError, ValueError, LookupError, TypeError, AttributeError):
            return None
        return cls(tuple(kept[:ended]), kept[ended] if len(kept) > ended else None)


def _progress(weights: Array, state: Sequence[float]) -> Progress:
    """The progress of one training; raises ValueError or TypeError for a malformed file."""
    alpha, beta, damping, iteration, finished = state
    numbers = np.array([alpha, beta, damping], dtype=np.float64)
    if weights.size not in map(parameter_count, SIZES.values()) or weights.dtype != np.float64:
        raise ValueError("weights of another network")
    # Comparisons with NaN are false.
    if not (
        np.abs(weights).max() <= _LARGEST and numbers.max() <= _LARGEST and min(alpha, beta) >= 1.0 / _LARGEST
    ):
        raise ValueError("out of range")
    if not damping >= 0.0:
        raise ValueError("a negative damping")
    if not isinstance(iteration, int) or iteration < 0 or not isinstance(finished, bool | int):
        raise TypeError("not a number of steps")
    return Progress(weights, Hyperparameters(alpha, beta), damping, iteration, bool(finished))


def read_checkpoint(path: Path, spec: dict[str, Any]) -> Checkpoint | None:
    """Read the checkpoint of a training.

    Args:
        path: of the file; need not exist.
        spec: of the training, as JSON.

    Returns:
        None where there is none, or it belongs to another training.

    Raises:
        TunnelError: when the file exists but cannot be read.
    """
    return Checkpoint.from_bytes(read_regular(path, limits.WEIGHTS_BYTES), spec) if path.exists() else None
