"""Numbers as text: with their deviations, as shares and probabilities, and readings in customary units.

Two significant digits of the standard deviation determine the digits of the value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.freedom import FREEDOMS, freedom_of_unit

if TYPE_CHECKING:
    from identification.show.quantity import Quantity
    from tunnel_sim.vocabulary.quantities import Share

FIXED_DECIMALS = 9
"""A number with more decimals than this, above a million or below a ten-thousandth is shown with a power of
ten."""


NEGLIGIBLE = 1e-9
"""A standard deviation below this share of the value does not determine the number of digits."""


def unit_mark(unit: str) -> str:
    """A unit of a document with superscripts: ``m³/rad`` for ``m3/rad``; a 1 is unchanged."""
    return re.sub(r"(?<=[A-Za-z])[234]\b", lambda found: "²³⁴"[int(found[0]) - 2], unit)


def in_degrees(angle: float) -> str:
    """An angle (rad) in degrees, such as ``5.2°``."""
    return f"{significant(math.degrees(angle), 2)}°"


def significant(value: float, digits: int = 4) -> str:
    """A number whose uncertainty is not known, in fixed notation where that is short.

    Args:
        value: the number, any unit.
        digits: significant digits (a count).
    """
    if not math.isfinite(value):
        return "not finite"
    if value == 0.0:
        return "0"
    exponent = _exponent(value, digits)
    if -4 <= exponent < 6:
        return f"{value:.{max(digits - 1 - exponent, 0)}f}"
    return f"{value:.{digits - 1}e}"


def with_std(value: float, std: float | None) -> str:
    """A value and its standard deviation, such as ``0.4951 ± 0.0012`` or ``(1.234 ± 0.056)e-05``.

    Args:
        value: the estimate, any unit.
        std: standard deviation, in the same unit; None if not known.
    """
    special = _special(value, std)
    if special or std is None:
        return special
    decimals = 1 - _exponent(std, 2)
    if _fixed(value, std, decimals):
        places = max(decimals, 0)
        return f"{round(value, decimals):.{places}f} ± {round(std, decimals):.{places}f}"
    power = max(_exponent(value, 2), _exponent(std, 2))
    scale, places = 10.0**power, max(decimals + power, 0)
    return f"({value / scale:.{places}f} ± {std / scale:.{places}f})e{power:+03d}"


def concise(value: float, std: float | None) -> str:
    """The short notation of metrology, such as ``0.4951(12)``, for narrow columns: arguments as in `with_std`."""
    special = _special(value, std)
    if special or std is None:
        return special
    decimals = 1 - _exponent(std, 2)
    if not _fixed(value, std, decimals):
        return with_std(value, std)
    if decimals <= 0:
        return f"{round(value, decimals):.0f}({round(std, decimals):.0f})"
    rounded = f"{round(std, decimals):.{decimals}f}"
    return f"{value:.{decimals}f}({rounded if std >= 1.0 else rounded.replace('.', '').lstrip('0')})"


def in_stds(error: float, std: float | None) -> str:
    """An error in standard deviations, such as ``+0.8 σ``; ``–`` if the standard deviation is not known.

    Args:
        error: estimate − truth, any unit.
        std: standard deviation of the estimate, in the same unit; None if not known.
    """
    if std is None or not math.isfinite(std) or std <= 0.0:
        return "–"
    ratio = error / std
    return f"{ratio:+.1f} σ" if abs(ratio) < 1000.0 else f"{ratio:+.0e} σ"


def unit(text: str) -> str:
    """A unit of an estimate's JSON as printed: ``[kg m²]`` for ``kg m2``."""
    return f"[{unit_mark(text)}]"


def _special(value: float, std: float | None) -> str:
    """The text of a value that its standard deviation cannot round; empty for other values."""
    if not math.isfinite(value):
        return "not finite"
    if std is None or not math.isfinite(std):
        return f"{significant(value)} (std unknown)"
    if std <= 0.0:
        return f"{significant(value, 7)} ± 0"
    return f"{value:.10g} ± {std:.1e}" if std < NEGLIGIBLE * abs(value) else ""


def _fixed(value: float, std: float, decimals: int) -> bool:
    """Whether fixed notation is short enough."""
    return decimals <= FIXED_DECIMALS and 1e-4 <= max(abs(value), std) < 1e6


