"""A campaign from whatever a user names: itself, its folder, or a file of a data logger."""

from __future__ import annotations

from pathlib import Path

from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_campaign
from tunnel_sim.vocabulary.campaign import Campaign


def as_campaign(given: Campaign | Path | str) -> Campaign:
    """A campaign, read if its folder, its ``campaign.toml`` or one file of a data logger is given."""
    if isinstance(given, Campaign):
        return given
    path = Path(given)
    if not path.is_file() or path.name == CAMPAIGN_FILE:
        return read_campaign(path)
    from tunnel_sim.files.importing.records import read_records  # only here: a campaign needs none of it

    return read_records([path]).campaign
