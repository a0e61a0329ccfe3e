"""The size of a gap, the readings on which it is measured, and the share that each cause explains."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.answer.held_out import Waterfall
from diagnosis.findings.finding import Judged, Picture
from diagnosis.findings.misfit import Misfit
from diagnosis.findings.terms import answer_name, without_scatter
from diagnosis.where.maps import Maps
from identification.show.blocks import TextTable
from identification.show.drawing import ACCENT, AFTER, BEFORE, INK, LINE, NARROW, NOISE, PAPER, QUIET, SIGMAS
from identification.show.numbers import p_text, plain, reading_shown, significant, unit_mark
from identification.show.style import figure, figure_text, grid, styled
from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.campaign import Campaign

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class RunGap:
    """A run's excess before and after the causes are added.

    Args:
        before: ratio of mean squared residual to noise variance, minus one, of the nominal model, predicted
            from the other runs where the run could be held out.
        after: the same ratio minus one with the causes added.
        held_out: whether the run could be held out; else both ratios come from fits of all runs.
    """

    id: str
    before: float
    after: float
    held_out: bool = True


@dataclass(frozen=True)
class GapSummary:
    """The gap of the campaign.

    Args:
        excess_before: excess of the nominal model, in units of the noise variance, on held-out readings; in a
            campaign without a gap, in the fitted runs.
        excess_after: with the causes added, on the same readings, in units of the noise variance.
        closed: share of the gap that is closed, 0 to 1.
        closed_on: the readings on which the excesses are measured (`diagnosis.findings.closure`).
        false_alarm_rate: false-alarm rate of the test of the gap, a fraction of the campaigns without a gap.
        p_value: p-value of the strongest test, corrected for the number of tests.
        tests: p-value by name of test.
        closed_ahead: share of the gap in the later half of driven runs that the causes explain when fitted to
            the earlier half; None where runs are held out whole, or are not driven.
    """

    detected: bool
    excess_before: float
    excess_after: float
    closed: float
    closed_on: str
    runs: tuple[RunGap, ...]
    false_alarm_rate: float
    p_value: float
    tests: Mapping[str, float]
    misfit: Misfit
    closed_ahead: float | None = None

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; ``misfit`` has the fields of `Misfit` and the root mean squares before and after."""
        found = {name: as_json(getattr(self, name)) for name in self.__dataclass_fields__}
        before, after = self.misfit.rms(self.excess_before), self.misfit.rms(self.excess_after)
        found["misfit"] |= {"before": before, "after": after}
        return found


FITTED = "in the fitted runs (none could be held out)"
"""The readings on which the gap before and after the causes is measured, as in the document."""


@dataclass(frozen=True)
class Confirmation:
    """Agreement of the fits' integrator and the MuJoCo model on the reported runs.

    Args:
        agrees: whether every run's difference is within the tolerance, and MuJoCo could predict them all.
        largest_difference: largest difference of any block mean of any run, rad.
        run: id of the run that is closest to its tolerance, or farthest beyond it.
        rms_difference: root mean square of that run's differences, rad.
        tolerance: maximum root mean square difference, a tenth of a block mean's noise, rad.
        failure: why MuJoCo could not predict the runs; empty where it could.
    """

    agrees: bool
    largest_difference: float
    run: str
    rms_difference: float
    tolerance: float
    failure: str = ""

    def scaled(self, factor: float) -> Confirmation:
        """This agreement with all readings times a factor, from a similar rig's to the measured one's."""
        return replace(
            self,
            largest_difference=self.largest_difference * factor,
            rms_difference=self.rms_difference * factor,
            tolerance=self.tolerance * factor,
        )

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with units in their names."""
        written = {WITH_UNIT.get(name, name): value for name, value in vars(self).items()}
        return {"model": "mujoco", **written}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, without units in their names."""
        own = {written: name for name, written in WITH_UNIT.items()}
        return {own.get(key, key): value for key, value in data.items()}


WITH_UNIT = {name: f"{name}_rad" for name in ("largest_difference", "rms_difference", "tolerance")}


@dataclass(frozen=True)
class NoiseSummary:
    """The reference noise of the gap.

    Args:
        std: standard deviation of one sample, quantisation included, rad.
        stated_std: standard deviation of one sample as stated by the campaign, rad; None where it is not
            stated.
        source: origin of ``std``: ``stated``, ``estimated`` or ``floor``, the accuracy of the fits.
        reason: reason for this noise, in words; empty until they are written.
    """

    std: float
    stated_std: float | None
    source: str
    reason: str = ""


_IN_BRACKETS = "root mean square (in brackets: mean square over the noise variance)"


