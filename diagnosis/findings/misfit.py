"""The misfit of a model in the units of the readings, as numbers and as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from diagnosis.findings.judged import Judged, Misfit
from diagnosis.where.maps import RunMap
from identification.show.numbers import held_out_excess, reading_shown, significant, times_noise, unit_shown


def misfit_of(answer: Judged) -> Misfit | None:
    """The misfit of a diagnosis' document; None where it has none, as in a document of an earlier version."""
    return answer.misfit


def rms_shown(misfit: Misfit, excess: float) -> str:
    """A misfit to three digits, such as ``0.134°``.

    Args:
        excess: in noise variances of a sample, a ratio.
    """
    return reading_shown(misfit.rms(excess), 3, misfit.unit)


def of_swing(misfit: Misfit, excess: float) -> str:
    """A misfit as a share of the swing in words, such as ``2.1 % of the swing``.

    Args:
        excess: in noise variances of a sample, a ratio.
    """
    share = 100.0 * misfit.rms(excess) / misfit.swing if misfit.swing > 0.0 else 0.0
    return f"{significant(share, 2) if share else '0'} % of the swing"


def unit_of(answer: Judged) -> str:
    """The unit of the readings of a document: rad, rad/s or rad/s²."""
    misfit = misfit_of(answer)
    return "rad" if misfit is None else misfit.unit


def misfit_text(answer: Judged, excess: float) -> str:
    """A gap in customary units, and in noise variances.

    Args:
        excess: in noise variances, a ratio.

    Returns:
        Text such as ``0.134° (19.34)``; the multiple alone for a document without ``misfit``. None below the noise.
    """
    if excess < _NONE:
        return NO_MISFIT
    misfit, times = misfit_of(answer), held_out_excess(excess)
    return times if misfit is None else f"{rms_shown(misfit, excess)} ({times})"


NO_MISFIT = "none (within the noise)"
"""A gap that is smaller than what chance adds to the noise."""
_NONE = 5e-4  # noise variances: shown as 0.000


def misfit_shown(answer: Judged, value: float) -> str:
    """A gap as a root mean square; in noise variances for a document without ``misfit``.

    Args:
        value: the gap as an excess, in noise variances, a ratio.
    """
    if value < _NONE:
        return NO_MISFIT
    misfit = misfit_of(answer)
    return times_noise(value) if misfit is None else rms_shown(misfit, value)


def misfit_scale(answer: Judged) -> tuple[str, Callable[[float], float]]:
    """The unit in which gaps are drawn, and the function from an excess in noise variances to this unit.

    The unit is degrees for readings of angles, and standard deviations of the noise for a document without
    ``misfit``.
    """
    misfit = answer.misfit or Misfit(1.0, 0.0, "rad")
    unit, factor = unit_shown(misfit.unit) if answer.misfit else ("noise std", 1.0)
    return unit, lambda excess: factor * misfit.rms(excess)


def excess_std(answer: Judged) -> float | None:
    """Standard deviation of the campaign's excess by chance, in noise variances; None where there are no maps."""
    if answer.maps is None:
        return None
    runs = answer.maps.runs
    return math.sqrt(sum(run.std**2 for run in runs)) / len(runs)


def windy(answer: Judged) -> bool:
    """Whether any run had wind; True where the document does not say."""
    return answer.maps is None or any(run.wind_speed > 0.0 for run in answer.maps.runs)


def run_labels(runs: Sequence[RunMap]) -> list[str]:
    """Runs with their conditions, such as ``r02 · 16.1 N m/rad · 15 m/s``.

    A spring is named where stated, and the wind speed where any run had wind.
    """
    windy = any(run.wind_speed > 0.0 for run in runs)
    labels = []
    for run in runs:
        parts = [run.id]
        if run.spring_stiffness:
            parts.append(f"{run.spring_stiffness:.4g} N m/rad")
        if windy:
            parts.append(f"{run.wind_speed:g} m/s" if run.wind_speed > 0.0 else "wind off")
        labels.append(" · ".join(parts))
    return labels
