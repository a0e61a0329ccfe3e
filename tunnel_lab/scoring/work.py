"""The work of a score: every estimator on every trial, in processes, continued after an interruption."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from identification.estimate import UNITS, Quantity
from identification.scoring.accuracy import Outcome
from tunnel_lab.scoring.grid import Cell, Grid, check_trials
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import output_folder, write_json
from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign

ItemT = TypeVar("ItemT")
Row = dict[str, Any]
Progress = Callable[[int, int], None]
UNIT_TRIALS = 5
"""Trials done together; an interruption loses at most these in each process."""


@dataclass(frozen=True)
class Unit:
    """Some trials of one cell.

    Args:
        cell: index of the cell in the grid.
        first: number of the first trial.
        stop: number after the last trial.
    """

    cell: int
    first: int
    stop: int

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"c{self.cell:04d}-t{self.first:05d}"


def units_of(grid: Grid) -> tuple[Unit, ...]:
    """The grid in units of a few trials, ordered across cells so that the time left can be estimated early."""
    return tuple(
        Unit(cell, first, min(first + UNIT_TRIALS, grid.trials))
        for first in range(0, grid.trials, UNIT_TRIALS)
        for cell in range(len(grid.cells))
    )


def score_unit(grid: Grid, estimators: Sequence[str], unit: Unit) -> list[Row]:
    """Every estimator on the unit's trials."""
    from tunnel_lab.scoring.draw import draw_trial

    cell = grid.cells[unit.cell]
    rows: list[Row] = []
    for number in range(unit.first, unit.stop):
        wanted = [name for name in estimators if number < grid.trials_for(name)]
        if not wanted:
            continue
        trial = draw_trial(cell, grid.seed, number)
        for name in wanted:
            rows += estimate_rows(
                name, trial.campaign, trial.truth, trial.bound, {"cell": unit.cell, "trial": number}
            )
    return rows


def estimate_rows(
    estimator: str,
    campaign: Campaign,
    truth: Mapping[str, float],
    bound: Mapping[str, float],
    about: Mapping[str, Any],
) -> list[Row]:
    """One estimator on one campaign of known truth, a row for each quantity of the truth.

    An estimator that raises an exception has failed, and its status names the exception: one bad record must not
    stop the work.

    Args:
        truth: by quantity, SI; ζ and ωn are those of the first run.
        bound: the Cramér–Rao bound by quantity, SI; quantities without one are left out.
        about: first columns of every row.

    Returns:
        The rows; value and std are None where the estimator failed.
    """
    from identification import identify

    begun = time.perf_counter()
    try:
        found: Estimate | None = identify(campaign, estimator, throw=False)
        status = "" if found is None else found.status.name.lower()
    except Exception as error:  # any exception of an estimator is counted and shown
        found, status = None, f"raised {type(error).__name__}"
    milliseconds = 1000.0 * (time.perf_counter() - begun) / len(campaign.runs)
    rows = []
    for quantity, value in truth.items():
        source = None if found is None else found.runs[0] if quantity in ("zeta", "omega_n") else found
        answer = getattr(source, quantity, None)
        rows.append(
            {
                **about,
                "estimator": estimator,
                "quantity": quantity,
                "unit": unit_of(quantity),
                "truth": value,
                "value": None if answer is None else answer.value,
                "std": None if answer is None else answer.std,
                "bound": bound.get(quantity),
                "status": status,
                "milliseconds": milliseconds,
            }
        )
    return rows


def outcome(row: Row) -> Outcome:
    """A row as it is scored."""
    found = None if row["value"] is None else Quantity(row["value"], row["std"], row["unit"])
    return Outcome(row["truth"], found, row["bound"])


def unit_of(quantity: str) -> str:
    """Unit of a scored quantity.

    Raises:
        KeyError: when no cell scores it.
    """
    return {**UNITS, "zeta": "1", "omega_n": "rad/s"}[quantity]


