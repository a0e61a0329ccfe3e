"""A campaign from whatever a user names: itself, its folder, or a file of a data logger."""

from __future__ import annotations

import os
from pathlib import Path

from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError, one_line


def as_campaign(given: Campaign | Path | str) -> Campaign:
    """A campaign, read if its folder, its ``campaign.toml`` or one file of a data logger is given.

    Raises:
        TunnelError: for anything else, and where it cannot be read.
    """
    if isinstance(given, Campaign):
        return given
    if not isinstance(given, str | os.PathLike):
        what = f"{one_line(repr(given), 40)} is not a campaign"
        remedy = "give a Campaign, or the path of its folder or of a file of a data logger"
        raise TunnelError(what, remedy=remedy)
    path = Path(given)
    if not path.is_file() or path.name == CAMPAIGN_FILE:
        return read_campaign(path)
    from tunnel_sim.files.importing.records import read_records  # only here: a campaign needs none of it

    return read_records([path]).campaign
