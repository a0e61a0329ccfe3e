"""Causes chosen by hand, fitted in a process of its own, which keeps the fits made so far."""

from __future__ import annotations

import asyncio
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

    from diagnosis.by_hand import ByHand, Closure

Parameters = ParamSpec("Parameters")
ResultT = TypeVar("ResultT")


async def closure(campaign: Path, effects: Sequence[str], *, converged: bool) -> Closure:
    """How far the gap closes with effects chosen by hand.

    Args:
        campaign: its folder.
        effects: their names.
        converged: whether the fit frees their forms and goes on until it has converged.

    Raises:
        TunnelError: when the campaign cannot be read, or an effect cannot be fitted to it.
    """
    return await _elsewhere(_closure, str(campaign), _state(campaign), tuple(sorted(effects)), converged)


async def next_run(campaign: Path, first: Sequence[str], second: Sequence[str]) -> dict[str, Any] | None:
    """The run that would distinguish two sets of effects; None in normalised form.

    Args:
        campaign: its folder.
        first: names of effects.
        second: names of their rivals.

    Raises:
        TunnelError: as `closure`.
    """
    return await _elsewhere(
        _next_run, str(campaign), _state(campaign), tuple(sorted(first)), tuple(sorted(second))
    )


async def _elsewhere(
    work: Callable[Parameters, ResultT], *given: Parameters.args, **_: Parameters.kwargs
) -> ResultT:
    return await asyncio.get_running_loop().run_in_executor(_pool(), work, *given)


@cache
def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))


def end() -> None:
    """End the process."""
    if _pool.cache_info().currsize:
        _pool().shutdown(wait=False, cancel_futures=True)


def _state(campaign: Path) -> tuple[int, ...]:
    """What changes with the campaign's files."""
    files = [campaign / "campaign.toml", *sorted((campaign / "runs").glob("*"))]
    return tuple(path.stat().st_mtime_ns for path in files if path.is_file())


@lru_cache(maxsize=2)
def _by_hand(campaign: str, state: tuple[int, ...]) -> ByHand:
    from diagnosis.by_hand import ByHand
    from tunnel_sim.files.campaign_io import read_campaign

    del state  # part of the key only
    return ByHand(read_campaign(campaign))


def _closure(campaign: str, state: tuple[int, ...], effects: tuple[str, ...], converged: bool) -> Closure:
    return _by_hand(campaign, state).closure(effects, converged=converged)


def _next_run(
    campaign: str, state: tuple[int, ...], first: tuple[str, ...], second: tuple[str, ...]
) -> dict[str, Any] | None:
    return _by_hand(campaign, state).next_run(first, second)
