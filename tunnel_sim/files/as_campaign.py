"""A campaign from anything that a user names: the campaign itself, its folder, or a file of a data logger."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from pathlib import Path

from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_campaign
from tunnel_sim.files.readers import reader_place
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError, counted, one_line, shown


def as_campaign(given: Campaign | Path | str) -> Campaign:
    """As is, or read from its folder, its ``campaign.toml`` or one file of a data logger.

    Raises:
        TunnelError: for any other argument, and if the campaign cannot be read.
    """
    if isinstance(given, Campaign):
        return given
    if not isinstance(given, str | os.PathLike):
        what = f"{one_line(repr(given), 40)} is not a campaign"
        remedy = "give a Campaign, or the path of its folder or of a file of a data logger"
        raise TunnelError(what, remedy=remedy)
    path = Path(given)
    refuse_records(path)
    if not path.is_file() or path.name == CAMPAIGN_FILE:
        return read_campaign(path)
    # imported here because a campaign needs none of it
    from tunnel_sim.files.importing.records import read_records

    return read_records([path]).campaign


_TEXT = (".txt", ".tsv", ".dat", ".lvm", ".asc", ".gz")
"""Endings of files of text without a reader of their own."""


def refuse_records(path: Path) -> None:
    """Refuse a folder of a data logger's files with the command that imports them; other paths pass.

    Raises:
        TunnelError: with the command, and with further questions, as options in the command.
    """
    if not path.is_dir() or any((one / CAMPAIGN_FILE).exists() for one in (path, path.resolve().parent)):
        return
    found = [one for one in sorted(path.iterdir()) if one.is_file() and one.name[0] != "."]
    endings = Counter(
        one.suffix for one in found if one.suffix.lower() in _TEXT or reader_place(one.suffix.lower())
    )
    if not endings:
        return
    from tunnel_sim.files.importing.records import read_records

    (ending, count), *_ = endings.most_common(1)
    name = one_line(path.resolve().name)
    options = ""
    asked = ""
    try:
        read_records([one for one in found if one.suffix == ending], name=name)
    except TunnelError as error:
        options, asked = "".join(f" {one}" for one in error.options), f"; it asks: {error}"
    out = shlex.quote(f"{name}-campaign")
    command = f"tunnel import {shlex.quote(str(path))}/*{ending} --out {out}{options}"
    what = f"is a folder of {counted(count, 'record')} ({ending}), not a campaign"
    raise TunnelError(what, where=shown(path), remedy=f"import it: {command}{asked}")
