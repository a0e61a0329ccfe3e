"""``tunnel sweep``, ``score`` and ``train``: many simulated campaigns, continued where they stopped."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from tunnel_lab.terminal.inputs import chosen_estimators, ending, refuse_unwritable_files
from tunnel_lab.terminal.outputs import bar, console, say, say_written, show_tables, table
from tunnel_sim.vocabulary.errors import TunnelError, counted

if TYPE_CHECKING:
    from tunnel_lab.experiments.score_trials import Results

PACKAGED = "packaged"
"""Name of the installed baseline."""
_RESULTS = ("trials.", "score", "breakdown")  # how the names of the files in --out begin
CHECKPOINT_EVERY_S = 5.0


def sweep(
    file: Annotated[Path | None, Argument(help="The sweep file (TOML).", show_default=False)] = None,
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="FOLDER", help="Folder of the results.")
    ] = None,
    jobs: Annotated[
        int | None,
        Option("--jobs", min=1, help="Processes on this machine. Default: one for each processor."),
    ] = None,
    scheduler: Annotated[
        str | None,
        Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Use the Dask cluster of this scheduler (tcp://host:8786), or start one here: local.",
        ),
    ] = None,
    estimators: Annotated[
        list[str] | None,
        Option(
            "--estimator",
            "-e",
            metavar="NAME",
            help="Estimate with this one too: a name, or module:Class of your own.",
        ),
    ] = None,
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
      0 finished, 1 an estimator raised an exception, 2 bad input,
      130 interrupted (finished work is kept).
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
    if jobs is not None and scheduler not in (None, "local"):
        what = "its workers are started on their own machines"
        raise TunnelError(what, where=f"--scheduler {scheduler}", remedy="leave out --jobs")
    from tunnel_lab.experiments.runner import available_processors, lasting_processes, on_cluster
    from tunnel_lab.experiments.sweep import run_sweep
    from tunnel_lab.experiments.sweep_cases import read_sweep

    plan = read_sweep(file, chosen_estimators(estimators))
    count = min(jobs or available_processors(), plan.shards)

    def say_line(line: str) -> None:
        say(f"tunnel: {line}", stderr=True)

    crew = lasting_processes(count, say_line) if scheduler is None else on_cluster(scheduler, count, say_line)
    with bar("cases", plan.size) as progress:
        outcome = run_sweep(plan, out, crew, progress)
    if outcome.found:
        say(f"{outcome.found} of {counted(plan.shards, 'shard')} finished before")
    estimates = plan.size * len(plan.document.estimators)
    sizes = (plan.size, "case"), (plan.runs, "run"), (estimates, "estimate")
    say(f"Written: {out} ({', '.join(counted(*size) for size in sizes)})")
    if outcome.crashes:
        crashes = f"{counted(outcome.crashes, 'estimate')} raised an exception"
        say(f"{crashes}: see status 'raised' in the results. The first:", stderr=True)
        say(outcome.first_crash, stderr=True)
        raise typer.Exit(1)


def _summarise(folder: Path) -> None:
    """Tabulate and draw the finished part of a sweep."""
    import polars as pl

    from tunnel_lab.experiments import sweep_summary
    from tunnel_lab.experiments.sweep import open_store
    from tunnel_lab.plotting.style import save_both
    from tunnel_sim.files.writing import output_folder, write_encoded
    from tunnel_sim.vocabulary.text_cells import as_text_cell

    store = open_store(folder)
    lines = sweep_summary.summarise(store)
    grouped = sweep_summary.groups(lines)
    target = output_folder(folder / "summary")
    frame = pl.DataFrame([line.to_row() for line in lines])
    texts = pl.col(pl.String).map_elements(as_text_cell, return_dtype=pl.String)
    written = [write_encoded(target / "summary.csv", frame.with_columns(texts).write_csv)]
    for name, part in grouped.items():
        drawn = sweep_summary.error_figure(part)
        if drawn is not None:
            written += save_both(drawn, target / f"{name}.png")
    done, shards = len(store.finished()), store.sweep.shards
    if done < shards:
        say(f"Finished: {done} of {counted(shards, 'shard')}; run the same command again for the rest\n")
    along = map(sweep_summary.axis_table, grouped.values())
    show_tables(sweep_summary.overall_table(lines), *along)
    say(sweep_summary.BRACKETS)
    say(f"Written to {target}: {', '.join(path.name for path in written)}")


def score(
    grid: Annotated[
        Path | None,
        Argument(help="Grid of conditions, TOML. Default: the packaged one, or the baseline's own."),
    ] = None,
    estimators: Annotated[
        list[str] | None,
        Option(
            "--estimator",
            "-e",
            metavar="NAME",
            help="Score only these: names, or module:Class of your own. Default: all packaged ones.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            "--out", metavar="FOLDER", help="Keep trials and scores (Parquet) and a figure (PNG, PDF) here."
        ),
    ] = None,
    trials: Annotated[
        int | None, Option("--trials", min=2, help="Records in each cell; overrides the grid's.")
    ] = None,
    seed: Annotated[
        int | None, Option("--seed", min=0, help="Seed of the records; overrides the grid's.")
    ] = None,
    jobs: Annotated[
        int, Option("--jobs", min=0, help="Number of processes, on which no result depends; 0 uses this one.")
    ] = 2,
    cells: Annotated[bool, Option("--cells", help="Also show every cell.")] = False,
    check: Annotated[
        str | None,
        Option(
            "--check",
            metavar="BASELINE",
            help="Exit with 1 if an estimator is worse than this file, or 'packaged'.",
        ),
    ] = None,
    write_baseline: Annotated[
        Path | None,
        Option(
            "--write-baseline",
            callback=ending(".parquet"),
            metavar="FILE",
            help="Write the trials as a baseline.",
        ),
    ] = None,
    breakdown: Annotated[
        bool, Option("--breakdown", help="Show the bias caused by each unmodelled effect instead.")
    ] = False,
    overwrite: Annotated[bool, Option("--overwrite", help="Replace a finished score in the folder.")] = False,
) -> None:
    """Score estimators: bias, RMSE over the Cramér–Rao bound, coverage, failures, time.

    Every estimator sees the same simulated records: single decays over ζ,
    frequency (Hz), noise and length (s), and campaigns over wind speed (m/s),
    with effects on or off. With --out an interrupted score continues where
    it ended. The same seed gives the same results (except the times) with any
    number of processes.

    --check compares with a baseline in five aspects: bias, spread, outliers,
    coverage and failures. The false-alarm rate of all tests together is
    1 %. Without a grid, the baseline's own records are scored, so that unchanged
    code reproduces the baseline to the last bit.

    --breakdown adds each unmodelled effect to a campaign of twelve runs of the
    reference simulator, at 1 and 10 times the noise power, and shows the bias of
    Cnβ and Cnr in % and in reported standard deviations (three realisations, or
    --trials). This takes a few minutes.

    [bold]Examples[/bold]
      tunnel score
      tunnel score grid.toml --out scores --trials 200
      tunnel score -e my_module:MyMethod -e output_error
      tunnel score --estimator output_error --write-baseline base.parquet
      tunnel score --check base.parquet
      tunnel score --check packaged --estimator conventional
      tunnel score --breakdown --out map

    [bold]Exit status[/bold]
      0 scored, 1 with --check: an estimator got worse or raised an exception, 2 bad input,
      130 interrupted (finished work is kept in --out).
    """
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_lab.experiments import score_trials, score_view
    from tunnel_lab.experiments.score_grid import load_grid, packaged_grid
    from tunnel_lab.plotting.style import save_both
    from tunnel_sim.files.writing import write_whole

    names = chosen_estimators(estimators) or ALL_ESTIMATORS
    if breakdown:  # it has its own conditions
        for name, value in {"GRID": grid, "--check": check, "--write-baseline": write_baseline}.items():
            if value is not None:
                raise TunnelError(
                    "cannot be combined with --breakdown", where=name, remedy="leave one of them out"
                )
        _refuse_occupied(out, overwrite)
        _breakdown(names, out, jobs, 1 if seed is None else seed, trials)
        return
    baseline = None if check is None else _baseline(check, names, everything=not estimators)
    wanted = baseline.grid if baseline is not None else packaged_grid()
    if grid is not None:
        wanted = load_grid(grid)
    if trials is not None:
        wanted = replace(wanted, trials=trials)
    if seed is not None:
        wanted = replace(wanted, seed=seed)
    _refuse_occupied(out, overwrite)
    refuse_unwritable_files(write_baseline)
    parts = None if out is None else out / "parts"
    with bar("scoring") as progress:
        rows = score_trials.score_grid(wanted, names, jobs=jobs, parts=parts, progress=progress)
    results = score_trials.Results(wanted, names, tuple(rows))
    written: list[Path] = []
    if out is not None:
        written = [
            score_trials.write_trials(out / "trials.parquet", results),
            write_whole(out / "scores.parquet", score_trials.parquet(score_view.scores_frame(results))),
            *save_both(score_view.score_figure(results), out / "score.png"),
        ]
        shutil.rmtree(out / "parts", ignore_errors=True)
    if write_baseline is not None:
        written.append(score_trials.write_trials(write_baseline, results))
    show_tables(*score_view.summary_tables(results))
    if cells:
        show_tables(*score_view.cell_tables(results))
    say(score_view.ABOUT)
    say_written(*written)
    raised = score_trials.raised_lines(rows)
    for line in raised:
        say(line, stderr=True)
    if baseline is not None:
        verdict = score_view.check(baseline, results)
        say("")
        show_tables(score_view.worse_table(verdict))
        for line in score_view.verdict_lines(verdict):
            say(line)
        if raised or not verdict.passed:
            raise typer.Exit(1)


def _baseline(text: str, names: tuple[str, ...], *, everything: bool) -> Results:
    from tunnel_lab.experiments.score_trials import packaged_baseline, read_trials

    baseline = packaged_baseline() if text == PACKAGED else read_trials(Path(text))
    gone = [name for name in baseline.estimators if name not in names]
    if everything and gone:
        what = f"the baseline has {', '.join(gone)}, which the registry does not have"
        remedy = "write a new baseline with --write-baseline, or name what to score with --estimator"
        raise TunnelError(what, where="--check", remedy=remedy)
    return baseline


def _refuse_occupied(out: Path | None, overwrite: bool) -> None:
    """Refuse a folder that holds anything but an interrupted score, unless ``overwrite``."""
    from tunnel_sim.files.writing import clear_leftovers

    if out is None or not out.exists():
        return
    clear_leftovers(out)
    if not out.is_dir():
        raise TunnelError("is a file, not a folder", where=str(out), remedy="name another --out")
    names = {path.name for path in out.iterdir()}
    # The parts are removed when all results are written: a full disk may have stopped it in between.
    interrupted = "parts" in names and all(name.startswith(_RESULTS) for name in names - {"parts"})
    if names and not interrupted and not overwrite:
        raise TunnelError("exists already", where=str(out), remedy="name another --out or add --overwrite")


def _breakdown(names: tuple[str, ...], out: Path | None, jobs: int, seed: int, trials: int | None) -> None:
    from tunnel_lab.experiments import breakdown
    from tunnel_lab.experiments.score_trials import parquet, raised_lines
    from tunnel_lab.plotting.style import save_both
    from tunnel_sim.files.writing import write_whole

    terminal, parts = console(stderr=True).is_terminal, None if out is None else out / "parts"
    cases = breakdown.make_cases(seed, realisations=trials or breakdown.REALISATIONS, show_steps=terminal)
    with bar("scoring") as progress:
        rows = breakdown.break_down(cases, names, seed, jobs=jobs, parts=parts, progress=progress)
    biases = breakdown.biases(rows)
    written = []
    if out is not None:
        frame = breakdown.breakdown_frame(biases)
        written.append(write_whole(out / "breakdown.parquet", parquet(frame)))
        for quantity in breakdown.SHOWN:
            path = out / f"breakdown-{quantity.replace('_', '-')}.png"
            written += save_both(breakdown.breakdown_figure(frame, quantity), path)
        shutil.rmtree(out / "parts", ignore_errors=True)
    for quantity in breakdown.SHOWN:
        show_tables(*breakdown.breakdown_tables(biases, quantity))
    say(breakdown.ABOUT)
    say_written(*written)
    for line in raised_lines(rows):
        say(line, stderr=True)


def train(
    out: Annotated[Path, Argument(help="File to write (.safetensors), with a record (.json) beside it.")],
    seed: Annotated[int, Option("--seed", min=0, help="Seed of the initial weights and the test set.")] = 1,
    zeta: Annotated[
        tuple[float, float], Option("--zeta", help="Range of damping ratios.", metavar="LOW HIGH")
    ] = (0.001, 0.35),
    omega: Annotated[
        tuple[float, float], Option("--omega", help="Range of ωn, rad/s.", metavar="LOW HIGH")
    ] = (0.4, 26.0),
    starts: Annotated[int, Option("--starts", min=1, help="Number of training runs of each network.")] = 3,
    steps: Annotated[
        int | None,
        Option(
            "--steps",
            min=1,
            help="Largest number of steps of each network. Default: 400 for ζ, 3000 for ωn; 2000 for "
            "neural_posterior.",
        ),
    ] = None,
    estimator: Annotated[
        Literal["neural_network", "neural_posterior"],
        Option("--estimator", "-e", help="Whose networks to train."),
    ] = "neural_network",
    shards: Annotated[
        int, Option("--shards", min=1, help="For neural_posterior: training campaigns, in units of 200.")
    ] = 15,
    jobs: Annotated[int, Option("--jobs", min=0, help="For neural_posterior: processes that simulate.")] = 2,
    restart: Annotated[
        bool, Option("--restart", help="Start again instead of continuing an interrupted training.")
    ] = False,
) -> None:
    """Train networks: the paper's, 100-5-5-1 for ζ and 2-2-5-1 for ωn, or the posterior's.

    Full-batch Levenberg-Marquardt with Bayesian regularisation on impulse
    responses over the ranges given. Each network is trained from several random
    starts, and the one with the largest evidence is kept. The effective number of
    parameters γ, α, β and the errors on test responses are shown and written as
    JSON beside the weights. The same seed gives the same bits on the same machine.
    Training takes half a minute on an idle core.

    An interrupted training leaves OUT.part.safetensors; the same command continues
    from there and gives the same bits.

    With --estimator neural_posterior, campaigns are drawn and simulated by the
    reference simulator with effects in many forms, and two networks are fitted to
    them: one for a record, one for a campaign. --zeta, --omega and --starts do not
    apply. Unfinished work is in the folder OUT.part; it does not matter how many
    processes simulate.

    [bold]Examples[/bold]
      tunnel train mine.safetensors --seed 7
      tunnel train wide.safetensors --zeta 0.001 0.5 --omega 0.4 60
      tunnel identify c -e neural_network --weights mine.safetensors
      tunnel train posterior.safetensors -e neural_posterior

    [bold]Exit status[/bold]
      0 trained, 2 bad input, 130 interrupted (finished work is kept).
    """
    from identification.neural.networks import DataSpec
    from identification.neural.train import Checkpoint, TrainingSpec, read_checkpoint
    from identification.neural.train import train as train_networks
    from tunnel_sim.files.writing import write_json, write_whole

    if out.suffix != ".safetensors":
        raise TunnelError("does not end in .safetensors", where=str(out), remedy="give the file this suffix")
    if estimator == "neural_posterior":
        _train_posterior(out, seed, shards, steps or 2000, jobs=jobs, restart=restart)
        return
    for option, (low, high), most in (("--zeta", zeta, 0.95), ("--omega", omega, 1e4)):
        if not 0.0 < low < high < most:
            remedy = f"give LOW HIGH between 0 and {most:g}"
            raise TunnelError(f"{low:g} {high:g} is not a range", where=option, remedy=remedy)
    data = DataSpec(zeta_range=zeta, omega_range=omega)
    spec = TrainingSpec(seed, data, starts, steps or 400, steps or 3000)
    partial = out.with_suffix(".part.safetensors")
    refuse_unwritable_files(out, out.with_suffix(".json"), partial)
    resume = None if restart else read_checkpoint(partial, spec.to_json_dict())
    if partial.exists() and resume is None and not restart:
        raise TunnelError(
            "belongs to another training", where=str(partial), remedy="add --restart, or name another file"
        )
    latest, written = resume or Checkpoint(), monotonic()

    def keep(checkpoint: Checkpoint) -> None:
        nonlocal latest, written
        latest = checkpoint
        if monotonic() - written > CHECKPOINT_EVERY_S:
            write_whole(partial, checkpoint.to_bytes(spec.to_json_dict()))
            written = monotonic()

    try:
        with bar("training", spec.total_work) as progress:
            trained = train_networks(
                spec,
                resume=resume,
                keep=keep,
                progress=lambda done, text: progress(done, spec.total_work, text),
            )
    except KeyboardInterrupt:
        write_whole(partial, latest.to_bytes(spec.to_json_dict()))
        say(f"Kept: {partial}; the same command continues from there", stderr=True)
        raise
    write_whole(out, trained.weights)
    write_json(out.with_suffix(".json"), trained.record)
    partial.unlink(missing_ok=True)
    record = trained.record
    headings = ("γ [1]", "α [1]", "β [1]", "ln evidence")
    result = table(f"Trained with seed {record['seed']}", "network", "start", *headings, right=headings)
    for name, network in record["networks"].items():
        for number, start in enumerate(network["starts"], 1):
            result.add_row(
                f"{name} {'-'.join(map(str, network['sizes']))}",
                f"{number}{' kept' if number == network['chosen_start'] else ''}",
                f"{start['effective_parameters']:.1f} of {network['parameters']}",
                f"{start['alpha']:.3f}", f"{start['beta']:.2e}", f"{start['log_evidence']:.1f}",
            )  # fmt: skip
    show_tables(result)
    errors = record["errors"]
    say(
        f"On {record['data']['test_count']} test responses: errors of ζ up to {errors['zeta']:.1e} "
        f"({100 * errors['zeta_relative']:.2g} % of ζ at most), "
        f"ωn to {100 * errors['omega_relative']:.2g} %"
    )
    say(f"Written: {out} and {out.with_suffix('.json')}")


def _train_posterior(out: Path, seed: int, shards: int, steps: int, *, jobs: int, restart: bool) -> None:
    """Train and write both networks of `neural_posterior`, with a record beside them."""
    from tunnel_lab.experiments.training import TrainingSpec, train
    from tunnel_sim.files.writing import write_json, write_whole

    refuse_unwritable_files(out, out.with_suffix(".json"))
    folder = out.with_suffix(".part")
    if restart and folder.exists():
        shutil.rmtree(folder)
    with bar("training", 1) as progress:
        weights, record = train(
            TrainingSpec(seed, shards, steps),
            folder,
            jobs=jobs,
            progress=lambda what, done, all_of_it: progress(done, all_of_it, what),
        )
    write_whole(out, weights)
    write_json(out.with_suffix(".json"), record)
    shutil.rmtree(folder)
    for kind, network in record["networks"].items():
        losses = ", ".join(f"{part} {loss:.3f}" for part, (loss, _) in network["loss"].items())
        say(
            f"{kind}: {network['samples']['training']} samples; −ln of the density at the truth, in standard "
            f"deviations of the nominal fit: {losses}"
        )
    say(f"Written: {out} and {out.with_suffix('.json')}")