def score_grid(
    grid: Grid,
    estimators: Sequence[str],
    *,
    jobs: int = 2,
    parts: Path | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Every estimator on every trial of a grid.

    Args:
        jobs: processes; 0 works in this one. Except for the times, the rows are the same to the bit.
        parts: folder for finished work, from which an interrupted score continues if grid, estimators and code
            are the same; None for none.
        progress: called with the number of finished trials and of all trials.

    Returns:
        The rows, in the order of cells, trials and estimators.

    Raises:
        TunnelError: more trials than a table can hold.
    """
    check_trials(grid, estimators, "score")
    units = units_of(grid)
    mark = fingerprint(grid.to_json_dict(), estimators)
    sizes = {unit.name: unit.stop - unit.first for unit in units}

    def report(names: Sequence[str]) -> None:
        if progress is not None:
            progress(sum(sizes[name] for name in names), sum(sizes.values()))

    done = resumed(
        partial(score_unit, grid, tuple(estimators)),
        {unit.name: unit for unit in units},
        mark,
        jobs=jobs,
        parts=parts,
        report=report,
    )
    order = sorted(units, key=lambda unit: (unit.cell, unit.first))
    return [row for unit in order for row in done[unit.name]]


def resumed(
    work: Callable[[ItemT], list[Row]],
    items: Mapping[str, ItemT],
    mark: str,
    *,
    jobs: int,
    parts: Path | None,
    report: Callable[[Sequence[str]], None],
) -> dict[str, list[Row]]:
    """Do work in processes, store what is finished, and skip what was finished before.

    Args:
        work: function of a module.
        items: its arguments, by the names of their files.
        mark: work stored under another mark is repeated, see `fingerprint`.
        jobs: number of processes; 0 works in this one.
        parts: folder for finished work; None for none.
        report: called with the names of all finished items, at the start and after each.

    Returns:
        The rows of every item, by name.
    """
    done: dict[str, list[Row]] = {}
    if parts is not None:
        kept = {name: _kept(parts, name, mark) for name in items}
        done = {name: rows for name, rows in kept.items() if rows is not None}
    report(tuple(done))
    names = {id(item): name for name, item in items.items()}
    left = [item for name, item in items.items() if name not in done]
    for item, rows in in_processes(work, left, jobs):
        name = names[id(item)]
        if parts is not None:
            write_json(output_folder(parts) / f"{name}.json", {"fingerprint": mark, "rows": rows})
        done[name] = rows
        report(tuple(done))
    return done


def fingerprint(document: Mapping[str, Any], estimators: Sequence[str]) -> str:
    """Hash of all that results depend on: conditions, names of the estimators, and code of the packages below.

    Args:
        document: the conditions, in JSON's types.

    Returns:
        SHA-256 in hexadecimal.
    """
    text = json.dumps([document, list(estimators), _code()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _code() -> str:
    """A digest of all files of identification and tunnel_sim, including weights and libraries."""
    import identification
    import tunnel_sim

    digest = hashlib.sha256()
    for package in (identification, tunnel_sim):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(root).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def _kept(parts: Path, name: str, mark: str) -> list[Row] | None:
    """Stored rows of a unit; None where there are none, or they have another mark."""
    try:
        document = read_json(parts / f"{name}.json", remedy="score it again")
    except TunnelError:
        return None
    rows = document.get("rows")
    whole = isinstance(rows, list) and all(isinstance(row, dict) for row in rows)
    return rows if whole and document.get("fingerprint") == mark else None


def describe(cell: Cell) -> Row:
    """A cell's conditions as columns of a table, units in their names."""
    return {
        "cell": cell.label,
        "kind": cell.kind,
        "zeta": cell.zeta or None,
        "frequency_hz": cell.frequency or None,
        "wind_speed_m_per_s": cell.wind_speed or None,
        "effect": cell.effect,
        "noise_over_amplitude": cell.noise,
        "duration_s": cell.duration,
        "runs": cell.runs,
    }
