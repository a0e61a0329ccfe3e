"""Training of both networks from a seed: the one of largest evidence among several starts is chosen for each.

Full-batch Levenberg–Marquardt in torch float64, on one thread and in a fixed order: the same start gives identical
weights on the same machine and version of torch, also after resuming from a checkpoint.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.networks import (
    DAMPING,
    FREQUENCY,
    SIZES,
    DataSpec,
    Network,
    NetworkErrors,
    Networks,
    Scaling,
    held_out_errors,
    parameter_count,
    split_weights,
    training_pairs,
    weights_bytes,
)
from tunnel_sim.files.reading import parse_json, read_regular
from tunnel_sim.files.writing import json_line
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.quantities import Vector
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class Hyperparameters:
    """The weights α and β of F = β E_D + α E_W, with E_D = Σ e² and E_W = Σ w², by MacKay's evidence.

    Up to a factor F is the paper's F_reg = γ F_e + (1 − γ) F_w (eq. 14). The variance of the errors is 1/(2β), and
    of the weights 1/(2α). Sources: D. J. C. MacKay, Neural Computation 4 (1992) 415–447, doi
    10.1162/neco.1992.4.3.415; F. D. Foresee and M. T. Hagan, Proc. ICNN'97, 1930–1935, doi
    10.1109/ICNN.1997.614194.

    Args:
        alpha: α, weight of the squared network weights; dimensionless, for scaled quantities.
        beta: β, weight of the squared errors; dimensionless, for scaled quantities.
    """

    alpha: float
    beta: float

    def performance_ratio(self, weights: int) -> float:
        """The paper's γ of eq. 14, for a number of weights and biases."""
        return self.beta / (self.beta + self.alpha * weights)

    def effective_parameters(self, eigenvalues: Array) -> float:
        """γ = Σ βλ/(βλ + α), the effective number of parameters, with the nonzero λ of JᵀJ, shape (k,)."""
        return float(np.sum(self.beta * eigenvalues / (self.beta * eigenvalues + self.alpha)))


def updated_hyperparameters(
    held: Hyperparameters, eigenvalues: Array, squared_errors: float, squared_weights: float, samples: int
) -> Hyperparameters:
    """One re-estimation by the evidence: α = γ/(2 E_W), β = (N − γ)/(2 E_D).

    Args:
        eigenvalues: the nonzero λ of JᵀJ, shape (k,).
        squared_errors: E_D, in squared units of the scaled output.
        squared_weights: E_W, (1).
        samples: number N of training pairs.
    """
    gamma = held.effective_parameters(eigenvalues)
    tiny, epsilon = np.finfo(np.float64).tiny, np.finfo(np.float64).eps
    left = max(samples - gamma, epsilon * samples)  # γ is below N, but rounding may make it N
    return Hyperparameters(
        gamma / (2.0 * max(squared_weights, tiny)), left / (2.0 * max(squared_errors, tiny))
    )


def log_evidence(
    held: Hyperparameters,
    eigenvalues: Array,
    squared_errors: float,
    squared_weights: float,
    counts: tuple[int, int],
) -> float:
    """Logarithm of p(targets | α, β) by Laplace's approximation; exact for a network linear in its weights.

    It is larger for the better of several trainings on the same data.

    Args:
        eigenvalues: the nonzero λ of JᵀJ at the optimum, shape (k,).
        squared_errors: E_D there, in squared units of the scaled output.
        squared_weights: E_W there, (1).
    """
    samples, weights = counts
    determinant = float(np.sum(np.log(2.0 * (held.beta * eigenvalues + held.alpha))))
    determinant += (weights - eigenvalues.size) * float(np.log(2.0 * held.alpha))
    return (
        -held.beta * squared_errors
        - held.alpha * squared_weights
        + 0.5 * weights * float(np.log(2.0 * held.alpha))
        + 0.5 * samples * float(np.log(held.beta / np.pi))
        - 0.5 * determinant
    )


_FIRST = Hyperparameters(0.01, 1.0)
_FIRST_DAMPING = 5e-3
_LARGEST_DAMPING = 1e10  # multiple of β: steps are then of the order of rounding errors
_SMALLEST_DAMPING = 1e-20  # multiple of β
_FACTOR = 10.0
_STANDS_OUT = 1e-4  # βλ/α below which the prior determines a direction


