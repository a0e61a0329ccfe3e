"""The network: a weight and a width for every rival, from all rivals and all runs.

Every rival goes through the same layers, and every run through others; runs are pooled, so their order and number
do not matter. The posterior of each quantity is the mixture of the rivals' normal distributions, scaled and
widened. The network only learns when to believe which rival, and how far.

The function runs in NumPy for an estimate and in torch for training.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.neural.posterior.rivals import MORE, SETS
from tunnel_sim.vocabulary.record import Array

Tensor = Any
"""An array of NumPy or a tensor of torch."""

TOKEN, RUN, CONTEXT, HEAD = 32, 32, 128, 32
_GAIN = 0.5  # greatest change of a rival's shift, as a share
_CLIP = 4.0  # of standardised inputs: those of records with hardly any noise lie far outside
_ALLOWANCE = -6.0  # of a rival of one column: there are fifty of them, and their sizes are not known
_SIZES = (-4.0, 9.0)  # of the logarithms of widths


@dataclass(frozen=True, eq=False)
class Output:
    """The mixture of each quantity in standard deviations of the nominal fit; one sample per row.

    Args:
        logarithms: of the weights, shape (b, r).
        means: shape (b, r, d).
        scales: factor on each rival's own width, shape (b, r, 1).
        extras: variance added to it, shape (b, r, d).
        effects: logits of the effects' probabilities, shape (b, e).
        context: of the sample, shape (b, CONTEXT): what the score of unlikeness uses.
    """

    logarithms: Tensor
    means: Tensor
    scales: Tensor
    extras: Tensor
    effects: Tensor
    context: Tensor


def shapes(
    rivals: int, features: int, runs: int, quantities: int, effects: int
) -> dict[str, tuple[int, ...]]:
    """Shapes of the trained weights by name; a matrix ends in ``.w`` and its bias in ``.b``.

    Args:
        features: of a rival.
        runs: features of a run.
    """
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

    Args:
        xp: numpy or torch.
        weights: as `shapes`, with the scalings ``rivals.mean``, ``rivals.std``, ``runs.mean`` and ``runs.std``.
        rivals: features, shape (b, r, f).
        runs: features, shape (b, n, k); after them 1 for a run and 0 for padding.
        valid: 1 for rivals that apply, shape (b, r).
        shifts: of the quantities under each rival, shape (b, r, d).
    """

    def layer(name: str, values: Tensor) -> Tensor:
        return values @ weights[f"{name}.w"] + weights[f"{name}.b"]

    def positive(values: Tensor) -> Tensor:
        return values * (values > 0.0)

    shown = valid[..., None]
    tokens = _scaled(xp, rivals, weights, "rivals") * shown
    hidden = positive(layer("token1", tokens) + weights["names"])
    hidden = positive(layer("token2", hidden)) * shown
    mask, on = runs[..., -1:], runs[..., -1:] * (runs[..., -2:-1] > 0.0)
    seen = _scaled(xp, runs[..., :-1], weights, "runs") * mask
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
    # Where the network adds nothing, a rival's weight follows from its significance, its χ² and its size.
    evidence = xp.log(1.0 + 0.5 * xp.sinh(xp.clip(rivals[..., 0], -9.0, 9.0)) ** 2)
    evidence = weights["evidence"][0] * evidence - weights["evidence"][1] * rivals[..., 3]
    logits = found[..., 0] + evidence + weights["allowance"] - 1e9 * (1.0 - valid)
    top = xp.amax(logits, 1)[:, None]
    logarithms = logits - top - xp.log(xp.exp(logits - top).sum(1))[:, None]
    return Output(
        logarithms, means, scales, (along * shifts) ** 2 + extras**2, layer("effects", context), context
    )


def _scaled(xp: Any, values: Tensor, weights: Mapping[str, Tensor], name: str) -> Tensor:
    return xp.clip((values - weights[f"{name}.mean"]) / weights[f"{name}.std"], -_CLIP, _CLIP)


def variances(output: Output, widths: Tensor) -> Tensor:
    """Variance of each quantity under each rival, shape (b, r, d)."""
    return (output.scales * widths) ** 2 + output.extras


def initial(sizes: Mapping[str, tuple[int, ...]], rng: np.random.Generator) -> dict[str, Array]:
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
