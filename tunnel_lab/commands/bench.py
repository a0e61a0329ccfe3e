"""``tunnel bench``: the whole way from a logger's files to a report, in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from tunnel_sim.vocabulary.errors import TunnelError


def run(
    folder: Annotated[Path, Argument(help="Folder of campaigns, or a campaign to open.")] = Path(),
    port: Annotated[
        int, Option("--port", metavar="N", min=0, max=65535, help="TCP port; 0 takes a free one.")
    ] = 0,
    browser: Annotated[bool, Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    r"""Go from a logger's files to a report in the browser.

    The stages are those of the commands, and write the same files: drop records
    (import), state the conditions, identify, diagnose, find the run that would
    distinguish the answers, and write the report. You can go on in a terminal at
    any point. Only this machine's user can open the page: its address has a secret
    in it. It needs pip install 'virtual-wind-tunnel\[bench]', and no network.

    [bold]Examples[/bold]
      tunnel bench
      tunnel bench campaigns --port 8050 --no-browser
      tunnel bench campaigns/my-rig

    [bold]Exit status[/bold]
      0 ended, by Ctrl-C; 2 bad input.
    """
    from importlib.util import find_spec
    from urllib.parse import quote

    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE
    from tunnel_sim.files.writing import output_folder

    if find_spec("nicegui") is None:
        remedy = "pip install 'virtual-wind-tunnel[bench]'"
        raise TunnelError("NiceGUI is not installed", where="tunnel bench", remedy=remedy)
    if find_spec("fcntl") is None:  # the bench follows its processes by locks
        raise TunnelError("needs Linux or macOS", where="tunnel bench", remedy="use the commands")
    from tunnel_lab.bench.server import serve

    opened = (folder / CAMPAIGN_FILE).is_file()
    campaign = folder.resolve()
    serve(
        output_folder(campaign.parent if opened else folder),
        port=port,
        browser=browser,
        first=f"/{quote(campaign.name)}/records" if opened else "/",
    )
