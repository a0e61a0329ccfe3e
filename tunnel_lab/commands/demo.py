"""``tunnel demo``: two faults injected into the virtual rig and diagnosed; or estimates compared with the truth."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from identification.show.blocks import TextTable
from tunnel_lab.terminal.outputs import console, say, say_written, show
from tunnel_lab.terminal.progress import bar, step_display
from tunnel_sim.vocabulary.dimensions import beside

if TYPE_CHECKING:
    from diagnosis.result import Diagnosis
    from identification.estimate import Estimate
    from identification.show.quantity import Quantity
    from tunnel_sim.vocabulary.campaign import Campaign
    from tunnel_sim.vocabulary.plan import CampaignPlan

SHOWN = ("output_error", "conventional", "neural_network")
"""Estimators of the comparison: the default and the paper's two methods. `tunnel score` compares all of them."""
CHECKED_ESTIMATOR = "output_error"
CHECK_STDS = 4.0
"""The check fails beyond this many standard deviations; its false-alarm rate is one in four thousand."""
CAMPAIGN, PLAN, REPORT = "demo", "demo-plan.toml", "report.html"


def demo(
    out: Annotated[
        Path, Option("--out", "-o", metavar="FOLDER", help="Where records, answers and report go.")
    ] = Path("tunnel-output"),
    seed: Annotated[
        int | None, Option("--seed", min=0, help="Seed of the noise; overrides the plan's.")
    ] = None,
    estimators: Annotated[
        bool,
        Option("--estimators", help="Compare estimators with the truth instead, on the paper's campaign."),
    ] = False,
) -> None:
    """Plant two faults in the virtual rig, and find them from its records.

    The rig is simulated with dry friction and with a spring that is softer than
    stated. The records alone are then identified and diagnosed: the causes, their
    sizes, and the share of the gap that they explain on held-out runs. The report
    (report.html), the plan, the campaign, and both answers as JSON are written to
    FOLDER. It takes 9 s on an idle server core, and longer beside other work.

    With --estimators, three estimators identify the paper's campaign, without
    faults, instead. Cnβ and Cnr (1/rad), Izz (kg m²) and Cr (N m s/rad) are shown
    beside the injected values, and figures (PNG, PDF) are written to FOLDER.
    tunnel score compares all estimators with the Cramér–Rao bound.

    [bold]Examples[/bold]
      tunnel demo
      tunnel demo --out here --seed 7
      tunnel demo --estimators

    [bold]Exit status[/bold]
      0 success, 1 the faults were not found, an estimate failed or missed the
      truth by more than four standard deviations, 2 bad input.
    """
    from tunnel_sim.files.plan_file import load_plan, paper_plan
    from tunnel_sim.files.writing import output_folder

    folder = output_folder(out)
    with resources.as_file(resources.files("tunnel_lab") / "data" / PLAN) as path:
        plan = paper_plan() if estimators else load_plan(path)
    if seed is not None:
        plan = replace(plan, seed=seed)
    missed = compare_estimators(plan, folder) if estimators else find_faults(plan, folder)
    if missed:
        say(f"Check failed: {'; '.join(missed)}", stderr=True)
        raise typer.Exit(1)


def find_faults(plan: CampaignPlan, folder: Path) -> list[str]:
    """Simulate a plan with effects, identify and diagnose the records, write all results and print two screens.

    Returns:
        Clauses on faults that the diagnosis missed; empty if it found all.
    """
    import diagnosis
    from identification import identify
    from tunnel_lab.bench.workspace import Session
    from tunnel_lab.report import write_report
    from tunnel_lab.terminal.arguments import file_hashes
    from tunnel_sim.files.writing import write_json, write_whole

    files = Session(folder, CAMPAIGN)  # named as on the bench, which can open them
    text = (resources.files("tunnel_lab") / "data" / PLAN).read_text(encoding="utf-8")
    text = re.sub(r"(?m)^seed = \d+", f"seed = {plan.seed}", text, count=1)  # keeps the comments
    campaign = _simulated(plan, files.campaign)
    write_whole(folder / PLAN, text.encode())
    # everything is written before anything is printed: the reader of a pipe may close it early
    estimate = identify(campaign, CHECKED_ESTIMATOR, throw=False)
    write_json(files.estimate(CHECKED_ESTIMATOR), estimate.to_json_dict())
    with step_display() as show_step:
        answer = diagnosis.diagnose(campaign, progress=show_step)
    answer = answer.with_hashes(file_hashes(files.campaign))
    write_json(files.diagnosis, answer.to_json_dict())
    write_report(answer, campaign, folder / REPORT)
    show_faults(plan, campaign, answer)
    say_written(folder / REPORT)
    say(f"Records, plan and both answers (JSON) are in {folder}")
    show_next(folder)
    return missed_faults(plan, answer)