@dataclass(frozen=True, eq=False)
class TrainingProgress:
    """The state of a training, sufficient to resume it.

    Args:
        damping: μ; dimensionless.
    """

    weights: Vector
    held: Hyperparameters = _FIRST
    damping: float = _FIRST_DAMPING
    iteration: int = 0
    finished: bool = False


@dataclass(frozen=True, eq=False)
class TrainingPairs:
    """Training pairs, scaled.

    Args:
        inputs: shape (N, inputs).
        targets: shape (N,).
    """

    sizes: tuple[int, ...]
    inputs: Array
    targets: Array
    input_scaling: Scaling
    output_scaling: Scaling

    @classmethod
    def of(cls, pairs: tuple[Array, Array], sizes: tuple[int, ...], *, unit_deviation: bool) -> TrainingPairs:
        """Scale inputs and targets to zero mean; to unit deviation, inputs only on request."""
        inputs, output = Scaling.of(pairs[0]), Scaling.of(pairs[1][:, None])
        if not unit_deviation:
            inputs = replace(inputs, deviation=(1.0,) * len(inputs.deviation))
        return cls(sizes, inputs.apply(pairs[0]), output.apply(pairs[1][:, None])[:, 0], inputs, output)


def first_weights(sizes: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Random weights with a variance of one over the number of a unit's inputs, and biases of deviation 0.3."""
    parts = []
    for before, after in pairwise(sizes):
        parts.append(rng.standard_normal(before * after) / np.sqrt(before))
        parts.append(0.3 * rng.standard_normal(after))
    return np.concatenate(parts)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread within the context."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _forward(
    weights: Tensor, sizes: tuple[int, ...], inputs: Tensor
) -> tuple[list[tuple[Tensor, Tensor]], list[Tensor], Tensor]:
    """The layers, the inputs of each, and the outputs, shape (N,)."""
    import torch

    # Slicing and reshaping are the same in torch and NumPy.
    layers = cast("list[tuple[Tensor, Tensor]]", split_weights(cast("Array", weights), sizes))
    activations = [inputs]
    for matrix, bias in layers[:-1]:
        activations.append(torch.tanh(activations[-1] @ matrix.T + bias))
    matrix, bias = layers[-1]
    return layers, activations, (activations[-1] @ matrix.T + bias)[:, 0]


def outputs_and_jacobian(weights: Tensor, sizes: tuple[int, ...], inputs: Tensor) -> tuple[Tensor, Tensor]:
    """The outputs, shape (N,), and their derivatives by the n weights, shape (N, n), in closed form."""
    import torch

    layers, activations, outputs = _forward(weights, sizes, inputs)
    slope = torch.ones((inputs.shape[0], 1), dtype=inputs.dtype)
    parts: list[Tensor] = []
    for (matrix, _), before in zip(reversed(layers), reversed(activations), strict=True):
        parts[:0] = [(slope[:, :, None] * before[:, None, :]).flatten(1), slope]
        if before is not inputs:
            slope = (slope @ matrix) * (1.0 - before**2)
    return outputs, torch.cat(parts, dim=1)


def advance_training(progress: TrainingProgress, problem: TrainingPairs) -> TrainingProgress:
    """One step of Levenberg–Marquardt, after α and β are re-estimated; ``finished`` if no step lowers F.

    It solves (βJᵀJ + (α + μ)I) δ = −(βJᵀe + αw) by the singular values of J, so that γ remains accurate where β is
    large. A step that lowers F is accepted and μ divided by ten; otherwise it is repeated with ten times the μ.
    Source: Hagan and Menhaj, IEEE Trans. Neural Networks 5 (1994) 989–993, doi 10.1109/72.329697.
    """
    import torch

    inputs, targets = torch.from_numpy(problem.inputs), torch.from_numpy(problem.targets)
    weights = torch.from_numpy(progress.weights)
    outputs, jacobian = outputs_and_jacobian(weights, problem.sizes, inputs)
    errors = outputs - targets
    singular, right = torch.linalg.svd(jacobian, full_matrices=False)[1:]
    eigenvalues = singular**2
    squared_errors, squared_weights = float(errors @ errors), float(weights @ weights)
    held = progress.held
    if progress.iteration:
        held = updated_hyperparameters(
            held, eigenvalues.numpy(), squared_errors, squared_weights, problem.targets.size
        )
    gradient = held.beta * (jacobian.T @ errors) + held.alpha * weights
    along = right @ gradient
    rest = gradient - right.T @ along
    cost = held.beta * squared_errors + held.alpha * squared_weights
    damping = max(progress.damping, _SMALLEST_DAMPING * held.beta)
    while damping < _LARGEST_DAMPING * held.beta:
        step = right.T @ (along / (held.beta * eigenvalues + held.alpha + damping))
        moved = weights - step - rest / (held.alpha + damping)
        left = _forward(moved, problem.sizes, inputs)[2] - targets
        if float(held.beta * (left @ left) + held.alpha * (moved @ moved)) < cost:
            return TrainingProgress(moved.numpy(), held, damping / _FACTOR, progress.iteration + 1)
        damping *= _FACTOR
    return replace(progress, held=held, iteration=progress.iteration + 1, finished=True)


