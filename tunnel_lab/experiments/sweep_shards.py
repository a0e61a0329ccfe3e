"""The work of one shard: its cases are simulated together, estimated one by one, and packed as Parquet.

A shard is a pure function of the sweep and its number, so it can be done anywhere and more than once.
"""

from __future__ import annotations

import io
import os
import platform
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import version
from math import sqrt
from typing import TYPE_CHECKING, Any

import polars as pl

from identification import identify
from identification.estimate import PARAMETERS, UNITS
from identification.estimators import Estimator, make_estimator
from tunnel_lab.experiments.sweep_cases import Sweep, SweepCase
from tunnel_lab.terminal.inputs import NO_EFFECT
from tunnel_sim.effects import effect_class
from tunnel_sim.files.toml_input import one_line
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import Condition, EffectSetting, aerodynamic_damping, aerodynamic_stiffness

if TYPE_CHECKING:
    from identification.estimate import Estimate, Quantity, RunEstimate
    from tunnel_sim.vocabulary.campaign import Campaign


ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""The last bit of sums in a linear algebra library depends on its number of threads; a shard uses one."""
_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy", "polars")
NOT_SIMULATED = "not_simulated"
SIMULATED = "simulated"
REFUSED = "refused"
RAISED = "raised"
RUN_QUANTITIES: Mapping[str, str] = {"omega_n": "rad/s", "zeta": "1"}
CAMPAIGN_QUANTITIES: Mapping[str, str] = {**{name: UNITS[name] for name in PARAMETERS}, "sensor_zero": "rad"}
CASE_COLUMNS: Mapping[str, Any] = {
    "case": pl.UInt32,
    "replicate": pl.UInt32,
    "seed": pl.Int64,
    "rig": pl.String,
    "conditions": pl.String,
    "duration": pl.Float64,
    "sample_rate": pl.Float64,
    "noise_std": pl.Float64,
    "resolution": pl.Float64,
    "effect": pl.String,
    "severity": pl.Float64,
    "effect_parameters": pl.String,
    "cn_beta": pl.Float64,
    "cn_r": pl.Float64,
    "yaw_inertia": pl.Float64,
    "mechanical_damping": pl.Float64,
    "sensor_zero": pl.Float64,
}
"""The simulated case; coefficients and zero are the injected ones."""
RESULT_COLUMNS: Mapping[str, Any] = {
    **CASE_COLUMNS,
    "estimator": pl.String,
    "run": pl.String,
    "spring_stiffness": pl.Float64,
    "wind_speed": pl.Float64,
    "release_angle": pl.Float64,
    "quantity": pl.String,
    "unit": pl.String,
    "truth": pl.Float64,
    "value": pl.Float64,
    "std": pl.Float64,
    "status": pl.String,
    "message": pl.String,
}
RECORD_COLUMNS: Mapping[str, Any] = {
    "case": pl.UInt32,
    "run": pl.String,
    "wind_speed": pl.Float64,
    "spring_stiffness": pl.Float64,
    "sample_rate": pl.Float64,
    "yaw_rad": pl.List(pl.Float64),
}
TIMING_COLUMNS: Mapping[str, Any] = {
    "shard": pl.UInt32,
    "step": pl.String,
    "cases": pl.UInt32,
    "runs": pl.UInt32,
    "seconds": pl.Float64,
}


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
    answers: list[tuple[SweepCase, str | None, Estimate | Failure | None]] = []
    for name in plan.document.estimators:
        answers += [
            (case, name, _estimate(campaign, name)) for case, campaign in zip(cases, campaigns, strict=True)
        ]
        clock.lap(name)
    if not plan.document.estimators:
        answers = [
            (case, None, campaign if isinstance(campaign, Failure) else None)
            for case, campaign in zip(cases, campaigns, strict=True)
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
        crashes=sum(
            isinstance(campaign, Failure) and campaign.status == RAISED for _, _, campaign in answers
        ),
    )


def simulate_cases(cases: Sequence[SweepCase], *, nthread: int = 1) -> list[Campaign | Failure]:
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


def _simulate(cases: Sequence[SweepCase], nthread: int) -> Sequence[Campaign | Failure]:
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


def _record_rows(
    cases: Iterable[SweepCase], campaigns: Iterable[Campaign | Failure]
) -> list[tuple[Any, ...]]:
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


def case_values(case: SweepCase) -> tuple[Any, ...]:
    """The first columns of a case's rows.

    Returns:
        Values of `CASE_COLUMNS`, in their order.
    """
    plan, sensor, truth = case.plan, case.plan.sensor, case.plan.truth
    settings = plan.effects
    return (
        case.index,
        case.replicate,
        plan.seed,
        case.rig_name,
        case.conditions,
        case.duration,
        sensor.sample_rate,
        sensor.noise_std,
        sensor.resolution,
        " + ".join(setting.name for setting in settings) or NO_EFFECT,
        _severity(settings[0]) if settings else 0.0,
        " ".join(_word(setting) for setting in settings),
        truth.cn_beta,
        truth.cn_r,
        truth.yaw_inertia,
        truth.mechanical_damping,
        sensor.zero,
    )


@dataclass(frozen=True)
class Failure:
    """Why a case has no estimate.

    Args:
        status: `NOT_SIMULATED`, `REFUSED` or `RAISED`.
    """

    status: str
    message: str


def estimate_rows(
    case: SweepCase, estimator: str | None, outcome: Estimate | Failure | None
) -> Iterator[tuple[Any, ...]]:
    """The rows of one estimator's answer to one case.

    Args:
        estimator: its name; None where the case was only simulated.
        outcome: its estimate, or why there is none; None where the case was only simulated.

    Yields:
        Values of `RESULT_COLUMNS`, in their order: of the runs, then of the campaign.
    """
    head = (*case_values(case), estimator)
    answer = None if outcome is None or isinstance(outcome, Failure) else outcome
    failure = outcome if isinstance(outcome, Failure) else None
    status, message = (failure.status, failure.message) if failure else (SIMULATED, None)
    for place, condition in enumerate(case.plan.conditions):
        run = answer.runs[place] if answer else None
        truths = _run_truths(case, condition)
        shown = run.status.name.lower() if run else status
        for name, unit in RUN_QUANTITIES.items():
            given = (condition.id, condition.spring_stiffness, condition.wind_speed, condition.release_angle)
            yield (*head, *given, name, unit, truths[name], *_figures(run, name), shown, message)
    common = (None, *_common(case.plan.conditions))
    truths = {**vars(case.plan.truth), "sensor_zero": case.plan.sensor.zero}
    shown = answer.status.name.lower() if answer else status
    for name, unit in CAMPAIGN_QUANTITIES.items():
        yield (*head, *common, name, unit, truths[name], *_figures(answer, name), shown, message)


def _figures(owner: Estimate | RunEstimate | None, name: str) -> tuple[float | None, float | None]:
    quantity: Quantity | None = getattr(owner, name, None)
    return (None, None) if quantity is None else (quantity.value, quantity.std)


def _severity(setting: EffectSetting) -> float:
    return float(setting.parameters[effect_class(setting.name).parameters()[0].name])


def _word(setting: EffectSetting) -> str:
    """An effect as ``--effect`` takes it."""
    return f"{setting.name}:" + ",".join(f"{name}={value!r}" for name, value in setting.parameters.items())


def _common(conditions: tuple[Condition, ...]) -> tuple[float | None, float | None, float | None]:
    """Spring, wind-on speed and release angle of a campaign, each where the campaign has only one."""
    kinds = (
        {condition.spring_stiffness for condition in conditions},
        {condition.wind_speed for condition in conditions if condition.wind_speed > 0.0} or {0.0},
        {condition.release_angle for condition in conditions},
    )
    spring, speed, angle = (next(iter(kind)) if len(kind) == 1 else None for kind in kinds)
    return spring, speed, angle


def _run_truths(case: SweepCase, condition: Condition) -> dict[str, float | None]:
    """ωn (rad/s) and ζ of the nominal model, small angles; None where its stiffness is not positive."""
    truth, air = case.plan.truth, case.rig.body.flow(condition.air_density, condition.wind_speed)
    stiffness = condition.spring_stiffness - aerodynamic_stiffness(truth.cn_beta, **air)
    damping = truth.mechanical_damping - aerodynamic_damping(truth.cn_r, **air)
    if stiffness <= 0.0:
        return {"omega_n": None, "zeta": None}
    omega_n = sqrt(stiffness / truth.yaw_inertia)
    return {"omega_n": omega_n, "zeta": damping / (2.0 * truth.yaw_inertia * omega_n)}