def _simulated(plan: CampaignPlan, folder: Path) -> Campaign:
    """Simulate a plan, and write the campaign with its truth."""
    from tunnel_sim.engine.virtual_campaign import simulate_campaign, truth_document
    from tunnel_sim.files.campaign_folder import write_campaign

    with bar("simulating runs", len(plan.conditions)) as progress:
        campaign = simulate_campaign(plan, progress=progress)
    write_campaign(campaign, folder, truth=truth_document(plan), overwrite=True)
    return campaign


def show_faults(plan: CampaignPlan, campaign: Campaign, answer: Diagnosis) -> None:
    """Print the injected faults, the findings, and the explained part of the gap."""
    from diagnosis.findings.closure import waterfall_table
    from tunnel_sim.effects.registry import effect_class

    springs = dict.fromkeys(condition.spring_stiffness for condition in plan.conditions)
    speeds = dict.fromkeys(condition.wind_speed for condition in plan.conditions)
    say(
        f"Simulated: {len(campaign.runs)} runs of the virtual rig, springs of {_listed(springs)} N m/rad, "
        f"wind of {_listed(speeds)} m/s, seed {plan.seed}"
    )
    for effect in plan.effects:
        sizes = (
            f"{info.name} {info.symbol} = {effect.parameters[info.name]:g}{beside(info.unit)}"
            for info in effect_class(effect.name).parameters()
            if info.name in effect.parameters
        )
        say(f"Planted: {effect.name}, {', '.join(sizes)}")
    say(f"\nFound, from the records alone:\n{answer.verdict}\n")
    show([found_table(plan, answer), waterfall_table(answer.waterfall, answer.misfit)])


def found_table(plan: CampaignPlan, answer: Diagnosis) -> TextTable:
    """The injected values, beside the results of the nominal model and of the model with the causes."""
    from identification.estimate import UNITS
    from identification.printing import SYMBOLS
    from identification.show.numbers import estimated, in_stds, significant, unit, with_std
    from tunnel_sim.effects.registry import effect_class

    rows = []
    before, after = answer.coefficients.before, answer.coefficients.after
    for name in after:
        truth = getattr(plan.truth, name)
        rows.append(
            (
                f"{SYMBOLS[name]} {unit(UNITS[name])}",
                significant(truth),
                with_std(before[name].value, before[name].std),
                with_std(after[name].value, after[name].std),
                in_stds(after[name].value - truth, after[name].std),
            )
        )
    for (effect, name), (truth, found) in planted_and_found(plan, answer).items():
        info = next(info for info in effect_class(effect).parameters() if info.name == name)
        error = in_stds(found.value - truth, found.std) if found and found.std else ""
        cell = "not found" if found is None else estimated(found)
        rows.append((f"{info.symbol} {unit(info.unit)}", significant(truth), "", cell, error))
    heads = ("quantity", "planted", "nominal model", "with the causes", "error")
    return TextTable(
        "Planted and found, ± one standard deviation σ", heads, tuple(rows), ("planted", "error")
    )


def planted_and_found(
    plan: CampaignPlan, answer: Diagnosis
) -> dict[tuple[str, str], tuple[float, Quantity | None]]:
    """Injected parameters by effect and name, each with the answer's value; None if the answer lacks it."""
    first = answer.candidates[0]
    given = {
        tuple(name.split(".")) if "." in name else (first.effect, name): found
        for name, found in first.parameters.items()
    }
    return {
        (effect.name, name): (value, given.get((effect.name, name)))
        for effect in plan.effects
        for name, value in effect.parameters.items()
    }


def missed_faults(plan: CampaignPlan, answer: Diagnosis) -> list[str]:
    """Clauses on errors of a diagnosis: other causes, or a size or coefficient too far from the truth.

    A choice among stated values, such as the spring, has no standard deviation and must equal the injected value.
    """
    planted = sorted(effect.name for effect in plan.effects)
    if sorted(answer.causes) != planted:
        named = " and ".join(answer.causes) or "none"
        return [f"planted {' and '.join(planted)}, found {named}"]
    pairs = {f"{effect} {name}": pair for (effect, name), pair in planted_and_found(plan, answer).items()}
    for name, found in answer.coefficients.after.items():
        pairs[name] = getattr(plan.truth, name), found
    return [
        f"{name} misses the truth by more than {CHECK_STDS:g} std"
        for name, (truth, found) in pairs.items()
        if found is None
        or not isclose(found.value, truth, abs_tol=CHECK_STDS * (found.std or 0.0), rel_tol=1e-9)
    ]


