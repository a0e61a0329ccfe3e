"""Repeatability of the runs: their chance differences, and every run against the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from diagnosis.answer.run_deviations import RunDeviations, RunRepeat, ScatterLimits, Spread
from diagnosis.findings.finding import Judged, NextStep, Picture
from diagnosis.findings.run_patterns import sought, trend_words
from diagnosis.findings.terms import NUMBERS, SCATTERS, scattering, without_scatter
from diagnosis.likelihood.least_squares import Fit
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.patterns import Trend, trends
from identification.show.blocks import TextTable
from identification.show.drawing import AFTER, BEFORE, INK, NARROW, NOISE, PAPER
from identification.show.numbers import concise, listed, percent_of, plain, probability, rounded_up
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import figure, figure_text, grid, styled
from identification.status import SYSTEMATIC
from tunnel_sim.vocabulary.quantities import Share

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_KNOWN_WITHIN: Final = 10.0
"""Maximum ratio of the ends of a width's interval for the width to count as well known. Convention. An order of
magnitude."""
DEVIATION_NAMED: Final = 3.0
"""Minimum deviation in frequency or damping for an outlying run to be stated, in standard deviations of the
other runs. Convention."""

_MEANT = (
    "These are standard deviations between runs, with 90 % intervals; the intervals of the coefficients allow for "
    "them."
)


@dataclass(frozen=True)
class AnswerWithout:
    """The answer from the other runs, without an outlying run.

    Args:
        causes: effect names, sorted; empty: no gap, or no cause is needed; ``unknown`` alone: no effect
            explains the gap.
        probability: probability of this answer; 1 without a gap.
    """

    causes: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class RunRepeatability:
    """Repeatability of the runs under the answer.

    Args:
        spreads: chance differences between the runs; empty where they repeat.
        runs: every run against the model.
        outlier: id of the outlying run; empty: none.
        trends: quantities that vary by a pattern, beyond chance; for each quantity the clearest pattern.
        without_outlier: the answer without the outlying run; None: no such run, or the others cannot be
            diagnosed.
        limits: upper limits of scatter if none was detected or stated; else None.
    """

    spreads: tuple[Spread, ...] = ()
    runs: tuple[RunRepeat, ...] = ()
    outlier: str = ""
    trends: tuple[Trend, ...] = ()
    without_outlier: AnswerWithout | None = None
    limits: ScatterLimits | None = None

    @classmethod
    def find(cls, fitted: Fit) -> RunRepeatability | None:
        """Repeatability of the runs.

        Args:
            fitted: the fit of the answer.

        Returns:
            None for a single run, for a body without a spring or a damping, and where the sensitivities are not
            finite.
        """
        found = RunDeviations.of(fitted)
        if found is None:
            return None
        runs = tuple(found.run(index) for index in range(len(fitted.problem.data.runs)))
        rate = fitted.settings.scatter.outlier_rate
        outliers = sorted((one for one in runs if one.p_value < rate), key=lambda one: one.p_value)
        outlier = outliers[0].id if outliers else ""
        return cls(found.spreads(), runs, outlier, trends(fitted), limits=found.limits())

    @property
    def scatters(self) -> bool:
        """Whether the runs show scatter, or some is stated."""
        return any(one.width for one in self.spreads)

    def repeats(self, judged: Judged) -> bool:
        """Whether a test that can detect scatter between the runs detected none, and none is stated."""
        return not self.scatters and not self._undetermined(judged)

    def _undetermined(self, judged: Judged) -> str:
        """The reason why the runs' repeatability is unknown, as a clause; empty where it is known.

        Scatter is measured against the noise, so the answer must explain the runs down to their noise.
        """
        if judged.causes == UNKNOWN:
            return "since no known effect explains the gap"
        if not judged.decided:
            return "since the answer is undecided"
        if judged.rest_is_significant:
            return "since the answer leaves a gap beyond the noise"
        if judged.between_runs_remain:
            return "since a difference between the runs could explain the rest"
        limits = self.limits
        if limits is None or (limits.frequency is None and limits.damping is None):
            return "since these runs would not show usual scatter"
        return ""

    def spread_estimate(self, effect: str, given: Quantity) -> str | None:
        """The parameter of a scatter in per cent, with its interval in the answer; None for other effects.

        Args:
            effect: the effect to which the parameter belongs.
            given: the parameter.
        """
        if effect not in SCATTERS:
            return None
        spread = next((one for one in self.spreads if one.effect == effect), None)
        return percent_of(given.value) if spread is None else width_text(spread)

    def words(self, judged: Judged) -> str:
        """Repeatability of the runs, in sentences; empty where they repeat, or it is not known."""
        return " ".join(filter(None, (self.scatter_words(judged), self._outlier_words(judged))))

    def scatter_words(self, judged: Judged) -> str:
        """Chance differences or drifts of the runs and their meaning; empty if there are none."""
        shown = [one for one in self.spreads if one.shown]
        if not shown:
            return self._stated_words(judged)
        trends = {one.effect: one for one in self.trends}
        drifting = {effect for effect, one in trends.items() if one.only}
        said = []
        if scattered := [one for one in shown if one.effect not in drifting]:
            parts = "; ".join(_differs(one, trends) for one in scattered)
            said.append(f"{self._start(judged)}: {parts}. {_MEANT}")
        said += map(trend_words, trends.values())
        if not scattered:
            said.append("The intervals of the coefficients allow for it.")
        return " ".join([*said, *_told_apart(self.spreads)])

    def systematic(self, judged: Judged) -> list[str]:
        """Sentences on a pattern of the runs' differences in the examination, and the effects that cause it."""
        remarks = [remark.figures.get(SYSTEMATIC) for remark in judged.remarks]
        return [*filter(None, remarks), *(one.effect for one in self.trends)]

    def _start(self, judged: Judged) -> str:
        if not judged.decided:
            by = ", and not by chance alone" if self.trends else " by chance"
            return f"With every answer the runs differ from each other{by}"
        if without_scatter(judged.causes):
            return "In addition the runs differ by chance"
        likely = probability(judged.likely)
        if self.systematic(judged):
            return f"The runs differ from each other, and not by chance alone (probability {likely})"
        only = "" if judged.rest_is_material else " only"
        return f"The runs differ from each other by chance{only} (probability {likely})"

    def _stated_words(self, judged: Judged) -> str:
        """The statement that the scatter is within the stated one; empty where the campaign states none."""
        stated = [one for one in self.spreads if one.stated]
        if not stated or judged.causes == UNKNOWN:
            return ""
        sizes = listed([f"{NUMBERS[SCATTERS[one.effect]]} {_stated(one)}" for one in stated])
        return f"The runs differ no more than stated ({sizes}); the intervals allow for it."

    def _outlier_words(self, judged: Judged) -> str:
        """The outlying run with its deviation; empty without one."""
        run = self.outlier
        if not run:
            return ""
        own = next(one for one in self.runs if one.id == run)
        parts = []
        for name in ("frequency", "damping"):
            value, std, band = own.deviation(name)
            usual = max(band, std, 1e-300)
            parts.append((abs(value) / usual, f"{name} {percent_of(value, sign=True)}"))
        far = [text for stds, text in parts if stds >= DEVIATION_NAMED] or [max(parts)[1]]
        said = f"Run {run} deviates far beyond the others: {' and '.join(far)} relative to the model of all runs."
        return " ".join(filter(None, (said, self._without_outlier(judged, self.without_outlier))))

    def _without_outlier(self, judged: Judged, other: AnswerWithout | None) -> str:
        """The answer of the other runs; empty where it is not known."""
        if not other:
            return ""
        causes, known = other.causes, probability(other.probability)
        if causes == judged.causes:
            return f"Without it the causes are the same ({known})."
        if not causes:
            return "Without it there is no gap."
        if causes == UNKNOWN:
            return f"Without it no known effect explains the gap ({known})."
        return f"Without it the answer is {plain(*causes)} ({known})."

    def pattern_step(self, effect: str) -> NextStep | None:
        """The step in place of the remedy of a scatter; None unless a pattern explains most of the scatter.

        Args:
            effect: name of the scatter.
        """
        width = next((one.width for one in self.spreads if one.effect == effect), 0.0)
        trend = next((one for one in self.trends if one.effect == effect), None)
        if trend is None or 2.0 * trend.left**2 > width**2:
            return None
        return NextStep(sought(trend), "most of the difference between runs follows it")

    @property
    def pattern_steps(self) -> list[NextStep]:
        """The steps where the differences between the runs have a cause that is not named."""
        return [
            NextStep(
                sought(one),
                "the runs differ by nothing else" if one.only else "such a difference has a cause",
            )
            for one in self.trends
            if one.only or one.of_condition
        ]

    def steps(self, judged: Judged) -> list[NextStep]:
        """Next steps for an outlying run, and for poorly distinguished quantities."""
        run = self.outlier
        steps = (
            [
                NextStep(
                    f"Repeat run {run}, which deviates far beyond the others, or look for a disturbance",
                    "shows whether the run or the rig is at fault",
                )
            ]
            if run
            else []
        )
        poorly = _told_apart(self.spreads)
        named = {SCATTERS[name] for name in scattering(judged.causes)}
        if poorly and "wind_speed" not in named:  # the advice for the scatter includes this step
            steps.append(NextStep("Log the wind speed of every run", "tells its scatter from the spring's"))
        return steps

    def line(self, judged: Judged) -> str:
        """Repeatability of the runs, in a line; empty for fewer than two runs."""
        if len(self.runs) < 2:
            return ""
        if self.limits is not None and self.repeats(judged):
            return f"Repeatability: no run-to-run scatter detected: {_limits(self.limits)}."
        if not self.scatters:
            own = [f"{name} by {_root_mean_square(self.runs, name)}" for name in ("frequency", "damping")]
            return (
                f"Repeatability: not determined, {self._undetermined(judged)}. The runs, one by one, deviate "
                f"from the model in {' and in '.join(own)} (root mean square)."
            )
        each = [
            f"{name} ± {_root_mean_square(self.runs, name, of_scatter=True)}"
            for name in ("frequency", "damping")
        ]
        beyond = f"; outlier: {self.outlier}" if self.outlier else ""
        return f"Repeatability: between runs {', '.join(each)} (one standard deviation){beyond}."

    def table(self, judged: Judged) -> TextTable:
        """Every run against the model; a table without rows where the runs repeat."""
        rows, known = [], self.scatters
        for run in self.runs if not self.repeats(judged) else ():
            deviations = [
                f"{_signed(value, std)}{_band(band) if known else ''}"
                for value, std, band in (run.deviation("frequency"), run.deviation("damping"))
            ]
            remark = "deviates far beyond the others" if run.id == self.outlier else ""
            wind = ("on" if run.windy else "off",) if judged.freedom.windy else ()
            rows.append((run.id, *wind, *deviations, remark))
        numbers = ("frequency [%]", "damping [%]")
        heads = ("run", *["wind"] * judged.freedom.windy, *numbers, "remark")
        last = None if any(row[-1] for row in rows) else -1
        title = "Every run against the model, with the deviation due to noise alone"
        if known:
            title += ", and its scatter by chance (one standard deviation)"
        return TextTable(title, heads[:last], tuple(row[:last] for row in rows), numbers)

    def pictures(self) -> tuple[Picture, ...]:
        """Every run against the model; none for fewer than two runs."""
        caption = (
            "Repeatability: frequency and damping ratio of every run minus the prediction of the model of all "
            "runs. Bars: 95 % intervals of the noise. Grey: the 95 % band of the scatter between runs, which "
            "depends on wind and spring."
        )
        description = (
            "Frequency and damping ratio of every run minus the model's, with the scatter as a band."
        )
        drawn = Picture("repeatability", caption, description, partial(repeatability_figure, self))
        return (drawn,) if len(self.runs) > 1 else ()


