"""``tunnel schema``: JSON schemas, for editors and programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

NAME = "schema"


def run(
    document: Annotated[str, typer.Argument(help="campaign, plan, estimate or diagnosis.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write to a file instead of standard output.")
    ] = None,
) -> None:
    """Print the JSON schema of a document.

    An editor with TOML support (such as VS Code with Even Better TOML) completes
    and checks keys of a campaign.toml whose first line names the schema:
    #:schema campaign.schema.json

    [bold]Examples[/bold]
      tunnel schema campaign --out my-campaign/campaign.schema.json
      tunnel schema plan --out plan.schema.json
      tunnel schema diagnosis | jq .properties

    [bold]Exit status[/bold]
      0 printed, 2 bad input.
    """
    from tunnel_lab.terminal.schemas import SCHEMAS, schema
    from tunnel_lab.terminal.tables import say_written
    from tunnel_sim.files.json_text import json_text
    from tunnel_sim.files.writing import write_json
    from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

    if document not in SCHEMAS:
        raise TunnelError(
            f"there is no schema {document!r}", where="tunnel schema", remedy=did_you_mean(document, SCHEMAS)
        )
    if out is None:
        typer.echo(json_text(schema(document)), nl=False)
        return
    write_json(out, schema(document))
    say_written(out)
