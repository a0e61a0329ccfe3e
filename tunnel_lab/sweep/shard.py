"""The work of one shard: its cases are simulated together, estimated one by one, and packed as Parquet.

A shard is a pure function of the sweep and its number, so it can be done anywhere and more than once.
"""

from __future__ import annotations

import io
import os
import platform
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import polars as pl

from identification import identify
from identification.estimators import Estimator, make_estimator
from tunnel_lab.sweep.product import Case, Sweep
from tunnel_lab.sweep.rows import (
    NOT_SIMULATED,
    RAISED,
    RECORD_COLUMNS,
    REFUSED,
    RESULT_COLUMNS,
    TIMING_COLUMNS,
    Failure,
    estimate_rows,
)
from tunnel_sim.files.toml_input import one_line
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""The last bit of sums in a linear algebra library depends on its number of threads; a shard uses one."""
_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy", "polars")


@dataclass(frozen=True)
class Finished:
    """A finished shard, ready to be written.

    Args:
        results: a Parquet file's bytes; they do not depend on where or when the shard is done.
        records: those of the records; None where they are not stored.
        timings: those of the times, which differ every time.
        made_with: what the bits of the results depend on besides the sweep.
        crashes: number of estimates that raised an exception.
    """

    index: int
    results: bytes
    records: bytes | None
    timings: bytes
    made_with: Mapping[str, str]
    crashes: int


def run_shard(sweep: str, index: int, nthread: int = 1) -> Finished:
    """Simulate and estimate the cases of a shard.

    Args:
        sweep: as `Sweep.to_json` gives it.
        nthread: threads that simulate; the result is the same to the bit whatever their number.
    """
    plan = _sweep(sweep)
    clock = _Clock()
    cases = list(plan.shard(index))
    campaigns = simulate_cases(cases, nthread=nthread)
    clock.lap("simulate")
    answers: list[tuple[Case, str | None, Estimate | Failure | None]] = []
    for name in plan.document.estimators:
        answers += [(case, name, _estimate(one, name)) for case, one in zip(cases, campaigns, strict=True)]
        clock.lap(name)
    if not plan.document.estimators:
        answers = [
            (case, None, one if isinstance(one, Failure) else None)
            for case, one in zip(cases, campaigns, strict=True)
        ]
    answers.sort(key=lambda answer: answer[0].index)  # the estimators of one case keep their order
    results = _parquet([row for answer in answers for row in estimate_rows(*answer)], RESULT_COLUMNS)
    records = _parquet(_record_rows(cases, campaigns), RECORD_COLUMNS) if plan.document.records else None
    clock.lap("pack")
    runs = sum(len(case.plan.conditions) for case in cases)
    timings = [(index, step, len(cases), runs, seconds) for step, seconds in clock.laps]
    return Finished(
        index=index,
        results=results,
        records=records,
        timings=_parquet(timings, TIMING_COLUMNS),
        made_with={**made_with(), "threads": os.environ.get(ONE_THREAD[0], "several")},
        crashes=sum(isinstance(one, Failure) and one.status == RAISED for _, _, one in answers),
    )


def simulate_cases(cases: Sequence[Case], *, nthread: int = 1) -> list[Campaign | Failure]:
    """Simulate cases; those of the same rig and sample rate are done together.

    Args:
        nthread: threads; the result is the same to the bit whatever their number.
    """
    groups: dict[tuple[str, float], list[int]] = {}
    for place, case in enumerate(cases):
        groups.setdefault((case.rig_name, case.plan.sensor.sample_rate), []).append(place)
    done: dict[int, Campaign | Failure] = {}
    for places in groups.values():
        done.update(zip(places, _simulate([cases[place] for place in places], nthread), strict=True))
    return [done[place] for place in range(len(cases))]


def _simulate(cases: Sequence[Case], nthread: int) -> Sequence[Campaign | Failure]:
    from tunnel_sim.engine.virtual_campaign import simulate_campaigns

    try:
        return simulate_campaigns([case.plan for case in cases], cases[0].rig, nthread=nthread)
    except TunnelError as error:
        if len(cases) == 1:
            return [Failure(NOT_SIMULATED, one_line(error))]
    half = len(cases) // 2  # one bad case must not stop the others
    return [*_simulate(cases[:half], nthread), *_simulate(cases[half:], nthread)]


def _estimate(campaign: Campaign | Failure, name: str) -> Estimate | Failure:
    """An estimate, or why there is none: one bad case must not stop the sweep."""
    if isinstance(campaign, Failure):
        return campaign
    try:
        return identify(campaign, _estimator(name), throw=False)
    except TunnelError as error:
        return Failure(REFUSED, one_line(error))
    except Exception as error:
        return Failure(RAISED, one_line(f"{type(error).__name__}: {error}"))


def _record_rows(cases: Iterable[Case], campaigns: Iterable[Campaign | Failure]) -> list[tuple[Any, ...]]:
    return [
        (
            case.index,
            run.id,
            run.wind_speed,
            run.spring_stiffness,
            case.plan.sensor.sample_rate,
            pl.Series(run.record.yaw_rad),
        )
        for case, campaign in zip(cases, campaigns, strict=True)
        if not isinstance(campaign, Failure)
        for run in campaign.runs
    ]


def _parquet(rows: Sequence[tuple[Any, ...]], columns: Mapping[str, Any]) -> bytes:
    buffer = io.BytesIO()
    pl.DataFrame(rows, schema=dict(columns), orient="row").write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


@cache
def made_with() -> dict[str, str]:
    """Versions and processor that the bits of a result depend on."""
    return {**{name: version(name) for name in _PACKAGES}, "machine": platform.machine()}


@lru_cache(maxsize=2)
def _sweep(text: str) -> Sweep:
    return Sweep.from_json(text)


@lru_cache(maxsize=16)
def _estimator(name: str) -> Estimator:
    return make_estimator(name)


class _Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self.laps: list[tuple[str, float]] = []
        self._last = time.perf_counter()

    def lap(self, step: str) -> None:
        now = time.perf_counter()
        self.laps.append((step, now - self._last))
        self._last = now
