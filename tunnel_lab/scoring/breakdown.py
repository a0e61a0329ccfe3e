"""The bias that each unmodelled effect causes in each estimator.

The campaigns are made by the reference simulator, which shares no numerics with estimators or model. Each has
twelve runs on three springs and one effect in its textbook form. The effect is sized so that the residuals of the
nominal refit exceed the noise by 1 or 10 times its power.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.scoring.accuracy import Score, collect, score
from tunnel_lab.scoring.work import Progress, Row, estimate_rows, fingerprint, outcome, resumed
from tunnel_reference.conditions import Conditions
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.forms import forms_of
from tunnel_reference.make import as_campaign
from tunnel_reference.severity import Simulated, read_and_fit, simulate_motions, size_effects
from tunnel_sim.effects import ALL_EFFECTS

if TYPE_CHECKING:
    import polars as pl

    from tunnel_sim.vocabulary.campaign import Campaign

NO_EFFECT = "no effect"
SEVERITIES = (1.0, 10.0)
"""Mean squared residual of the nominal refit over the noise power, minus one."""
QUANTITIES = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")
EFFECTS: tuple[str, ...] = tuple(kind.name for kind in ALL_EFFECTS)
REALISATIONS = 3
TRUTH = {"cn_beta": 0.49, "cn_r": -0.11, "yaw_inertia": 0.1014, "mechanical_damping": 0.012}
NOISE = 5e-4  # rad

_SPRINGS, _SPEEDS = (16.12, 35.02, 51.88), (0.0, 15.0, 25.0)
_DENSITY = 1.204
_RUNS = (
    *((spring, speed, 20.0) for spring in _SPRINGS for speed in _SPEEDS),
    (16.12, 0.0, 8.0),
    (16.12, 25.0, 8.0),
    (35.02, 20.0, 14.0),
)  # N m/rad, m/s, degrees


@dataclass(frozen=True, eq=False)
class Case:
    """A campaign under one effect, or none.

    Args:
        effect: its name, or ``no effect``.
        severity: excess that it was sized for, as a ratio to the noise power; 0 for no effect.
        reached: excess after the reference simulator's own nominal refit, in noise powers (a ratio).
        realisation: number of the realisation, from 0.
        bound: Cramér–Rao bound of the nominal model by quantity, SI.
    """

    effect: str
    severity: float
    reached: float
    realisation: int
    campaign: Campaign
    bound: dict[str, float]

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"{self.effect.replace(' ', '_')}-{self.severity:g}-{self.realisation}"


def conditions_of(seed: int, *, duration: float = 10.0) -> Conditions:
    """The campaign to which the effects are added.

    Args:
        seed: of the actual release angles.
        duration: of every run, s.
    """
    springs, speeds, degrees = (np.array(column) for column in zip(*_RUNS, strict=True))
    release = np.round(np.radians(degrees), 4)
    start = release * (1.0 + 0.03 * np.random.default_rng(seed).standard_normal(release.size))
    return Conditions(
        spring_stiffness=springs, wind_speed=speeds, release_angle=release, start_angle=start,
        air_density=_DENSITY, duration=duration, noise_std=NOISE, zero=radians(0.2),
        yaw_inertia=TRUTH["yaw_inertia"], mechanical_damping=TRUTH["mechanical_damping"],
        cn_beta=TRUTH["cn_beta"], cn_r=TRUTH["cn_r"],
    )  # fmt: skip


def make_cases(
    seed: int,
    *,
    realisations: int = REALISATIONS,
    effects: Sequence[str] = EFFECTS,
    severities: Sequence[float] = SEVERITIES,
    duration: float = 10.0,
    show_steps: bool = False,
) -> list[Case]:
    """Size the effects and simulate their campaigns.

    Realisations differ in the noise, and in the forcing where it is random. Effects that have a sign are
    positive.

    Args:
        realisations: number of campaigns for each effect and severity.
        severities: excess to leave after the nominal refit, in noise powers.
        duration: of every run, s.
        show_steps: show the progress of sizing on standard error.

    Returns:
        The campaign without effect, then by effect, severity and realisation.
    """
    conditions = conditions_of(seed, duration=duration)
    nothing = CampaignDraw("none", conditions, (), 0)
    sized = size_effects(
        [_draw(conditions, name, severity, seed) for name in effects for severity in severities],
        progress=show_steps,
    )
    several = [_realise(draw, i, seed) for draw in (nothing, *sized) for i in range(realisations)]
    # A motion without random forcing is integrated once.
    moving = [draw for i, draw in enumerate(several) if i % realisations == 0 or _random(draw)]
    motions = iter(simulate_motions(moving))
    cases = []
    motion = None
    for i, draw in enumerate(several):
        if motion is None or i % realisations == 0 or _random(draw):
            motion = next(motions)
        cases.append(_case(draw, read_and_fit(draw, motion), i % realisations))
    return cases


def _draw(conditions: Conditions, name: str, severity: float, seed: int) -> CampaignDraw:
    form = forms_of(name)[0]
    rng = np.random.default_rng([seed, EFFECTS.index(name)])
    extra = {key: float(value) for key, value in form.draw(rng, conditions).items()}
    effect = EffectDraw(form, extra, max(form.signs), severity, form.start)
    return CampaignDraw("single", conditions, (effect,), seed)


def _random(draw: CampaignDraw) -> bool:
    return any("seed" in effect.extra for effect in draw.effects)


def _realise(draw: CampaignDraw, number: int, seed: int) -> CampaignDraw:
    """The same case with other noise, and other forcing where it is random."""
    name = draw.effects[0].form.family if draw.effects else NO_EFFECT
    key = EFFECTS.index(name) if draw.effects else len(EFFECTS)
    rng = np.random.default_rng([seed, key, number, 1])
    noise = int(rng.integers(2**62))
    effects = draw.effects
    if _random(draw) and number > 0:
        other = {"seed": float(rng.integers(0, 2**31))}
        effects = tuple(replace(effect, extra=effect.extra | other) for effect in effects)
    return replace(draw, effects=effects, seed=noise)


def _case(draw: CampaignDraw, simulated: Simulated, number: int) -> Case:
    from identification.uncertainty.cramer_rao import campaign_bound

    campaign = as_campaign(simulated, "breakdown")
    starts = [(float(angle), 0.0) for angle in draw.conditions.start_angle]
    noise = float(np.sqrt(draw.conditions.noise_power))
    bound = campaign_bound(campaign, **TRUTH, noise_std=noise, initial_states=starts)
    return Case(
        effect=draw.effects[0].form.family if draw.effects else NO_EFFECT,
        severity=draw.effects[0].target if draw.effects else 0.0,
        reached=simulated.excess,
        realisation=number,
        campaign=campaign,
        bound={name: bound.std(name) for name in QUANTITIES},
    )


def break_down(
    cases: Sequence[Case],
    estimators: Sequence[str],
    seed: int,
    *,
    jobs: int = 2,
    parts: Path | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Every estimator on every case.

    Args:
        seed: the cases were made with.
        jobs: number of processes; 0 works in this one.
        parts: folder for finished work, so that an interrupted score can be continued; None for none.
        progress: called with the number of finished cases and of all cases.
    """
    named = {case.name: case for case in cases}
    mark = fingerprint({"breakdown": sorted(named), "seed": seed}, estimators)
    done = resumed(
        partial(_estimate_case, tuple(estimators)),
        named,
        mark,
        jobs=jobs,
        parts=parts,
        report=lambda names: None if progress is None else progress(len(names), len(named)),
    )
    return [row for name in named for row in done[name]]