def conclude_training(progress: TrainingProgress, problem: TrainingPairs) -> tuple[Network, dict[str, Any]]:
    """The trained network with its posterior, and the record of its training."""
    import torch

    weights = torch.from_numpy(progress.weights)
    outputs, jacobian = outputs_and_jacobian(weights, problem.sizes, torch.from_numpy(problem.inputs))
    errors = outputs.numpy() - problem.targets
    singular, right = torch.linalg.svd(jacobian, full_matrices=False)[1:]
    eigenvalues, held = singular.numpy() ** 2, progress.held
    kept = held.beta * eigenvalues > _STANDS_OUT * held.alpha
    network = Network(
        sizes=problem.sizes,
        weights=progress.weights,
        inputs=problem.input_scaling,
        output=problem.output_scaling,
        directions=np.ascontiguousarray(right.numpy()[kept]),
        precision=2.0 * (held.beta * eigenvalues[kept] + held.alpha),
        prior_precision=2.0 * held.alpha,
    )
    squares = float(errors @ errors), float(progress.weights @ progress.weights)
    counts = problem.targets.size, parameter_count(problem.sizes)
    return network, {
        "steps": progress.iteration,
        "stopped_because": "no step lowers F" if progress.finished else "all steps taken",
        "alpha": held.alpha,
        "beta": held.beta,
        "effective_parameters": held.effective_parameters(eigenvalues),
        "performance_ratio": held.performance_ratio(progress.weights.size),
        "rms_error_scaled": float(np.sqrt(squares[0] / errors.size)),
        "log_evidence": log_evidence(held, eigenvalues, *squares, counts),
    }


