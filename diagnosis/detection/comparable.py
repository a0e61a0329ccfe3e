"""Runs that one model can be fitted to: all with a stated spring, or all with one spring that is not stated."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

from diagnosis.fitting.similarity import free_frequency
from diagnosis.policy import ANOTHER_MODE, SAME_SPRING
from tunnel_sim.vocabulary.campaign import Campaign, Run


def comparable_runs(campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """Leave out the runs that cannot be fitted together with the others.

    Returns:
        The campaign of the remaining runs, and sentences that say which were left out and why; none where all
        runs remain. Where some runs state ``spring_stiffness`` and others do not, the larger group remains (those
        that state it, if equal). Of runs that do not state it, those with the same frequency at the same wind
        speed remain: only they can have one spring. A wind-on run that swings in another mode than the wind-off
        runs of its spring is left out.
    """
    stated = [run for run in campaign.runs if run.spring_stiffness is not None]
    bare = [run for run in campaign.runs if run.spring_stiffness is None]
    said = []
    kept = stated if len(stated) >= len(bare) else bare
    if stated and bare:
        other, what = (bare, "state no") if kept is stated else (stated, "state their")
        said.append(
            f"Left out, since they {what} spring_stiffness and the others "
            f"{'do' if kept is stated else 'do not'}: {_ids(other)}. State it for all runs, or diagnose these "
            f"separately."
        )
    if kept is bare:
        same = _of_one_spring(bare)
        if len(same) < len(bare):
            other = [run for run in bare if run not in same]
            said.append(
                f"Left out, since different frequencies at one wind speed show more than one spring, and these "
                f"runs may not have the spring of the rest: {_ids(other)}. State spring_stiffness, or diagnose "
                f"these separately."
            )
        kept = same
    elsewhere = _in_another_mode(kept)
    if elsewhere:
        said.append(
            f"Left out, since they swing in another mode, {ANOTHER_MODE:g} times as fast as the same spring with "
            f"the wind off or faster: {_ids(elsewhere)}. Diagnose these separately."
        )
        kept = [run for run in kept if run not in elsewhere]
    order = {run.id for run in kept}
    return replace(campaign, runs=tuple(run for run in campaign.runs if run.id in order)), tuple(said)


def _ids(runs: Sequence[Run]) -> str:
    return ", ".join(run.id for run in runs)


def _in_another_mode(runs: Sequence[Run]) -> list[Run]:
    """Wind-on runs far above the frequency of the wind-off runs of the same spring."""
    still: dict[float | None, list[float]] = defaultdict(list)
    for run in runs:
        if not run.wind_on:
            still[run.spring_stiffness].append(free_frequency(run))
    windy = [run for run in runs if run.wind_on and run.spring_stiffness in still]
    return [run for run in windy if free_frequency(run) > ANOTHER_MODE * median(still[run.spring_stiffness])]


def _of_one_spring(runs: Sequence[Run]) -> list[Run]:
    """The largest group of runs that may have one spring.

    The air reduces the stiffness of every spring by the same amount, so that the order of the frequencies is the
    same at each speed.
    """
    by_speed: dict[float, list[Run]] = defaultdict(list)
    for run in runs:
        by_speed[run.wind_speed].append(run)
    groups = {speed: _by_frequency(alike) for speed, alike in by_speed.items()}
    counts = {len(found) for found in groups.values()}
    if counts == {1}:
        return list(runs)
    if len(counts) == 1:
        ranks = [[run for found in groups.values() for run in found[rank]] for rank in range(counts.pop())]
        return max(ranks, key=len)
    return max((group for found in groups.values() for group in found), key=len)


def _by_frequency(runs: Sequence[Run]) -> list[list[Run]]:
    """Groups of runs with about the same frequency, lowest first."""
    found = sorted(((free_frequency(run), run) for run in runs), key=lambda pair: pair[0])
    groups = [[found[0][1]]]
    for (last, _), (now, run) in itertools.pairwise(found):
        if now > SAME_SPRING * last:
            groups.append([])
        groups[-1].append(run)
    return groups
