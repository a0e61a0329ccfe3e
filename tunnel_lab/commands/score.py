"""``tunnel score``: estimators on the same simulated records, continued where it stopped."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from tunnel_lab.terminal.arguments import (
    SchedulerOption,
    chosen_estimators,
    estimator_option,
    output_file,
    refuse_unwritable_files,
)
from tunnel_lab.terminal.outputs import console, say, say_written, show
from tunnel_lab.terminal.progress import bar
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tunnel_lab.experiments.estimate_rows import Failed
    from tunnel_lab.experiments.runner import Workers
    from tunnel_lab.experiments.score import Results
    from tunnel_lab.experiments.score_grid import Grid
    from tunnel_lab.experiments.view import ExperimentView

PACKAGED = "packaged"
"""Name of the installed baseline."""
PARTS = "parts"
_JOBS = 2
_RESULTS = ("trials.", "score", "breakdown", "index.")  # beginnings of the file names in --out


@dataclass(frozen=True)
class ScoredRecords:
    """The records on which estimators are scored."""

    grid: Annotated[
        Path | None,
        Argument(help="Grid of conditions, TOML. Default: the packaged one, or the baseline's own."),
    ] = None
    trials: Annotated[
        int | None, Option("--trials", min=2, help="Records in each cell; overrides the grid's.")
    ] = None
    seed: Annotated[
        int | None, Option("--seed", min=0, help="Seed of the records; overrides the grid's.")
    ] = None

    def of(self, usual: Grid) -> Grid:
        """The given or the usual grid, with these trials and this seed."""
        from tunnel_lab.experiments.score_grid import load_grid

        wanted = usual if self.grid is None else load_grid(self.grid)
        trials = wanted.trials if self.trials is None else self.trials
        return replace(wanted, trials=trials, seed=wanted.seed if self.seed is None else self.seed)


@dataclass(frozen=True)
class ScoreView:
    """The part of the score to show, and its baselines."""

    cells: Annotated[bool, Option("--cells", help="Also show every cell.")] = False
    check: Annotated[
        str | None,
        Option(
            "--check",
            metavar="BASELINE",
            help="Exit with 1 if an estimator is worse than this file, or 'packaged'.",
        ),
    ] = None
    write_baseline: Annotated[
        Path | None, output_file("--write-baseline", ".parquet", help="Write the trials as a baseline.")
    ] = None
    breakdown: Annotated[
        bool, Option("--breakdown", help="Show the bias caused by each unmodelled effect instead.")
    ] = False


def score(
    *,
    estimators: Annotated[
        tuple[str, ...],
        estimator_option("Score only this one", "May be repeated. Default: all packaged ones."),
    ] = (),
    out: Annotated[
        Path | None,
        Option(
            "--out", metavar="FOLDER", help="Keep trials and scores (Parquet) and a figure (PNG, PDF) here."
        ),
    ] = None,
    records: ScoredRecords,
    jobs: Annotated[
        int | None,
        Option(
            "--jobs",
            min=0,
            help="Number of processes, on which no result depends; 0 uses this one. Default: 2.",
        ),
    ] = None,
    scheduler: SchedulerOption = None,
    shown: ScoreView,
    overwrite: Annotated[bool, Option("--overwrite", help="Replace a finished score in the folder.")] = False,
) -> None:
    """Score estimators: RMSE, also over the Cramér–Rao bound; coverage, failures, time.

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
    reference simulator, at 1 and 10 times the noise variance, and shows the bias of
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
    from tunnel_lab.experiments.runner import crew
    from tunnel_lab.experiments.score import score_grid, write_trials
    from tunnel_lab.experiments.score_grid import packaged_grid
    from tunnel_lab.experiments.score_view import check, score_view, verdict_blocks

    names = chosen_estimators(estimators) or ALL_ESTIMATORS
    workers = crew(jobs, scheduler, usual=_JOBS)
    if shown.breakdown:  # with its own conditions
        others = {
            "GRID": records.grid,
            "--check": shown.check,
            "--write-baseline": shown.write_baseline,
        }
        for name, value in others.items():
            if value is not None:
                raise TunnelError(
                    "cannot be combined with --breakdown", where=name, remedy="leave one of them out"
                )
        parts = _parts(out, overwrite)
        _breakdown(names, out, parts, workers, 1 if records.seed is None else records.seed, records.trials)
        return
    baseline = None if shown.check is None else _baseline(shown.check, names, everything=not estimators)
    wanted = records.of(packaged_grid() if baseline is None else baseline.grid)
    parts = _parts(out, overwrite)
    refuse_unwritable_files(shown.write_baseline)
    with bar("scoring") as progress:
        results, failed = score_grid(wanted, names, workers, parts=parts, progress=progress)
    view = score_view(results, cells=shown.cells)
    if out is not None:
        write_trials(out / "trials.parquet", results)
    if shown.write_baseline is not None:
        write_trials(shown.write_baseline, results)
    _present(view, out, failed)
    say_written(shown.write_baseline)
    if baseline is not None:
        verdict = check(baseline, results)
        say("")
        show(verdict_blocks(verdict))
        if failed or not verdict.passed:
            raise typer.Exit(1)


