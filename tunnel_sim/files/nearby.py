"""What lies beside a path that is wrong, for the remedy of an error."""

from __future__ import annotations

import os
from collections.abc import Iterator
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

from tunnel_sim.vocabulary.errors import shown

_MOST_NAMES = 1000  # of a folder that are compared
_MARKER = "campaign.toml"


def nearest(path: Path) -> str:
    """The file or folder whose name is most similar, as a question.

    Args:
        path: does not exist.

    Returns:
        Such as ``did you mean the folder 'my-rig'?``; empty where nothing is similar.
    """
    names = {entry.name: _is_folder(entry) for entry in _entries(path.parent) if entry.name != path.name}
    found = get_close_matches(path.name, names, n=1)
    return _question(path.parent / found[0], names[found[0]]) if found else ""


def nearest_campaign(folder: Path) -> str:
    """The campaign around or inside a folder that is not one, as a question.

    Returns:
        As `nearest`; empty where there is no campaign, or several.
    """
    around = [folder.parent] if (folder.parent / _MARKER).is_file() else []
    inside = [folder / entry.name for entry in _entries(folder) if (folder / entry.name / _MARKER).is_file()]
    found = around or inside
    return _question(found[0], True) if len(found) == 1 else ""


def inside(folder: Path) -> str:
    """The remedy where a file is wanted and a folder is given.

    Returns:
        What the folder is, or a file in it; empty where it has none.
    """
    if (folder / _MARKER).is_file():
        return "it is a campaign, which tunnel identify and tunnel diagnose take"
    files = sorted(entry.name for entry in _entries(folder) if (folder / entry.name).is_file())
    return f"name a file in it, such as '{shown(folder / files[0])}'" if files else ""


def _question(path: Path, folder: bool) -> str:
    return f"did you mean the {'folder' if folder else 'file'} '{shown(path)}'?"


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link to itself
        return False


def _entries(folder: Path) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            yield from islice(entries, _MOST_NAMES)
    except (OSError, ValueError):
        return
