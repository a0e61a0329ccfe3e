"""Makes a blind set: campaigns without their truth, a sealed key, and the hash that seals it."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from diagnosis.blind.files import KEY, SCHEMA_VERSION, SEAL, folder_hash, write_document
from tunnel_reference.draw import DEFAULT_SHARES, Mixture, redraw
from tunnel_reference.make import as_campaign, draw_set, simulate_set, truth_of
from tunnel_reference.separable import ATTEMPTS
from tunnel_reference.severity import Simulated
from tunnel_sim.files.campaign_folder import write_campaign
from tunnel_sim.files.writing import clear_leftovers, whole_folder
from tunnel_sim.vocabulary.errors import TunnelError

CHUNK = 100
"""Campaigns simulated together: their runs advance in one array, so that few at a time would cost as much."""

Progress = Callable[[int, int], None]


def make_blind(
    out: Path,
    *,
    count: int,
    seed: int,
    shares: Mapping[str, float] = DEFAULT_SHARES,
    mixture: Mixture | None = None,
    key: Path | None = None,
    progress: Progress | None = None,
    show_steps: bool = False,
) -> Path:
    """Draw, simulate and write campaigns whose truth is only in the key.

    The key begins with 32 random bytes (the salt), so that the truth cannot be found by trying guesses against the
    published hash; the hash shows that the key was not changed later. The seed is in the key too, since the truth
    follows from it.

    Args:
        out: folder to make.
        count: number of campaigns.
        seed: of everything drawn; the same arguments give the same campaigns.
        shares: weight of each kind of campaign, of `tunnel_reference.draw.KINDS`.
        mixture: how often other forms, other circumstances and small effects are drawn.
        key: file of the key; inside the folder, beside the campaigns, when None.
        progress: called with the number of campaigns written and the number in all.
        show_steps: report on standard error how the sizing of the effects proceeds.

    Returns:
        The file of the key.

    Raises:
        TunnelError: when the folder or the key exists already, or the count is not above zero.
    """
    if count < 1:
        raise TunnelError(f"{count} is not a number of campaigns", where="--count", remedy="give 1 or more")
    clear_leftovers(out.resolve().parent)  # what a killed command set aside is there again
    target = out / KEY if key is None else key
    for path in (out, target):
        if path.is_file() or (path.is_dir() and any(path.iterdir())):
            raise TunnelError("exists already", where=str(path), remedy="name another")
    mixture = mixture or Mixture()
    with whole_folder(out, replace=False) as partial:
        truths = _write_campaigns(partial, count, seed, shares, mixture, progress, show_steps)
        document = {
            "schema_version": SCHEMA_VERSION,
            "salt": secrets.token_hex(32),
            "made_with": {
                "count": count,
                "seed": seed,
                "kinds": dict(shares),
                "textbook": mixture.textbook,
                "rare": mixture.rare,
                "variety": mixture.variety,
                "small": mixture.small,
            },
            "truths": truths,
        }
        sealed = write_document(partial / KEY if key is None else key, document)
        hashes = {name: folder_hash(partial / name) for name in truths}
        write_document(
            partial / SEAL,
            {"schema_version": SCHEMA_VERSION, "key_sha256": sealed, "campaigns_sha256": hashes},
        )
    return target


def _write_campaigns(
    folder: Path,
    count: int,
    seed: int,
    shares: Mapping[str, float],
    mixture: Mixture,
    progress: Progress | None,
    show_steps: bool,
) -> dict[str, Any]:
    """Write the campaigns; their truths by name."""
    draws = draw_set(count, seed, dict(shares), mixture)
    width = max(4, len(str(count)))
    truths: dict[str, Any] = {}
    for start in range(0, count, CHUNK):
        for simulated in simulate_set(draws[start : start + CHUNK], progress=show_steps):
            name = f"c{len(truths) + 1:0{width}d}"
            truths[name] = truth_of(written(simulated, folder / name, show_steps))
            if progress is not None:
                progress(len(truths), count)
    return truths


def written(simulated: Simulated, folder: Path, show_steps: bool) -> Simulated:
    """Write a simulated campaign; one that the reader refuses, as for too few cycles, is drawn again.

    Args:
        simulated: the campaign.
        folder: to write, named as the campaign is to be.
        show_steps: whether the steps of a second simulation are shown.

    Returns:
        The campaign that was written.

    Raises:
        TunnelError: when the reader refuses several draws in turn.
    """
    for attempt in range(ATTEMPTS):
        try:
            write_campaign(as_campaign(simulated, folder.name), folder)
            break
        except TunnelError:
            if attempt == ATTEMPTS - 1:
                raise
            (simulated,) = simulate_set([redraw(simulated.draw)], progress=show_steps)
    return simulated