def _listed(values: Iterable[float]) -> str:
    *first, last = (f"{value:g}" for value in values)
    return f"{', '.join(first)} and {last}" if first else last


def show_next(folder: Path) -> None:
    """Print the next commands, as typed in this folder."""
    typed = sys.argv[0] if Path(sys.argv[0]).stem == "tunnel" else ""
    name = "tunnel" if not typed or shutil.which("tunnel") else shlex.quote(typed)
    steps = (
        (f"bench {shlex.quote(str(folder))}", "this campaign and your own files, in the browser"),
        ("import log.csv --out my-rig", "your own records, from a data logger's files"),
        ("diagnose my-rig --report my.html", "what is missing in the model of your rig"),
    )
    say("\nNext")
    room = max(len(command) for command, _ in steps)
    for command, what in steps:
        say(f"  {name} {command:<{room}}  {what}")


def compare_estimators(plan: CampaignPlan, folder: Path) -> list[str]:
    """Simulate the paper's campaign, compare estimates with the truth, and draw both.

    Returns:
        Clauses on failed checks.
    """
    from identification.show.style import save_both
    from tunnel_lab.plotting import runs

    campaign, estimates = simulated_part(plan, folder)
    off = campaign.in_still_air[0]
    pairs = [run for run in campaign.in_wind if run.spring_stiffness == off.spring_stiffness]
    on = max(pairs, key=lambda run: run.wind_speed)
    save_both(runs.wind_off_on_figure(off, on), folder / "traces.png")
    save_both(runs.spectrum_figure((off, on)), folder / "spectrum.png")
    save_both(runs.truth_figure(estimates, vars(plan.truth)), folder / "estimates.png")
    show_simulated(campaign, estimates, plan)
    say("Figures (.png and .pdf): traces, spectrum, estimates")
    say(f"Campaign, estimates (JSON) and figures are in {folder}")
    return misses(estimates, plan)


def misses(estimates: Sequence[Estimate], plan: CampaignPlan) -> list[str]:
    """Clauses on failed checks: estimates missing, or too far from the truth for their standard deviation.

    The distance is checked only for the maximum-likelihood estimator, whose standard deviations should be exact.
    """
    lines = [f"{e.estimator}: {e.status.value}" for e in estimates if e.status.failed]
    for estimate in estimates:
        if estimate.estimator != CHECKED_ESTIMATOR or estimate.status.failed:
            continue
        for name, value in vars(plan.truth).items():
            quantity = getattr(estimate, name)
            if quantity is None:
                lines.append(f"{estimate.estimator}: no {name}")
            elif abs(quantity.value - value) > CHECK_STDS * quantity.std:
                lines.append(f"{estimate.estimator}: {name} misses the truth by more than {CHECK_STDS:g} std")
    return lines


def simulated_part(plan: CampaignPlan, folder: Path) -> tuple[Campaign, tuple[Estimate, ...]]:
    """Simulate, identify by the paper's two methods and the default method, and write all results to the folder."""
    from identification import identify
    from tunnel_sim.files.writing import write_json

    campaign = _simulated(plan, folder / "campaign")
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

    say(f"Simulated: {campaign.name}, {len(campaign.runs)} runs, seed {plan.seed}\n")
    show([truth_table(estimate, vars(plan.truth)) for estimate in estimates])
    for estimate in estimates:
        for line in status_lines(estimate.to_json_dict()):
            say(f"Note, {estimate.estimator}: {line}")


def truth_table(estimate: Estimate, truth: Mapping[str, float]) -> TextTable:
    """An estimate beside the injected values.

    Args:
        truth: injected values by name, each in the unit of the estimate's quantity of that name.
    """
    from identification.estimate import UNITS
    from identification.printing import SYMBOLS
    from identification.show.numbers import in_stds, significant, unit, with_std

    rows = []
    for name, value in truth.items():
        cells = (f"{SYMBOLS[name]} {unit(UNITS[name])}", significant(value))
        quantity: Quantity | None = getattr(estimate, name)
        if quantity is None:
            rows.append((*cells, estimate.status.name.lower().replace("_", " "), "", ""))
            continue
        error = quantity.value - value
        relative = f"{100.0 * error / abs(value):+.1g} %" if value else ""
        rows.append((*cells, with_std(quantity.value, quantity.std), relative, in_stds(error, quantity.std)))
    heads = ("quantity", "truth", "estimate ± std", "error", "error/std")
    right = ("truth", "error", "error/std")
    return TextTable(f"{estimate.estimator} against the injected truth", heads, tuple(rows), right)