def runs_table(
    gap: GapSummary, shows: Sequence[str], judged: Judged, campaign: Campaign | None = None
) -> TextTable:
    """The gap before and after, all runs first; a table without rows where no gap was found.

    Args:
        shows: ids of the runs that show the gap.
        campaign: adds the conditions of the runs, also where no gap was found.
    """
    named = judged.names_effects
    gaps = {run.id: run for run in gap.runs}
    runs = {run.id: run for run in campaign.runs} if campaign else {}
    windy = campaign is not None and bool(campaign.in_wind)
    conditions = (
        ("spring [N m/rad]", *["wind [m/s]"] * windy, "duration [s]", "sample rate [Hz]") if runs else ()
    )

    def before(value: float) -> str:
        return gap.misfit.words(value, times=True)

    def after(value: float) -> str:
        return before(value) if named else "–"

    whole = ("all", *[""] * len(conditions), before(gap.excess_before), after(gap.excess_after), "")
    rows = [whole] if gap.detected else []
    for name in runs or (gaps if gap.detected else ()):
        found, stated = gaps.get(name), []
        if run := runs.get(name):
            spring = "–" if run.spring_stiffness is None else f"{run.spring_stiffness:g}"
            wind = [f"{run.wind_speed:g}" if run.wind_on else "off"] if windy else []
            stated = [spring, *wind, f"{run.record.duration:.3g}", f"{run.record.sample_rate:.4g}"]
        fitted = " (fitted)" if found and not found.held_out else ""
        sizes = (before(found.before), after(found.after)) if found else ("–", "–")
        rows.append((name + fitted, *stated, *sizes, "yes" if name in shows else ""))
    shown = "shows the gap"
    heads = ("run", *conditions, "before", "after", shown)
    detail = (*conditions, shown)
    return TextTable(f"Gap, {_IN_BRACKETS}", heads, tuple(rows), right=heads[1:-1], detail=detail)


def waterfall_table(waterfall: Waterfall, misfit: Misfit) -> TextTable:
    """The residual gap as each cause is added, and without each; a table without rows where no cause is named."""
    steps, without = waterfall.steps, waterfall.without
    rows = []
    for step in steps if len(steps) > 1 else ():
        alone = without.get(step.effect or "")
        cell = "" if alone is None else misfit.words(alone, times=True)
        name = answer_name(step.effect) if step.effect else "without the causes"
        rows.append((name, misfit.words(step.excess, times=True), cell))
    title = f"Gap {waterfall.held_out} as the causes are added, {_IN_BRACKETS}"
    heads = ("cause added", "residual gap", "without this cause")
    return TextTable(title, heads, tuple(rows), heads[1:], names=heads[:1])


def shares_of_gap(waterfall: Waterfall) -> dict[str, tuple[float, str]]:
    """By cause, the share of the gap that its step explains, and the causes added in the same step.

    Chance differences between the runs come last, because they remain where a cause is removed from the rig.
    The fit of the waterfall adds them first, where they absorb a part of the causes.
    """
    found: dict[str, tuple[float, str]] = {}
    taken = list(waterfall.steps)
    if not taken or taken[0].excess <= 0.0:
        return found
    by_chance = next(
        (step for step in taken if step.effect and not without_scatter(step.effect.split(" + "))), None
    )
    least = 0.0 if by_chance is None else waterfall.without.get(str(by_chance.effect), 0.0)
    if by_chance is not None and least > 0.0:
        whole, last = taken[0].excess, taken[-1].excess
        # without the chance differences the causes leave more, in the same proportion
        absorbed = by_chance.excess - last
        steps = [step for step in taken[1:] if step is not by_chance]
        left = [(step.excess - last) / absorbed if absorbed > 0.0 else 0.0 for step in steps]
        taken = [
            taken[0],
            *(
                replace(step, excess=least + max(whole - least, 0.0) * min(max(share, 0.0), 1.0))
                for step, share in zip(steps, left, strict=True)
            ),
            replace(by_chance, excess=last),
        ]
    for before, step in pairwise(taken):
        names = str(step.effect).split(" + ")
        part = max(before.excess, 0.0) - max(step.excess, 0.0)
        for name in names:
            others = [other for other in names if other != name]
            found[name] = (part / taken[0].excess, f" together with {plain(*others)}" if others else "")
    return found


TESTS = {
    "below": "residual power below half the frequency f₀ of the oscillation",
    "f0": "residual power at f₀, from 0.5 to 1.5 f₀: the oscillation itself",
    "2f0": "residual power at its second harmonic, from 1.5 to 2.5 f₀",
    "3f0": "residual power at its third harmonic, from 2.5 to 3.5 f₀",
    "above": "residual power above 3.5 f₀",
    "offset": "whether the runs have a common zero",
    "noise against amplitude": "whether the noise grows or shrinks with the amplitude of the motion",
    "noise against rate": "whether the noise grows or shrinks with the rate of the motion",
    "noise in bursts": "whether the noise comes in bursts",
    "noise level": "whether the noise is above the level that the campaign states",
}
"""Names of the tests, and the properties that they test."""


