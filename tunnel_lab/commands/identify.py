"""``tunnel identify``: the coefficients of a campaign on disk, measured or simulated."""

from __future__ import annotations

import inspect
import shlex
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer
from rich.text import Text
from typer import Argument, Option

from identification.estimators import SUMMARIES, make_estimator
from identification.printing import budget_blocks, estimate_blocks
from identification.show.blocks import Block, Paragraph, TextTable
from tunnel_lab.terminal.arguments import HELP as CAMPAIGN_HELP
from tunnel_lab.terminal.arguments import (
    LeaveOutOption,
    chosen_estimator,
    chosen_estimators,
    estimator_option,
    given_campaign,
    output_file,
    own_code,
    refuse_unwritable_files,
)
from tunnel_lab.terminal.encoding import printable_json
from tunnel_lab.terminal.outputs import console, say, say_written, show
from tunnel_lab.terminal.progress import bar
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from identification.estimators import Estimator
    from identification.uncertainty.budget import Budget
    from tunnel_sim.vocabulary.campaign import Campaign
    from tunnel_sim.vocabulary.turning_points import TurningPoints

DIAGNOSE = "run the diagnosis"
"""The ending of notes with a diagnosis as their remedy."""
FEW_RUNS = 3
"""Maximum number of runs for showing the windows by default."""
ESTIMATORS = "  {estimators}"
"""Placeholder in the help for the list of estimators."""
_HELP_WIDTH = 78
WITH_WEIGHTS = ("neural_network", "neural_posterior")


@dataclass(frozen=True)
class BudgetOptions:
    """The options of an uncertainty budget."""

    budget: Annotated[bool, Option("--budget", help="Add the choice of model; show the dominant source.")] = (
        False
    )
    uncertainties: Annotated[
        Path | None,
        Option(
            "--uncertainties",
            metavar="FILE",
            help="Uncertainties of Kr, V, ρ, A and l (TOML); implies --budget.",
        ),
    ] = None
    models: Annotated[
        tuple[str, ...],
        Option(
            "--model",
            metavar="NAME",
            help="Another estimator for the choice of model; with --budget. May be repeated.",
        ),
    ] = ()

    @property
    def wanted(self) -> bool:
        """Whether a budget is made."""
        return self.budget or self.uncertainties is not None

    def make(
        self, data: Campaign, estimate: Estimate, chosen: str | Estimator, others: Iterable[str]
    ) -> Budget:
        """The budget of an estimate, from the estimator that made it and from other estimators."""
        from identification import identify
        from identification.uncertainty import budget as budgets

        inputs = budgets.InputUncertainties()  # exact
        if self.uncertainties is not None:
            inputs = budgets.load_uncertainties(self.uncertainties)
        with console(stderr=True).status("uncertainty budget") as status:
            return budgets.make_budget(
                data,
                estimate,
                partial(identify, estimator=chosen, throw=False),
                inputs,
                others={
                    name: partial(identify, estimator=name, throw=False)
                    for name in others
                    if name != estimate.estimator
                },
                progress=lambda what: status.update(Text(f"uncertainty budget: {what}")),
            )


