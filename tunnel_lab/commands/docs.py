"""``tunnel docs``: the documentation site."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

NAME = "docs"


def run(
    source: Annotated[
        Path, typer.Option(help="Folder of the pages, in the source tree.", file_okay=False)
    ] = Path("docs"),
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FOLDER", help="Where the site goes, in its folder html.")
    ] = Path("tunnel-output/docs"),
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the first page, or only say where it is.")
    ] = True,
) -> None:
    """Build the documentation site and open it.

    The site has all pages, an API reference and three notebooks, which are
    executed. Pages that have not changed since the last time are not built again.
    Nothing is written beside the pages. It needs the extra 'docs'.

    [bold]Examples[/bold]
      tunnel docs
      tunnel docs --out /tmp/site --no-browser

    [bold]Exit status[/bold]
      0 built, 1 a page could not be built, 2 bad input.
    """
    from tunnel_lab.terminal import tables
    from tunnel_sim.files.writing import output_folder
    from tunnel_sim.vocabulary.errors import TunnelError, library, shown

    if not (source / "conf.py").is_file():
        raise TunnelError(
            "no documentation here", where=shown(source), remedy="run it in the source tree, or give --source"
        )
    build = library("sphinx.cmd.build", "the documentation", "docs").main
    if out.resolve().is_relative_to(source.resolve()):
        raise TunnelError("is among the pages", where=shown(out), remedy="name a folder elsewhere with --out")
    site = output_folder(out) / "html"  # the results of the notebooks are kept beside it
    if build(["-q", "-W", "--keep-going", "-b", "html", str(source), str(site)]):
        raise typer.Exit(1)
    page = (site / "index.html").resolve()
    tables.say(f"Built: {page}")
    if browser:
        typer.launch(page.as_uri())
