"""``tunnel score``: estimators on the same simulated records, continued where it stopped."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from tunnel_lab.terminal.inputs import chosen_estimators, ending, estimator_option, refuse_unwritable_files
from tunnel_lab.terminal.outputs import bar, console, say, say_written, show_tables
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_lab.experiments.score_trials import Results

PACKAGED = "packaged"
"""Name of the installed baseline."""
_RESULTS = ("trials.", "score", "breakdown")  # beginnings of the file names in --out


def score(
    grid: Annotated[
        Path | None,
        Argument(help="Grid of conditions, TOML. Default: the packaged one, or the baseline's own."),
    ] = None,
    estimators: Annotated[
        list[str] | None,
        estimator_option("Score only this one", "May be repeated. Default: all packaged ones."),
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
      0 scored, 1 with --check: an estimator got worse, raised an exception or returned no
      valid estimate, 2 bad input, 130 interrupted (finished work is kept in --out).
    """
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_lab.experiments import score_trials, score_view
    from tunnel_lab.experiments.score_drawing import score_figure
    from tunnel_lab.experiments.score_grid import load_grid, packaged_grid
    from tunnel_lab.plotting.style import save_both
    from tunnel_sim.files.writing import write_whole

    names = chosen_estimators(estimators) or ALL_ESTIMATORS
    if breakdown:  # with its own conditions
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
            *save_both(score_figure(results), out / "score.png"),
        ]
        shutil.rmtree(out / "parts", ignore_errors=True)
    if write_baseline is not None:
        written.append(score_trials.write_trials(write_baseline, results))
    show_tables(*score_view.summary_tables(results))
    if cells:
        show_tables(*score_view.cell_tables(results))
    for line in score_view.lines_below(results):
        say(line)
    say_written(*written)
    failed = score_trials.failure_lines(rows)
    for line in failed:
        say(line, stderr=True)
    if baseline is not None:
        verdict = score_view.check(baseline, results)
        say("")
        show_tables(score_view.worse_table(verdict))
        for line in score_view.verdict_lines(verdict):
            say(line)
        if failed or not verdict.passed:
            raise typer.Exit(1)


def _baseline(text: str, names: tuple[str, ...], *, everything: bool) -> Results:
    from tunnel_lab.experiments.score_trials import packaged_baseline, read_trials

    baseline = packaged_baseline() if text == PACKAGED else read_trials(Path(text))
    gone = [name for name in baseline.estimators if name not in names]
    if everything and gone:
        what = f"the baseline has {', '.join(gone)}, which no installed package adds"
        remedy = "name a class of your own again with -e module:Class, or what else to score with --estimator"
        raise TunnelError(what, where="--check", remedy=remedy)
    return baseline


def _refuse_occupied(out: Path | None, overwrite: bool) -> None:
    """Refuse a folder with anything other than an interrupted score, unless ``overwrite``."""
    from tunnel_sim.files.writing import clear_leftovers

    if out is None or not out.exists():
        return
    clear_leftovers(out)
    if not out.is_dir():
        raise TunnelError("is a file, not a folder", where=str(out), remedy="name another --out")
    names = {path.name for path in out.iterdir()}
    # The parts are removed after all results are written: a full disk may have interrupted the writing.
    interrupted = "parts" in names and all(name.startswith(_RESULTS) for name in names - {"parts"})
    if names and not interrupted and not overwrite:
        raise TunnelError("exists already", where=str(out), remedy="name another --out or add --overwrite")


def _breakdown(names: tuple[str, ...], out: Path | None, jobs: int, seed: int, trials: int | None) -> None:
    from tunnel_lab.experiments import breakdown
    from tunnel_lab.experiments.score_trials import failure_lines, not_given, parquet
    from tunnel_lab.experiments.score_view import not_given_lines
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
        for quantity in (one for one in breakdown.SHOWN if any(bias.quantity == one for bias in biases)):
            path = out / f"breakdown-{quantity.replace('_', '-')}.png"
            written += save_both(breakdown.breakdown_figure(frame, quantity), path)
        shutil.rmtree(out / "parts", ignore_errors=True)
    for quantity in breakdown.SHOWN:
        show_tables(*breakdown.breakdown_tables(biases, quantity))
    for line in (breakdown.ABOUT, *not_given_lines(not_given(rows))):
        say(line)
    say_written(*written)
    for line in failure_lines(rows):
        say(line, stderr=True)
