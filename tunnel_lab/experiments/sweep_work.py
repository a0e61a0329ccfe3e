"""The work on a shard of a sweep: its cases are simulated together and estimated one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from math import hypot
from typing import TYPE_CHECKING, Any

import polars as pl

from identification.estimate import PARAMETERS
from identification.estimators import make_estimator
from tunnel_lab.experiments.bounds import PlanBounds, nominal_oscillation, plan_bounds, recovered
from tunnel_lab.experiments.estimate_rows import (
    QUANTITY_COLUMNS,
    Failed,
    Failure,
    asked,
    counted_failures,
    quantity_rows,
)
from tunnel_lab.experiments.experiment import RESULTS, Done, parquet
from tunnel_lab.experiments.sweep_cases import Sweep, SweepCase
from tunnel_lab.terminal.arguments import NO_EFFECT
from tunnel_sim.effects import BetweenRuns, effect_class, effect_from
from tunnel_sim.vocabulary.between_runs import SCATTERED, Scatter
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.plan import CampaignPlan

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign


RECORDS = "records"
NOT_SIMULATED, SIMULATED = "not_simulated", "simulated"
RUN_QUANTITIES = ("omega_n", "zeta")
CAMPAIGN_QUANTITIES = (*PARAMETERS, "sensor_zero")
SCATTER_COLUMNS: Mapping[str, str] = {f"scatter_{one.name}": one.name for one in fields(Scatter)}
"""The column for each number of a scatter."""
CASE_COLUMNS: Mapping[str, Any] = {
    **dict.fromkeys(("case", "replicate"), pl.UInt32),
    "seed": pl.Int64,
    **dict.fromkeys(("rig", "conditions"), pl.String),
    **dict.fromkeys(("duration", "sample_rate", "noise_std", "resolution"), pl.Float64),
    "effect": pl.String,
    "severity": pl.Float64,
    "effect_parameters": pl.String,
    **dict.fromkeys(CAMPAIGN_QUANTITIES, pl.Float64),
    **dict.fromkeys(SCATTER_COLUMNS, pl.Float64),
}
"""The simulated case; coefficients, zero and scatter are the injected ones."""
RESULT_COLUMNS: Mapping[str, Any] = {
    **CASE_COLUMNS,
    **dict.fromkeys(("estimator", "run"), pl.String),
    **dict.fromkeys(("spring_stiffness", "wind_speed", "release_angle"), pl.Float64),
    **QUANTITY_COLUMNS,
    "message": pl.String,
}
RECORD_COLUMNS: Mapping[str, Any] = {
    "case": pl.UInt32,
    "run": pl.String,
    **dict.fromkeys(("wind_speed", "spring_stiffness", "sample_rate"), pl.Float64),
    "yaw_rad": pl.List(pl.Float64),
}


_estimator = lru_cache(maxsize=16)(make_estimator)


def run_shard(sweep: Sweep, index: int, nthread: int = 1) -> Done:
    """Simulate the cases of a shard together, and estimate them one by one.

    Args:
        nthread: number of simulating threads; results are bit-identical for any number.
    """
    cases = list(sweep.shard(index))
    groups: dict[tuple[str, float], list[SweepCase]] = {}
    for case in cases:
        groups.setdefault((case.rig_name, case.plan.sensor.sample_rate), []).append(case)
    simulated: dict[int, Campaign | Failure] = {}
    for group in groups.values():
        simulated.update(zip((case.index for case in group), _simulate(group, nthread), strict=True))
    bounds = bounds_of(cases)
    rows: list[tuple[Any, ...]] = []
    failed: list[Failed] = []
    for case in cases:
        campaign = simulated[case.index]
        for name in sweep.document.estimators or (None,):
            found: Estimate | Failure | None = None
            if isinstance(campaign, Failure):
                found = campaign
            elif name is not None:
                found = asked(campaign, _estimator(name))
            if name is not None and isinstance(found, Failure):
                failed.append(found.of(name))
            rows += case_rows(case, name, found, bounds[case.index])
    records = [
        (case.index, run.id, run.wind_speed, run.spring_stiffness, case.plan.sensor.sample_rate,
         pl.Series(run.record.yaw_rad))
        for case in cases
        for run in getattr(simulated[case.index], "runs", ())
        if sweep.document.records
    ]  # fmt: skip
    files = {RESULTS: parquet(rows, RESULT_COLUMNS)}
    if sweep.document.records:
        files[RECORDS] = parquet(records, RECORD_COLUMNS)
    return Done(files, counted_failures(failed))


def bounds_of(cases: Sequence[SweepCase]) -> dict[int, PlanBounds]:
    """The bounds of cases by index; cases that differ only in seed and effects share one computation."""
    known: dict[object, PlanBounds] = {}
    found = {}
    for case in cases:
        widths = _widths(case.plan)
        key = (case.rig_name, case.plan.conditions, case.plan.truth, case.plan.sensor, *widths.items())
        if key not in known:
            known[key] = plan_bounds(case.plan, case.rig, widths)
        found[case.index] = known[key]
    return found


def _widths(plan: CampaignPlan) -> dict[str, float]:
    """Relative standard deviations between the runs of a case, from its scatter and its effects, by name."""
    widths = {name: getattr(plan.scatter, name) for name in SCATTERED}
    for setting in plan.effects:
        effect = effect_from(setting.name, setting.parameters)
        if isinstance(effect, BetweenRuns):
            widths[effect.scatters] = hypot(widths[effect.scatters], effect.severity)
    return widths


def _simulate(cases: Sequence[SweepCase], nthread: int) -> Sequence[Campaign | Failure]:
    """Simulate cases of one rig and sample rate; one bad case must not stop the others."""
    from tunnel_sim.engine.virtual_campaign import simulate_campaigns

    try:
        return simulate_campaigns([case.plan for case in cases], cases[0].rig, nthread=nthread)
    except TunnelError as error:
        if len(cases) == 1:
            return [Failure(NOT_SIMULATED, one_line(error))]
    half = len(cases) // 2
    return [*_simulate(cases[:half], nthread), *_simulate(cases[half:], nthread)]


def case_rows(
    case: SweepCase, estimator: str | None, outcome: Estimate | Failure | None, bounds: PlanBounds
) -> Iterator[tuple[Any, ...]]:
    """The rows of one estimator's answer to one case.

    Args:
        bounds: bounds of the case, see `bounds_of`.
        estimator: name of the estimator; None if the case was only simulated.
        outcome: estimate, or the failure; None if the case was only simulated.

    Yields:
        Values of `RESULT_COLUMNS`, in their order: of the runs, then of the campaign.
    """
    plan, sensor, truth, conditions = case.plan, case.plan.sensor, case.plan.truth, case.plan.conditions
    severity = 0.0
    if plan.effects:
        first = plan.effects[0]
        severity = float(first.parameters[effect_class(first.name).parameters()[0].name])
    parameters = " ".join(  # in the format of ``--effect``
        f"{effect.name}:" + ",".join(f"{name}={value!r}" for name, value in effect.parameters.items())
        for effect in plan.effects
    )
    head = (
        case.index, case.replicate, plan.seed, case.rig_name, case.conditions, case.duration, sensor.sample_rate,
        sensor.noise_std, sensor.resolution, " + ".join(effect.name for effect in plan.effects) or NO_EFFECT,
        severity, parameters, truth.cn_beta, truth.cn_r, truth.yaw_inertia, truth.mechanical_damping, sensor.zero,
        *(float(getattr(plan.scatter, name)) for name in SCATTER_COLUMNS.values()), estimator,
    )  # fmt: skip
    answer = None if isinstance(outcome, Failure) else outcome
    status, message = (outcome.status, outcome.message) if isinstance(outcome, Failure) else (SIMULATED, None)
    for place, condition in enumerate(conditions):
        run = answer.runs[place] if answer else None
        nominal = nominal_oscillation(condition, truth, case.rig) or {}
        given = (condition.id, condition.spring_stiffness, condition.wind_speed, condition.release_angle)
        found = run.status.name.lower() if run else status
        for row in quantity_rows(run, RUN_QUANTITIES, nominal, bounds.runs[place], found):
            yield (*head, *given, *row, message)
    # spring, wind-on speed and release angle of the campaign, each only if unique
    kinds = (
        {condition.spring_stiffness for condition in conditions},
        {condition.wind_speed for condition in conditions if condition.wind_speed > 0.0} or {0.0},
        {condition.release_angle for condition in conditions},
    )
    common = (None, *(next(iter(kind)) if len(kind) == 1 else None for kind in kinds))
    injected = {**vars(recovered(plan, case.rig)), "sensor_zero": sensor.zero}
    found = answer.status.name.lower() if answer else status
    for row in quantity_rows(answer, CAMPAIGN_QUANTITIES, injected, bounds.campaign, found):
        yield (*head, *common, *row, message)
