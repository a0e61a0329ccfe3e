"""Training of both networks of `neural_posterior` from a seed, resumable, with their thresholds and record."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.posterior import (
    KINDS,
    TrainedPosterior,
    forward,
    initial_weights,
    to_bytes,
    variances,
    weight_shapes,
)
from tunnel_lab.experiments.experiment import read_manifest, refuse_other_content, run_in
from tunnel_lab.experiments.runner import Workers
from tunnel_lab.experiments.training_samples import (
    PARTS,
    TRAINING,
    read_samples,
    samples_of,
    sizes_at_unit_excess,
)
from tunnel_reference.forms import FAMILIES
from tunnel_sim.files.reading import read_regular
from tunnel_sim.files.writing import json_line, write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.record import Array

FALSE_ALARMS = 0.01
"""Share of calibration samples that are called unlike the training although they are like it."""
_KEPT_EVERY = 250  # number of steps between checkpoints
_SHRINK = 0.05  # shrinkage of the context's covariance towards its mean variance
Progress = Callable[[str, int, int], None]
INPUTS = ("rivals", "runs", "valid", "shifts")
"""The network's arguments, by their names among the samples."""
FAR = 3e4
"""Standard deviations beyond which a sample is left out: the nominal fit found another oscillation."""
_EFFECTS_WEIGHT = 0.1  # weight of the effects' cross entropy, relative to the posterior's
_LEAST_STD = 0.05  # minimum standard deviation of an input over the training set
_GREATEST_GRADIENT = 5.0
_BATCH = 64
_RATE = 1.5e-3  # greatest learning rate; a cosine schedule reduces it to zero


@dataclass(frozen=True)
class ShardedTraining:
    """The specification of a training: shards of two hundred campaigns each, and batches of each network."""

    seed: int = 1
    shards: int = 15
    steps: int = 2000

    def of_part(self, part: str) -> int:
        """Number of shards of a part."""
        return self.shards if part == PARTS[0] else max(1, self.shards // 10)


def train(
    spec: ShardedTraining,
    folder: Path,
    workers: Workers,
    progress: Progress = lambda _what, _done, _all: None,
) -> tuple[bytes, dict[str, Any]]:
    """Simulate the missing shards, and fit both networks; finished work in the folder is kept and used.

    Args:
        workers: workers for the simulations; the result does not depend on them.
        progress: function called with the name of the step, the amount finished, and the total.

    Returns:
        The safetensors file, and the record of the training as JSON.

    Raises:
        TunnelError: when the folder belongs to another seed or version, or cannot be written.
    """
    shards = {part: spec.of_part(part) for part in PARTS}
    if (folder / f"{TRAINING}.json").is_file():  # the sizes take long; another seed is refused below
        sizes = read_manifest(TRAINING, folder)[TRAINING].get("sizes", {})
    else:
        refuse_other_content(samples_of(spec.seed, shards, {}), folder)
        sizes = sizes_at_unit_excess(spec.seed)
    run_in(samples_of(spec.seed, shards, sizes), folder, workers, partial(progress, "simulating"))
    used = {
        kind: {part: usable(read_samples(folder, f"{kind}s", part, count)) for part, count in shards.items()}
        for kind in KINDS
    }
    networks = {kind: _fitted(kind, spec, used[kind][PARTS[0]], folder, progress) for kind in KINDS}
    trained = {kind: judged(networks[kind], used[kind][PARTS[0]], used[kind][PARTS[2]]) for kind in KINDS}
    weights = to_bytes(trained)
    described = {}
    for kind, by_part in used.items():
        rivals, runs = by_part["training"]["rivals"], by_part["training"]["runs"]
        described[kind] = {
            "sizes": {
                "rivals": rivals.shape[1],
                "features": rivals.shape[2],
                "runs": runs.shape[2] - 1,
                "quantities": by_part["training"]["target"].shape[1],
                "effects": len(FAMILIES),
            },
            "samples": {part: len(values["target"]) for part, values in by_part.items()},
            "loss": {
                part: [float(loss) for loss in losses(np, trained[kind].weights, values)]
                for part, values in by_part.items()
            },
            "threshold": trained[kind].threshold,
        }
    record = {
        "schema_version": 1,
        "seed": spec.seed,
        "spec": asdict(spec),
        "false_alarms": FALSE_ALARMS,
        "effects": list(FAMILIES),
        "networks": described,
        "versions": {name: version(name) for name in ("numpy", "torch", "safetensors")},
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
    }
    return weights, record


def _fitted(
    kind: str, spec: ShardedTraining, samples: Mapping[str, Array], folder: Path, progress: Progress
) -> dict[str, Array]:
    """The weights of one network; the fit continues from the checkpoint of the same training, if any."""
    mark = json_line([asdict(spec), sorted((name, list(value.shape)) for name, value in samples.items())])
    path = folder / f"{kind}.part.safetensors"
    state = None
    if path.exists():
        content = read_regular(path, limits.WEIGHTS_BYTES)
        try:
            header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])["__metadata__"]
            if header["mark"] == mark:
                tensors, step = load(content), int(header["step"])
                weights = {n[2:]: v for n, v in tensors.items() if n.startswith("w/")}
                moments = {n[2:]: v for n, v in tensors.items() if n.startswith("m/")}
                state = State(weights, moments, step)
        except (SafetensorError, ValueError, LookupError, TypeError):
            state = None
    state = state or start_state(samples, spec)
    while state.step < spec.steps:
        state = fit(samples, spec, state, until=state.step + _KEPT_EVERY)
        tensors = {f"w/{n}": v for n, v in state.weights.items()}
        tensors |= {f"m/{n}": v for n, v in state.moments.items()}
        write_whole(path, save(tensors, {"mark": mark, "step": str(state.step)}))
        progress(f"fitting the network of a {kind}", state.step, spec.steps)
    return state.weights


