"""Training of both networks from a seed: several starts each, of which the one with the largest evidence is kept.

The checkpoint of a training as safetensors, with the specification it belongs to. The training can be stopped
after any step and resumed from its checkpoint with an identical result.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.levenberg import (
    Hyperparameters,
    Problem,
    Progress,
    TrainingResult,
    advance_training,
    conclude_training,
    first_weights,
    one_thread,
)
from identification.neural.networks import (
    Network,
    NetworkErrors,
    Networks,
    held_out_errors,
    parameter_count,
    weights_bytes,
)
from identification.neural.training_set import DAMPING, FREQUENCY, SIZES, DataSpec, training_pairs
from tunnel_sim.files.reading import parse_json, read_regular
from tunnel_sim.files.writing import json_line
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


NETWORKS = (DAMPING, FREQUENCY)
_START, _TEST = 0, 2  # purposes of the random generators
_DATA = DataSpec()
_NO_ERRORS = NetworkErrors(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class TrainingSpec:
    """Everything a training depends on.

    Args:
        seed: of the first weights, the noise and the test set.
        starts: number of trainings of each network, from different weights.
        damping_steps: number of Levenberg–Marquardt steps of the first network, at most.
        frequency_steps: number of those of the second.
    """

    seed: int = 1
    data: DataSpec = _DATA
    starts: int = 3
    damping_steps: int = 400
    frequency_steps: int = 3000

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name."""
        return asdict(self)

    def steps(self, which: str) -> int:
        """Steps of a network's training, at most."""
        return self.damping_steps if which == DAMPING else self.frequency_steps

    def work(self, which: str) -> int:
        """Cost of a step, in steps of the second network."""
        if which == FREQUENCY:
            return 1
        return max(1, self.data.zeta_count * parameter_count(SIZES[DAMPING]) // 12_000)

    @property
    def total_work(self) -> int:
        """Cost of all steps."""
        return sum(self.starts * self.steps(which) * self.work(which) for which in NETWORKS)


@dataclass(frozen=True)
class TrainedNetworks:
    """The result of a training.

    Args:
        weights: the safetensors file.
        record: the training record.
    """

    networks: Networks
    weights: bytes
    record: dict[str, Any]


def train(
    spec: TrainingSpec,
    *,
    resume: Checkpoint | None = None,
    progress: Callable[[int, str], None] = lambda _done, _text: None,
    keep: Callable[[Checkpoint], None] = lambda _checkpoint: None,
) -> TrainedNetworks:
    """Train both networks.

    Args:
        resume: progress of an interrupted training of the same specification.
        progress: called after every step with the work done and a description.
        keep: called with a checkpoint after every step; an exception from it ends the training.
    """
    checkpoint = resume or Checkpoint()
    with one_thread():
        for number, which in enumerate(NETWORKS):
            problem = problem_of(spec, which)
            for start in range(spec.starts):
                if len(checkpoint.ended) > number * spec.starts + start:
                    continue
                checkpoint = _one_start(spec, (number, start), problem, checkpoint, progress, keep)
        return _collect(spec, checkpoint)


def problem_of(spec: TrainingSpec, which: str) -> Problem:
    """The scaled training pairs of a network.

    Args:
        which: ``damping`` or ``frequency``.
    """
    return Problem.of(training_pairs(spec.data, which), SIZES[which], unit_deviation=which == FREQUENCY)


def _one_start(
    spec: TrainingSpec,
    place: tuple[int, int],
    problem: Problem,
    checkpoint: Checkpoint,
    progress: Callable[[int, str], None],
    keep: Callable[[Checkpoint], None],
) -> Checkpoint:
    number, start = place
    which, name = NETWORKS[number], f"{NETWORKS[number]} network, start {start + 1} of {spec.starts}"
    state = checkpoint.running
    if state is None:
        state = Progress(
            first_weights(problem.sizes, np.random.default_rng([spec.seed, _START, number, start]))
        )
    whole = sum(spec.starts * spec.steps(which) * spec.work(which) for which in NETWORKS[:number])
    before = whole + start * spec.steps(NETWORKS[number]) * spec.work(NETWORKS[number])
    while state.iteration < spec.steps(which) and not state.finished:
        state = advance_training(state, problem)
        checkpoint = replace(checkpoint, running=state)
        keep(checkpoint)
        progress(before + state.iteration * spec.work(which), name)
    progress(before + spec.steps(which) * spec.work(which), name)
    return Checkpoint((*checkpoint.ended, state), None)


def _collect(spec: TrainingSpec, checkpoint: Checkpoint) -> TrainedNetworks:
    best: dict[str, Network] = {}
    described: dict[str, Any] = {}
    for number, which in enumerate(NETWORKS):
        problem = problem_of(spec, which)
        ended = checkpoint.ended[number * spec.starts : (number + 1) * spec.starts]
        concluded = [conclude_training(progress, problem) for progress in ended]
        chosen = int(np.argmax([outcome.log_evidence for _, outcome in concluded]))
        best[which] = concluded[chosen][0]
        described[which] = {
            "sizes": list(SIZES[which]),
            "parameters": parameter_count(SIZES[which]),
            "training_pairs": int(problem.targets.size),
            "chosen_start": chosen + 1,
            "starts": [_described(*pair) for pair in zip(ended, (o for _, o in concluded), strict=True)],
        }
    untested = Networks(best[DAMPING], best[FREQUENCY], spec.data, _NO_ERRORS)
    networks = replace(untested, errors=held_out_errors(untested, np.random.default_rng([spec.seed, _TEST])))
    weights = weights_bytes(best[DAMPING], best[FREQUENCY])
    record = {
        **spec.to_json_dict(),
        "networks": described,
        "errors": asdict(networks.errors),
        "versions": {
            name: version(name) for name in ("virtual-wind-tunnel", "torch", "numpy", "safetensors")
        },
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
    }
    return TrainedNetworks(networks, weights, json.loads(json_line(record)))


def _described(progress: Progress, outcome: TrainingResult) -> dict[str, Any]:
    return {
        "steps": progress.iteration,
        "stopped_because": "no step lowers F" if progress.finished else "all steps taken",
        "alpha": outcome.held.alpha,
        "beta": outcome.held.beta,
        "effective_parameters": outcome.effective_parameters,
        "performance_ratio": outcome.held.performance_ratio(progress.weights.size),
        "rms_error_scaled": outcome.rms_error,
        "log_evidence": outcome.log_evidence,
    }