def _stated(spread: Spread) -> str:
    """The scatter stated by the campaign, in its own form, or the statement that none is stated."""
    return f"{100.0 * (spread.stated or 0.0):.4g} %"


def width_text(spread: Spread) -> str:
    """A width with its interval, such as ``0.29 % (0.13 to 0.62 %)``; a stated width has none."""
    low, high = spread.interval
    text = percent_of(spread.width)
    return text if low == high else f"{text} ({percent_of(low).removesuffix(' %')} to {percent_of(high)})"


def _differs(spread: Spread, trends: Mapping[str, Trend]) -> str:
    """One quantity that differs: its width, the reference, and the runs with the largest deviations."""
    text = f"{NUMBERS[SCATTERS[spread.effect]]} by {width_text(spread)}"
    if spread.stated is not None:
        text += f", beyond the {_stated(spread)} stated"
    if spread.effect in trends:
        return text
    most = sorted(spread.deviations.items(), key=lambda one: -abs(one[1]))[:2]
    return f"{text}, {' and '.join(f'{run} {percent_of(own, 1, sign=True)}' for run, own in most)} most"


def _ratio(interval: Sequence[float]) -> float:
    low, high = interval
    return high / low if low > 0.0 else float("inf")


def _limits(limits: ScatterLimits) -> str:
    """Upper limits of scatter that is not detected, such as ``frequency less than 0.05 %``."""
    said = [
        f"{name} not determined, since these runs would not show usual scatter"
        if limit is None
        else f"{name} less than {rounded_up(100.0 * limit)} %"
        for name, limit in (("frequency", limits.frequency), ("damping", limits.damping))
    ]
    return f"{', '.join(said)} (one standard deviation; 95 % limits)"


