"""The network that weighs the rivals, from all rivals and all runs; its files, and its posterior.

The posterior of each quantity is the mixture of the rivals' normal distributions, scaled and widened: the
network only learns which rival to believe, and how far. It runs in NumPy for an estimate and in torch for
training. Trained networks are stored as safetensors, with their training record beside them as JSON, without
pickle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save
from scipy.special import ndtr

from identification.neural.networks import open_stored, read_packaged, read_stored
from identification.neural.rivals import LEVEL, MORE, SETS, Features
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.record import Array

LEVELS = (0.025, 0.5, 0.975)
NORMAL_WIDTH = 3.92  # width of a normal distribution's 95 % interval, in standard deviations
_HALVINGS = 36
_FAR = 12.0  # standard deviations beyond which no component has weight
_NEGLIGIBLE = 1e-9  # weight of a component below which it does not change the quantiles


def distribution(weights: Array, means: Array, stds: Array, values: Array) -> Array:
    """Cumulative probability of mixtures, shape (b, q, d).

    Args:
        weights: shape (b, r), each row sums to 1.
        means: shape (b, r, d).
        stds: shape (b, r, d).
        values: shape (b, q, d).
    """
    away = (values[:, :, None, :] - means[:, None]) / stds[:, None]
    return np.asarray((weights[:, None, :, None] * ndtr(away)).sum(axis=2))


def quantiles(weights: Array, means: Array, stds: Array) -> Array:
    """The quantiles at `LEVELS`, by bisection, shape (b, 3, d): arguments as in `distribution`."""
    there = (weights > _NEGLIGIBLE)[..., None]
    low = np.where(there, means - _FAR * stds, np.inf).min(axis=1)[:, None, :]
    high = np.where(there, means + _FAR * stds, -np.inf).max(axis=1)[:, None, :]
    levels = np.array(LEVELS)[None, :, None]
    low, high = (
        np.broadcast_to(end, (len(weights), len(LEVELS), means.shape[2])).copy() for end in (low, high)
    )
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = distribution(weights, means, stds, middle) < levels
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


Tensor = Any
"""An array of NumPy or a tensor of torch."""

TOKEN, RUN, CONTEXT, HEAD = 32, 32, 128, 32
_GAIN = 0.5  # maximum relative change of a rival's shift
_CLIP = 4.0  # limit of standardised inputs: records with hardly any noise are far outside
_ALLOWANCE = -6.0  # for a rival of one column: there are fifty of them, and their sizes are not known
_SIZES = (-4.0, 9.0)  # of the logarithms of widths


@dataclass(frozen=True, eq=False)
class Output:
    """The mixture of each quantity in standard deviations of the nominal fit; one sample per row.

    Args:
        logarithms: logarithms of the weights, shape (b, r).
        means: shape (b, r, d).
        scales: factor on each rival's own width, shape (b, r, 1).
        extras: added variance, shape (b, r, d).
        effects: logits of the effects' probabilities, which only the training uses, shape (b, e).
        context: context of the sample, shape (b, CONTEXT), for the score of unlikeness.
    """

    logarithms: Tensor
    means: Tensor
    scales: Tensor
    extras: Tensor
    effects: Tensor
    context: Tensor


def weight_shapes(
    rivals: int, features: int, runs: int, quantities: int, effects: int
) -> dict[str, tuple[int, ...]]:
    """Shapes of the trained weights by name; a matrix ends in ``.w`` and its bias in ``.b``."""
    layers = {
        "token1": (features, TOKEN),
        "token2": (TOKEN, TOKEN),
        "run1": (runs, 2 * RUN),
        "run2": (2 * RUN, RUN),
        "context1": (2 * rivals + 2 * TOKEN + 3 * RUN, CONTEXT),
        "context2": (CONTEXT, CONTEXT),
        "head1": (TOKEN, HEAD),
        "spread": (CONTEXT, HEAD),
        "head2": (HEAD, 4 + 2 * quantities),
        "effects": (CONTEXT, effects),
    }
    found: dict[str, tuple[int, ...]] = {
        "names": (rivals, TOKEN),
        "own": (rivals, HEAD),
        "evidence": (2,),
        "allowance": (rivals,),
    }
    for name, shape in layers.items():
        found |= {f"{name}.w": shape, f"{name}.b": shape[1:]}
    return found


def forward(
    xp: Any, weights: Mapping[str, Tensor], rivals: Tensor, runs: Tensor, valid: Tensor, shifts: Tensor
) -> Output:
    """Put samples through the network.

    Every rival passes through one set of layers, and every run through another; runs are pooled, so their order
    and number do not matter.

    Args:
        xp: numpy or torch.
        weights: as `weight_shapes`, with the scalings ``rivals.mean``, ``rivals.std``, ``runs.mean``,
            ``runs.std``.
        rivals: features, shape (b, r, f).
        runs: features, shape (b, n, k), followed by 1 for a run and 0 for padding.
        valid: 1 for rivals that apply, shape (b, r).
        shifts: shifts of the quantities under each rival, shape (b, r, d).
    """

    def layer(name: str, values: Tensor) -> Tensor:
        return values @ weights[f"{name}.w"] + weights[f"{name}.b"]

    def positive(values: Tensor) -> Tensor:
        return values * (values > 0.0)

    def scaled(values: Tensor, name: str) -> Tensor:
        return xp.clip((values - weights[f"{name}.mean"]) / weights[f"{name}.std"], -_CLIP, _CLIP)

    shown = valid[..., None]
    tokens = scaled(rivals, "rivals") * shown
    hidden = positive(layer("token1", tokens) + weights["names"])
    hidden = positive(layer("token2", hidden)) * shown
    mask, on = runs[..., -1:], runs[..., -1:] * (runs[..., -2:-1] > 0.0)
    seen = scaled(runs[..., :-1], "runs") * mask
    seen = positive(layer("run2", positive(layer("run1", seen)))) * mask
    pooled = (
        tokens[..., 0],
        tokens[..., 2],
        hidden.sum(1) / shown.sum(1),
        xp.amax(hidden, 1),
        seen.sum(1) / mask.sum(1),
        xp.amax(seen, 1),
        (seen * on).sum(1) / (on.sum(1) + 1e-6),
    )
    context = positive(layer("context1", xp.concatenate(pooled, -1)))
    context = positive(layer("context2", context))
    spread = layer("spread", context)[:, None, :] + weights["own"]
    found = layer("head2", positive(layer("head1", hidden) + spread))
    quantities = shifts.shape[-1]
    scales = xp.exp(xp.clip(found[..., 2:3], -0.5, 6.0))
    along = xp.exp(xp.clip(found[..., 3:4] - 2.0, *_SIZES))
    extras = xp.exp(xp.clip(found[..., 4 : 4 + quantities] - 2.0, *_SIZES))
    means = shifts * (1.0 + _GAIN * xp.tanh(found[..., 1:2])) + extras * xp.tanh(found[..., 4 + quantities :])
    # Without the network's contribution, a rival's weight follows from its significance, its χ² and its size.
    evidence = xp.log(1.0 + 0.5 * xp.sinh(xp.clip(rivals[..., 0], -9.0, 9.0)) ** 2)
    evidence = weights["evidence"][0] * evidence - weights["evidence"][1] * rivals[..., 3]
    logits = found[..., 0] + evidence + weights["allowance"] - 1e9 * (1.0 - valid)
    top = xp.amax(logits, 1)[:, None]
    logarithms = logits - top - xp.log(xp.exp(logits - top).sum(1))[:, None]
    return Output(
        logarithms, means, scales, (along * shifts) ** 2 + extras**2, layer("effects", context), context
    )


def variances(output: Output, widths: Tensor) -> Tensor:
    """Variance of each quantity under each rival, shape (b, r, d)."""
    return (output.scales * widths) ** 2 + output.extras


def initial_weights(sizes: Mapping[str, tuple[int, ...]], rng: np.random.Generator) -> dict[str, Array]:
    """Weights before training: rivals keep their shifts and widths, and their weights follow from their fits."""
    found = {}
    for name, shape in sizes.items():
        scale = np.sqrt(2.0 / shape[0]) if name.endswith(".w") else 0.5 if name in ("names", "own") else 0.0
        found[name] = scale * rng.standard_normal(shape)
    found["head2.w"] *= 0.1
    found["effects.w"] *= 0.1
    found["evidence"][:] = 3.0, 8.0
    found["allowance"][1:] = _ALLOWANCE
    found["allowance"][-MORE + 1 :] = [_ALLOWANCE * number for number in (*SETS, 2 * SETS[-1])]
    return found


SHIPPED = "posterior"
KINDS = ("record", "campaign")


@dataclass(frozen=True, eq=False)
class TrainedPosterior:
    """One network with its threshold.

    Args:
        weights: as `weight_shapes`, and the scalings.
        centre: mean context of the training samples, shape (c,).
        precision: inverse covariance of the context, shape (c, c).
        threshold: squared distance above which a sample is unlike all training samples.
    """

    weights: Mapping[str, Array]
    centre: Array
    precision: Array
    threshold: float

    def distance(self, context: Array) -> Array:
        """Squared Mahalanobis distance of contexts from the training samples, shape (b,)."""
        away = context - self.centre
        return np.asarray(np.einsum("bi,ij,bj->b", away, self.precision, away))


def to_bytes(networks: Mapping[str, TrainedPosterior]) -> bytes:
    """Both networks as safetensors, in single precision."""
    tensors: dict[str, Array] = {}
    for kind in KINDS:
        one = networks[kind]
        values = {**one.weights, "unlike.centre": one.centre, "unlike.precision": one.precision}
        tensors |= {
            f"{kind}/{name}": np.ascontiguousarray(value, np.float32) for name, value in values.items()
        }
    return save(tensors)


def read_trained(path: Path) -> dict[str, TrainedPosterior]:
    """Read networks that ``tunnel train`` wrote, as `read_stored` does."""
    return trained_of(*read_stored(path), str(path))


@cache
def shipped_posteriors() -> dict[str, TrainedPosterior]:
    """The packaged networks."""
    return trained_of(*read_packaged(SHIPPED), SHIPPED)


def trained_of(weights: bytes, record: bytes, where: str) -> dict[str, TrainedPosterior]:
    """Networks from safetensors and the JSON of their training record, by kind."""
    with open_stored(weights, record, where, estimator="neural_posterior") as (tensors, document):
        trained = {}
        for kind in KINDS:
            own = {
                name.removeprefix(f"{kind}/"): np.asarray(value, dtype=np.float64)
                for name, value in tensors.items()
                if name.startswith(f"{kind}/")
            }
            stated = document["networks"][kind]
            counts = ("rivals", "features", "runs", "quantities", "effects")
            for name, shape in weight_shapes(*(stated["sizes"][count] for count in counts)).items():
                if own[name].shape != shape:
                    raise ValueError(name)
            if not all(np.all(np.isfinite(value)) for value in own.values()):
                raise ValueError(kind)
            centre, precision = own.pop("unlike.centre"), own.pop("unlike.precision")
            trained[kind] = TrainedPosterior(own, centre, precision, float(stated["threshold"]))
        return trained


# Logarithm of χ² over its freedom: smaller values come from records with hardly any noise.
_NOISY = float(np.log(0.5))


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of one record or campaign.

    Args:
        values: medians, SI, shape (d,).
        intervals: 95 % intervals, SI, shape (d, 2).
        covariance: of normal distributions with these intervals and the mixture's correlations, SI, shape (d, d).
    """

    values: Array
    intervals: Array
    covariance: Array
    unlike: bool

    def quantity(self, place: int, unit: str) -> Quantity:
        """One of the values with its interval."""
        low, high = self.intervals[place]
        std = float(np.sqrt(self.covariance[place, place]))
        return Quantity(float(self.values[place]), std, unit, (float(low), float(high)))


