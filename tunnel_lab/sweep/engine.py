"""Runs a sweep: keeps finished shards and does the rest."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tunnel_lab.sweep.product import Sweep
from tunnel_lab.sweep.store import Store, begin

if TYPE_CHECKING:
    from tunnel_lab.sweep.shard import Finished

Work = Callable[[str, Sequence[int]], Iterator["Finished"]]
"""A function that does shards: given the sweep as JSON and their numbers, it yields them in any order."""
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Outcome:
    """The outcome of a sweep.

    Args:
        found: number of shards that were finished already.
        crashes: number of estimates that raised an exception, in the shards done now.
    """

    store: Store
    found: int
    crashes: int


def run_sweep(sweep: Sweep, folder: Path, work: Work, progress: Progress | None = None) -> Outcome:
    """Do the rest of a sweep.

    Args:
        progress: called with the number of finished cases and of all cases, at the start and after each shard.

    Returns:
        The outcome; all results are then complete.

    Raises:
        TunnelError: when the folder belongs to another sweep, or the work cannot be done.
    """
    store = begin(sweep, folder)
    finished = set(store.finished())
    left = [index for index in range(sweep.shards) if index not in finished]
    done = sum(_cases(sweep, index) for index in finished)
    if progress is not None:
        progress(done, sweep.size)
    crashes = 0
    with closing(_started(work, sweep, left)) as shards:
        for shard in shards:
            store.keep(shard)
            crashes += shard.crashes
            done += _cases(sweep, shard.index)
            if progress is not None:
                progress(done, sweep.size)
    store.tidy()
    return Outcome(store, len(finished), crashes)


def _started(work: Work, sweep: Sweep, left: Sequence[int]) -> Generator[Finished, None, None]:
    """The work as a generator, which is always closed at the end."""
    if left:
        yield from work(sweep.to_json(), left)


def _cases(sweep: Sweep, shard: int) -> int:
    return min(sweep.cases_per_shard, sweep.size - shard * sweep.cases_per_shard)