def _present(view: ExperimentView, out: Path | None, failed: Iterable[Failed]) -> None:
    """Write and print the results."""
    written = "" if out is None else view.write(out)
    if out is not None:
        shutil.rmtree(out / PARTS)
    view.show()
    if written:
        say(written)
    for line in (line for one in failed for line in one.lines):
        say(line, stderr=True)


def _baseline(text: str, names: tuple[str, ...], *, everything: bool) -> Results:
    from tunnel_lab.experiments.score import packaged_baseline, read_trials

    baseline = packaged_baseline() if text == PACKAGED else read_trials(Path(text))
    gone = [name for name in baseline.estimators if name not in names]
    if everything and gone:
        what = f"the baseline has {', '.join(gone)}, which no installed package adds"
        remedy = "name your own class again with -e module:Class, or another estimator with --estimator"
        raise TunnelError(what, where="--check", remedy=remedy)
    return baseline


def _parts(out: Path | None, overwrite: bool) -> Path | None:
    """The folder of unfinished work in ``--out``, which may contain only the files of an interrupted score."""
    from tunnel_sim.files.writing import clear_leftovers

    if out is None:
        return None
    if out.exists():
        clear_leftovers(out)
        if not out.is_dir():
            raise TunnelError("is a file, not a folder", where=str(out), remedy="name another --out")
        names = {path.name for path in out.iterdir()}
        # the parts are removed after all results are written, because a full disk may interrupt the writing
        interrupted = PARTS in names and all(name.startswith(_RESULTS) for name in names - {PARTS})
        if overwrite:
            shutil.rmtree(out / PARTS, ignore_errors=True)
        elif names and not interrupted:
            raise TunnelError(
                "exists already", where=str(out), remedy="name another --out or add --overwrite"
            )
    return out / PARTS


def _breakdown(
    names: tuple[str, ...],
    out: Path | None,
    parts: Path | None,
    workers: Workers,
    seed: int,
    trials: int | None,
) -> None:
    from tunnel_lab.experiments.breakdown import REALISATIONS, breakdown_of, breakdown_view, make_cases
    from tunnel_lab.experiments.estimate_rows import failures_in
    from tunnel_lab.experiments.experiment import results_of

    terminal = console(stderr=True).is_terminal
    cases = make_cases(seed, realisations=trials or REALISATIONS, show_steps=terminal)
    with bar("scoring") as progress:
        results, outcome = results_of(breakdown_of(cases, names, seed), parts, workers, progress)
    failed = failures_in(results, ("effect", "severity", "realisation"), outcome.failed)
    _present(breakdown_view(results), out, failed)