def _exponent(value: float, digits: int) -> int:
    """Decimal exponent of ``value`` after rounding to ``digits`` significant digits."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2]) if value != 0.0 else -300


def estimated(given: Quantity, mark: str = "") -> str:
    """An estimate: ``0.4951 ± 0.0012``, ``0.4951 ± 0.0012 (0.4939 to 0.4986)``, or not determined.

    A deviation of zero means that the value was given, not fitted: it is marked as fixed.
    """
    if not given.determined:
        return UNDETERMINED
    value = with_std(given.value, given.std) if given.std else significant(given.value)
    bound = f" (at its {given.bound} bound)" if given.bound else ""
    text = f"{value} {mark}".rstrip() + bound + (" (fixed)" if given.std == 0.0 else "")
    if given.interval is None or not given.std:
        return text
    # The ends of the interval have as many digits as the value.
    texts = [with_std(end, given.std) for end in given.interval]
    powers = [end.rpartition(")")[2] if end.startswith("(") else "" for end in texts]
    low, high = (
        end.partition(" ± ")[0].removeprefix("(") + power for end, power in zip(texts, powers, strict=True)
    )
    return f"{text} ({low} to {high})"


UNDETERMINED = "not determined by these runs"


def p_text(value: float) -> str:
    """The text of a probability, never rounded to 0: such as ``= 3.7e-08``, or ``< 1e-300``."""
    return f"= {value:.2g}" if value >= _LEAST_P else f"< {_LEAST_P:.0e}"


_LEAST_P = 1e-300  # close to the smallest positive float


_ORDINALS = ("half", "third", "quarter", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")


_CARDINALS = ("", "", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def probability(value: float) -> str:
    """A probability in whole per cent, never rounded to 0 or 100 %, such as ``97 %`` or ``> 99 %``."""
    if value >= 0.995:
        return "> 99 %"
    return f"{100.0 * value:.0f} %" if value >= 0.005 else "< 1 %"


def for_people(value: float, std: float | None, unit: str) -> str:
    """A value to three digits, with its standard deviation if these digits show it, such as ``1.96 ± 0.12 %``.

    Args:
        value: in the unit; radians are shown in degrees.
        std: standard deviation, in the same unit; None: not known.
        unit: unit in the spelling of effects and documents.
    """
    if unit in _MOTIONS:
        mark, factor = unit_shown(unit)
        mark = joined_mark(mark)
        value, std = factor * value, None if std is None else factor * std
    else:
        mark = unit_mark(beside(unit))
    last = 10.0 ** (math.floor(math.log10(abs(value))) - 2) if value else 0.0
    shown = significant(value, 3) if std is None or std < 0.5 * last else with_std(value, std)
    return f"{shown.replace('-', '−') if shown.startswith('-') else shown}{mark}"


_MOTIONS = tuple(next(iter(one.shown)) for one in FREEDOMS.values())


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
        value: a fraction; below 0, where the residual has grown, the text is ``none``.
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
        std: standard deviation, a fraction.
    """
    beside = "" if std is None else f" ± {max(100.0 * std, 0.1):.1f}"
    return f"{min(100.0 * share, 100.0):.1f}{beside} %"


_UNITS = {"l/V": "the time in which the air passes the reference length"}


def explained(units: Iterable[str]) -> str:
    """Explanation, in brackets after a blank, of units that only this field uses; empty if all are common."""
    said = [f"{unit}: {_UNITS[unit]}" for unit in units if unit in _UNITS]
    return f" ({'; '.join(said)})" if said else ""


def explained_in(text: str) -> bool:
    """Whether a text has a unit that only this field uses."""
    return any(re.search(rf"{re.escape(unit)}\b", text) for unit in _UNITS)