def _estimate_case(estimators: Sequence[str], case: Case) -> list[Row]:
    about = {
        "effect": case.effect,
        "severity": case.severity,
        "reached": case.reached,
        "realisation": case.realisation,
    }
    return [
        row for name in estimators for row in estimate_rows(name, case.campaign, TRUTH, case.bound, about)
    ]


@dataclass(frozen=True)
class Bias:
    """The bias that one effect causes in one estimate.

    Args:
        effect: its name, or ``no effect``.
        severity: excess that it was sized for, as a ratio to the noise power; 0 for no effect.
        reached: mean excess over the realisations, in noise powers (a ratio).
        departs: share of the realisations in which the estimator reported that the model departs.
    """

    effect: str
    severity: float
    reached: float
    estimator: str
    quantity: str
    score: Score
    departs: float


def biases(rows: Sequence[Row]) -> list[Bias]:
    """Rows summarised over realisations."""
    groups: dict[tuple[str, float, str, str], list[Row]] = {}
    for row in rows:
        key = (row["effect"], row["severity"], row["estimator"], row["quantity"])
        groups.setdefault(key, []).append(row)
    return [
        Bias(
            effect, severity, float(np.mean([row["reached"] for row in some])), estimator, quantity,
            score(collect(outcome(row) for row in some)),
            float(np.mean([row["status"] == "model_departs" for row in some])),
        )
        for (effect, severity, estimator, quantity), some in groups.items()
    ]  # fmt: skip


def breakdown_frame(found: Sequence[Bias]) -> pl.DataFrame:
    """The map as a table.

    Returns:
        A row for each effect, severity, estimator and quantity; units in the columns' names.
    """
    import polars as pl

    return pl.DataFrame([_record(one) for one in found], infer_schema_length=None)


def _record(one: Bias) -> dict[str, Any]:
    judged = one.score
    relative, in_stds = judged.relative_bias, judged.bias_in_stds
    return {
        "effect": one.effect,
        "severity_noise_powers": one.severity,
        "reached_noise_powers": one.reached,
        "estimator": one.estimator,
        "quantity": one.quantity,
        "realisations": judged.count,
        "failures": judged.failures.count,
        "bias_percent": None if relative is None else relative.value,
        "bias_percent_std_error": None if relative is None else relative.std,
        "bias_in_stds": None if in_stds is None else in_stds.value,
        "bias_in_stds_std_error": None if in_stds is None else in_stds.std,
        "rmse_over_bound": None if judged.rmse_over_bound is None else judged.rmse_over_bound.value,
        "covered": None if judged.coverage is None else judged.coverage.count,
        "model_departs_share": one.departs,
    }
