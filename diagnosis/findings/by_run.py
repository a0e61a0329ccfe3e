"""Whether the runs agree on the size of a cause: its size in every run beside the common one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from diagnosis.answer.sizes_by_run import SizeByRun, units_of
from diagnosis.findings.finding import Answered, Finding, Judged, Picture
from diagnosis.findings.units import own_parameters
from identification.show.blocks import Detail, Paragraph, Section, TextTable
from identification.show.drawing import AFTER, NARROW, NOISE, SOFT
from identification.show.numbers import (
    for_people,
    p_text,
    percent_of,
    plain,
    sentence_case,
    unit_mark,
)
from identification.show.numbers import with_std as sized
from identification.show.quantity import INTERVAL, Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.errors import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class CausesByRun(Finding):
    """The size of every fitted cause in every run.

    Args:
        causes: the causes with a size that at least two runs show.
    """

    after: ClassVar[str] = "found"

    causes: tuple[SizeByRun, ...]

    @classmethod
    def find(cls, answered: Answered) -> CausesByRun | None:
        """The sizes by linear theory from the fit of the answer; None where no cause is fitted to two runs."""
        study, fit = answered.study, answered.study.chosen
        units = units_of(fit)
        free = {name: Quantity(fit.value(name), None, units[name]) for name in units}

        def own(cause: SizeByRun, given: Quantity) -> Quantity:
            name = f"{cause.effect}.{cause.parameter}"  # the unit of the information depends on the exponents
            return own_parameters({**free, name: given}, answered.campaign, study.similarity, study.model)[
                name
            ]

        causes = tuple(
            replace(
                cause,
                common=own(cause, cause.common),
                runs={run: own(cause, of) for run, of in cause.runs.items()},
            )
            for cause in answered.sizes
        )
        return cls(causes) if causes else None

    def section(self, judged: Judged) -> Section:
        """The causes on which the runs differ, the figure, and in detail the others with the table."""
        heads = tuple(f"{plain(cause.effect)} [{unit_mark(cause.common.unit)}]" for cause in self.causes)
        ids = dict.fromkeys(name for cause in self.causes for name in cause.runs)
        rows = tuple((name, *(_shown(cause.runs.get(name)) for cause in self.causes)) for name in ids)
        table = TextTable("Size of each cause in every run, ± one standard deviation", ("run", *heads), rows,
                          right=heads)  # fmt: skip
        agree, differ = (
            tuple(Paragraph(_words(cause), "Run by run") for cause in self.causes if cause.agrees is agrees)
            for agrees in (True, False)
        )
        drawn = (picture.block for picture in self.pictures(judged))
        detail = Detail((*agree, table, Paragraph(self._how, kind="small")))
        return Section("by-run", "Whether the runs agree", (*differ, *drawn, detail))

    @property
    def _how(self) -> str:
        """How the sizes are computed, with the causes to which each method applies."""
        ways = {
            True: "fitted to each run with a stiffness and a damping of its own",
            False: "the size that suits one run, with every other number as in all runs",
        }
        clauses = []
        for alone, way in ways.items():
            names = [cause.effect for cause in self.causes if cause.alone is alone]
            if names:
                clauses.append(f"{plain(*names)}: {way}")
        return f"{sentence_case('; '.join(clauses))}."

    def pictures(self, judged: Judged) -> tuple[Picture, ...]:
        """The size of each cause by run, a panel each."""
        del judged
        caption = "Size of each cause in every run, with 95 % intervals. The band is the size in all runs."
        description = "A forest plot: by run, the size of a cause with its interval, beside the common size."
        return (Picture("by-run", caption, description, partial(forest_figure, self.causes)),)


def _shown(given: Quantity | None) -> str:
    return "–" if given is None else sized(given.value, given.std)


def _words(cause: SizeByRun) -> str:
    """Whether the runs agree on it, in sentences."""
    size, runs = cause.common, f"the {counted(len(cause.runs), 'run')} that show it"
    text = f"{sentence_case(plain(cause.effect))}: "
    if cause.agrees:
        text += f"{runs} agree on {for_people(size.value, size.std, size.unit)} (p {p_text(cause.p_value)})."
    else:  # the noise alone is not the error of a size on which the runs differ
        text += (
            f"{for_people(size.value, None, size.unit)} fits all runs best, but {runs} differ by "
            f"{percent_of(cause.spread)} beyond their errors (p {p_text(cause.p_value)}), {cause.farthest} the "
            "most: its law has another form, or a run is odd."
        )
    if cause.silent:
        text += f" {sentence_case(counted(len(cause.silent), 'run'))} cannot show it."
    return text


@styled
def forest_figure(causes: Sequence[SizeByRun]) -> Figure:
    """The size of each cause in every run with its interval, and the common one as a band."""
    tall = [0.8 + 0.2 * len(cause.runs) for cause in causes]
    fig = figure(NARROW, sum(tall))
    for axes, cause in zip(
        fig.subplots(len(causes), 1, squeeze=False, height_ratios=tall)[:, 0], causes, strict=True
    ):
        low, high = cause.common.ends
        axes.axvspan(low, high, color=NOISE, zorder=0)
        axes.axvline(cause.common.value, color=SOFT, lw=1.0)
        rows = np.arange(len(cause.runs))
        values = [given.value for given in cause.runs.values()]
        reach = [INTERVAL * given.known_std for given in cause.runs.values()]
        axes.errorbar(values, rows, xerr=reach, fmt="o", ms=4, color=AFTER, capsize=2)
        axes.set_yticks(rows, list(cause.runs))
        axes.set(ylim=(len(rows) - 0.4, -0.6))
        symbol = next(
            info.symbol for info in effect_class(cause.effect).parameters() if info.name == cause.parameter
        )
        axes.set_xlabel(f"{plain(cause.effect)} {symbol} [{unit_mark(cause.common.unit)}]")
        axes.locator_params(axis="x", nbins=5)
        grid(axes)
    return fig
