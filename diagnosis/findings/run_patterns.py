"""Sentences on patterns in the differences between the runs."""

from __future__ import annotations

from diagnosis.findings.terms import NUMBERS, SCATTERS
from diagnosis.search.patterns import Trend
from identification.show.numbers import listed, percent_of, with_std

_ALONG = {
    "spring_stiffness": "stiffness of the spring",
    "wind_speed": "wind speed",
    "air_density": "air density",
    "amplitude": "amplitude",
}
_DRIFTS = {
    "wind_speed": "does the lab warm up, or the fan drift?",
    "spring_stiffness": "does the spring warm up, or creep?",
    "mechanical_damping": "does the bearing run in, or the cable creep?",
}


def trend_words(trend: Trend) -> str:
    """The pattern that a quantity follows, in a sentence."""
    number, drifts = SCATTERS[trend.effect], trend.along == "order"
    change, rises = with_std(100.0 * abs(trend.change), 100.0 * trend.std), trend.change > 0.0
    if drifts:
        goes = "rises" if rises else "falls"
        differs = f"{NUMBERS[number]} {goes} by {change} % from the first to the last run ({_DRIFTS[number]})"
    else:
        differs = f"{NUMBERS[number]} is {change} % {'higher' if rises else 'lower'} {_compared(trend)}"
    if trend.only:
        return f"The runs {'drift' if drifts else 'differ'} but do not scatter: {differs}."
    start = "Part of this is a drift" if drifts else "Part of this is not by chance"
    return f"{start}: {differs}. The remaining scatter is {percent_of(trend.left)}."


def _compared(trend: Trend) -> str:
    """The runs in which a quantity is higher or lower, and those with which they are compared."""
    if trend.along == "wind":
        return "with the wind on than with the wind off"
    if not trend.runs:
        return f"at the greatest {_ALONG[trend.along]} than at the least"
    parted = f"in {listed(list(trend.runs))} than in the other runs"
    if trend.of_condition:
        return f"{parted}, which have another {_ALONG[trend.along]}"
    return f"{parted} (another logger, day or clamping?)"


def sought(trend: Trend) -> str:
    """The search for the cause of a pattern."""
    if trend.along == "order":
        course = "from the first run to the last"
    elif trend.along == "wind":
        course = "with the wind on"
    elif trend.along == "groups":
        course = f"in {listed(list(trend.runs))}"
    else:
        course = f"with the {_ALONG[trend.along]}"
    return f"Look for what makes {NUMBERS[SCATTERS[trend.effect]]} differ {course}"