def rounded_up(value: float) -> str:
    """Two significant digits, never below the value."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.2g}"


def relative_change(before: float, after: float) -> Share:
    """The relative change of a coefficient by the causes; the reference is its value without them.

    Args:
        before: the value without the causes, not 0, in its unit.
        after: the value with the causes, in the same unit and of the same sign.
    """
    return abs(after) / abs(before) - 1.0


def size_change(before: float, after: float) -> str:
    """The change of a coefficient's size, such as ``-6.6 %``: negative if the coefficient comes nearer to zero.

    Args:
        before: the value without the causes, not 0, in its unit.
        after: the value with the causes, in the same unit.
    """
    if before * after < 0.0:
        return "other sign"
    return changed_by(relative_change(before, after))


def changed_by(change: Share) -> str:
    """A relative change, such as ``+3.3 %``, ``less than 0.01 %`` or ``+210 %``: never a power of ten."""
    if 0.0 < abs(change) < _NO_CHANGE:
        return f"less than {100.0 * _NO_CHANGE:g} %"
    return f"{100.0 * change:{'+.2g' if abs(change) < 0.995 else '+.0f'}} %" if change else "0 %"


_NO_CHANGE = 1e-4


def within(reach: Share) -> str:
    """Half an interval as a share of its middle, such as ``± 5 %``."""
    return (
        f"± {significant(100.0 * reach, 2 if reach >= 0.01 else 1)} %" if reach > _NO_CHANGE else "± 0.01 %"
    )


def change_up_to(size: float, given: Quantity) -> str:
    """An upper limit on a coefficient's relative change; in its unit if the coefficient is uncertain.

    Args:
        size: the change, in the coefficient's unit.
        given: the coefficient, from the document.
    """
    if given.std is not None and given.std < abs(given.value):
        return f"{rounded_up(100.0 * size / abs(given.value))} %"
    return f"{rounded_up(size)} {'' if given.unit == '1' else unit_mark(given.unit)}".strip()


def unit_shown(unit: str) -> tuple[str, float]:
    """The mark of the displayed unit of readings, and the factor on values in the given unit."""
    return freedom_of_unit(unit).shown[unit]


def motion_shown(unit: str) -> tuple[str, float]:
    """The mark of the motion's displayed unit (angle or displacement) and the factor, for readings of a unit."""
    return next(iter(freedom_of_unit(unit).shown.values()))


def joined_mark(mark: str) -> str:
    """The mark of a unit after a number, with a blank before it if it needs one."""
    return mark if mark == "°" else f" {mark}"


def beside_noise(excess: float) -> str:
    """A residual in multiples of the noise, root mean square, such as ``0.999 times the noise``.

    Args:
        excess: mean square of the residual over the noise variance, minus one, a ratio.
    """
    return f"{significant(math.sqrt(max(1.0 + excess, 0.0)), 3)} times the noise"


def reading_shown(value: float, digits: int, unit: str = "rad") -> str:
    """A reading, or an error of one, in the displayed unit, such as ``0.0226°``.

    Args:
        value: in the unit.
        digits: significant digits (a count).
    """
    mark, factor = unit_shown(unit)
    return f"{significant(factor * value, digits) if value else '0'}{joined_mark(mark)}"


def held_out_excess(value: float) -> str:
    """An excess in noise variances, a ratio: with three decimals if small, else with four significant digits."""
    return f"{round(value, 3) + 0.0:.3f}" if abs(value) < 10.0 else significant(value, 4)


def to_interval(given: Quantity) -> tuple[str, int]:
    """An estimate with its 95 % interval, to four digits at most, and the number of its decimals.

    Returns:
        Text such as ``0.432 ± 0.013``, or ``0.43 (0.41 to 0.46)`` for an interval that is not symmetric.
    """
    low, high = given.ends
    reach = 0.5 * (high - low)
    last = (
        max(_exponent(reach, 2) - 1, _exponent(given.value, 4) - 3)
        if reach
        else _exponent(given.value, 3) - 2
    )
    places, least = max(-last, 0), 10.0**last

    def text(value: float) -> str:
        return f"{round(value, -last) + 0.0:.{places}f}"

    if given.interval is not None and reach > least:
        return f"{text(given.value)} ({text(low)} to {text(high)})", places
    return text(given.value) + (f" ± {text(max(reach, least))}" if reach else ""), places


def span(values: Sequence[float], text: Callable[[float], str]) -> str:
    """The range of values, such as ``0.04 to 0.11``; one number where the texts of both ends are the same."""
    least, most = text(min(values)), text(max(values))
    return least if least == most else f"{least} to {most}"


def sentence_case(words: str) -> str:
    """The words with a capital at the start; a Greek letter is a symbol."""
    return words[:1].upper() + words[1:] if words[:1].isascii() else words


def plain(*names: str) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    return listed([name.replace("_", " ") for name in names])


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence as a list: ``one, two and three``."""
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def alternatives(parts: Sequence[str]) -> str:
    """Parts that may contain commas as a choice: ``one or two``; ``one; two; or three``."""
    *first, last = parts
    return f"{'; '.join(first)}; or {last}" if len(first) > 1 else " or ".join(parts)


def percent_of(value: Share, digits: int = 2, *, sign: bool = False) -> str:
    """A fraction in per cent, such as ``0.29 %`` or ``−0.6 %``.

    Args:
        digits: significant ones (a count).
        sign: whether to write a plus sign.
    """
    text = significant(100.0 * abs(value), digits) if value else "0"
    return f"{'−' if value < 0.0 else '+' if sign else ''}{text} %"
