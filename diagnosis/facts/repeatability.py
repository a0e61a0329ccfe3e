"""Repeatability of the runs: their chance differences, and every run against the model."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Spread:
    """Chance difference of a quantity between the runs.

    Args:
        effect: name of the scatter.
        width: standard deviation of the runs' relative deviations, the likeliest, dimensionless.
        interval: its central interval of 0.90, dimensionless.
        stated: value stated by the campaign, dimensionless; None: not stated.
        shown: whether the runs show it beyond the stated value; it is then among the causes.
        deviations: of every run that it acts on, by id, relative, dimensionless.
    """

    effect: str
    width: float
    interval: tuple[float, float]
    stated: float | None
    shown: bool
    deviations: dict[str, float]


@dataclass(frozen=True)
class Trend:
    """A quantity that differs between the runs by a pattern: in their order, or with a condition of the plan.

    Args:
        effect: name of the scatter of that quantity.
        change: of the quantity from the first run to the last one, or from the least value of the condition to the
            greatest, relative, dimensionless.
        std: its standard deviation, dimensionless.
        p_value: probability of such an order by chance, times the number of trends sought.
        left: standard deviation of the runs' deviations from the drift, relative, dimensionless.
        only: whether the runs show no scatter of the quantity beside the drift.
        along: ``order``, ``spring_stiffness``, ``wind_speed``, ``air_density`` or ``amplitude``.
    """

    effect: str
    change: float
    std: float
    p_value: float
    left: float
    only: bool = False
    along: str = "order"


@dataclass(frozen=True)
class RunRepeat:
    """A run against the model of all runs.

    Args:
        id: of the run.
        windy: whether the wind is on.
        frequency_hz: of small swings, predicted without a deviation of the run, Hz.
        damping_ratio: of small swings, predicted without a deviation of the run, dimensionless.
        frequency: the run's own over the predicted one minus one, a fraction.
        frequency_std: its standard deviation by the noise, a fraction.
        damping: the run's own damping ratio over the predicted one minus one, a fraction.
        damping_std: its standard deviation by the noise, a fraction.
        frequency_band: standard deviation of the frequency between runs, a fraction; 0 where they repeat.
        damping_band: standard deviation of the damping ratio between runs, a fraction.
        p_value: probability of such a deviation by chance, given the other runs, times the number of runs.
    """

    id: str
    windy: bool
    frequency_hz: float
    damping_ratio: float
    frequency: float
    frequency_std: float
    damping: float
    damping_std: float
    frequency_band: float
    damping_band: float
    p_value: float


@dataclass(frozen=True)
class ScatterLimits:
    """Upper limits of scatter that was not detected, under a model that explains the runs down to their noise.

    Args:
        frequency: greatest standard deviation of the frequency between runs, with probability 0.95, a fraction;
            None where the runs would hide usual scatter.
        damping: of the damping ratio, as ``frequency``.
    """

    frequency: float | None
    damping: float | None


@dataclass(frozen=True)
class AnswerWithout:
    """The answer from the other runs, without a run that deviates far beyond them.

    Args:
        causes: names, sorted; empty: no gap, or none is needed; ``unknown`` alone: no effect explains the gap.
        probability: of that answer (a probability); 1 where there is no gap.
    """

    causes: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class RunRepeatability:
    """Repeatability of the runs under the answer.

    Args:
        spreads: chance differences between the runs; empty where they repeat.
        runs: every run against the model.
        outlier: id of the run that deviates far beyond the others; empty: none.
        trends: numbers that differ by a pattern, beyond chance; of each the clearest pattern.
        without_outlier: the answer without that run; None: there is none, or the others cannot be diagnosed.
        limits: of scatter where none was detected or stated; else None.
    """

    spreads: tuple[Spread, ...] = ()
    runs: tuple[RunRepeat, ...] = ()
    outlier: str = ""
    trends: tuple[Trend, ...] = ()
    without_outlier: AnswerWithout | None = None
    limits: ScatterLimits | None = None
