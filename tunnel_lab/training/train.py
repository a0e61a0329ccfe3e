"""Training of both networks of `neural_posterior` from a seed, resumable, with their thresholds and record."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from identification.neural.posterior.files import KINDS, Trained, to_bytes
from identification.neural.posterior.network import forward
from tunnel_lab.training.draw import sizes_at_unit_excess
from tunnel_lab.training.fit import INPUTS, FitSpec, State, fit, losses, start_state, usable
from tunnel_lab.training.samples import PARTS, ShardSpec, read_shards, write_shard
from tunnel_reference.forms import FAMILIES
from tunnel_sim.files.json_text import json_line
from tunnel_sim.files.reading import read_json, read_regular
from tunnel_sim.files.writing import output_folder, write_json, write_whole
from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

FALSE_ALARMS = 0.01
"""Share of calibration samples, like those of the training, that are called unlike them."""
_KEPT_EVERY = 250  # steps between checkpoints
_SHRINK = 0.05  # of the context's covariance towards its mean variance
_LETTERS = {"record": "r", "campaign": "c"}
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class TrainingSpec:
    """Everything that a training depends on.

    Args:
        seed: of all random numbers.
        shards: of training samples, two hundred campaigns each.
        steps: number of batches of each network.
    """

    seed: int = 1
    shards: int = 15
    steps: int = 2000

    def of_part(self, part: str) -> int:
        """Number of shards of a part."""
        return self.shards if part == PARTS[0] else max(1, self.shards // 10)

    @property
    def fit(self) -> FitSpec:
        """How each network is fitted."""
        return FitSpec(self.seed, self.steps)


@dataclass(frozen=True)
class Result:
    """The result of a training.

    Args:
        weights: the safetensors file.
        record: of the training, as JSON.
    """

    weights: bytes
    record: dict[str, Any]


def train(
    spec: TrainingSpec, folder: Path, *, jobs: int, progress: Progress = lambda _what, _done, _all: None
) -> Result:
    """Simulate what is missing, and fit both networks; finished work in the folder is kept and used.

    Args:
        folder: of shards and checkpoints.
        jobs: processes that simulate; the result does not depend on their number.
        progress: called with what is done, how much of it is finished, and of how much.

    Raises:
        TunnelError: when the folder belongs to another seed, or cannot be written.
    """
    output_folder(folder)
    sizes = _sizes(spec.seed, folder)
    shards = [
        ShardSpec(spec.seed, part, number, sizes) for part in PARTS for number in range(spec.of_part(part))
    ]
    for done, _ in enumerate(in_processes(partial(write_shard, folder=folder), shards, jobs), 1):
        progress("simulating", done, len(shards))
    parts = {part: read_shards(folder, part, spec.of_part(part)) for part in PARTS}
    networks = {kind: _fitted(kind, spec, parts[PARTS[0]], folder, progress) for kind in KINDS}
    found = {
        kind: judged(
            networks[kind], usable(parts[PARTS[0]], _LETTERS[kind]), usable(parts[PARTS[2]], _LETTERS[kind])
        )
        for kind in KINDS
    }
    weights = to_bytes(found)
    return Result(weights, _record(spec, found, parts, weights))


def _sizes(seed: int, folder: Path) -> tuple[tuple[str, float], ...]:
    """The sizes of the forms, which also mark the folder as one of this seed."""
    path = folder / "sizes.json"
    if not path.exists():
        write_json(path, {"seed": seed, "sizes": sizes_at_unit_excess(seed)})
    document = read_json(path, remedy="remove the folder")
    if document.get("seed") != seed or not isinstance(document.get("sizes"), dict):
        raise TunnelError(
            "belongs to another training", where=str(path), remedy="name another file, or --restart"
        )
    return tuple(sorted(document["sizes"].items()))


def _fitted(
    kind: str, spec: TrainingSpec, samples: Mapping[str, Array], folder: Path, progress: Progress
) -> dict[str, Array]:
    """The weights of one network, from its checkpoint on."""
    own = usable(samples, _LETTERS[kind])
    mark = json_line([asdict(spec), sorted((name, list(value.shape)) for name, value in own.items())])
    path = folder / f"{kind}.part.safetensors"
    state = _resumed(path, mark) or start_state(own, spec.fit)
    while state.step < spec.steps:
        state = fit(own, spec.fit, state, until=state.step + _KEPT_EVERY)
        tensors = {f"w/{n}": v for n, v in state.weights.items()} | {
            f"m/{n}": v for n, v in state.moments.items()
        }
        write_whole(path, save(tensors, {"mark": mark, "step": str(state.step)}))
        progress(f"fitting the network of a {kind}", state.step, spec.steps)
    return state.weights


def _resumed(path: Path, mark: str) -> State | None:
    """A checkpoint of the same training; None where there is none."""
    if not path.exists():
        return None
    content = read_regular(path, limits.WEIGHTS_BYTES)
    try:
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])["__metadata__"]
        if header["mark"] != mark:
            return None
        tensors = load(content)
        step = int(header["step"])
    except (SafetensorError, ValueError, LookupError, TypeError):
        return None
    own = {letter: {n[2:]: v for n, v in tensors.items() if n.startswith(f"{letter}/")} for letter in "wm"}
    return State(own["w"], own["m"], step)


def contexts(weights: Mapping[str, Array], samples: Mapping[str, Array]) -> Array:
    """What the score of unlikeness uses, shape (samples, c)."""
    found = forward(np, weights, *(samples[name] for name in INPUTS))
    return np.asarray(found.context, dtype=np.float64)


def judged(weights: dict[str, Array], samples: Mapping[str, Array], apart: Mapping[str, Array]) -> Trained:
    """The network with its threshold, from samples it was not fitted to."""
    seen = contexts(weights, samples)
    covariance = np.cov(seen.T)
    covariance += _SHRINK * float(np.trace(covariance)) / len(covariance) * np.eye(len(covariance))
    trained = Trained(
        weights, seen.mean(axis=0), np.asarray(np.linalg.inv(covariance), np.float64), np.inf, FAMILIES
    )
    distances = trained.distance(contexts(weights, apart))
    return replace(trained, threshold=float(np.quantile(distances, 1.0 - FALSE_ALARMS)))


def _record(
    spec: TrainingSpec, found: Mapping[str, Trained], parts: Mapping[str, Mapping[str, Array]], weights: bytes
) -> dict[str, Any]:
    networks = {}
    for kind, letter in _LETTERS.items():
        own = {part: usable(samples, letter) for part, samples in parts.items()}
        rivals, runs = own["training"]["rivals"], own["training"]["runs"]
        networks[kind] = {
            "sizes": {
                "rivals": rivals.shape[1],
                "features": rivals.shape[2],
                "runs": runs.shape[2] - 1,
                "quantities": own["training"]["target"].shape[1],
                "effects": len(FAMILIES),
            },
            "samples": {part: len(values["target"]) for part, values in own.items()},
            "loss": {
                part: [float(one) for one in losses(np, found[kind].weights, values)]
                for part, values in own.items()
            },
            "threshold": found[kind].threshold,
        }
    return {
        "schema_version": 1,
        "seed": spec.seed,
        "spec": asdict(spec),
        "false_alarms": FALSE_ALARMS,
        "effects": list(FAMILIES),
        "networks": networks,
        "versions": {name: version(name) for name in ("numpy", "torch", "safetensors")},
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
    }
