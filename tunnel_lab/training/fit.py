"""The fit of the network to samples, in torch with one thread: the same seed gives the same bits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.neural.posterior.network import forward, initial, shapes, variances
from tunnel_sim.vocabulary.record import Array

INPUTS = ("rivals", "runs", "valid", "shifts")
"""The network's arguments, by their names among the samples."""
FAR = 3e4
"""Standard deviations beyond which a sample is left out: the nominal fit is of another oscillation."""
_EFFECTS_WEIGHT = 0.1  # of the effects' cross entropy beside the posterior's
_LEAST_STD = 0.05  # of an input over the training set
_GREATEST_GRADIENT = 5.0


@dataclass(frozen=True)
class FitSpec:
    """How a network is fitted.

    Args:
        steps: number of batches.
        rate: greatest learning rate, dimensionless; it falls to zero as a cosine.
    """

    seed: int = 1
    steps: int = 4000
    batch: int = 64
    rate: float = 1.5e-3


@dataclass(frozen=True, eq=False)
class State:
    """Progress of a fit: everything that the next step depends on.

    Args:
        weights: as `shapes`, and the scalings.
        moments: first and second moments of the gradients by Adam, by name.
        step: number of finished steps.
    """

    weights: dict[str, Array]
    moments: dict[str, Array]
    step: int


def usable(samples: Mapping[str, Array], kind: str) -> dict[str, Array]:
    """The samples of a kind whose target is not absurdly far from the nominal fit, without the kind's prefix."""
    own = {name[2:]: values for name, values in samples.items() if name.startswith(f"{kind}.")}
    if not all(np.all(np.isfinite(values)) for values in own.values()):
        raise ValueError("internal error: a training sample is not finite")
    near = np.abs(own["target"]).max(axis=1) < FAR
    return {name: values[near] for name, values in own.items()}


def start_state(samples: Mapping[str, Array], spec: FitSpec) -> State:
    """Initial weights, and scalings from the training samples."""
    rivals, runs = samples["rivals"], samples["runs"]
    sizes = shapes(
        rivals.shape[1],
        rivals.shape[2],
        runs.shape[2] - 1,
        samples["target"].shape[1],
        samples["labels"].shape[1],
    )
    weights = initial(sizes, np.random.default_rng([spec.seed, 0]))
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
    spec: FitSpec,
    state: State,
    progress: Callable[[int, float], None] = lambda _step, _loss: None,
    until: int | None = None,
) -> State:
    """Continue a fit.

    Args:
        progress: called with the step and its loss.
        until: step to stop at; the last one where None.
    """
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
        rows = torch.from_numpy(rng.integers(0, count, spec.batch))
        batch = {name: values[rows] for name, values in data.items()}
        posterior, effects = losses(torch, weights, batch)
        value = posterior + _EFFECTS_WEIGHT * effects
        gradients = torch.autograd.grad(value, [weights[name] for name in trained])
        norm = math.sqrt(sum(float((g * g).sum()) for g in gradients))
        shrink = min(1.0, _GREATEST_GRADIENT / max(norm, 1e-12))
        rate = _rate(step, spec)
        with torch.no_grad():
            for name, gradient in zip(trained, gradients, strict=True):
                first[name].lerp_(shrink * gradient, 0.1)
                second[name].lerp_((shrink * gradient) ** 2, 0.001)
                move = first[name] / (1.0 - 0.9 ** (step + 1))
                size = (second[name] / (1.0 - 0.999 ** (step + 1))).sqrt() + 1e-8
                weights[name] -= rate * (move / size + 1e-3 * weights[name])
        progress(step, float(value.detach()))
    moments = {f"1.{n}": v.numpy() for n, v in first.items()} | {
        f"2.{n}": v.numpy() for n, v in second.items()
    }
    done = min(until or spec.steps, spec.steps)
    return State({n: v.detach().numpy() for n, v in weights.items()}, moments, max(done, state.step))


def _rate(step: int, spec: FitSpec) -> float:
    warm = min(1.0, (step + 1) / 100.0)
    return spec.rate * warm * 0.5 * (1.0 + math.cos(math.pi * step / spec.steps))


def losses(xp: Any, weights: Mapping[str, Any], batch: Mapping[str, Any]) -> tuple[Any, Any]:
    """What the fit lowers, means over the samples.

    Args:
        xp: numpy or torch.

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
