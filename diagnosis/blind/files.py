"""Files of a blind set and their hashes.

A set is a folder: a folder for each campaign, ``seal.json`` (published: hashes of the key and of the campaigns) and
``key.json`` (the truth; may be elsewhere). Answers are in a folder of their own, which has a ``seal.json`` too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tunnel_sim.files.json_text import json_text
from tunnel_sim.files.reading import read_json, read_regular
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown

SCHEMA_VERSION = 1
SEAL = "seal.json"
KEY = "key.json"
_CAMPAIGN = "campaign.toml"


def write_document(path: Path, document: Mapping[str, Any]) -> str:
    """Write JSON whole or not at all.

    Args:
        path: the file; replaced when it exists.
        document: as for `tunnel_sim.files.json_text.json_text`.

    Returns:
        SHA-256 of what was written, in hexadecimal.

    Raises:
        TunnelError: when the file cannot be written.
        ValueError: when the document holds NaN or infinity.
    """
    content = json_text(document).encode()
    write_whole(path, content)
    return hashlib.sha256(content).hexdigest()


def read_document(path: Path, remedy: str) -> dict[str, Any]:
    """Read a JSON document.

    Args:
        remedy: what to do when it is missing or broken.

    Raises:
        TunnelError: when it is missing, cannot be read or is no JSON object.
    """
    return read_json(path, remedy=remedy)


def read_hashes(path: Path, key: str, remedy: str) -> dict[str, str]:
    """Read hashes by name from a seal.

    Args:
        path: of the ``seal.json``.
        key: under which they are listed.
        remedy: what to do when the file is missing or broken.

    Raises:
        TunnelError: when the file is missing or malformed.
    """
    found = read_document(path, remedy).get(key)
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise TunnelError(f"has no hashes under '{key}'", where=shown(path), remedy=remedy)
    return found


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(read_regular(path, limits.DATA_BYTES)).hexdigest()


def folder_hash(folder: Path) -> str:
    """SHA-256 over names and contents of a folder's files, in hexadecimal.

    Args:
        folder: with subfolders; hidden files are left out.

    Returns:
        A hash that changes when any file is changed, added, removed or renamed.
    """
    found = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and not p.name.startswith(".")):
        found.update(f"{path.relative_to(folder).as_posix()}\0{file_hash(path)}\n".encode())
    return found.hexdigest()


def campaign_folders(folder: Path) -> list[Path]:
    """Campaigns of a set, by name.

    Returns:
        Its subfolders that hold a campaign.

    Raises:
        TunnelError: when there are none.
    """
    found = sorted(path.parent for path in folder.glob(f"*/{_CAMPAIGN}"))
    if not found:
        raise TunnelError(
            "holds no campaign", where=str(folder), remedy="make a set first: tunnel blind make FOLDER"
        )
    return found
