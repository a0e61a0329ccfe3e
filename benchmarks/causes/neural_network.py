"""The neural classifier: a network encodes each run of a campaign; the pooled codes and the statistics of all runs
together give a probability for every cause and for `unknown`. Several networks are averaged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.causes.entry import NAMES, UNKNOWN
from benchmarks.causes.moments import Array
from tunnel_sim.files.reading import as_described

WEIGHTS = Path(__file__).parent / "neural_weights.safetensors"
LABELS = (*NAMES, UNKNOWN)
LAYERS = ("run 1", "run 2", "all 1", "all 2")


@dataclass(frozen=True, eq=False)
class Classifier:
    """Trained networks.

    Args:
        networks: weights of each network by ``LAYERS``, shape (inputs + 1, outputs), the last row the bias.
        scaling: mean and standard deviation of the statistics of a run, shape (2, k), and of all runs, (2, m).
        temperature: divisor of the logits.
        facts: facts of the training: campaigns, simulation_s, training_s, held_out (nats), width, decay,
            dropout.
    """

    networks: Sequence[Mapping[str, Array]]
    scaling: tuple[Array, Array]
    temperature: float
    facts: Mapping[str, float]

    def probabilities(self, runs: Array, whole: Array) -> dict[str, float]:
        """Probability of every label.

        Args:
            runs: statistics of the runs, shape (runs, k), from `benchmarks.causes.summaries.summaries`.
            whole: statistics of all runs together, shape (m,), from the same function.
        """
        (mean, std), (whole_mean, whole_std) = self.scaling
        x, w = scaled(runs, mean, std), scaled(whole, whole_mean, whole_std)
        found = [_sigmoid(_logits(weights, x, w) / self.temperature) for weights in self.networks]
        return dict(zip(LABELS, np.mean(found, axis=0).tolist(), strict=True))

    def save(self, path: Path) -> None:
        """Write the classifier as safetensors."""
        from safetensors.numpy import save_file

        given = {
            f"{i} {n}": w.astype(np.float32) for i, net in enumerate(self.networks) for n, w in net.items()
        }
        facts = {f"fact {name}": np.array(value) for name, value in self.facts.items()}
        rest = {"run": self.scaling[0], "whole": self.scaling[1], "temperature": np.array(self.temperature)}
        save_file(given | facts | rest | {"count": np.array(len(self.networks))}, path)


def read_classifier(path: Path = WEIGHTS) -> Classifier:
    """Read a trained classifier.

    Raises:
        TunnelError: when the file is missing or is not a classifier.
    """
    remedy = "train it: python -m benchmarks.causes.neural_training FOLDER"
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    with as_described("is not a trained classifier", str(path), remedy):
        try:
            f = load_file(path)
        except SafetensorError as error:
            raise ValueError(str(error)) from error
        networks = [{n: f[f"{i} {n}"].astype(np.float64) for n in LAYERS} for i in range(int(f["count"]))]
        facts = {name.removeprefix("fact "): float(f[name]) for name in f if name.startswith("fact ")}
        return Classifier(networks, (f["run"], f["whole"]), float(f["temperature"]), facts)


def scaled(values: Array, mean: Array, std: Array) -> Array:
    """Statistics in standard deviations of the training campaigns, clipped to ±6: larger values were not seen."""
    return np.asarray(np.clip((values - mean) / std, -6.0, 6.0))


def _logits(weights: Mapping[str, Array], runs: Array, whole: Array) -> Array:
    hidden = _layer(np.maximum(_layer(runs, weights["run 1"]), 0.0), weights["run 2"])
    hidden = np.maximum(hidden, 0.0)
    pooled = np.concatenate([hidden.mean(axis=0), hidden.max(axis=0), whole])
    return _layer(np.maximum(_layer(pooled, weights["all 1"]), 0.0), weights["all 2"])


def _layer(values: Array, weights: Array) -> Array:
    return np.asarray(values @ weights[:-1] + weights[-1])


def _sigmoid(values: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(values, -40.0, 40.0))))
