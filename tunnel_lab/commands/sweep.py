"""``tunnel sweep``: simulate and estimate many campaigns, and summarise them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

NAME = "sweep"


def run(
    file: Annotated[Path | None, typer.Argument(help="The sweep file (TOML).", show_default=False)] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FOLDER", help="Folder of the results.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Processes on this machine. Default: one for each processor."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Use the Dask cluster of this scheduler (tcp://host:8786), or start one here: local.",
        ),
    ] = None,
    summary: Annotated[
        Path | None,
        typer.Option("--summary", metavar="FOLDER", help="Draw and tabulate the finished part of a sweep."),
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
      tunnel sweep sweep.toml --out results --scheduler tcp://host:8786
      tunnel sweep --summary results

    [bold]Exit status[/bold]
      0 finished, 1 an estimator raised an exception, 2 bad input,
      130 interrupted (finished work is kept).
    """
    from tunnel_sim.vocabulary.errors import TunnelError

    if summary is not None:
        if file is not None or out is not None:
            raise TunnelError(
                "takes neither FILE nor --out", where="--summary", remedy="name the folder of a sweep only"
            )
        show_summary(summary)
        return
    if file is None or out is None:
        missing = "FILE" if file is None else "--out"
        raise TunnelError(
            f"{missing} is missing", where="sweep", remedy="give FILE --out FOLDER, or --summary FOLDER"
        )
    sweep_file(file, out, workers, scheduler)


def sweep_file(file: Path, out: Path, workers: int | None, scheduler: str | None) -> None:
    """Run a sweep, or the rest of it.

    Args:
        workers: number of processes or, with a scheduler started here, of its workers.
        scheduler: address, ``local``, or None for processes of this machine.

    Raises:
        TunnelError: for bad input.
    """
    from tunnel_lab.experiments.runner import available_processors, lasting_processes, on_cluster
    from tunnel_lab.experiments.sweep import run_sweep
    from tunnel_lab.experiments.sweep_cases import read_sweep
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.vocabulary.errors import TunnelError

    if workers is not None and scheduler not in (None, "local"):
        raise TunnelError(
            "its workers are started on their own machines",
            where=f"--scheduler {scheduler}",
            remedy="leave out --workers",
        )
    sweep = read_sweep(file)
    count = min(workers or available_processors(), sweep.shards)

    def say_line(line: str) -> None:
        say(f"tunnel: {line}", stderr=True)

    crew = lasting_processes(count, say_line) if scheduler is None else on_cluster(scheduler, count, say_line)
    with bar("cases", sweep.size) as progress:
        outcome = run_sweep(sweep, out, crew, progress)
    if outcome.found:
        say(f"{outcome.found} of {sweep.shards} shards were finished before")
    estimates = sweep.size * len(sweep.document.estimators)
    say(f"Written: {out} ({sweep.size} cases, {sweep.runs} runs, {estimates} estimates)")
    if outcome.crashes:
        say(
            f"{outcome.crashes} estimates raised an exception: see status 'raised' in the results",
            stderr=True,
        )
        raise typer.Exit(1)


def show_summary(folder: Path) -> None:
    """Tabulate and draw the finished part of a sweep.

    Raises:
        TunnelError: when it holds no sweep, or nothing is finished.
    """
    import polars as pl

    from tunnel_lab.experiments import sweep_summary
    from tunnel_lab.experiments.sweep import open_store
    from tunnel_lab.experiments.sweep_summary import summarise
    from tunnel_lab.plotting import style
    from tunnel_lab.terminal.tables import say, show_tables
    from tunnel_sim.files.writing import output_folder, write_encoded

    store = open_store(folder)
    lines = summarise(store)
    grouped = sweep_summary.groups(lines)
    target = output_folder(folder / "summary")
    written = [
        write_encoded(target / "summary.csv", pl.DataFrame([line.to_row() for line in lines]).write_csv)
    ]
    for name, part in grouped.items():
        drawn = sweep_summary.error_figure(part)
        if drawn is not None:
            written += style.save_both(drawn, target / f"{name}.png")
    done, shards = len(store.finished()), store.sweep.shards
    if done < shards:
        say(f"Finished: {done} of {shards} shards; run the same command again for the rest\n")
    show_tables(
        sweep_summary.overall_table(lines),
        *map(sweep_summary.axis_table, grouped.values()),
        sweep_summary.pace_table(store),
    )
    say(sweep_summary.BRACKETS)
    say(f"Written to {target}: {', '.join(path.name for path in written)}")