def contexts(weights: Mapping[str, Array], samples: Mapping[str, Array]) -> Array:
    """The contexts for the score of unlikeness, shape (samples, c)."""
    output = forward(np, weights, *(samples[name] for name in INPUTS))
    return np.asarray(output.context, dtype=np.float64)


def judged(
    weights: dict[str, Array], samples: Mapping[str, Array], apart: Mapping[str, Array]
) -> TrainedPosterior:
    """The network with its threshold, from held-out samples."""
    seen = contexts(weights, samples)
    covariance = np.cov(seen.T)
    covariance += _SHRINK * float(np.trace(covariance)) / len(covariance) * np.eye(len(covariance))
    trained = TrainedPosterior(
        weights, seen.mean(axis=0), np.asarray(np.linalg.inv(covariance), np.float64), np.inf
    )
    distances = trained.distance(contexts(weights, apart))
    return replace(trained, threshold=float(np.quantile(distances, 1.0 - FALSE_ALARMS)))


@dataclass(frozen=True, eq=False)
class State:
    """State of a fit: weights, Adam's moments of the gradients, number of steps done."""

    weights: dict[str, Array]
    moments: dict[str, Array]
    step: int


def usable(samples: Mapping[str, Array]) -> dict[str, Array]:
    """The samples, without targets very far from the nominal fit."""
    if not all(np.all(np.isfinite(values)) for values in samples.values()):
        raise ValueError("internal error: a training sample is not finite")
    near = np.abs(samples["target"]).max(axis=1) < FAR
    return {name: values[near] for name, values in samples.items()}


