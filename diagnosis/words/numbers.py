"""The format of names and numbers: effects, channels, probabilities, shares, and gaps in customary units."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction

from diagnosis.findings.closure import Misfit
from diagnosis.findings.whole import Findings
from identification.estimate import Quantity
from identification.printing import Document, significant, unit_mark, with_std
from tunnel_sim.effects import known_effects
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.quantities import Share

_ORDINALS = ("half", "third", "quarter", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
_CARDINALS = ("", "", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def probability(value: float) -> str:
    """A probability in whole per cent, never rounded to 0 or 100 %, such as ``97 %`` or ``> 99 %``."""
    if value >= 0.995:
        return "> 99 %"
    return f"{100.0 * value:.0f} %" if value >= 0.005 else "< 1 %"


def for_people(value: float, std: float | None, unit: str) -> str:
    """A value to three digits, with its standard deviation where they show it, such as ``1.96 ± 0.12 %``.

    Args:
        value: in the unit; radians are shown in degrees.
        std: its standard deviation, in the same unit; None: not known.
        unit: as effects and documents write it.
    """
    if unit == "rad":
        mark, factor = unit_shown(unit)
        value, std = factor * value, None if std is None else factor * std
    else:
        mark = unit_mark(beside(unit))
    last = 10.0 ** (math.floor(math.log10(abs(value))) - 2) if value else 0.0
    shown = significant(value, 3) if std is None or std < 0.5 * last else with_std(value, std)
    return f"{shown.replace('-', '−') if shown.startswith('-') else shown}{mark}"


def part(share: float) -> str:
    """A share above 0 and below 1 as a simple fraction in words, such as ``four fifths``; others in per cent."""
    simple = Fraction(share).limit_denominator(10)
    if abs(float(simple) - share) > 1e-9 or not 0 < simple < 1:
        return f"{100.0 * share:.3g} %"
    ordinal, count = _ORDINALS[simple.denominator - 2], simple.numerator
    if count > 1:
        return f"{_CARDINALS[count]} {ordinal}s"
    return ordinal if ordinal == "half" else f"{'an' if ordinal == 'eighth' else 'a'} {ordinal}"


def share(value: float) -> str:
    """A share in per cent, never rounded to 0 or 100 %: text such as ``98.2 %`` or ``> 99.9 %``.

    Args:
        value: a fraction; ``none`` below 0, where the residual has grown.
    """
    if value < 0.0:
        return "none"
    if value > 0.9995:
        return "> 99.9 %" if value < 1.0 else "100 %"
    if value < 0.0005:
        return "< 0.1 %" if value > 0.0 else "0 %"
    return f"{100.0 * value:.1f} %"


def percent(share: Share, std: float | None = None) -> str:
    """A share in per cent, such as ``94.2 ± 0.6 %``.

    Args:
        std: its standard deviation, a fraction.
    """
    beside = "" if std is None else f" ± {max(100.0 * std, 0.1):.1f}"
    return f"{min(100.0 * share, 100.0):.1f}{beside} %"


_UNITS = {"l/V": "the time in which the air passes the reference length"}


def explained(units: Iterable[str]) -> str:
    """Explanation of units that only this field uses, in brackets after a blank; empty where all are common."""
    said = [f"{unit}: {_UNITS[unit]}" for unit in units if unit in _UNITS]
    return f" ({'; '.join(said)})" if said else ""


def rounded_up(value: float) -> str:
    """Two significant digits, never below the value."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.2g}"


def size_change(before: float, after: float) -> str:
    """How the size of a coefficient changes, such as ``-6.6 %``: a negative one that comes nearer to zero falls.

    Args:
        before: the value without the causes, not 0, in its unit.
        after: the value with the causes, in the same unit.
    """
    if before * after < 0.0:
        return "other sign"
    change = 100.0 * (abs(after) / abs(before) - 1.0)
    return f"{change:+.2g} %" if change else "0 %"


def change_up_to(size: float, given: Quantity) -> str:
    """A change of a coefficient as its share, rounded up; in its unit where the coefficient is uncertain.

    Args:
        size: the change, in the coefficient's unit.
        given: the coefficient, from the document.
    """
    if given.std is not None and given.std < abs(given.value):
        return f"{rounded_up(100.0 * size / abs(given.value))} %"
    return f"{rounded_up(size)} {'' if given.unit == '1' else unit_mark(given.unit)}".strip()


def unit_shown(unit: str) -> tuple[str, float]:
    """The mark of the displayed unit of readings, and the factor on values in the given unit."""
    return {"rad": "°", "rad/s": "°/s", "rad/s2": "°/s²"}[unit], math.degrees(1.0)


def misfit_of(answer: Findings) -> Misfit | None:
    """The misfit of a diagnosis' document; None where it has none, as in a document of an earlier version."""
    return answer.gap.misfit


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


def times_noise(value: float) -> str:
    """A gap in words, such as ``2.75 times the noise variance``, from its excess, a ratio."""
    return f"{significant(value, 4) if value >= 10.0 else f'{value:.2f}'} times the noise variance"


def left_over(excess: float) -> str:
    """A residual gap, such as ``9.6 times the noise variance``, a ratio."""
    least = 1e-3
    size = f"less than {least:g}" if excess < least else significant(excess, 2)
    return f"{size} times the noise variance"


def beside_noise(excess: float) -> str:
    """A residual in multiples of the noise, root mean square, such as ``0.999 times the noise``.

    Args:
        excess: its mean square over the noise variance, minus one, a ratio.
    """
    return f"{significant(math.sqrt(max(1.0 + excess, 0.0)), 3)} times the noise"


