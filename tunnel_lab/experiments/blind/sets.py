"""A blind set: campaigns without their truth, a sealed key, answers without the key, and the hashes of all.

A set is a folder with one folder per campaign, ``seal.json`` (published: hashes of the key and of the campaigns)
and ``key.json`` (the truth; may be elsewhere). Answers have their own folder, with a ``seal.json`` too.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from tunnel_lab.experiments.runner import Progress
from tunnel_reference.draw import DEFAULT_SHARES, Mixture, redraw
from tunnel_reference.in_phase import in_phase
from tunnel_reference.make import as_campaign, draw_set, simulate_set, truth_of
from tunnel_reference.scatter_draws import MIXED
from tunnel_reference.severity import ATTEMPTS, Simulated
from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, write_campaign
from tunnel_sim.files.reading import read_json, read_regular
from tunnel_sim.files.writing import clear_leftovers, json_text, whole_folder, write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown

SCHEMA_VERSION = 1
SEAL = "seal.json"
KEY = "key.json"


@dataclass(frozen=True)
class MadeWith:
    """The arguments of `make_blind` in the key; the defaults are for keys of earlier versions."""

    count: int
    seed: int
    kinds: dict[str, float]
    textbook: float
    rare: float
    variety: float = 0.0
    small: float = 0.0
    driven: bool = False
    departures: float = 0.0
    scatter: float = 0.0
    scatter_level: str = MIXED
    stated: float = 0.5
    scatter_normal: float = 0.5

    @classmethod
    def of(cls, count: int, seed: int, kinds: Mapping[str, float], mixture: Mixture) -> MadeWith:
        """The arguments as the key states them."""
        names = {"level": "scatter_level", "normal": "scatter_normal"}
        known = {one.name for one in fields(cls)}
        given = {names.get(name, name): value for name, value in vars(mixture).items()}
        shares = {name: value for name, value in given.items() if name in known}
        return cls(count, seed, dict(kinds), **shares)


MADE_WITH = TypeAdapter(MadeWith)


def write_document(path: Path, document: Mapping[str, Any]) -> str:
    """Write JSON whole or not at all, as `tunnel_sim.files.writing.json_text` does; its SHA-256 in hexadecimal.

    Raises:
        TunnelError: when the file cannot be written.
        ValueError: when the document contains NaN or infinity.
    """
    content = json_text(document).encode()
    write_whole(path, content)
    return hashlib.sha256(content).hexdigest()


def read_hashes(path: Path, key: str, remedy: str) -> dict[str, str]:
    """Read the hashes by name that a seal lists under a key.

    Raises:
        TunnelError: when the file is missing or malformed.
    """
    found = read_json(path, remedy=remedy).get(key)
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise TunnelError(f"has no hashes under '{key}'", where=shown(path), remedy=remedy)
    return found


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(read_regular(path, limits.DATA_BYTES)).hexdigest()


def folder_hash(folder: Path) -> str:
    """SHA-256, in hexadecimal, over names and contents of a folder's files, except hidden ones."""
    found = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and not p.name.startswith(".")):
        found.update(f"{path.relative_to(folder).as_posix()}\0{file_hash(path)}\n".encode())
    return found.hexdigest()


def campaign_folders(folder: Path) -> list[Path]:
    """Subfolders of a set with a campaign, by name.

    Raises:
        TunnelError: when there are none.
    """
    found = sorted(path.parent for path in folder.glob(f"*/{CAMPAIGN_FILE}"))
    if not found:
        raise TunnelError(
            "does not contain a campaign",
            where=str(folder),
            remedy="make a set first: tunnel blind make FOLDER",
        )
    return found


CHUNK = 100
"""Number of campaigns simulated together: their runs advance in one array, so fewer would cost as much."""


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
    """Draw, simulate and write campaigns with their truth only in the key, and return the key's file.

    The key begins with 32 random bytes (the salt), so that the truth cannot be guessed from the published hash;
    the hash proves that the key was not changed later. The seed is also in the key, because the truth follows
    from it.

    Args:
        seed: seed of all random draws; equal arguments give equal campaigns.
        shares: weight of each kind of campaign in `tunnel_reference.draw.KINDS`.
        mixture: shares of other forms, other circumstances and small effects.
        key: file of the key; None: inside the folder, beside the campaigns.
        progress: function called with the number of campaigns written and the total.
        show_steps: report the sizing of the effects on standard error.

    Raises:
        TunnelError: when the folder or the key exists already, or the count is not above zero.
    """
    if count < 1:
        raise TunnelError(f"{count} is not a number of campaigns", where="--count", remedy="give 1 or more")
    clear_leftovers(out.resolve().parent)  # restores the files that a killed command had moved aside
    target = out / KEY if key is None else key
    for path in (out, target):
        if path.is_file() or (path.is_dir() and any(path.iterdir())):
            raise TunnelError("exists already", where=str(path), remedy="name another")
    mixture = mixture or Mixture()
    with whole_folder(out, replace=False) as partial:
        draws = draw_set(count, seed, dict(shares), mixture)
        width = max(4, len(str(count)))
        truths: dict[str, Any] = {}
        for start in range(0, count, CHUNK):
            for simulated in simulate_set(draws[start : start + CHUNK], progress=show_steps):
                name = f"c{len(truths) + 1:0{width}d}"
                kept = written(simulated, partial / name, show_steps)
                meant = in_phase(kept.draw)  # of a lag that an answer may not name
                truths[name] = truth_of(kept) | ({} if meant is None else {"in_phase": meant})
                if progress is not None:
                    progress(len(truths), count)
        document = {
            "schema_version": SCHEMA_VERSION,
            "salt": secrets.token_hex(32),
            "made_with": asdict(MadeWith.of(count, seed, shares, mixture)),
            "truths": truths,
        }
        sealed = write_document(partial / KEY if key is None else key, document)
        hashes = {name: folder_hash(partial / name) for name in truths}
        write_document(
            partial / SEAL,
            {"schema_version": SCHEMA_VERSION, "key_sha256": sealed, "campaigns_sha256": hashes},
        )
    return target


def written(simulated: Simulated, folder: Path, show_steps: bool) -> Simulated:
    """Write a simulated campaign to a folder with its name, and return it.

    A campaign that the reader refuses, as for too few cycles, is drawn again.

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