def tests_table(gap: GapSummary) -> TextTable:
    """The tests of the gap: name, tested property, and p-value."""
    tests = gap.tests.items()
    rows = tuple((name, TESTS.get(name, "–"), p_text(value).removeprefix("= ")) for name, value in tests)
    title = "Tests of the gap; p is the probability that noise alone gives as much"
    return TextTable(title, ("test", "tested property", "p"), rows, right=("p",))


def noise_line(noise: NoiseSummary, unit: str) -> str:
    """The noise to which the gap is compared, and its origin.

    Args:
        unit: unit of the readings.
    """
    size = f"{reading_shown(noise.std, 3, unit)} (noise_std = {noise.std:.3g} {unit_mark(unit)})"
    return f"Noise: {size}, {noise.source} ({noise.reason})."


def model_line(checked: Confirmation, unit: str) -> str:
    """The model that computes the gaps; empty where a caveat says more about it.

    Args:
        unit: unit of the readings.
    """
    if not checked.agrees:
        return ""
    most, rms, allowed = (
        reading_shown(size, 2, unit)
        for size in (checked.largest_difference, checked.rms_difference, checked.tolerance)
    )
    return (
        f"The gaps are computed by the MuJoCo model. The integrator of the fits differs from it by {most} at most "
        f"({rms} root mean square in run {checked.run}; {allowed} is allowed)."
    )


WITHIN_THE_NOISE = "within the noise"
"""A residual gap that is not significant, in the words of the verdict."""


def waterfall_pictures(waterfall: Waterfall, maps: Maps | None, judged: Judged) -> tuple[Picture, ...]:
    """Figure of the residual gap as the causes are added; none without causes."""
    circles = " Open circles: all causes but this one." if len(waterfall.without) > 1 else ""
    drawn = Picture(
        "waterfall",
        f"What the model misses, as the causes are added one after another.{circles}",
        "The residual gap as the causes are added one after another.",
        partial(waterfall_figure, waterfall, maps, judged),
    )
    return (drawn,) if len(waterfall.steps) > 1 else ()


def closure_pictures(gap: GapSummary, maps: Maps | None) -> tuple[Picture, ...]:
    """Figure of the gap run by run."""
    drawn = Picture(
        "how-far",
        "Misfit of every run before and after. Filled circles: the run was held out of the fit, and only its "
        "release was refitted. Open circles: the run was part of the fit.",
        "Misfit of every run with the nominal model and with the causes added.",
        partial(closure_figure, gap, maps),
    )
    return (drawn,)


@styled
def waterfall_figure(waterfall: Waterfall, maps: Maps | None, judged: Judged) -> Figure:
    """The residual gap as the causes are added one after another.

    A dot for the nominal gap, a bar for each cause from the residual before it to the residual after it, and a
    dot for the remainder, on a linear scale of the root mean square misfit.
    """
    steps = waterfall.steps
    unit, size = judged.misfit.scale()
    misfits = np.array([size(step.excess) for step in steps], np.float64)
    without = {name: size(value) for name, value in waterfall.without.items()}
    alone = [without.get(step.effect or "", np.nan) if len(without) > 1 else np.nan for step in steps]
    fig = figure(NARROW, 1.2 + 0.36 * (misfits.size + 1))
    axes = fig.add_subplot()
    rows, upper = np.arange(misfits.size + 1), np.maximum(misfits[:-1], misfits[1:])
    lower = np.minimum(misfits[:-1], misfits[1:])
    colours = [AFTER if after <= before else BEFORE for before, after in pairwise(misfits)]
    axes.vlines(misfits, rows[:-1], rows[1:], color=QUIET, linewidth=0.8, zorder=0.9)
    axes.barh(rows[1:-1], upper - lower, left=lower, color=colours, height=0.55)
    for row, value, colour in ((0, misfits[0], BEFORE), (rows[-1], misfits[-1], ACCENT)):
        axes.plot(value, row, "o", color=colour, ms=8, clip_on=False)
    if np.isfinite(alone).any():
        label = "without this cause alone"
        axes.plot(alone, rows[:-1], "o", color=INK, mfc=PAPER, ms=_MARK, label=label)
    names = [textwrap.fill(f"+ {plain(answer_name(step.effect or ''))}", _STEP_LABEL) for step in steps[1:]]
    axes.set_yticks(rows, ["without the causes", *names, "the rest"])
    axes.set(ylim=(misfits.size + 0.5, -0.5), xlabel=f"root mean square misfit [{unit}]")
    axes.locator_params(axis="x", nbins=6)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.axvline(0.0, color=QUIET, linewidth=0.8, zorder=0.8)
    grid(axes, "x")
    shown = [
        f"{significant(value, 3) if value else '0'}{unit if unit == '°' else ''}"
        for value in misfits.tolist()
    ]
    if judged.rest_is_significant:
        shown[-1] += ", material" if judged.rest_is_material else ", immaterial"
    else:
        shown[-1] = WITHIN_THE_NOISE
    # The row of the remainder gives the residual after the last cause.
    words = [shown[0], *(f"leaves {text}" for text in shown[1:-1]), "", shown[-1]]
    _place_texts(axes, words, [misfits[0], *upper, misfits[-1]], [*alone, np.nan])
    noise = size(SIGMAS * (maps.excess_std if maps else _LEAST_EXCESS))
    seen = noise > _VISIBLE * axes.get_xlim()[1]
    axes.axvspan(0.0, noise, color=NOISE, linewidth=0, zorder=0.3, label="noise (3σ)" if seen else None)
    if seen or np.isfinite(alone).any():  # a key aligned with the axis above it
        axes.legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderpad=0.0, borderaxespad=0.3,
            handlelength=1.2, columnspacing=1.4,
        )  # fmt: skip
    return fig


