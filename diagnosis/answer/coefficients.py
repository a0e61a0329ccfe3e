"""Coefficients before and after the causes are added, with intervals that hold under model error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from diagnosis.answer.determined import meant_coefficient
from diagnosis.answer.held_out import HeldOut
from diagnosis.answer.pulls import coefficient_move
from diagnosis.answer.small_swings import (
    JOINT_UNITS,
    coefficient_gradient,
    coefficient_names,
    coefficient_value,
    stiffness_names,
)
from diagnosis.attribution.decide import Weighed
from diagnosis.attribution.hypothesis import Hypothesis
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.spectra import linear_coefficients
from diagnosis.policy import COLOURED_EXCESS, EVEN_SHARE, FORM_CHANGE_STD
from diagnosis.result import ParameterEstimate
from identification.statistics.widening import scatter_of_runs
from tunnel_sim.effects.fitting import WindOnRun
from tunnel_sim.vocabulary.campaign import Campaign

_UNITS = {"cn_beta": "1/rad", "cn_r": "1/rad", "omega_n": "rad/s", "zeta": "1", **JOINT_UNITS}


def coefficients(
    fit: Fit,
    held_out: HeldOut,
    campaign: Campaign,
    rivals: Sequence[tuple[Fit, float]] = (),
    textbook: Fit | None = None,
) -> dict[str, ParameterEstimate]:
    """The coefficients of a fit.

    Args:
        fit: nominal, or with causes added.
        held_out: the same without groups of runs.
        campaign: gives the digits to which the air density is stated.
        rivals: other fits and their probabilities.
        textbook: the same effects in textbook form, where the fit freed their forms.

    Returns:
        By the names of `coefficient_names`; ``omega_n`` and ``zeta`` are those of small swings. The variance is
        that of the fit scaled by its excess, or where the residuals are coloured the greatest of that, the
        delete-a-group jackknife (Kott, J. Off. Stat. 17 (2001) 521), the scatter of the runs and half the
        difference between two halves of the data (`diagnosis.answer.pulls`); plus the rounding of the air density,
        plus the part of a cause's form that no free decay shows, plus half the change made by freeing the forms
        (another family of forms may change as much), plus the spread over rivals. No standard deviation is given
        at a bound and where the runs do not determine the coefficient.
    """
    result = {}
    for name in coefficient_names(fit.problem):
        value, std = _value(fit, held_out, name)
        if value is None:
            continue
        spread = sum(
            p * (other - value) ** 2 for f, p in rivals if (other := _value_only(f, name)) is not None
        )
        rounding = abs(value) * _density_rounding(campaign) if name.startswith("cn_") else 0.0
        unseen = _unseen_form(fit, name) if name.startswith("cn_") else 0.0
        unfreed = None if textbook is None else _value_only(textbook, name)
        moved = 0.0 if unfreed is None else FORM_CHANGE_STD * (value - unfreed)
        noise = min(_formal_std(fit, name), std)
        parts = {
            "noise": noise**2,
            "misfit": (std - noise) * (std + noise),
            "air density": rounding**2,
            "unseen form": unseen**2,
            "freed form": moved**2,
            "rivals": spread,
        }
        variance = std**2 + rounding**2 + unseen**2 + moved**2 + spread
        result[name] = _estimate(fit, name, value, math.sqrt(variance), parts)
    return result


def _estimate(fit: Fit, name: str, value: float, std: float, parts: Mapping[str, float]) -> ParameterEstimate:
    """A coefficient, marked where the fit stopped at a bound or the runs do not determine it."""
    whole = sum(parts.values())
    shares = {source: part / whole for source, part in parts.items()} if whole > 0.0 else {}
    bound = fit.bound("mechanical_damping") if name in ("zeta", "mechanical_damping") else None
    if name == "omega_n" and len(stiffness_names(fit.problem.names)) == 1:  # no gravity instead of the spring
        bound = fit.bound("stiffness")
    found = ParameterEstimate(value, None if bound else std, _UNITS[name], bound, shares=shares)
    return meant_coefficient(found, fit, name)


def _unseen_form(fit: Fit, name: str) -> float:
    """Standard deviation of Cnβ or Cnr, 1/rad, from the part of the causes' forms that no free decay shows."""
    runs = _wind_on_runs(fit)
    place = 0 if name == "cn_beta" else 1
    effects = fit.problem.effects_at(fit.point.common)
    return math.hypot(*(effect.unseen_form(fit.value("cn_beta"), runs)[place] for effect in effects))


