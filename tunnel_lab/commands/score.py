"""``tunnel score``: errors of the estimators, and a comparison with a baseline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tunnel_lab.experiments.score_grid import Grid
    from tunnel_lab.experiments.score_trials import Results

NAME = "score"
PACKAGED = "packaged"
"""Name of the installed baseline."""
_RESULTS = ("trials.", "score", "breakdown")  # how the names of the files in --out begin


def run(
    grid: Annotated[
        Path | None,
        typer.Argument(help="Grid of conditions, TOML. Default: the packaged one, or the baseline's own."),
    ] = None,
    estimators: Annotated[
        list[str] | None,
        typer.Option("--estimator", "-e", metavar="NAME", help="Score only these. Default: all."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FOLDER", help="Keep trials and scores (Parquet) and a figure (PNG, PDF) here."
        ),
    ] = None,
    trials: Annotated[
        int | None, typer.Option("--trials", min=2, help="Records in each cell; overrides the grid's.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of the records; overrides the grid's.")
    ] = None,
    jobs: Annotated[
        int,
        typer.Option(
            "--jobs", min=0, help="Number of processes, on which no result depends; 0 uses this one."
        ),
    ] = 2,
    cells: Annotated[bool, typer.Option("--cells", help="Also show every cell.")] = False,
    check: Annotated[
        str | None,
        typer.Option(
            "--check",
            metavar="BASELINE",
            help="Exit with 1 if an estimator is worse than this file, or 'packaged'.",
        ),
    ] = None,
    write_baseline: Annotated[
        Path | None, typer.Option("--write-baseline", metavar="FILE", help="Write the trials as a baseline.")
    ] = None,
    breakdown: Annotated[
        bool,
        typer.Option("--breakdown", help="Show the bias caused by each unmodelled effect instead."),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a finished score in the folder.")
    ] = False,
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
      tunnel score --estimator output_error --write-baseline base.parquet
      tunnel score --check base.parquet
      tunnel score --check packaged --estimator conventional
      tunnel score --breakdown --out map

    [bold]Exit status[/bold]
      0 scored, 1 an estimator got worse, 2 bad input,
      130 interrupted (finished work is kept in --out).
    """
    from tunnel_lab.experiments import score_view
    from tunnel_lab.experiments import score_view as checking
    from tunnel_lab.experiments.score_trials import Results, write_trials
    from tunnel_lab.terminal.options import refuse_unwritable_files
    from tunnel_lab.terminal.tables import say, say_written, show_tables

    names = chosen(estimators)
    if breakdown:
        _refuse_of_the_grid({"GRID": grid, "--check": check, "--write-baseline": write_baseline})
        _refuse_occupied(out, overwrite)
        _breakdown(names, out, jobs, 1 if seed is None else seed, trials)
        return
    baseline = None if check is None else _baseline(check, names, everything=not estimators)
    wanted = _grid(grid, baseline, trials, seed)
    _refuse_occupied(out, overwrite)
    refuse_unwritable_files(write_baseline)
    results = Results(wanted, names, tuple(_rows(wanted, names, jobs, out)))
    written = [] if out is None else _keep(out, results)
    if write_baseline is not None:
        written.append(write_trials(write_baseline, results))
    show_tables(*score_view.summary_tables(results))
    if cells:
        show_tables(*score_view.cell_tables(results))
    say(score_view.ABOUT)
    for name, kinds in results.raised().items():
        say(f"Note: {name} raised {', '.join(kinds)}; counted as failures")
    say_written(*written)
    if baseline is not None:
        verdict = checking.check(baseline, results)
        say("")
        show_tables(score_view.worse_table(verdict))
        for line in score_view.verdict_lines(verdict):
            say(line)
        if not verdict.passed:
            raise typer.Exit(1)


def chosen(names: list[str] | None) -> tuple[str, ...]:
    """The estimators to score.

    Args:
        names: as typed; a word may hold several, separated by commas. None takes all.

    Raises:
        TunnelError: when one is unknown, with the closest name.
    """
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_lab.terminal.options import known_estimator

    if not names:
        return ALL_ESTIMATORS
    given = [part.strip() for word in names for part in word.split(",")]
    for name in given:
        known_estimator(name)
    return tuple(dict.fromkeys(given))


