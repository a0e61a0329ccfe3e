"""``tunnel sweep``: a product of simulated campaigns, continued where it stopped."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from tunnel_lab.terminal.arguments import SchedulerOption, chosen_estimators, estimator_option
from tunnel_lab.terminal.outputs import say
from tunnel_lab.terminal.progress import bar
from tunnel_sim.vocabulary.errors import TunnelError, counted


def sweep(
    file: Annotated[Path | None, Argument(help="The sweep file (TOML).", show_default=False)] = None,
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="FOLDER", help="Folder of the results.")
    ] = None,
    jobs: Annotated[
        int | None,
        Option("--jobs", min=1, help="Processes on this machine. Default: one for each processor."),
    ] = None,
    scheduler: SchedulerOption = None,
    estimators: Annotated[tuple[str, ...], estimator_option("Estimate with this one too")] = (),
    summary: Annotated[
        Path | None,
        Option("--summary", metavar="FOLDER", help="Draw and tabulate the finished part of a sweep."),
    ] = None,
) -> None:
    r"""Simulate and estimate a product of campaigns; continue where it stopped.

    Every case is a campaign: one rig, conditions, sensor, truth and effect from
    the file. Its seed is computed from these, so results are identical to the bit
    with any number of workers, on one machine or a cluster. They go to
    FOLDER/results, a Parquet dataset in the order of the cases. After an
    interruption the same command does the rest.

    A Dask scheduler has no password: anyone who reaches its port can run any code
    on its workers and here. Use --scheduler only in a network that you trust.

    [bold]A sweep file[/bold]
      name = "noise-and-friction"
      seed = 1
      replicates = 10              # of every case, with other noise
      estimators = ["output_error", "conventional"]
      records = false              # true also keeps the runs
      conditions.springs = [5, 8]            # of the paper's Table II
      conditions.wind_speeds = [0.0, 15.0]   # m/s; 0 is wind-off
      conditions.release_angles_deg = [20.0]
      conditions.duration = 10.0             # s
      truth.cn_beta = [0.35, 0.495]          # 1/rad; a number or a list
      truth.cn_r = -0.114                    # 1/rad
      sensor.noise_std = [0.0002, 0.0005, 0.002]   # rad
      effects = [
        { name = "none" },
        { name = "mains_hum", parameters.amplitude = [1e-4, 1e-3] },   # rad
      ]

    [bold]Examples[/bold]
      tunnel sweep sweep.toml --out results
      tunnel sweep sweep.toml --out results -e my_module:MyMethod
      tunnel sweep sweep.toml --out results --scheduler tcp://host:8786
      tunnel sweep --summary results

    [bold]Exit status[/bold]
      0 finished, 1 an estimator raised an exception or returned no valid estimate,
      2 bad input, 130 interrupted (finished work is kept).
    """
    if summary is not None:
        if file is not None or out is not None:
            raise TunnelError(
                "takes neither FILE nor --out", where="--summary", remedy="name the folder of a sweep only"
            )
        _summarise(summary)
        return
    if file is None or out is None:
        missing = "FILE" if file is None else "--out"
        raise TunnelError(
            f"{missing} is missing", where="sweep", remedy="give FILE --out FOLDER, or --summary FOLDER"
        )
    from tunnel_lab.experiments.experiment import run_in
    from tunnel_lab.experiments.runner import crew
    from tunnel_lab.experiments.sweep import read_sweep, sweep_of

    plan = read_sweep(file, chosen_estimators(estimators))
    workers = crew(jobs, scheduler, plan.shards)
    with bar("cases", plan.size) as progress:
        _, outcome = run_in(sweep_of(plan), out, workers, progress)
    if outcome.finished_before:
        say(f"{outcome.finished_before} of {counted(plan.shards, 'shard')} finished before")
    estimates = plan.size * len(plan.document.estimators)
    sizes = (plan.size, "case"), (plan.runs, "run"), (estimates, "estimate")
    say(f"Written: {out} ({', '.join(counted(*size) for size in sizes)})")
    if plan.document.estimators:
        say(f"Tables and figures: tunnel sweep --summary {shlex.quote(str(out))}")
    for line in (line for failed in outcome.failed for line in failed.lines):
        say(line, stderr=True)
    if any(failed.of_the_estimator for failed in outcome.failed):
        raise typer.Exit(1)


def _summarise(folder: Path) -> None:
    """Tabulate and draw the finished part of a sweep."""
    from tunnel_lab.experiments.experiment import Parts
    from tunnel_lab.experiments.sweep import stored_sweep, sweep_of
    from tunnel_lab.experiments.sweep_view import sweep_view

    sweep = stored_sweep(folder)
    store = Parts(folder, sweep_of(sweep))
    if not sweep.document.estimators:
        remedy = "there is no estimate to summarise"
        raise TunnelError("the sweep has no estimators", where=str(folder), remedy=remedy)
    view = sweep_view(store.scan(), sweep.document.name)
    written = view.write(folder / "summary")
    done, shards = len(store.finished()), sweep.shards
    if done < shards:
        say(f"Finished: {done} of {counted(shards, 'shard')}; run the same command again for the rest\n")
    view.show()
    say(written)
