"""The most informative drive for Cnβ and Cnr, among the drives that a plan can express and a rig allows.

Inputs are compared by the Cramér–Rao bound of the nominal model at the plan's truth, with the noise of its sensor
and the random moments of the plan. The response is linear in the input, so the limits determine the amplitude.
Optimal inputs for linear systems: Goodwin & Payne, Dynamic System Identification (1977), ch. 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import cos, floor, hypot, inf, log, log10, pi, sqrt
from typing import Literal

import numpy as np

from identification.signal.forcing import driven_rows
from identification.uncertainty.cramer_rao import CampaignBound, campaign_bound
from tunnel_sim.files.plan_file import PlanDocument, SensorModelTable, plan_from
from tunnel_sim.files.plan_input import InputTable, check_input_table
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import (
    CampaignPlan,
    Condition,
    SensorModel,
    aerodynamic_damping,
    aerodynamic_stiffness,
)
from tunnel_sim.vocabulary.record import Record
from tunnel_sim.vocabulary.rig import Rig

Goal = Literal["d", "cn_r"]
"""The determinant of the covariance of (Cnβ, Cnr), or the variance of Cnr."""

_PER_CYCLE = 8.0  # samples per cycle while inputs are compared
_STEPS = (0.16, 0.08, 0.04, 0.02, 0.01)  # relative steps of an end of the band
_WIDER = 1.1  # ratio of an end to the outermost resonance at the start of the search
_BROAD = 2.0  # ratio of an end of a plain broad band to the outermost resonance
_DIGITS = 3  # digits of an amplitude and a frequency in the plan


@dataclass(frozen=True)
class Limits:
    """The limits of the rig.

    Args:
        moment: maximum of the input, N m.
        angle: maximum of the response from rest, rad.
    """

    moment: float
    angle: float


def plan_bound(plan: CampaignPlan, rig: Rig) -> CampaignBound:
    """The bound of a plan's coefficients at its truth, from free decays and driven runs.

    Only random moments with a broad spectrum count among the plan's effects; each is taken as white, with its
    intensity at a run's natural frequency.

    Raises:
        TunnelError: when the runs do not determine Cnβ and Cnr, or the readings have no noise.
    """
    sensor = plan.sensor
    noise = _noise(sensor)
    if not noise > 0.0:
        raise TunnelError(
            "readings without noise have no bound", remedy="give noise_std under [sensor] in rad"
        )
    time = np.arange(max(2, round(plan.conditions[0].duration * sensor.sample_rate))) / sensor.sample_rate
    record = Record(time, np.zeros(time.size))
    runs = tuple(
        Run(c.id, record, c.wind_speed, c.spring_stiffness, c.air_density, c.release_angle, c.drive)
        for c in plan.conditions
    )
    campaign = Campaign(plan.name, RigProperties.of(rig), SensorProperties.of(sensor), runs)
    moments = None  # spectral intensity over the inertia at the natural frequency of each run, rad²/s³
    if plan.effects:
        from tunnel_sim.effects import effect_from  # imported here because most plans do not need it
        from tunnel_sim.effects.capabilities import AtRandom

        effects = [effect_from(setting.name, setting.parameters) for setting in plan.effects]
        at_random = [effect for effect in effects if isinstance(effect, AtRandom)]
        if any(effect.random == "broad_band" for effect in at_random):
            moments = []
            for condition in plan.conditions:
                reference = aerodynamic_stiffness(1.0, **_air(condition, rig))
                rate = sqrt(_decay(plan, condition, rig)[1])
                density = sum(effect.moment_density(rate, reference) for effect in at_random)
                moments.append(density / plan.truth.yaw_inertia**2)
    try:
        bound = campaign_bound(
            campaign,
            plan.truth,
            noise_std=noise,
            drive_gain=plan.conditions[0].gain,
            random_moments=moments,
        )
    except np.linalg.LinAlgError:
        bound = CampaignBound((), ())
    if not {"cn_beta", "cn_r"} <= set(bound.parameters):
        raise TunnelError(
            "the runs do not determine Cnβ and Cnr",
            remedy="give wind_speeds of 0 and above, such as [0, 15], and several springs where nothing is driven",
        )
    return bound


def peak_response(plan: CampaignPlan, rig: Rig) -> float:
    """The largest angle of the driven runs of a plan at its truth, rad.

    Raises:
        TunnelError: when the motion of a run diverges.
    """
    peak = 0.0
    inertia = plan.truth.yaw_inertia
    for condition in plan.conditions:
        if condition.drive is None:
            continue
        time = np.arange(condition.drive.values.size) / plan.sensor.sample_rate
        decay = _decay(plan, condition, rig)
        with np.errstate(all="ignore"):
            drive = condition.drive
            gain = drive.kind.true_scale(condition.gain, condition.spring_stiffness, inertia) / inertia
            motion = driven_rows(time, gain * drive.values, *decay, held=drive.held)[0]
        if not np.isfinite(motion).all():
            raise TunnelError(
                "the motion grows without bound", where=f"run {condition.id}", remedy="lower wind_speeds"
            )
        peak = max(peak, float(np.abs(motion).max()))
    return peak


def driven_plan(document: PlanDocument, drive: InputTable, duration: float) -> PlanDocument:
    """A plan with one driven run for each spring and speed instead of its free decays.

    Args:
        duration: duration of each record, s.
    """
    return document.model_copy(
        update={"release_angles_deg": [], "repeats": 1, "duration": duration, "drive": drive}
    )


def within_limits(
    document: PlanDocument, drive: InputTable, rig: Rig, limits: Limits, duration: float
) -> PlanDocument:
    """The driven plan with the largest input that the limits allow.

    Args:
        duration: duration of each record, s.
    """
    unit = driven_plan(document, drive.model_copy(update={"amplitudes_nm": [1.0]}), duration)
    plan = plan_from(unit, rig, document.name)
    largest = min(limits.moment, limits.angle / _peak_between_samples(plan, drive, rig))
    digit = 10.0 ** (_DIGITS - 1 - floor(log10(largest)))
    rounded_down = floor(largest * digit) / digit
    return driven_plan(document, drive.model_copy(update={"amplitudes_nm": [rounded_down]}), duration)


def propose_drive(
    document: PlanDocument,
    rig: Rig,
    limits: Limits,
    *,
    goal: Goal = "d",
    duration: float | None = None,
    progress: Callable[[], None] = lambda: None,
) -> PlanDocument:
    """The driven plan, of one run for each spring and speed, with the lowest bound that the search finds.

    A stepped sine begins at the resonances, and frequencies are removed as long as the bound falls. Its
    frequencies, and the ends of a multisine and a chirp, are then changed one at a time. The result is the best
    of these, of sines at the resonances and of a broad multisine.

    Args:
        document: plan of free decays; its conditions, sensor and truth are kept.
        duration: duration of each record, s; None: the plan's.

    Raises:
        TunnelError: as `plan_bound` and `peak_response`.
    """
    length = document.duration if duration is None else duration
    plan = plan_from(document, rig, document.name)
    resonances = sorted({sqrt(max(_decay(plan, c, rig)[1], 0.0)) / (2.0 * pi) for c in plan.conditions})
    if not resonances[0] > 0.0:
        remedy = "lower wind_speeds, or stiffen springs"
        raise TunnelError("the wind overcomes the spring: a run has no resonance", remedy=remedy)
    coarse, rate = document, _PER_CYCLE * _BROAD * resonances[-1]
    if rate < document.sample_rate:  # fewer readings with the same information
        sensor = SensorModel(**document.sensor.model_dump(exclude_none=True))
        noise = _noise(sensor) * sqrt(rate / document.sample_rate)
        thin = SensorModelTable(sample_rate=rate, noise_std=noise, resolution=0.0)
        coarse = document.model_copy(update={"sensor": thin})
    tried: dict[str, float] = {}

    def score(drive: InputTable) -> float:
        key = drive.model_dump_json()
        if key in tried:
            return tried[key]
        unit = driven_plan(coarse, drive, length)
        try:
            check_input_table(drive, unit.samples, unit.sample_rate, unit.name)
        except TunnelError:
            tried[key] = inf
        else:
            driven = plan_from(unit, rig, unit.name)
            bound = plan_bound(driven, rig)
            amplitude = min(limits.moment, limits.angle / _peak_between_samples(driven, drive, rig))
            if goal == "cn_r":
                tried[key] = log(bound.std("cn_r")) - log(amplitude)
            else:  # the geometric mean of the two standard deviations
                places = [bound.parameters.index(name) for name in ("cn_beta", "cn_r")]
                volume = float(np.linalg.slogdet(np.array(bound.covariance)[np.ix_(places, places)])[1])
                tried[key] = 0.25 * volume - log(amplitude)
        progress()
        return tried[key]

    outer = (resonances[0], resonances[-1])
    found = [
        *(_stepped([f]) for f in resonances),
        _band("multisine")([outer[0] / _BROAD, outer[1] * _BROAD]),
        *(_moved(_band(k), [outer[0] / _WIDER, outer[1] * _WIDER], score) for k in ("multisine", "chirp")),
    ]
    rates = resonances  # frequencies of a stepped sine, Hz; time may be better spent on fewer
    while len(rates) > 1:
        shorter = min(
            ([*rates[:i], *rates[i + 1 :]] for i in range(len(rates))), key=lambda left: score(_stepped(left))
        )
        if score(_stepped(shorter)) >= score(_stepped(rates)):
            break
        rates = shorter
    found.append(_moved(_stepped, rates, score))
    best = min(found, key=score)
    if score(best) == inf:
        remedy = "give a longer duration or --minutes"
        raise TunnelError("no input has a line in the band of the resonances", remedy=remedy)
    return within_limits(document, best, rig, limits, length)


def _moved(
    make: Callable[[list[float]], InputTable], start: list[float], score: Callable[[InputTable], float]
) -> InputTable:
    """The input made from frequencies (Hz) that are changed one at a time, in shorter and shorter steps."""
    rates, best = start, make(start)
    for step in _STEPS:
        improved = True
        while improved:
            improved = False
            for i, factor in product(range(len(rates)), (1.0 - step, 1.0 + step)):
                moved = [*rates[:i], rates[i] * factor, *rates[i + 1 :]]
                if score(trial := make(moved)) < score(best):
                    rates, best, improved = moved, trial, True
    return best


def _stepped(rates: list[float]) -> InputTable:
    if len(rates) == 1:
        return _table("sine", frequency_hz=rates[0])
    return _table("stepped_sine", frequencies_hz=rates)


def _band(kind: str) -> Callable[[list[float]], InputTable]:
    return lambda ends: _table(kind, from_hz=ends[0], to_hz=ends[1])


def _table(kind: str, **keys: float | list[float]) -> InputTable:
    rounded = {
        name: [_rounded(f) for f in value] if isinstance(value, list) else _rounded(value)
        for name, value in keys.items()
    }
    return InputTable.model_validate({"kind": kind, "amplitudes_nm": [1.0], **rounded})


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS + 1}g}")


def _peak_between_samples(plan: CampaignPlan, drive: InputTable, rig: Rig) -> float:
    """The peak, with a margin for samples that miss the peak of the fastest motion, rad."""
    fastest = max(
        drive.to_hz or 0.0,
        drive.from_hz or 0.0,
        drive.frequency_hz or 0.0,
        *drive.frequencies_hz,
        *(sqrt(_decay(plan, c, rig)[1]) / (2.0 * pi) for c in plan.conditions),
    )
    return peak_response(plan, rig) / max(cos(pi * fastest / plan.sensor.sample_rate), 0.5)


def _noise(sensor: SensorModel) -> float:
    return hypot(sensor.noise_std, sensor.resolution / sqrt(12.0))


def _decay(plan: CampaignPlan, condition: Condition, rig: Rig) -> tuple[float, float]:
    """Decay rate (1/s) and stiffness (1/s²) of a run at the truth."""
    truth, air = plan.truth, _air(condition, rig)
    stiffness = condition.spring_stiffness - aerodynamic_stiffness(truth.cn_beta, **air)
    damping = truth.mechanical_damping - aerodynamic_damping(truth.cn_r, **air)
    return 0.5 * damping / truth.yaw_inertia, stiffness / truth.yaw_inertia


def _air(condition: Condition, rig: Rig) -> dict[str, float]:
    return {
        "air_density": condition.air_density,
        "wind_speed": condition.wind_speed,
        "frontal_area": rig.body.frontal_area,
        "reference_length": rig.body.length,
    }
