"""``tunnel identify``: the coefficients of a campaign on disk, measured or simulated."""

from __future__ import annotations

import inspect
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from identification.estimators import SUMMARIES
from tunnel_lab.terminal.inputs import HELP as CAMPAIGN_HELP

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from identification.estimators import Estimator
    from identification.uncertainty.budget import Budget
    from tunnel_sim.vocabulary.campaign import Campaign

NAME = "identify"
FEW_RUNS = 3
"""For up to this many runs the windows are shown by default."""
ESTIMATORS = "  {estimators}"
"""Placeholder of their list in the help."""
_HELP_WIDTH = 78
WITH_WEIGHTS = ("neural_network", "neural_posterior")


def run(
    campaign: Annotated[Path, typer.Argument(help=CAMPAIGN_HELP)],
    estimator: Annotated[
        str, typer.Option("--estimator", "-e", metavar="NAME", help="One of the estimators listed above.")
    ] = "output_error",
    json: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write the estimate as JSON; - for standard output."),
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights", metavar="FILE", help="Networks written by tunnel train, for the same estimator."
        ),
    ] = None,
    windows: Annotated[
        bool | None,
        typer.Option(
            "--windows/--no-windows",
            help="Show ζ and ωn by windows of a few cycles. Default: for up to three runs.",
            show_default=False,
        ),
    ] = None,
    budget: Annotated[
        bool, typer.Option("--budget", help="Add scatter and choice of model; show the dominant source.")
    ] = False,
    uncertainties: Annotated[
        Path | None,
        typer.Option(
            "--uncertainties",
            metavar="FILE",
            help="Uncertainties of Kr, V, ρ, A and l (TOML); implies --budget.",
        ),
    ] = None,
    models: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            metavar="NAME",
            help="Another estimator for the choice of model; with --budget. May be repeated.",
        ),
    ] = None,
) -> None:
    """Identify Cnβ, Cnr, Izz and Cr of a campaign, measured or simulated.

    Every run gives its natural frequency ωn (rad/s) and damping ratio ζ. Runs
    with a stated spring, with the wind off and on, together give Cnβ and Cnr
    (1/rad), Izz (kg m²) and Cr (N m s/rad). Without spring_stiffness the runs
    stay in normalised form: ωn and ζ. Every estimate has a standard deviation,
    and every note says what to do.

    [bold]Estimators[/bold]
      {estimators}

    [bold]Examples[/bold]
      tunnel identify my-campaign
      tunnel identify my-campaign --estimator conventional --json estimate.json
      tunnel identify my-campaign --json - | jq .cn_beta
      tunnel identify my-campaign --uncertainties known.toml --model conventional

    [bold]Uncertainty[/bold]
      By default, standard deviations are due to sensor noise only. --budget adds
      the scatter of the runs and the choice of model. --uncertainties also adds
      those of the stated Kr, V, ρ, A and l. The combined standard uncertainty is
      then reported, and a table shows which source dominates.

    [bold]Exit status[/bold]
      0 identified, 1 nothing could be identified, 2 bad input.
    """
    from identification import identify
    from tunnel_lab.terminal.inputs import given_campaign
    from tunnel_lab.terminal.options import known_estimator
    from tunnel_lab.terminal.outputs import show_estimate
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.writing import json_text, refuse_unwritable, write_json
    from tunnel_sim.vocabulary.errors import TunnelError

    for name in (estimator, *(models or ())):
        known_estimator(name)
    if models and not budget and uncertainties is None:
        raise TunnelError("needs --budget", where="--model", remedy="add --budget, or leave it out")
    if json is not None and str(json) != "-":
        refuse_unwritable(json)
    data = given_campaign(campaign)
    chosen = with_weights(estimator, weights)
    estimate = identify(data, chosen, throw=False)
    found = None
    if (budget or uncertainties is not None) and not estimate.status.failed:
        estimate, found = budgeted(data, estimate, chosen, uncertainties, models or [])
    document = estimate.to_json_dict() | ({} if found is None else {"budget": found.to_json_dict()})
    if json is not None and str(json) == "-":
        typer.echo(json_text(document), nl=False)
    else:
        if json is not None:
            write_json(json, document)
        detailed = len(data.runs) <= FEW_RUNS if windows is None else windows
        show_estimate(data, estimate, windows=detailed, source=campaign)
        if found is not None:
            show_budget(document["budget"])
        if json is not None:
            say(f"Written: {json}")
    if estimate.status.failed:
        raise typer.Exit(1)


def with_estimators(text: str | None) -> str:
    """A docstring with one paragraph per estimator: its name, and its summary wrapped beside it."""
    column = max(map(len, SUMMARIES)) + 4
    paragraphs = [
        textwrap.fill(
            summary, _HELP_WIDTH, initial_indent=f"  {name}".ljust(column), subsequent_indent=" " * column
        )
        for name, summary in SUMMARIES.items()
    ]
    return inspect.cleandoc(text or "").replace(ESTIMATORS, "\n".join(paragraphs))


run.__doc__ = with_estimators(run.__doc__)


def budgeted(
    campaign: Campaign,
    estimate: Estimate,
    chosen: str | Estimator,
    uncertainties: Path | None,
    models: list[str],
) -> tuple[Estimate, Budget]:
    """The estimate with combined standard uncertainties, and their budget.

    Args:
        chosen: the estimator that made it, which is called again with changed campaigns.
        uncertainties: file of the inputs' uncertainties; None takes them as exact.

    Raises:
        TunnelError: when the file is wrong, or there is no coefficient to budget.
    """
    from functools import partial

    from rich.text import Text

    from identification import identify
    from identification.uncertainty.budget import (
        InputUncertainties,
        load_uncertainties,
        make_budget,
        with_budget,
    )
    from tunnel_lab.terminal.tables import console

    inputs = InputUncertainties() if uncertainties is None else load_uncertainties(uncertainties)
    others = {
        name: partial(identify, estimator=name, throw=False) for name in models if name != estimate.estimator
    }
    terminal = console(stderr=True)
    with terminal.status("uncertainty budget") as status:
        budget = make_budget(
            campaign,
            estimate,
            partial(identify, estimator=chosen, throw=False),
            inputs,
            others=others,
            progress=lambda what: status.update(Text(f"uncertainty budget: {what}")),
        )
    return with_budget(estimate, budget), budget


def show_budget(budget: dict[str, Any]) -> None:
    """Print a budget and what dominates.

    Args:
        budget: as in the JSON document.
    """
    from tunnel_lab.terminal import outputs, tables

    tables.say("")
    table = tables.rich_table(outputs.budget_table(budget))
    table.rows[-2].end_section = True
    tables.show_tables(table)
    for line in outputs.budget_lines(budget):
        tables.say(line)
    tables.say("The standard deviations above are the combined ones.")


def with_weights(name: str, weights: Path | None) -> str | Estimator:
    """The estimator's name, or the network estimator with the given weights.

    Args:
        weights: a file written by ``tunnel train``; None for the packaged weights.

    Raises:
        TunnelError: when the estimator has no weights.
    """
    from tunnel_sim.vocabulary.errors import TunnelError

    if weights is None:
        return name
    if name not in WITH_WEIGHTS:
        remedy = f"add --estimator {' or '.join(WITH_WEIGHTS)}, or leave it out"
        raise TunnelError(f"{name} has no weights", where="--weights", remedy=remedy)
    from identification.estimators import make_estimator

    return cast("Estimator", replace(cast("Any", make_estimator(name)), weights=weights))
