"""A sweep from its file to its folder: what is finished stays, and the rest is done."""

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
"""Does shards: given the sweep as JSON and the shards' numbers, yields them as they finish, in any order."""
Told = Callable[[int, int], None]


@dataclass(frozen=True)
class Outcome:
    """How a sweep went.

    Args:
        store: its folder.
        found: number of shards that were finished already.
        crashes: number of estimates that ended in an error of the estimator itself, in the shards done now.
    """

    store: Store
    found: int
    crashes: int


def run_sweep(sweep: Sweep, folder: Path, work: Work, progress: Told | None = None) -> Outcome:
    """Do what is left of a sweep.

    Args:
        sweep: what to do.
        folder: where its results are and go.
        work: does the shards.
        progress: told cases finished and their number, once at the start and after each shard.

    Returns:
        How it went; then all results are there.

    Raises:
        TunnelError: when the folder is another sweep's, or the work cannot be done.
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
    """The work as a generator, which is closed when it is left, however it is left."""
    if left:
        yield from work(sweep.to_json(), left)


def _cases(sweep: Sweep, shard: int) -> int:
    return min(sweep.cases_per_shard, sweep.size - shard * sweep.cases_per_shard)
