"""Training of both networks from a seed: several starts each, of which the one with the largest evidence is kept.

The training can be stopped after any step and resumed from its checkpoint with an identical result.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from identification.neural.checkpoint import Checkpoint
from identification.neural.files import weights_bytes
from identification.neural.levenberg import (
    Outcome,
    Problem,
    Progress,
    advance,
    conclude,
    first_weights,
    one_thread,
)
from identification.neural.network import Network, parameter_count
from identification.neural.networks import Errors, Networks, held_out_errors
from identification.neural.training_set import DAMPING, FREQUENCY, SIZES, DataSpec, training_pairs
from tunnel_sim.files.json_text import json_line

NETWORKS = (DAMPING, FREQUENCY)
_START, _TEST = 0, 2  # purposes of the random generators
_DATA = DataSpec()
_NO_ERRORS = Errors(0.0, 0.0, 0.0, 0.0, 0.0)


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
class Trained:
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
) -> Trained:
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
    before = _work_before(spec, number, start)
    while state.iteration < spec.steps(which) and not state.finished:
        state = advance(state, problem)
        checkpoint = replace(checkpoint, running=state)
        keep(checkpoint)
        progress(before + state.iteration * spec.work(which), name)
    progress(before + spec.steps(which) * spec.work(which), name)
    return Checkpoint((*checkpoint.ended, state), None)


def _work_before(spec: TrainingSpec, number: int, start: int) -> int:
    whole = sum(spec.starts * spec.steps(which) * spec.work(which) for which in NETWORKS[:number])
    return whole + start * spec.steps(NETWORKS[number]) * spec.work(NETWORKS[number])


def _collect(spec: TrainingSpec, checkpoint: Checkpoint) -> Trained:
    best: dict[str, Network] = {}
    described: dict[str, Any] = {}
    for number, which in enumerate(NETWORKS):
        problem = problem_of(spec, which)
        ended = checkpoint.ended[number * spec.starts : (number + 1) * spec.starts]
        concluded = [conclude(progress, problem) for progress in ended]
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
    return Trained(networks, weights, json.loads(json_line(record)))


def _described(progress: Progress, outcome: Outcome) -> dict[str, Any]:
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
