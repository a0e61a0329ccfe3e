"""What commands are given: a campaign, as a folder or as a file of a data logger, and an effect."""

from __future__ import annotations

import hashlib
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.campaign import Campaign
    from tunnel_sim.vocabulary.plan import EffectSetting


NO_EFFECT = "none"
"""How the nominal model is written where an effect may be named."""
HELP = (
    "Folder of the campaign: campaign.toml and its runs. Or one file of a data logger, as for tunnel import."
)
_FORM = "write NAME:PARAMETER=VALUE, with a comma before each further PARAMETER=VALUE; see tunnel effects"


def given_campaign(path: Path) -> Campaign:
    """Read what a command is given.

    Args:
        path: the folder of a campaign, its ``campaign.toml``, or a file of any format that ``tunnel import`` reads.

    Returns:
        The campaign. What was made of a file of a data logger is printed on standard error.

    Raises:
        TunnelError: for the first fault.
    """
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_campaign
    from tunnel_sim.vocabulary.errors import TunnelError, shown

    if not path.is_file() or path.name == CAMPAIGN_FILE:
        return read_campaign(path)
    if path.suffix.lower() == ".toml":
        raise TunnelError(
            f"is neither a record nor a {CAMPAIGN_FILE}",
            where=shown(path),
            remedy=f"if it is a plan: tunnel simulate {shlex.quote(str(path))} --out FOLDER",
        )
    from tunnel_sim.files.importing.records import read_records  # only here: a campaign needs none of it

    try:
        imported = read_records([path])
    except TunnelError as error:
        remedy = f"tunnel import takes options: {error.remedy}"
        raise TunnelError(error.what, where=error.where, remedy=remedy) from None
    for line in imported.remarks():
        say(f"Note: {line}", stderr=True)
    return imported.campaign


def file_hashes(path: Path) -> dict[str, str]:
    """SHA-256 of the files that a campaign was read from.

    Args:
        path: as for `given_campaign`, which has read it.

    Returns:
        Hexadecimal digests by name in the campaign's folder: ``campaign.toml`` and the runs, or the one file.
    """
    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_document
    from tunnel_sim.vocabulary.errors import one_line

    if path.is_file() and path.name != CAMPAIGN_FILE:
        return {one_line(path.name): _sha256(path)}
    folder = path.parent if path.is_file() else path
    names = dict.fromkeys([CAMPAIGN_FILE, *(run.file for run in read_document(folder / CAMPAIGN_FILE).runs)])
    return {name: _sha256(folder / name) for name in names}


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def parse_effect(text: str) -> EffectSetting:
    """Read the value of ``--effect``.

    Args:
        text: such as ``coulomb_friction:friction_moment=0.004``.

    Returns:
        Name and parameters; the registry checks whether they exist and are in range.

    Raises:
        TunnelError: when it does not have that form, or a value is not a number.
    """
    from tunnel_sim.vocabulary.plan import EffectSetting

    where = f"--effect {text}"
    name, _, rest = text.partition(":")
    values: dict[str, float] = {}
    for part in rest.split(",") if rest else []:
        parameter, equals, value = (piece.strip() for piece in part.partition("="))
        if not (parameter and equals and value):
            raise TunnelError(f"{part!r} is not PARAMETER=VALUE", where=where, remedy=_FORM)
        if parameter in values:
            raise TunnelError(f"{parameter} is given twice", where=where, remedy="give it once")
        try:
            values[parameter] = float(value)
        except ValueError:
            raise TunnelError(f"{value!r} is not a number", where=where, remedy=_FORM) from None
    if not name.strip():
        raise TunnelError("no effect is named", where=where, remedy=_FORM)
    return EffectSetting(name.strip(), values)