_STEP_LABEL = 20  # characters in a line of a label
_LEAST_EXCESS, _LEAST_NOISE = (
    1e-3,
    0.03,
)  # share of an excess and of three standard deviations, for a document without maps
_VISIBLE = 0.01  # share of the axis: a narrower band is invisible, and has no key
_BESIDE = 7.0  # points between a mark and its text
_MARK = 5.0  # points: the mark of the residual gap without one cause
_BEFORE_ZERO = 0.03  # share of the axis that keeps a mark at zero clear of the labels


def _place_texts(axes: Axes, words: Sequence[str], ends: Sequence[float], marks: Sequence[float]) -> None:
    """Write texts to the right of their bars or dots, clear of the marks, and extend the axis to hold all texts.

    Args:
        words: the text of each row.
        ends: right end of each row's bar or dot, in data units.
        marks: another mark in the row, in data units; NaN: none.
    """
    axes.figure.draw_without_rendering()  # type: ignore[union-attr]  # sizes are known only after the layout
    points = 72.0 / axes.figure.dpi
    whole = points * axes.get_window_extent().width
    texts = [
        axes.annotate(text, (end, row), (_BESIDE, 0), textcoords="offset points", va="center")
        for row, (text, end) in enumerate(zip(words, ends, strict=True))
    ]
    widths = [_BESIDE + points * text.get_window_extent().width for text in texts]
    beside = np.fmax(ends, marks)  # position of a text that would overlap the mark
    free = (1.0 + _BEFORE_ZERO) * (1.0 - np.array(widths) / whole) - _BEFORE_ZERO
    reach = float(max(np.max(beside / free), 1.05 * np.max(beside))) or 1.0
    axes.set_xlim(-_BEFORE_ZERO * reach, reach)
    point = (1.0 + _BEFORE_ZERO) * reach / whole
    for row, (text, end, mark) in enumerate(zip(texts, ends, marks, strict=True)):
        if end + (_BESIDE - _MARK) * point < mark < end + (widths[row] + _MARK) * point:
            text.xy = (mark, row)


@styled
def closure_figure(gap: GapSummary, maps: Maps | None) -> Figure:
    """Misfit of every run before and after the causes are added; filled marks for runs held out of the fit."""
    runs = gap.runs
    fig = figure(NARROW, 1.2 + 0.22 * max(len(runs), 4))
    axes = fig.add_subplot()
    rows = np.arange(len(runs))
    unit, size = gap.misfit.scale()
    before = np.array([size(run.before) for run in runs])
    after = np.array([size(run.after) for run in runs])
    stds = [run.std for run in maps.runs] if maps else []
    noise = size(SIGMAS * max(stds) if stds else _LEAST_NOISE)
    axes.axvspan(0.0, noise, color=NOISE, lw=0, label="noise (3σ)")
    most = 1.05 * float(max(before.max(), after.max())) or 1.0
    axes.set(xlim=(0.0, most), xlabel=f"root mean square misfit [{unit}]")
    axes.hlines(rows, after, before, color=LINE, linewidth=2.5)
    axes.plot(before, rows, "s", color=BEFORE, ms=5, clip_on=False, label="nominal model")
    if not np.array_equal(before, after):
        held_out = np.array([run.held_out for run in runs])
        for chosen, face, words in ((held_out, AFTER, "held out"), (~held_out, PAPER, "fitted")):
            if chosen.any():
                points, label = (after[chosen], rows[chosen]), f"with the causes, run {words}"
                axes.plot(*points, "o", color=AFTER, mfc=face, ms=5, clip_on=False, label=label)
    axes.set_yticks(rows, [figure_text(run.id) for run in runs])
    axes.invert_yaxis()
    fig.legend(loc="outside upper left", ncols=2)
    grid(axes)
    return fig