_LARGEST = 1e20
"""Limits of the largest weight, α, β and μ, and of one over α and β, within which no product of a step
overflows."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The progress of a training.

    Args:
        ended: finished trainings, network by network and start by start.
        running: the current training; None between two.
    """

    ended: tuple[TrainingProgress, ...] = ()
    running: TrainingProgress | None = None

    def to_bytes(self, spec: dict[str, Any]) -> bytes:
        """As safetensors, valid only for a training of the same specification, as JSON."""
        kept = [*self.ended, *([] if self.running is None else [self.running])]
        tensors = {f"weights.{number}": one.weights for number, one in enumerate(kept)}
        state = [
            [one.held.alpha, one.held.beta, one.damping, one.iteration, one.finished] for one in kept
        ]  # Python writes floats exactly
        document = {"spec": spec, "state": state, "ended": len(self.ended)}
        return save(tensors or {"none": np.zeros(1)}, {"training": json_line(document)})

    @classmethod
    def from_bytes(cls, content: bytes, spec: dict[str, Any]) -> Checkpoint | None:
        """The inverse of `to_bytes`; None where the content is not a checkpoint of that specification."""
        try:
            # A safetensors file is the length of its header, the header as JSON, and the tensors.
            header = parse_json(content[8 : 8 + int.from_bytes(content[:8], "little")], "header", "")
            document = parse_json(header["__metadata__"]["training"], "training", "")
            if document["spec"] != json.loads(json_line(spec)):
                return None
            tensors = load(content)
            kept: list[TrainingProgress] = []
            for at, (alpha, beta, damping, iteration, finished) in enumerate(document["state"]):
                weights = tensors[f"weights.{at}"]
                numbers = np.array([alpha, beta, damping], dtype=np.float64)
                sizes = SIZES[NETWORKS[at // spec["starts"]]]  # network by network, start by start
                if weights.size != parameter_count(sizes) or weights.dtype != np.float64:
                    return None
                # Comparisons with NaN are false.
                inside = np.abs(weights).max() <= _LARGEST and numbers.max() <= _LARGEST
                if not (inside and min(alpha, beta) >= 1.0 / _LARGEST and damping >= 0.0):
                    return None
                if not isinstance(iteration, int) or iteration < 0 or not isinstance(finished, bool | int):
                    return None
                held = Hyperparameters(alpha, beta)
                kept.append(TrainingProgress(weights, held, damping, iteration, bool(finished)))
            ended = document["ended"]
            if not isinstance(ended, int) or not max(0, len(kept) - 1) <= ended <= len(kept):
                return None
        except (SafetensorError, TunnelError, ValueError, LookupError, TypeError, AttributeError):
            return None
        return cls(tuple(kept[:ended]), kept[ended] if len(kept) > ended else None)


def read_checkpoint(path: Path, spec: dict[str, Any]) -> Checkpoint | None:
    """Read the checkpoint of a training; None if it is missing, or belongs to another training."""
    return Checkpoint.from_bytes(read_regular(path, limits.WEIGHTS_BYTES), spec) if path.exists() else None


NETWORKS = (DAMPING, FREQUENCY)
_START, _TEST = 0, 2  # purposes of the random generators
_DATA = DataSpec()
_NO_ERRORS = NetworkErrors(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class TrainingSpec:
    """Everything a training depends on."""

    seed: int = 1
    data: DataSpec = _DATA
    starts: int = 3
    damping_steps: int = 400
    frequency_steps: int = 3000

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name."""
        return asdict(self)

    def steps(self, which: str) -> int:
        """Greatest number of steps of a network's training."""
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
    """The networks, their safetensors file and the training record."""

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
    """Train both networks, or resume an interrupted training of the same specification.

    Args:
        progress: called after every step with the work done and a description.
        keep: called with a checkpoint after every step; an exception from it ends the training.
    """
    checkpoint, before = resume or Checkpoint(), 0
    with one_thread():
        for number, which in enumerate(NETWORKS):
            problem = problem_of(spec, which)
            for start in range(spec.starts):
                whole = before + spec.steps(which) * spec.work(which)
                if len(checkpoint.ended) <= number * spec.starts + start:
                    state, name = checkpoint.running, f"{which} network, start {start + 1} of {spec.starts}"
                    if state is None:
                        rng = np.random.default_rng([spec.seed, _START, number, start])
                        state = TrainingProgress(first_weights(problem.sizes, rng))
                    while state.iteration < spec.steps(which) and not state.finished:
                        state = advance_training(state, problem)
                        checkpoint = replace(checkpoint, running=state)
                        keep(checkpoint)
                        progress(before + state.iteration * spec.work(which), name)
                    progress(whole, name)
                    checkpoint = Checkpoint((*checkpoint.ended, state), None)
                before = whole
        best: dict[str, Network] = {}
        described: dict[str, Any] = {}
        for number, which in enumerate(NETWORKS):
            problem = problem_of(spec, which)
            ended = checkpoint.ended[number * spec.starts : (number + 1) * spec.starts]
            concluded = [conclude_training(one, problem) for one in ended]
            chosen = int(np.argmax([record["log_evidence"] for _, record in concluded]))
            best[which] = concluded[chosen][0]
            described[which] = {
                "sizes": list(SIZES[which]),
                "parameters": parameter_count(SIZES[which]),
                "training_pairs": int(problem.targets.size),
                "chosen_start": chosen + 1,
                "starts": [record for _, record in concluded],
            }
        untested = Networks(best[DAMPING], best[FREQUENCY], spec.data, _NO_ERRORS)
        networks = replace(
            untested, errors=held_out_errors(untested, np.random.default_rng([spec.seed, _TEST]))
        )
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


def problem_of(spec: TrainingSpec, which: str) -> TrainingPairs:
    """The scaled training pairs of a network, ``damping`` or ``frequency``."""
    return TrainingPairs.of(training_pairs(spec.data, which), SIZES[which], unit_deviation=which == FREQUENCY)