def reading_shown(value: float, digits: int, unit: str = "rad") -> str:
    """A reading, or an error of one, in the displayed unit, such as ``0.0226°``.

    Args:
        value: in the unit.
        digits: significant digits (a count).
    """
    mark, factor = unit_shown(unit)
    return f"{significant(factor * value, digits) if value else '0'}{mark if mark == '°' else f' {mark}'}"


def unit_of(answer: Findings) -> str:
    """The unit of the readings of a document: rad, rad/s or rad/s²."""
    misfit = misfit_of(answer)
    return "rad" if misfit is None else misfit.unit


def held_out_excess(value: float) -> str:
    """An excess in noise variances, a ratio: three decimals where it is small, or four significant digits."""
    return f"{round(value, 3) + 0.0:.3f}" if abs(value) < 10.0 else significant(value, 4)


def misfit_text(answer: Findings, excess: float) -> str:
    """A gap in customary units, and in noise variances.

    Args:
        excess: in noise variances, a ratio.

    Returns:
        Text such as ``0.134° (19.34)``; the multiple alone for a document without ``misfit``.
    """
    misfit, times = misfit_of(answer), held_out_excess(excess)
    return times if misfit is None else f"{rms_shown(misfit, excess)} ({times})"


def misfit_shown(answer: Findings, value: float) -> str:
    """A gap as a root mean square; in noise variances for a document without ``misfit``.

    Args:
        value: the gap as an excess, in noise variances, a ratio.
    """
    misfit = misfit_of(answer)
    return times_noise(value) if misfit is None else rms_shown(misfit, value)


def excess_std(answer: Findings) -> float | None:
    """Standard deviation of the campaign's excess by chance, in noise variances; None where there are no maps."""
    runs = answer.figure_data.get("runs", [])
    return math.sqrt(sum(run["std"] ** 2 for run in runs)) / len(runs) if runs else None


"""A diagnosis in JSON's types (`Diagnosis.to_json_dict`)."""

CHANNELS = {
    "stiffness": "the restoring moment",
    "damping": "the damping",
    "forcing": "the forcing moment",
    "sensor": "the sensor reading",
    "calibration": "a stated value",
}
"""The object on which a cause or a gap acts."""

CONDITIONS = {"always": "with the wind on and off", "wind_on": "only with the wind on"}
"""The condition under which a cause acts, or a gap shows."""

BANDS = {
    "0": "slower than the oscillation",
    "f0": "at the oscillation itself",
    "2f0": "at twice its frequency",
    "3f0": "at three times its frequency",
    "above": "faster than its third harmonic",
}
"""Bands of frequency, in multiples of that of the motion."""

MISFITS = {
    "damping": "the damping along the runs",
    "frequency": "the frequency along the runs",
    "damping of runs": "the damping of single runs",
    "frequency of runs": "the frequency of single runs",
    "zero": "the zero",
    "harmonics": "the harmonics",
}
"""Channels in which a set of effects may have a misfit."""

KINDS: Mapping[str, str] = {
    "angle": "a moment of the angle alone",
    "rate": "a moment of the rate alone",
    "state": "a moment of angle and rate",
    "wind": "a moment of angle and rate with the wind",
    "time": "a moment in time, equal in all runs",
    "reading": "an error of the reading, equal in all runs",
    "line": "a steady line in the reading, with its own phase in every run",
    "between": "a stiffness, damping or moment of each run",
    "event": "a moment in time of each run",
    "wander": "a wandering or jumping zero of each run",
    "noise": "nothing smooth: the rest is noise",
}
"""Kinds of missing law (`diagnosis.likelihood.ceiling.KINDS`)."""


def plain(*names: str) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    return listed([name.replace("_", " ") for name in names])


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence as a list: ``one, two and three``."""
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def windy(answer: Findings) -> bool:
    """Whether any run had wind; True where the document does not say."""
    runs = answer.figure_data.get("runs")
    return not runs or any(run["wind_speed"] > 0.0 for run in runs)


def acts_on(answer: Findings, effect: str) -> str:
    """The object and condition of an effect, such as ``the damping, only with the wind on``; empty if unknown."""
    kind = {kind.name: kind for kind in known_effects()}.get(effect)
    if kind is None:
        return ""
    return f"{CHANNELS[kind.channel]}{f', {CONDITIONS[kind.condition]}' if windy(answer) else ''}"


def misfit_scale(answer: Findings) -> tuple[str, Callable[[float], float]]:
    """The unit in which gaps are drawn, and the function from an excess in noise variances to this unit.

    The unit is degrees for readings of angles, and standard deviations of the noise for a document without
    ``misfit``.
    """
    misfit = answer.gap.misfit or Misfit(1.0, 0.0, "rad")
    unit, factor = unit_shown(misfit.unit) if answer.gap.misfit else ("noise std", 1.0)
    return unit, lambda excess: factor * misfit.rms(excess)


def run_labels(maps: Document) -> list[str]:
    """The runs of ``maps`` with their conditions, such as ``r02 · 16.1 N m/rad · 15 m/s``.

    A spring is named where stated, and the wind speed where any run had wind.
    """
    windy = any(run["wind_speed"] > 0.0 for run in maps["runs"])
    labels = []
    for run in maps["runs"]:
        parts = [str(run["id"])]
        if run["spring_stiffness"]:
            parts.append(f"{run['spring_stiffness']:.4g} N m/rad")
        if windy:
            parts.append(f"{run['wind_speed']:g} m/s" if run["wind_speed"] > 0.0 else "wind off")
        labels.append(" · ".join(parts))
    return labels
