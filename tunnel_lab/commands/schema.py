"""``tunnel schema``: JSON schemas, for editors and programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

NAME = "schema"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def _campaign() -> dict[str, Any]:
    from tunnel_sim.files.campaign_folder import CampaignDocument

    return CampaignDocument.model_json_schema()


def _plan() -> dict[str, Any]:
    from tunnel_sim.files.plan_file import PlanDocument

    return PlanDocument.model_json_schema()


def _estimate() -> dict[str, Any]:
    from identification.estimate import estimate_schema

    return estimate_schema()


def _diagnosis() -> dict[str, Any]:
    from tunnel_lab.report.diagnosis_file import DiagnosisDocument

    return DiagnosisDocument.model_json_schema()


SCHEMAS: dict[str, Callable[[], dict[str, Any]]] = {
    "campaign": _campaign,
    "plan": _plan,
    "estimate": _estimate,
    "diagnosis": _diagnosis,
}
"""By name of the document."""


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
    from tunnel_lab.terminal.tables import say_written
    from tunnel_sim.files.writing import json_text, write_json
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


def schema(name: str) -> dict[str, Any]:
    """The JSON schema of a document.

    Args:
        name: one of `SCHEMAS`.

    Returns:
        The schema. Titles that only repeat a field's name are left out: an editor shows the description.
    """
    document = {"$schema": DIALECT, **SCHEMAS[name](), "title": f"tunnel {name}"}
    return {key: _plain(value) if key != "title" else value for key, value in document.items()}


def _plain(value: Any) -> Any:
    """Without titles, and with the first line of a description where it is a docstring."""
    if isinstance(value, dict):
        kept = {
            key: _plain(part) for key, part in value.items() if not (key == "title" and isinstance(part, str))
        }
        if isinstance(text := kept.get("description"), str):
            kept["description"] = text.partition("\n")[0]
        return kept
    return [_plain(part) for part in value] if isinstance(value, list) else value