def start_state(samples: Mapping[str, Array], spec: ShardedTraining) -> State:
    """Initial weights, and scalings from the training samples."""
    rivals, runs = samples["rivals"], samples["runs"]
    sizes = weight_shapes(
        rivals.shape[1],
        rivals.shape[2],
        runs.shape[2] - 1,
        samples["target"].shape[1],
        samples["labels"].shape[1],
    )
    weights = initial_weights(sizes, np.random.default_rng([spec.seed, 0]))
    moments = {f"{order}.{name}": np.zeros(shape) for name, shape in sizes.items() for order in "12"}
    there = runs[..., -1] > 0.0
    weights |= {
        "rivals.mean": rivals.mean(axis=0),
        "rivals.std": np.maximum(rivals.std(axis=0), _LEAST_STD),
        "runs.mean": runs[there][:, :-1].mean(axis=0),
        "runs.std": np.maximum(runs[there][:, :-1].std(axis=0), _LEAST_STD),
    }
    return State({name: value.astype(np.float32) for name, value in weights.items()}, moments, 0)


def fit(
    samples: Mapping[str, Array],
    spec: ShardedTraining,
    state: State,
    until: int | None = None,
) -> State:
    """Continue a fit until a step; None: the last."""
    import torch

    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    data = {name: torch.from_numpy(np.asarray(values, dtype=np.float32)) for name, values in samples.items()}
    trained = [name for name in state.weights if not name.endswith((".mean", ".std"))]
    weights = {
        name: torch.from_numpy(np.array(value, dtype=np.float32)) for name, value in state.weights.items()
    }
    first = {name: torch.from_numpy(np.array(state.moments[f"1.{name}"], np.float32)) for name in trained}
    second = {name: torch.from_numpy(np.array(state.moments[f"2.{name}"], np.float32)) for name in trained}
    for name in trained:
        weights[name].requires_grad_(True)
    count = len(data["target"])
    for step in range(state.step, min(until or spec.steps, spec.steps)):
        rng = np.random.default_rng([spec.seed, 1, step])
        rows = torch.from_numpy(rng.integers(0, count, _BATCH))
        batch = {name: values[rows] for name, values in data.items()}
        posterior, effects = losses(torch, weights, batch)
        value = posterior + _EFFECTS_WEIGHT * effects
        gradients = torch.autograd.grad(value, [weights[name] for name in trained])
        norm = math.sqrt(sum(float((g * g).sum()) for g in gradients))
        shrink = min(1.0, _GREATEST_GRADIENT / max(norm, 1e-12))
        warm = min(1.0, (step + 1) / 100.0)
        rate = _RATE * warm * 0.5 * (1.0 + math.cos(math.pi * step / spec.steps))
        with torch.no_grad():
            for name, gradient in zip(trained, gradients, strict=True):
                first[name].lerp_(shrink * gradient, 0.1)
                second[name].lerp_((shrink * gradient) ** 2, 0.001)
                move = first[name] / (1.0 - 0.9 ** (step + 1))
                size = (second[name] / (1.0 - 0.999 ** (step + 1))).sqrt() + 1e-8
                weights[name] -= rate * (move / size + 1e-3 * weights[name])
    moments = {f"1.{n}": v.numpy() for n, v in first.items()} | {
        f"2.{n}": v.numpy() for n, v in second.items()
    }
    done = min(until or spec.steps, spec.steps)
    return State({n: v.detach().numpy() for n, v in weights.items()}, moments, max(done, state.step))


def losses(xp: Any, weights: Mapping[str, Any], batch: Mapping[str, Any]) -> tuple[Any, Any]:
    """The losses of the fit, means over the samples, in numpy or torch.

    Returns:
        The negative logarithm of the posterior's density at the truth, per quantity, and the cross entropy of the
        effects.
    """
    output = forward(xp, weights, *(batch[name] for name in INPUTS))
    variance = variances(output, batch["widths"])
    away = batch["target"][:, None, :] - output.means
    density = output.logarithms[..., None] - 0.5 * (xp.log(variance) + away**2 / variance)
    top = xp.amax(density, 1)
    value = top + xp.log(xp.exp(density - top[:, None]).sum(1))
    logits = xp.clip(output.effects, -30.0, 30.0)
    entropy = (xp.log(1.0 + xp.exp(logits)) - batch["labels"] * logits).mean()
    return -(value * batch["known"]).sum() / batch["known"].sum(), entropy
