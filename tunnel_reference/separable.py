"""Draws effects again until each matters by itself and beside the others.

An effect's signature is what it adds to the residuals of the nominal model. No change of the other effects' sizes
imitates the part of it that is orthogonal to their signatures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tunnel_reference.conditions import Array
from tunnel_reference.draw import CampaignDraw, redraw
from tunnel_reference.severity import read_and_fit, simulate_motions, size_effects

OWN_EXCESS = 0.5
"""Least excess of an effect that the others cannot imitate, noise powers: a hundred deviations in 10⁵ samples."""
OWN_SHARE = 0.1
"""That excess as a share of the whole: signatures of large effects are not exactly proportional to their size."""
ATTEMPTS = 4
_STRIDE = 7  # samples of the signatures that are kept


def size_separably(draws: Sequence[CampaignDraw], *, progress: bool = False) -> list[CampaignDraw]:
    """Scale the effects of campaigns; draw again where an effect does not matter or cannot be distinguished.

    Args:
        progress: whether to report progress on standard error.

    Returns:
        The campaigns with severity parameters and own excesses set. After four attempts a campaign stays as it is.
    """
    found = list(draws)
    left = list(range(len(found)))
    for attempt in range(ATTEMPTS):
        sized = own_excesses(size_effects([found[i] for i in left], progress=progress))
        for number, draw in zip(left, sized, strict=True):
            found[number] = draw
        left = [i for i in left if not _separable(found[i])]
        if not left or attempt == ATTEMPTS - 1:
            break
        for number in left:
            found[number] = redraw(found[number])
    return found


def _separable(draw: CampaignDraw) -> bool:
    """Whether every effect that matters has an excess of its own."""
    owns = [(e.own, e.target) for e in draw.effects if e.own is not None]
    return all(own >= max(OWN_EXCESS, OWN_SHARE * target) for own, target in owns)


def own_excesses(draws: Sequence[CampaignDraw]) -> list[CampaignDraw]:
    """Set the own excess of every effect that matters.

    Returns:
        The campaigns; those without effects are unchanged.
    """
    alone: list[CampaignDraw] = []
    places: list[tuple[int, int]] = []
    for number, draw in enumerate(draws):
        slots = [i for i, e in enumerate(draw.effects) if not e.small]
        for slot in [-1, *slots] if slots else []:
            alone.append(replace(draw, effects=(draw.effects[slot],) if slot >= 0 else ()))
            places.append((number, slot))
    residuals: dict[int, dict[int, Array]] = {}
    motions = simulate_motions(alone, fine=False) if alone else []
    for draw, (number, slot), motion in zip(alone, places, motions, strict=True):
        residual = read_and_fit(draw, motion).residual[:, ::_STRIDE].ravel()
        residuals.setdefault(number, {})[slot] = residual.astype(np.float32)
    found = list(draws)
    for number, by_slot in residuals.items():
        nothing = by_slot.pop(-1)
        power = found[number].conditions.noise_power
        own = _orthogonal(np.stack([r - nothing for r in by_slot.values()]).astype(np.float64)) / power
        effects = list(found[number].effects)
        for slot, value in zip(by_slot, own, strict=True):
            effects[slot] = replace(effects[slot], own=float(value))
        found[number] = replace(found[number], effects=tuple(effects))
    return found


def _orthogonal(signatures: Array) -> Array:
    """Mean square of the part of each row that is orthogonal to the others, shape (rows,)."""
    found = np.empty(len(signatures))
    for row, signature in enumerate(signatures):
        others = np.delete(signatures, row, axis=0)
        rest = signature
        if len(others):
            rest = signature - others.T @ np.linalg.lstsq(others.T, signature, rcond=None)[0]
        found[row] = np.mean(rest**2)
    return found
