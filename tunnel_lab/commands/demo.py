"""``tunnel demo``: the whole chain, from a simulated campaign to figures on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign, Run
    from tunnel_sim.vocabulary.plan import CampaignPlan

SHOWN = ("output_error", "conventional", "neural_network")
"""Estimators of the comparison: the default and the two of the paper. `tunnel score` compares them all."""
NAME = "demo"
MEASURED = "rotary-pendulum"
CHECKED_ESTIMATOR = "output_error"
CHECK_STDS = 4.0
"""The check fails beyond this many standard deviations; its false-alarm rate is one in four thousand."""


def run(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FOLDER", help="Where campaign, estimates and figures go.")
    ] = Path("tunnel-output"),
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of the noise; overrides the plan's.")
    ] = None,
) -> None:
    """Simulate the paper's campaign, identify it, compare it with the truth.

    The paper's rig is simulated with the wind off and on. Three estimators give
    Cnβ and Cnr (1/rad), Izz (kg m²) and Cr (N m s/rad), shown beside the injected
    values. Measured swings of a pendulum follow, by windows of a few cycles.
    Campaign, estimates (JSON) and figures (PNG, PDF) are kept in FOLDER.

    [bold]Examples[/bold]
      tunnel demo
      tunnel demo --out here --seed 7

    [bold]Exit status[/bold]
      0 success, 1 an estimate failed or output_error missed the truth by more
      than four standard deviations, 2 bad input.
    """
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.plan_file import paper_plan
    from tunnel_sim.files.writing import output_folder

    folder = output_folder(out)
    plan = paper_plan()
    if seed is not None:
        plan = replace(plan, seed=seed)
    # Everything is written before anything is printed: the reader of a pipe may close it early.
    campaign, estimates = simulated_part(plan, folder)
    measured = measured_part(folder)
    problem = draw(folder, campaign, estimates, plan, measured[1])
    show_simulated(campaign, estimates, plan)
    show_measured(*measured)
    say("\nFigures (.png and .pdf): traces, spectrum, windows, estimates")
    say(f"No picture of the rig: {problem}" if problem else "Picture of the rig: rig.png")
    say(f"Campaign, estimates (JSON) and figures are in {folder}")
    if missed := misses(estimates, plan):
        say(f"Check failed: {'; '.join(missed)}", stderr=True)
        raise typer.Exit(1)


def truth_of(plan: CampaignPlan) -> dict[str, float]:
    """What a plan injects, by the names of an estimate's quantities.

    Returns:
        Cnβ and Cnr in 1/rad, Izz in kg m², Cr in N m s/rad.
    """
    truth = plan.truth
    return {
        "cn_beta": truth.cn_beta,
        "cn_r": truth.cn_r,
        "yaw_inertia": truth.yaw_inertia,
        "mechanical_damping": truth.mechanical_damping,
    }


def misses(estimates: Sequence[Estimate], plan: CampaignPlan) -> list[str]:
    """The checks that fail: estimates that are missing, or too far from the truth for their standard deviation.

    Returns:
        A clause for each; the distance is checked for the maximum-likelihood estimator only, whose
        standard deviations should be exact.
    """
    lines = [f"{e.estimator}: {e.status.value}" for e in estimates if e.status.failed]
    for estimate in estimates:
        if estimate.estimator != CHECKED_ESTIMATOR or estimate.status.failed:
            continue
        for name, value in truth_of(plan).items():
            quantity = getattr(estimate, name)
            if quantity is None:
                lines.append(f"{estimate.estimator}: no {name}")
            elif abs(quantity.value - value) > CHECK_STDS * quantity.std:
                lines.append(f"{estimate.estimator}: {name} misses the truth by more than {CHECK_STDS:g} std")
    return lines


def simulated_part(plan: CampaignPlan, folder: Path) -> tuple[Campaign, tuple[Estimate, ...]]:
    """Simulate, identify by the paper's two methods and the default one, and write all of it.

    Args:
        folder: where ``campaign`` and the estimates go.
    """
    from identification import identify
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import console
    from tunnel_sim.engine.virtual_campaign import simulate_campaign, truth_document
    from tunnel_sim.files.campaign_folder import write_campaign
    from tunnel_sim.files.writing import write_json

    with bar("simulating runs", len(plan.conditions)) as progress:
        campaign = simulate_campaign(plan, progress=progress)
    write_campaign(campaign, folder / "campaign", truth=truth_document(plan), overwrite=True)
    estimates = []
    for name in SHOWN:
        with console(stderr=True).status(f"identifying by {name}"):
            estimate = identify(campaign, name, throw=False)
        write_json(folder / f"estimate-{name}.json", estimate.to_json_dict())
        estimates.append(estimate)
    return campaign, tuple(estimates)


def show_simulated(campaign: Campaign, estimates: Sequence[Estimate], plan: CampaignPlan) -> None:
    """Print the comparison with the truth."""
    from identification.printing import status_lines
    from tunnel_lab.terminal.tables import say, show_tables, truth_table

    say(f"Simulated: {campaign.name}, {len(campaign.runs)} runs, seed {plan.seed}\n")
    show_tables(truth_table(estimates, truth_of(plan)))
    for estimate in estimates:
        for line in status_lines(estimate.to_json_dict()):
            say(f"Note, {estimate.estimator}: {line}")


def measured_part(folder: Path) -> tuple[Campaign, Estimate]:
    """Identify a packaged measured campaign in normalised form.

    Args:
        folder: where the estimate goes.
    """
    from identification import identify
    from identification.datasets import measured_campaign
    from tunnel_sim.files.writing import write_json

    campaign = measured_campaign(MEASURED)
    estimate = identify(campaign, CHECKED_ESTIMATOR, throw=False)
    write_json(folder / f"estimate-{MEASURED}.json", estimate.to_json_dict())
    return campaign, estimate


def show_measured(campaign: Campaign, estimate: Estimate) -> None:
    """Print a measured campaign's estimate with its windows."""
    from tunnel_lab.terminal.outputs import show_estimate
    from tunnel_lab.terminal.tables import say

    say(f"Measured: {campaign.name}, {len(campaign.runs)} runs. {campaign.description}\n")
    show_estimate(campaign, estimate, windows=True)


