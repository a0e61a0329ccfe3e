"""An interrupted training on disk: safetensors, with the spec it belongs to."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.evidence import Hyperparameters
from identification.neural.levenberg import Progress
from tunnel_sim.json_text import json_line


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """How far a training has come.

    Args:
        ended: trainings that ended, network by network and start by start.
        running: the one that has begun; None between two.
    """

    ended: tuple[Progress, ...] = ()
    running: Progress | None = None

    def to_bytes(self, spec: dict[str, Any]) -> bytes:
        """As safetensors.

        Args:
            spec: of the training, as JSON; read again only for the same one.
        """
        told = [*self.ended, *([] if self.running is None else [self.running])]
        tensors = {f"weights.{number}": one.weights for number, one in enumerate(told)}
        state = [
            [one.held.alpha, one.held.beta, one.damping, one.iteration, one.finished] for one in told
        ]  # Python writes floats so that they read back to the same bits
        document = {"spec": spec, "state": state, "ended": len(self.ended)}
        return save(tensors or {"none": np.zeros(1)}, {"training": json_line(document)})

    @classmethod
    def from_bytes(cls, content: bytes, spec: dict[str, Any]) -> Checkpoint | None:
        """The inverse of `to_bytes`.

        Args:
            content: the file's.
            spec: of the training that is to go on, as JSON.

        Returns:
            None where it is no checkpoint of that spec.
        """
        try:
            # A safetensors file is the length of its header, the header as JSON, and the tensors.
            header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
            document = json.loads(header["__metadata__"]["training"])
            if document["spec"] != json.loads(json_line(spec)):
                return None
            tensors = load(content)
            told = [
                Progress(
                    tensors[f"weights.{number}"], Hyperparameters(alpha, beta), damping, iteration, finished
                )
                for number, (alpha, beta, damping, iteration, finished) in enumerate(document["state"])
            ]
        except (SafetensorError, ValueError, KeyError, TypeError):
            return None
        ended = int(document["ended"])
        return cls(tuple(told[:ended]), told[ended] if len(told) > ended else None)


def read_checkpoint(path: Path, spec: dict[str, Any]) -> Checkpoint | None:
    """A checkpoint of this very training.

    Args:
        path: of the file; need not exist.
        spec: of the training, as JSON.

    Returns:
        None where there is none, or it belongs to another training.
    """
    return Checkpoint.from_bytes(path.read_bytes(), spec) if path.is_file() else None
