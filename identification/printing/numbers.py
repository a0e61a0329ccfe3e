"""Formatting of numbers: two significant digits of the standard deviation determine the others."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

SYMBOLS: Mapping[str, str] = {
    "cn_beta": "Cnβ",
    "cn_r": "Cnr",
    "yaw_inertia": "Izz",
    "mechanical_damping": "Cr",
}
"""How the paper writes the quantities of an estimate, by their name in its JSON."""

COEFFICIENTS: Mapping[str, str] = {
    "cn_beta": "Cnβ",
    "cn_r": "Cnr",
    "cn_beta_area": "Cnβ·A",
    "cn_r_area": "Cnr·A",
    "cn_beta_length": "Cnβ·l",
    "cn_r_length2": "Cnr·l²",
    "cn_beta_area_length": "Cnβ·A·l",
    "cn_r_area_length2": "Cnr·A·l²",
    "omega_n": "ωn",
    "zeta": "ζ",
    "yaw_inertia": "inertia",
    "mechanical_damping": "damping",
    "added_stiffness": "added stiffness",
}
"""Symbols of the coefficients of a diagnosis, also of those multiplied by sizes that are not stated."""

FIXED_DECIMALS = 9
"""A number with more decimals than this, above a million or below a ten-thousandth has a power of ten."""

NEGLIGIBLE = 1e-9
"""A standard deviation below this share of the value does not determine the number of digits."""


def unit_mark(unit: str) -> str:
    """A unit with raised powers.

    Args:
        unit: of a document, such as ``m3/rad`` or ``N m s2/rad2``.

    Returns:
        Text such as ``m³/rad``; a 1 stays.
    """
    return re.sub(r"(?<=[A-Za-z])[234]\b", lambda found: "²³⁴"[int(found[0]) - 2], unit)


def coefficient_label(name: str, unit: str) -> str:
    """A coefficient's symbol and unit.

    Returns:
        Text such as ``Cnβ [1/rad]``.
    """
    return f"{COEFFICIENTS.get(name, name)} [{unit_mark(unit)}]"


def significant(value: float, digits: int = 4) -> str:
    """A number whose uncertainty is not known.

    Args:
        value: the number, any unit.
        digits: significant digits (a count).

    Returns:
        Fixed notation where it is short, otherwise with a power of ten.
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
    """A value and its standard deviation, both rounded to two significant digits of the latter.

    Args:
        value: the estimate, any unit.
        std: its standard deviation, in the same unit; None where it is not known.

    Returns:
        Text such as ``0.4951 ± 0.0012`` or ``(1.234 ± 0.056)e-05``.
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
    """The same as `with_std` in the short notation of metrology, for narrow columns.

    Args:
        value: the estimate, any unit.
        std: its standard deviation, in the same unit; None where it is not known.

    Returns:
        Text such as ``0.4951(12)``: the deviation counts in the last digits, unless it has a point itself.
    """
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
    """An error in standard deviations.

    Args:
        error: estimate − truth, any unit.
        std: standard deviation of the estimate, in the same unit; None where it is not known.

    Returns:
        Text such as ``+0.8 σ``; ``–`` where the standard deviation is not known.
    """
    if std is None or not math.isfinite(std) or std <= 0.0:
        return "–"
    ratio = error / std
    return f"{ratio:+.1f} σ" if abs(ratio) < 1000.0 else f"{ratio:+.0e} σ"


def unit(text: str) -> str:
    """A unit as printed, in brackets.

    Args:
        text: as in an estimate's JSON, such as ``kg m2``.

    Returns:
        Text such as ``[kg m²]``.
    """
    return f"[{unit_mark(text)}]"


def _special(value: float, std: float | None) -> str:
    """The text of a value that cannot be rounded by its standard deviation; empty for others."""
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
    """Decimal exponent of ``value`` once rounded to ``digits`` significant digits."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2]) if value != 0.0 else -300


def at_bound(given: Mapping[str, Any]) -> str:
    """The mark of a parameter that stopped at the end of its range.

    Args:
        given: value, std and unit, and ``bound`` where there is one.

    Returns:
        Text such as `` (at its upper bound)``; empty inside the range.
    """
    return f" (at its {given['bound']} bound)" if given.get("bound") else ""


def estimated(given: Mapping[str, Any], mark: str = "") -> str:
    """An estimate of a document.

    Args:
        given: value, std and unit; ``bound`` where it stopped at the end of its range, ``determined`` where it is
            false, and ``interval`` where that is not value ± 1.96 std. A std of zero means that the value was
            given, not fitted.
        mark: of the unit, where it is to be shown.

    Returns:
        Text such as ``0.4951 ± 0.0012``, with an interval ``0.4951 ± 0.0012 (0.4939 to 0.4986)``, or
        ``not determined by these runs``.
    """
    if not given.get("determined", True):
        return UNDETERMINED
    value = with_std(given["value"], given["std"]) if given["std"] else significant(given["value"])
    return f"{value} {mark}".rstrip() + at_bound(given) + _ends(given)


def _ends(given: Mapping[str, Any]) -> str:
    """The interval with as many digits as the value; empty where there is none."""
    if not given.get("interval") or not given["std"]:
        return ""
    texts = [with_std(end, given["std"]) for end in given["interval"]]
    powers = [text.rpartition(")")[2] if text.startswith("(") else "" for text in texts]
    low, high = (
        text.partition(" ± ")[0].removeprefix("(") + power for text, power in zip(texts, powers, strict=True)
    )
    return f" ({low} to {high})"


UNDETERMINED = "not determined by these runs"


def p_text(value: float) -> str:
    """A p-value, never rounded to 0.

    Args:
        value: a probability.

    Returns:
        Two significant digits, such as ``= 3.7e-08``, or ``< 1e-300``.
    """
    return f"= {value:.2g}" if value >= _LEAST_P else f"< {_LEAST_P:.0e}"


_LEAST_P = 1e-300  # close to the smallest number that a computer represents