def draw(
    folder: Path, campaign: Campaign, estimates: Sequence[Estimate], plan: CampaignPlan, measured: Estimate
) -> str:
    """Draw the figures and the rig.

    Args:
        folder: where they go.

    Returns:
        Why there is no picture of the rig; empty where there is one.
    """
    from tunnel_lab.plotting import runs, style
    from tunnel_lab.plotting.runs import windows_figure
    from tunnel_lab.show.film import Look, write_still
    from tunnel_lab.show.request import Request
    from tunnel_lab.terminal.tables import console
    from tunnel_sim.vocabulary.errors import TunnelError

    off, on = wind_off_on_pair(campaign)
    style.save_both(runs.wind_off_on_figure(off, on), folder / "traces.png")
    style.save_both(runs.spectrum_figure((off, on)), folder / "spectrum.png")
    style.save_both(windows_figure(measured), folder / "windows.png")
    style.save_both(runs.truth_figure(estimates, truth_of(plan)), folder / "estimates.png")
    with console(stderr=True).status("rendering the rig"):
        try:
            write_still(Request(), Look(height=800, trace=False), folder / "rig.png", 0.0)
        except TunnelError as error:
            return str(error)
    return ""


def wind_off_on_pair(campaign: Campaign) -> tuple[Run, Run]:
    """A wind-off run, and the wind-on run of its spring at the highest speed.

    Args:
        campaign: with the wind off and on for one spring at least.

    Raises:
        TunnelError: when no spring has both.
    """
    from tunnel_sim.vocabulary.errors import TunnelError

    for off in campaign.runs:
        pairs = [r for r in campaign.runs if r.wind_on and r.spring_stiffness == off.spring_stiffness]
        if not off.wind_on and pairs:
            return off, max(pairs, key=lambda r: r.wind_speed)
    raise TunnelError(
        "no spring has runs with the wind off and on", where=campaign.name, remedy="add such runs"
    )