def _wind_on_runs(fit: Fit) -> list[WindOnRun]:
    data = fit.problem.data
    found = []
    for i, run in enumerate(data.runs):
        if not run.wind_on:
            continue
        inertia, _, stiffness = linear_coefficients(fit, i)
        spring = fit.problem.stated(fit.point.common, fit.point.release[i], run).spring_stiffness
        if stiffness <= 0.0 or spring <= 0.0:
            continue
        load = 0.5 * run.air_density * run.wind_speed * data.frontal_area * data.reference_length**2
        omega, still = math.sqrt(stiffness / inertia), math.sqrt(spring / inertia)
        pressure = load * run.wind_speed / data.reference_length
        found.append(WindOnRun(spring, omega, still, pressure, load))
    return found


def rival_fits(
    weighed: Sequence[Weighed], hypotheses: Sequence[Hypothesis], chosen: Fit
) -> list[tuple[Fit, float]]:
    """Fits of the answers that were not chosen, with their probabilities.

    Args:
        weighed: answers.
        hypotheses: their fits.
        chosen: the fit of the answer.

    Returns:
        Fit and probability of each fitted rival, without its part of `EVEN_SHARE`: that stands for causes not
        considered, not for a rival that the runs refute.
    """
    found = []
    even = EVEN_SHARE / max(len(weighed), 1)
    for answer in weighed:
        for hypothesis in hypotheses:
            if hypothesis.names == answer.effects and hypothesis.fit is not chosen:
                found.append((hypothesis.fit, max(answer.probability - even, 0.0)))
    return found


def _value(fit: Fit, held_out: HeldOut, name: str) -> tuple[float | None, float]:
    value = _value_only(fit, name)
    if value is None:
        return None, 0.0
    scale = math.sqrt(1.0 + max(fit.excess, 0.0))
    std = _formal_std(fit, name) * scale
    if fit.excess > COLOURED_EXCESS and len(held_out.common) > 1:
        values = [coefficient_value(held_out.names, row, name) for row in held_out.common]
        count = len(values)
        jackknife = math.sqrt((count - 1.0) / count * sum((v - value) ** 2 for v in values if v is not None))
        std = max(std, jackknife)
    if fit.excess > COLOURED_EXCESS:
        std = max(std, coefficient_move(fit, name))
    if fit.excess > COLOURED_EXCESS and name in fit.problem.names:
        std = max(std, _scatter_of_runs(fit, name))
    return value, std


def _scatter_of_runs(fit: Fit, name: str) -> float:
    """Standard deviation of a common parameter from the scatter of the runs."""
    count = len(fit.problem.names)
    information, scores = np.zeros((count, count)), []
    for (common, release), residual in zip(fit.jacobian, fit.residuals, strict=True):
        left = common - release @ np.linalg.lstsq(release, common, rcond=1e-10)[0]
        information += left.T @ left
        scores.append(left.T @ residual)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    influences = np.array(scores) / scale @ inverse / scale
    place = fit.problem.names.index(name)
    speaking = sum(run.wind_on or not name.startswith("cn_") for run in fit.problem.data.runs)
    return float(scatter_of_runs(influences[:, place : place + 1], np.array([speaking]))[0])


def _value_only(fit: Fit, name: str) -> float | None:
    return coefficient_value(fit.problem.names, fit.point.common, name)


def _formal_std(fit: Fit, name: str) -> float:
    """Standard deviation from the fit's covariance, to first order."""
    gradient = coefficient_gradient(fit.problem.names, fit.point.common, name)
    return math.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0))


def _density_rounding(campaign: Campaign) -> float:
    """Relative standard deviation from the rounding of the stated air density."""
    worst = 0.0
    for run in campaign.runs:
        if run.wind_on and run.air_density:
            exponent = Decimal(repr(float(run.air_density))).as_tuple().exponent
            digits = -exponent if isinstance(exponent, int) else 4
            worst = max(worst, 0.5 * 10.0 ** -min(digits, 8) / math.sqrt(3.0) / run.air_density)
    return worst