def run(
    campaign: Annotated[Path, Argument(help=CAMPAIGN_HELP)],
    leave_out: LeaveOutOption = (),
    *,
    estimator: Annotated[
        str, estimator_option("One of the estimators listed above or of an installed package")
    ] = "output_error",
    json: Annotated[
        Path | None, output_file("--json", ".json", help="Write the estimate as JSON; - for standard output.")
    ] = None,
    weights: Annotated[
        Path | None,
        Option("--weights", metavar="FILE", help="Networks written by tunnel train, for the same estimator."),
    ] = None,
    windows: Annotated[
        bool | None,
        Option(
            "--windows/--no-windows",
            help="Show ζ and ωn by windows of a few cycles. Default: for up to three runs.",
            show_default=False,
        ),
    ] = None,
    budgeted: BudgetOptions,
) -> None:
    """Identify Cnβ, Cnr, Izz and Cr of a campaign, measured or simulated.

    Every run gives its natural frequency ωn (rad/s) and damping ratio ζ. Runs
    with a stated spring, with the wind off and on, together give Cnβ and Cnr
    (1/rad), Izz (kg m²) and Cr (N m s/rad). Without spring_stiffness the runs
    give only ωn and ζ. Every estimate has a standard deviation, and every note
    states a remedy.

    [bold]Estimators[/bold]
      {estimators}

    [bold]Examples[/bold]
      tunnel identify my-campaign
      tunnel identify my-campaign --estimator conventional --json estimate.json
      tunnel identify my-campaign --leave-out r07 --leave-out r09
      tunnel identify my-campaign --json - | jq .cn_beta
      tunnel identify my-campaign --uncertainties known.toml --model conventional

    [bold]Uncertainty[/bold]
      By default, standard deviations include sensor noise and the scatter between
      runs. --budget adds the choice of model, and --uncertainties the errors of the
      stated Kr, V, ρ, A and l. The combined standard uncertainty is then reported,
      and a table shows the dominant source.

    [bold]Exit status[/bold]
      0 identified, 1 nothing could be identified, or an estimator of your own failed, 2 bad input.
    """
    from identification import identify
    from tunnel_sim.files.writing import json_text, write_json
    from tunnel_sim.vocabulary.turning_points import HoldsTurningPoints

    estimator, models = chosen_estimator(estimator), chosen_estimators(budgeted.models)
    if models and not budgeted.wanted:
        raise TunnelError("needs --budget", where="--model", remedy="add --budget, or leave it out")
    to_stdout = json is not None and str(json) == "-"
    refuse_unwritable_files(None if to_stdout else json)
    try:
        whole = given_campaign(campaign)
    except HoldsTurningPoints as held:
        if leave_out or weights or budgeted != BudgetOptions() or estimator != "output_error":
            raise
        _show_turning_points(held.points, json)
        return
    data = whole.without(leave_out)
    chosen: str | Estimator = estimator
    if weights is not None:
        if estimator not in WITH_WEIGHTS:
            remedy = f"add --estimator {' or '.join(WITH_WEIGHTS)}, or leave it out"
            raise TunnelError(f"{estimator} has no weights", where="--weights", remedy=remedy)
        chosen = cast("Estimator", replace(cast("Any", make_estimator(estimator)), weights=weights))
    with own_code([estimator]), bar("identifying runs", len(data.runs)) as progress:
        estimate = identify(whole, chosen, leave_out=leave_out, throw=False, progress=progress)
    made = None
    if budgeted.wanted and not estimate.status.failed:
        from identification.uncertainty.budget import with_budget

        with own_code([estimator, *models]):
            made = budgeted.make(data, estimate, chosen, models)
        estimate = with_budget(estimate, made)
    document = estimate.to_json_dict() | ({} if made is None else {"budget": made.to_json_dict()})
    if to_stdout:
        typer.echo(printable_json(json_text(document)), nl=False)
    else:
        if json is not None:
            write_json(json, document)
        detailed = len(data.runs) <= FEW_RUNS if windows is None else windows
        show(estimate_shown(data, document, campaign, windows=detailed))
        if made is not None:
            say("")
            show(
                (*budget_blocks(document), Paragraph("The standard deviations above are the combined ones."))
            )
        say_written(json)
    if estimate.status.failed:
        raise typer.Exit(1)


def estimate_shown(
    campaign: Campaign, document: Mapping[str, Any], source: Path, *, windows: bool
) -> Iterator[Block]:
    """The blocks of an estimate, with the conditions of all runs, and with commands to copy in its notes."""
    conditions = {run.id: (run.spring_stiffness, run.wind_speed) for run in campaign.runs}
    command = f"run tunnel diagnose {shlex.quote(str(source))}"
    for block in estimate_blocks(document, conditions, windows=windows):
        if isinstance(block, Paragraph):
            yield replace(block, text=block.text.replace(DIAGNOSE, command))
        else:
            yield block


def _show_turning_points(points: TurningPoints, json: Path | None) -> None:
    """Identify turning points by the likelihood of their times and angles: ωn and ζ, with the JSON of a run."""
    from identification.estimate import Estimate, RunEstimate
    from identification.show.numbers import with_std
    from identification.show.quantity import Quantity
    from identification.signal.turning_points import fit_turning_points
    from identification.status import Status
    from tunnel_sim.files.writing import json_text, write_json

    for line in points.remarks:
        say(f"Note: {points.name}: {line}", stderr=True)
    fit = fit_turning_points(points)
    omega = Quantity(fit.omega_n.value, fit.omega_n.std, "rad/s")
    zeta = Quantity(fit.zeta.value, fit.zeta.std, "1")
    zero = Quantity(fit.zero.value, fit.zero.std, "rad")
    run = RunEstimate(points.name, omega_n=omega, zeta=zeta, sensor_zero=zero)
    document = Estimate(points.name, "turning_points", (run,), (Status.NO_STIFFNESS,)).to_json_dict()
    if json is not None and str(json) == "-":
        typer.echo(printable_json(json_text(document)), nl=False)
        return
    if json is not None:
        write_json(json, document)
    rows = [
        ("natural frequency ωn [rad/s]", fit.omega_n),
        ("damping ratio ζ", fit.zeta),
        ("period of the swing [s]", fit.period),
        ("logarithmic decrement of a period", fit.decrement),
        ("angle at rest [rad]", fit.zero),
        ("first swing from there [rad]", fit.first_swing),
    ]
    cells = tuple((name, with_std(one.value, one.std)) for name, one in rows)
    heading = "value ± one standard deviation"
    title = f"{points.name}: {points.time_s.size} turning points"
    show([TextTable(title, ("quantity", heading), cells, right=(heading,))])
    for line in fit.remarks:
        say(f"Note: {line}")
    say(
        "Note: turning points give ωn and ζ alone; a campaign, and a diagnosis, need the angle between them too"
    )
    say_written(json)


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
