"""Shards in parallel in processes of this machine; those of a process that dies are repeated."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import TYPE_CHECKING

from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_lab.sweep.shard import Finished

PATIENCE = 3
"""How often processes may die in succession without finishing a shard."""

Said = Callable[[str], None]


def available_processors() -> int:
    """Number of processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def shards_in_processes(workers: int, say: Said) -> Callable[[str, Sequence[int]], Iterator[Finished]]:
    """Work by processes of this machine.

    Args:
        say: called with each line for the user.

    Returns:
        A function that does shards: given the sweep as JSON and the shards' numbers, it yields them as they finish.
    """
    return partial(_work, workers, say)


def _work(workers: int, say: Said, sweep: str, shards: Sequence[int]) -> Iterator[Finished]:
    from tunnel_lab.sweep.shard import run_shard

    left = list(shards)
    broken = 0
    while left:
        try:
            for index, done in in_processes(partial(run_shard, sweep), tuple(left), workers):
                left.remove(index)
                broken = 0
                yield done
        except BrokenProcessPool:
            broken += 1
            if broken >= PATIENCE:
                raise TunnelError(
                    f"worker processes died {PATIENCE} times without finishing a shard",
                    remedy="check the memory and give fewer --workers; finished shards are kept",
                ) from None
            say("a worker process was lost; its shards are repeated")
