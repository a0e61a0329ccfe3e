"""The confidence interval of a proportion."""

from __future__ import annotations


def wilson_interval(count: int, total: int) -> tuple[float, float]:
    """Wilson's interval of 95 % (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212).

    Args:
        count: number of successes.
        total: number of trials, above 0.

    Returns:
        Lower and upper end, as fractions of 1.
    """
    from scipy.stats import binomtest

    found = binomtest(count, total).proportion_ci(method="wilson")
    return float(found.low), float(found.high)
