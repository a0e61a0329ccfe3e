"""What remains after the named causes: whether it is significant, and whether it moves the coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from scipy.special import chdtrc

from diagnosis.closure import Move, Remainder
from diagnosis.noise.gap import gap_test
from diagnosis.noise.rounding import rounding_errors
from diagnosis.policy import GAP_FALSE_ALARM_RATE, MATERIAL_SHARE
from diagnosis.printing import noise_powers
from diagnosis.result import ParameterEstimate
from diagnosis.search.investigate import Study
from identification.printing import COEFFICIENTS, unit_mark

Estimates = Mapping[str, ParameterEstimate]


def remainder(study: Study, stated: Estimates, moved: Mapping[str, float], excess: float) -> Remainder:
    """Judge what the answer leaves of the gap.

    Args:
        stated: the coefficients of the answer's fit with their standard deviations.
        moved: by the same names, how far what remains moves them (`diagnosis.answer.small_swings`), in their units.
        excess: left on readings held out of the fit, in noise variances of a sample.

    Returns:
        The judgement. What chance explains is never material.
    """
    p_value = _p_value(study)
    significant = p_value < GAP_FALSE_ALARM_RATE
    moves = {name: _move(moved[name], given) for name, given in stated.items()}
    material = [name for name, move in moves.items() if significant and _is_material(move)]
    words = _words(study, excess, stated, moves, material, significant=significant)
    return Remainder(significant, excess, p_value, bool(material), moves, words)


def _move(value: float, given: ParameterEstimate) -> Move:
    return Move(value, value / abs(given.value) if given.value else None, given.std, given.unit)


def _is_material(move: Move) -> bool:
    """Whether a coefficient that the runs determine moves by its standard deviation, or by 1 %."""
    if move.std is None:
        return False
    return move.value > move.std or (move.relative is not None and move.relative > MATERIAL_SHARE)


def _p_value(study: Study) -> float:
    """The test of the gap, of the residuals of the answer's fit; in its wind a random moment leaves innovations."""
    random = study.random_answer(study.fitted)
    if random is not None:
        runs = zip(study.chosen.problem.data.runs, study.chosen.residuals, strict=True)
        still = [residual for run, residual in runs if not run.wind_on]
        left = np.concatenate([*random.process.innovations, *still])
        return float(chdtrc(left.size, left @ left))
    if study.chosen is study.nominal:
        return study.test.p_value
    # no cause changes the tests of the noise itself: those of the residuals count
    errors = rounding_errors(study.chosen, study.noise.white(study.step), study.step)
    return gap_test(study.chosen, study.noise, study.trend, coarse_step=True, errors=errors).p_value


def _words(
    study: Study,
    excess: float,
    stated: Estimates,
    moves: Mapping[str, Move],
    material: list[str],
    *,
    significant: bool,
) -> str:
    """What remains, in a sentence or two."""
    if not study.causes:
        return "No gap: nothing remains beyond the noise."
    left = f"what remains ({noise_powers(excess)})" if study.named else "it"
    if not significant:
        return f"Explained; {left} is within the noise."
    if material:
        moved = _each(material, lambda name: _sized(moves[name].value, stated[name]))
        start = f"Not all is explained: {left}" if study.named else "It"
        return f"{start} could move {moved}. Do not trust the coefficients beyond the intervals given."
    known = [name for name, move in moves.items() if move.std is not None]
    if not known:
        start = f"Explained; {left}" if study.named else "It"
        return f"{start} concerns no coefficient that these runs determine."
    bounds = _each(
        known,
        lambda name: f"less than {_sized(max(moves[name].value, moves[name].std or 0.0), stated[name])}",
    )
    return f"Explained; {left} moves {bounds}." if study.named else f"It hardly matters: it moves {bounds}."


def _each(names: list[str], size: Callable[[str], str]) -> str:
    return " and ".join(f"{COEFFICIENTS.get(name, name)} by {size(name)}" for name in names)


def _sized(size: float, given: ParameterEstimate) -> str:
    """A change of a coefficient as its share, rounded up; in its unit where the coefficient itself is uncertain."""
    if given.std is not None and given.std < abs(given.value):
        return f"{_rounded_up(100.0 * size / abs(given.value))} %"
    return f"{_rounded_up(size)} {'' if given.unit == '1' else unit_mark(given.unit)}".strip()


def _rounded_up(value: float) -> str:
    """Two significant digits, never below the value."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.2g}"