def posteriors(samples: Sequence[Features], network: TrainedPosterior) -> list[Posterior]:
    """Put samples of one kind through the network of that kind."""
    if not samples:
        return []
    shifts = np.stack([sample.shifts for sample in samples])
    covariances = np.stack([sample.covariances for sample in samples])
    known = np.stack([sample.known for sample in samples])
    longest = max(len(sample.runs) for sample in samples)
    runs = np.zeros((len(samples), longest, samples[0].runs.shape[1] + 1))
    for place, sample in enumerate(samples):  # a 1 follows the features of a run, and 0 marks padding
        runs[place, : len(sample.runs), :-1], runs[place, : len(sample.runs), -1] = sample.runs, 1.0
    output = forward(
        np,
        network.weights,
        np.stack([sample.rivals for sample in samples]),
        runs,
        np.stack([sample.valid for sample in samples]).astype(np.float64),
        shifts,
    )
    widths = np.sqrt(np.maximum(np.diagonal(covariances, axis1=2, axis2=3), 1e-12))
    widths = np.where(known[:, None, :], np.minimum(widths, 1e9), 1.0)
    weights, variance = np.exp(output.logarithms), variances(output, widths)
    found = quantiles(weights, output.means, np.sqrt(variance))
    distances = network.distance(output.context)
    result = []
    for place, sample in enumerate(samples):
        low, middle, high = sample.values + sample.stds * found[place]
        stds = (high - low) / NORMAL_WIDTH
        scaled = covariances[place] * output.scales[place, :, :, None] ** 2
        scaled = np.where(np.outer(sample.known, sample.known), scaled, np.eye(sample.known.size))
        # Correlations of the mixture, shape (d, d).
        centred = output.means[place] - weights[place] @ output.means[place]
        spread = scaled + np.einsum("ri,rj->rij", centred, centred)
        related = np.einsum("r,rij->ij", weights[place], spread) + np.diag(
            weights[place] @ output.extras[place]
        )
        sizes = np.sqrt(np.diag(related))
        related = related / np.outer(sizes, sizes)
        result.append(
            Posterior(
                middle,
                np.column_stack((low, high)),
                related * np.outer(stds, stds),
                bool(distances[place] > network.threshold and sample.rivals[0, LEVEL] > _NOISY),
            )
        )
    return result
