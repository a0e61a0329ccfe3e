"""Causes chosen by hand, fitted in a process of its own, which keeps the fits made so far."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from concurrent.futures.process import BrokenProcessPool
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tunnel_lab.bench.workspace import Session
from tunnel_sim.processes import Worker
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from collections.abc import Callable

    from diagnosis.by_hand import ByHand, Closure

Given = ParamSpec("Given")
ResultT = TypeVar("ResultT")
State = tuple[tuple[str, int, int], ...]


async def closure(session: Session, effects: Sequence[str], *, converged: bool) -> Closure:
    """How far the gap closes with effects chosen by hand.

    Args:
        converged: whether the fit frees their forms and goes on until it has converged.

    Raises:
        TunnelError: when the campaign cannot be read, or an effect cannot be fitted to it.
    """
    return await _elsewhere(_closure, session.campaign, session.state(), tuple(sorted(effects)), converged)


async def next_run(session: Session, first: Sequence[str], second: Sequence[str]) -> dict[str, Any] | None:
    """The run that would distinguish two sets of effects; None in normalised form.

    Args:
        first: names of effects.
        second: names of their rivals.

    Raises:
        TunnelError: as `closure`.
    """
    answers = (tuple(sorted(first)), tuple(sorted(second)))
    return await _elsewhere(_next_run, session.campaign, session.state(), *answers)


async def _elsewhere(work: Callable[Given, ResultT], *given: Given.args, **named: Given.kwargs) -> ResultT:
    try:
        return await asyncio.wrap_future(_worker().submit(work, *given, **named))
    except BrokenProcessPool:
        _worker.cache_clear()
        raise TunnelError("the fitting process was ended from outside", remedy="try again") from None


@cache
def _worker() -> Worker:
    return Worker()


def end() -> None:
    """End the process, also in the middle of a fit."""
    if _worker.cache_info().currsize:
        _worker().end()


@lru_cache(maxsize=2)
def _by_hand(campaign: Path, state: State) -> ByHand:
    from diagnosis.by_hand import ByHand
    from tunnel_sim.files.campaign_io import read_campaign

    del state  # part of the key only
    return ByHand(read_campaign(campaign))


def _closure(campaign: Path, state: State, effects: tuple[str, ...], converged: bool) -> Closure:
    return _by_hand(campaign, state).closure(effects, converged=converged)


def _next_run(
    campaign: Path, state: State, first: tuple[str, ...], second: tuple[str, ...]
) -> dict[str, Any] | None:
    return _by_hand(campaign, state).next_run(first, second)