def _baseline(text: str, names: tuple[str, ...], *, everything: bool) -> Results:
    from tunnel_lab.experiments.score_trials import packaged_baseline, read_trials
    from tunnel_sim.vocabulary.errors import TunnelError

    baseline = packaged_baseline() if text == PACKAGED else read_trials(Path(text))
    gone = [name for name in baseline.estimators if name not in names]
    if everything and gone:
        raise TunnelError(
            f"the baseline has {', '.join(gone)}, which the registry does not have",
            where="--check",
            remedy="write a new baseline with --write-baseline, or name what to score with --estimator",
        )
    return baseline


def _grid(path: Path | None, baseline: Results | None, trials: int | None, seed: int | None) -> Grid:
    from tunnel_lab.experiments.score_grid import load_grid, packaged_grid

    grid = baseline.grid if baseline is not None else packaged_grid()
    if path is not None:
        grid = load_grid(path)
    if trials is not None:
        grid = replace(grid, trials=trials)
    return grid if seed is None else replace(grid, seed=seed)


def _rows(grid: Grid, names: tuple[str, ...], jobs: int, out: Path | None) -> list[dict[str, object]]:
    from tunnel_lab.experiments.score_trials import score_grid
    from tunnel_lab.terminal.progress import bar

    parts = None if out is None else out / "parts"
    with bar("scoring") as progress:
        return score_grid(grid, names, jobs=jobs, parts=parts, progress=progress)


def _keep(out: Path, results: Results) -> list[Path]:
    import shutil

    from tunnel_lab.experiments.score_trials import parquet, write_trials
    from tunnel_lab.experiments.score_view import score_figure, scores_frame
    from tunnel_lab.plotting.style import save_both
    from tunnel_sim.files.writing import write_whole

    written = [
        write_trials(out / "trials.parquet", results),
        write_whole(out / "scores.parquet", parquet(scores_frame(results))),
        *save_both(score_figure(results), out / "score.png"),
    ]
    shutil.rmtree(out / "parts", ignore_errors=True)
    return written


def _refuse_occupied(out: Path | None, overwrite: bool) -> None:
    """Refuse a folder that holds anything but an interrupted score, unless ``overwrite``."""
    from tunnel_sim.files.writing import clear_leftovers
    from tunnel_sim.vocabulary.errors import TunnelError

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


def _refuse_of_the_grid(given: dict[str, object]) -> None:
    """Refuse options that do not apply to the breakdown, which has its own conditions."""
    from tunnel_sim.vocabulary.errors import TunnelError

    for name, value in given.items():
        if value is not None:
            raise TunnelError(
                "cannot be combined with --breakdown", where=name, remedy="leave one of them out"
            )


def _breakdown(names: tuple[str, ...], out: Path | None, jobs: int, seed: int, trials: int | None) -> None:
    import shutil

    from tunnel_lab.experiments import breakdown as view
    from tunnel_lab.experiments import breakdown as work
    from tunnel_lab.experiments.score_trials import parquet
    from tunnel_lab.plotting.style import save_both
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import console, say, say_written, show_tables
    from tunnel_sim.files.writing import write_whole

    terminal = console(stderr=True).is_terminal
    cases = work.make_cases(seed, realisations=trials or work.REALISATIONS, show_steps=terminal)
    parts = None if out is None else out / "parts"
    with bar("scoring") as progress:
        rows = work.break_down(cases, names, seed, jobs=jobs, parts=parts, progress=progress)
    biases = work.biases(rows)
    written = []
    if out is not None:
        frame = work.breakdown_frame(biases)
        written.append(write_whole(out / "breakdown.parquet", parquet(frame)))
        for quantity in view.SHOWN:
            path = out / f"breakdown-{quantity.replace('_', '-')}.png"
            written += save_both(view.breakdown_figure(frame, quantity), path)
        shutil.rmtree(out / "parts", ignore_errors=True)
    show_tables(*(shown for quantity in view.SHOWN for shown in view.breakdown_tables(biases, quantity)))
    say(view.ABOUT)
    say_written(*written)