def _root_mean_square(runs: Sequence[RunRepeat], name: str, *, of_scatter: bool = False) -> str:
    """Root mean square over the runs of their deviations in a quantity, or of its scatter, in per cent."""
    place = 2 if of_scatter else 0
    return percent_of((sum(one.deviation(name)[place] ** 2 for one in runs) / len(runs)) ** 0.5)


def _band(width: Share) -> str:
    """The chance scatter of a quantity, such as `` (± 0.039)``."""
    return f" (± {percent_of(width).removesuffix(' %')})"


def _signed(value: float, std: float) -> str:
    """A deviation in per cent with its sign."""
    text = concise(100.0 * abs(value), 100.0 * std)
    return f"{'−' if value < 0.0 else '+'}{text}"


def _told_apart(spreads: Sequence[Spread]) -> list[str]:
    """The statement that the runs hardly distinguish two quantities; empty where they do."""
    both = [one for one in spreads if SCATTERS[one.effect] in ("wind_speed", "spring_stiffness")]
    if len(both) < 2 or not any(one.shown for one in both):
        return []
    poorly = [one for one in both if _ratio(one.interval) > WIDTH_KNOWN_WITHIN and one.shown]
    hidden = [one for one in both if not one.shown and one.stated is None]
    if hidden:
        other = NUMBERS[SCATTERS[hidden[0].effect]]
        bound = percent_of(hidden[0].interval[1])
        return [
            f"{other[0].upper()}{other[1:]} may also differ, by up to {bound}; these runs do not show it."
        ]
    if poorly:
        return [
            "These runs hardly distinguish the wind speed from the spring: add wind-off runs, or log the wind "
            "speed."
        ]
    return []


