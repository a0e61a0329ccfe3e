"""The rows of a sweep's results: one for every quantity of an estimate, with its truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any

import polars as pl

from identification.estimate import PARAMETERS, UNITS
from tunnel_lab.sweep.product import NO_EFFECT, Case
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.aero import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.plan import Condition, EffectSetting

if TYPE_CHECKING:
    from identification.estimate import Estimate, Quantity, RunEstimate

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


def case_values(case: Case) -> tuple[Any, ...]:
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
        " + ".join(one.name for one in settings) or NO_EFFECT,
        _severity(settings[0]) if settings else 0.0,
        " ".join(_word(one) for one in settings),
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
    case: Case, estimator: str | None, outcome: Estimate | Failure | None
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
        found = answer.runs[place] if answer else None
        truths = _run_truths(case, condition)
        said = found.status.name.lower() if found else status
        for name, unit in RUN_QUANTITIES.items():
            given = (condition.id, condition.spring_stiffness, condition.wind_speed, condition.release_angle)
            yield (*head, *given, name, unit, truths[name], *_figures(found, name), said, message)
    common = (None, *_common(case.plan.conditions))
    truths = {**vars(case.plan.truth), "sensor_zero": case.plan.sensor.zero}
    said = answer.status.name.lower() if answer else status
    for name, unit in CAMPAIGN_QUANTITIES.items():
        yield (*head, *common, name, unit, truths[name], *_figures(answer, name), said, message)


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
        {one.spring_stiffness for one in conditions},
        {one.wind_speed for one in conditions if one.wind_speed > 0.0} or {0.0},
        {one.release_angle for one in conditions},
    )
    spring, speed, angle = (next(iter(kind)) if len(kind) == 1 else None for kind in kinds)
    return spring, speed, angle


def _run_truths(case: Case, condition: Condition) -> dict[str, float | None]:
    """ωn (rad/s) and ζ of the nominal model, small angles; None where its stiffness is not positive."""
    truth, air = case.plan.truth, case.rig.body.flow(condition.air_density, condition.wind_speed)
    stiffness = condition.spring_stiffness - aerodynamic_stiffness(truth.cn_beta, **air)
    damping = truth.mechanical_damping - aerodynamic_damping(truth.cn_r, **air)
    if stiffness <= 0.0:
        return {"omega_n": None, "zeta": None}
    omega_n = sqrt(stiffness / truth.yaw_inertia)
    return {"omega_n": omega_n, "zeta": damping / (2.0 * truth.yaw_inertia * omega_n)}