_ROW = 0.24  # inches for a run
_AROUND = 1.25  # inches: key, axis and its label
_BAND_HEIGHT = 0.72  # share of a row
_MARGIN = 0.08  # share of the axis
_BESIDE = 7.0  # points between a mark and its text
_DRAWN_NUMBERS = {"frequency": "frequency", "damping": "damping ratio"}


@styled
def repeatability_figure(found: RunRepeatability) -> Figure:
    """Every run's frequency and damping minus the model's, in per cent.

    The runs are in their order. The band of a run is the 95 % interval of the scatter between runs under its wind
    and spring. Error bars are the noise's 95 % intervals.
    """
    runs = found.runs
    fig = figure(NARROW, _AROUND + _ROW * max(len(runs), 4))
    panels = fig.subplots(1, 2, sharey=True)
    for axes, name in zip(panels, _DRAWN_NUMBERS, strict=True):
        _draw_runs(axes, runs, name, str(found.outlier))
    panels[0].set_yticks(np.arange(len(runs)), [figure_text(str(one.id)) for one in runs])
    panels[0].set_ylim(len(runs) - 0.4, -0.6)
    panels[1].tick_params(axis="y", length=0)
    handles, labels = panels[0].get_legend_handles_labels()
    if not found.scatters:
        labels = ["noise (95 %)" if label.startswith("scatter") else label for label in labels]
    fig.legend(
        handles,
        labels,
        loc="outside upper left",
        ncols=min(len(labels), 3),
        handlelength=1.4,
        columnspacing=1.2,
    )
    return fig


def _draw_runs(axes: Axes, runs: Sequence[RunRepeat], name: str, outlier: str) -> None:
    """One quantity of every run against the model's, with its band and error bar."""
    rows = np.arange(len(runs))
    value, std, band = (
        100.0 * column for column in np.array([one.deviation(name) for one in runs], np.float64).T
    )
    reach = INTERVAL * np.hypot(band, std if not band.any() else 0.0)
    axes.barh(
        rows, 2.0 * reach, left=-reach, height=_BAND_HEIGHT, color=NOISE, linewidth=0, label="scatter (95 %)"
    )
    axes.axvline(0.0, color=INK, linewidth=0.8)
    windy = np.array([bool(one.windy) for one in runs])
    far = np.array([one.id == outlier for one in runs])
    kinds = ((windy & ~far, "wind on", AFTER, AFTER), (~windy & ~far, "wind off", AFTER, PAPER))
    for chosen, label, colour, face in (*kinds, (far, "deviates far beyond", BEFORE, BEFORE)):
        if chosen.any():
            axes.errorbar(
                value[chosen], rows[chosen], xerr=INTERVAL * std[chosen], fmt="D" if label[0] == "d" else "o",
                color=colour, mfc=face, ms=5, capsize=2, elinewidth=1.0, label=label,
            )  # fmt: skip
    ends = np.concatenate([value - INTERVAL * std, value + INTERVAL * std, reach, -reach])
    low, high = float(ends.min()), float(ends.max())
    margin = _MARGIN * (high - low) or 1.0
    axes.set_xlim(low - margin, high + margin)
    axes.set_xlabel(f"{_DRAWN_NUMBERS[name]} minus\nthe model's [%]")
    axes.locator_params(axis="x", nbins=4)
    grid(axes, "x")
    for row in np.flatnonzero(far & (np.abs(value) > reach)).tolist():
        # on the side with more room
        side = -1.0 if value[row] > float(np.mean(axes.get_xlim())) else 1.0
        axes.annotate(
            percent_of(runs[row].deviation(name)[0], sign=True), (value[row], row), (side * _BESIDE, 0),
            textcoords="offset points", ha="left" if side > 0.0 else "right", va="center", color=INK,
        )  # fmt: skip
