"""The score of a blind check: tables for a terminal, a page in Markdown, and two figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from identification.printing import SYMBOLS
from identification.show.blocks import Block, Figure, Heading, Paragraph, TextTable, as_markdown
from identification.show.drawing import AFTER, BEFORE, INK, PAPER, QUIET
from identification.show.numbers import plain
from identification.show.style import WIDTH, figure, grid, styled
from tunnel_lab.experiments.view import ExperimentView
from tunnel_sim.vocabulary.errors import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing
    from numpy.typing import NDArray

    from identification.statistics import Proportion
    from tunnel_lab.experiments.blind import BlindScore
    from tunnel_lab.experiments.blind.sets import MadeWith


CALIBRATION = "Calibration"
KINDS = {
    "single": "one effect",
    "single, below 1": "· below 1 × noise variance",
    "single, 1 to 10": "· 1 to 10 × noise variance",
    "single, above 10": "· above 10 × noise variance",
    "pair": "two effects",
    "three": "three effects",
    "four": "four effects",
    "none": "none acts",
    "outside": "outside the vocabulary",
    "withheld": "withheld from the vocabulary",
    "all": "all",
}
_RIGHT_ANSWER = {"withheld": "unknown"}  # the right answer to any other truth is its name
_CELL, _NAMES, _RIGHT = 0.19, 1.6, 1.0  # inches: a cell, the row names, the shares
_DARK = 0.55  # share of the colour above which white text is legible


@dataclass(frozen=True)
class ScoreSection(TextTable):
    """A table with a line below it.

    Args:
        note: line below the table; empty: none.
    """

    note: str = ""


def sections(score: BlindScore) -> list[ScoreSection]:
    """The sections of a score, in order, without empty ones."""
    return [one for one in (*_answer_sections(score), *_other_sections(score)) if one.rows]


def _section(
    title: str, headings: tuple[str, ...], rows: Iterable[tuple[str, ...]], note: str = ""
) -> ScoreSection:
    return ScoreSection(title, headings, tuple(rows), headings[1:-1], note=note)


def _answer_sections(score: BlindScore) -> list[ScoreSection]:
    """Correctness of the answers, and calibration of their probabilities."""
    alarms = {
        "a cause named where none acts": score.false_alarms(),
        "no cause named where one acts": score.missed(),
        "truth named as rival in a wrong answer": score.rivals(),
    }
    error, bins = score.calibration()
    found, inclusion, smooth = score.causes_found(), score.inclusion(), []
    if inclusion is not None:
        ends = "{:.4f}–{:.4f}".format(*inclusion.interval)
        smooth = [(f"{inclusion.error:.4f}", ends, str(inclusion.statements), str(inclusion.campaigns))]
    return [
        _section(
            "Causes exactly right",
            ("group", "right", "of", "share", "95 %"),
            ((KINDS[name], *_share(share)) for name, share in score.exact().items()),
        ),
        _section(
            "Causes found and false",
            ("group", "sets exact", "true causes found", "named causes false", ""),
            ((group, *map(_brief, (of.exact, of.found, of.false)), "") for group, of in found.items()),
            "Small causes that act beside others need not be named, and naming them is not an error. Fast and slow "
            "rigs have periods beyond a third and three times the standard rig's. Intervals take the causes of a "
            "campaign as independent.",
        ),
        *_scatter_sections(score),
        _section(
            "Alarms",
            ("", "number", "of", "share", "95 %"),
            ((name, *_share(share)) for name, share in alarms.items() if share.total),
        ),
        _section(
            CALIBRATION,
            ("probability stated", "mean", "right", "of", "share", "95 %"),
            ((f"{b.low:.1f} to {b.high:.1f}", f"{b.mean:.3f}", *_share(b.right)) for b in bins),
            f"Expected calibration error of the answer given, {len(bins)} bins in use: {error:.3f}",
        ),
        _section(
            "Decisions",
            ("group", "wrong set stated", "true causes in the smallest set of 0.9", "its mean size"),
            (
                (group, _brief(of.stated_wrongly), _brief(of.covered), f"{of.credible_size:.2f}")
                for group, of in found.items()
            ),
            "An answer below one half is undecided and states no set. The smallest set of answers that together "
            "have a probability of 0.9 should contain the true causes in about nine of ten campaigns.",
        ),
        _section(
            "Calibration of inclusion",
            ("smooth calibration error", "95 %", "statements", "campaigns"),
            smooth,
            "Calibration of the probability that each effect is among the causes. The kernel is as wide as the "
            "resulting error (Błasiok and Nakkiran 2023); the interval is by resampling campaigns.",
        ),
    ]


_OF_SCATTER = {
    "named_alone": "no cause, scatter not stated: scatter named and nothing else",
    "no_gap": "no cause, scatter as stated: nothing named",
    "false_alarms": "runs repeat: scatter named falsely",
    "exact": "runs scatter: causes exactly right",
    "exact_repeating": "runs repeat: causes exactly right",
}


def _scatter_sections(score: BlindScore) -> list[ScoreSection]:
    """Findings on the scatter between runs; empty where there are none."""
    scatter = score.scatter()
    if scatter is None:
        return []
    shares = ((text, getattr(scatter, name)) for name, text in _OF_SCATTER.items())
    return [
        _section(
            "Scatter between runs",
            ("campaigns where", "number", "of", "share", "95 %"),
            ((text, *_share(share)) for text, share in shares if share.total),
            "Scatter is not counted among the causes. Where there is no cause, and for the widths below, campaigns "
            "count whose deviations are normal.",
        ),
        _section(
            "Widths of the scatter",
            (
                "number",
                "named where not stated",
                "of those named, falsely",
                "within a factor of 1.5",
                "in the 90 % interval",
            ),
            (
                (number.replace("_", " "), *map(_brief, (of.named, of.false, of.within, of.covered)))
                for number, of in scatter.by_number.items()
                if any(share.total for share in (of.named, of.false, of.within, of.covered))
            ),
        ),
    ]


def _other_sections(score: BlindScore) -> list[ScoreSection]:
    """The explained parts of the gaps, the coefficients, the answers by truth, and the time taken."""
    closed, median, low = score.closure()
    pairs, (middle, high, longest) = score.pairs(), score.seconds()
    right, answers = score.right_by_truth(), []
    for truth, given in sorted(score.confusion().items(), key=lambda item: _order(item[0])):
        wrong = sorted(given.items(), key=lambda item: -item[1])
        others = [f"{name} {number}" for name, number in wrong if name != _RIGHT_ANSWER.get(truth, truth)]
        answers.append((truth, str(right[truth].total), str(right[truth].count), ", ".join(others)))
    errors = {(e.group, e.name, e.when): e for e in score.coefficients()}
    coefficients: list[tuple[str, ...]] = []
    for (group, name, when), later in errors.items():
        earlier = errors.get((group, name, "before"))
        if when == "before" or earlier is None:
            continue
        least, most = later.covered.interval
        coefficients.append(
            (
                f"{group}: {SYMBOLS[name]}",
                f"{100.0 * earlier.median_relative_error:.2g}",
                f"{100.0 * later.median_relative_error:.2g}",
                f"{earlier.rms_z:.3g}",
                f"{later.rms_z:.3g}",
                f"{later.covered.count}/{later.covered.total}",
                f"{100.0 * least:.1f}–{100.0 * most:.1f} %",
            )
        )
    return [
        _section(
            "Share of the gap explained on held-out runs, where the causes are right",
            ("", "number", "of", "share", "95 %"),
            [("at least 0.95 of the gap explained", *_share(closed))] if closed.total else (),
            f"Median {median:.4f}, 5th percentile {low:.4f}",
        ),
        _section(
            "Coefficients before and after the causes are added",
            (
                "group",
                "error before [%]",
                "after [%]",
                "rms z before",
                "after",
                "in the 95 % interval",
                "95 %",
            ),
            coefficients,
            "Errors are medians of |estimate − truth| / |truth|. z is the error over the stated standard "
            "deviation: its root mean square is 1 where these are right. Without a named lag, the true Cnβ and Cnr "
            "are those in phase with angle and rate.",
        ),
        _section(
            "Answers to two effects",
            ("answered", "number", ""),
            ((name, str(number), "") for name, number in pairs.items() if any(pairs.values())),
        ),
        _section("Answers by truth", ("truth", "number", "right", "answered otherwise"), answers),
        _section(
            "Seconds for each campaign",
            ("median", "90th percentile", "largest"),
            [(f"{middle:.1f}", f"{high:.1f}", f"{longest:.1f}")] if longest > 0.0 else (),
        ),
    ]


def blind_view(score: BlindScore) -> ExperimentView:
    """The view of a score, each table with its note."""
    blocks: list[Block] = [Paragraph(line) for line in origin_lines(score)]
    for section in sections(score):
        blocks += [section, Paragraph(section.note)]
    return ExperimentView("Blind check", blocks)


def origin_lines(score: BlindScore) -> list[str]:
    """The scored set, and its sealing hashes."""
    lines = [counted(len(score.cases), "campaign")]
    if score.excluded:
        lines.append(f"Withheld from the vocabulary: {', '.join(score.excluded)}")
    if score.sealed:
        lines.append(f"Key     sha256 {score.key_sha256} (verified, with every campaign)")
    else:
        lines.append("Open set: the truth was beside the data, so this is not a blind test")
    lines.append(f"Answers sha256 {score.answers_sha256} (verified)")
    return lines


def markdown(score: BlindScore, folder: str, figures: Sequence[str] = ("", "")) -> str:
    """The page in Markdown, with all tables and the full confusion matrix.

    Args:
        figures: addresses of the calibration and confusion figures, relative to the page; empty: not drawn.
    """
    withheld = "".join(f" --exclude {name}" for name in score.excluded)
    drawn = f" --figure docs/{figures[0]}" if figures[0] else ""
    making = [] if score.made_with is None else [f"tunnel blind make {folder} {_options(score.made_with)}"]
    about_scatter = _ABOUT_SCATTER if score.scatter() else ""
    commands = [
        *making,
        f"tunnel blind diagnose {folder}{withheld}",
        f"tunnel blind score {folder}{withheld} --markdown docs/blind-check.md{drawn}",
    ]
    origin = [f"    {line}" for line in origin_lines(score)]
    head = [_HEAD.format(day=date.today()) + about_scatter, "```bash", *commands, "```", "", *origin]
    blocks: list[Block] = []
    for section in sections(score):
        blocks += [Heading(section.title), replace(section, title=""), Paragraph(section.note)]
        if figures[0] and section.title == CALIBRATION:
            blocks.append(Figure(figures[0], "Share that is right against the probability stated"))
    rows, columns, counts = confusion(score)
    numbers = {name: str(index) for index, name in enumerate(columns, 1)}
    cells = tuple(
        (name, numbers.get(name, ""), *(str(count or "·") for count in numbers_of))
        for name, numbers_of in zip(rows, counts.tolist(), strict=True)
    )
    blocks += [
        Heading("Confusion matrix"),
        Paragraph("True causes in rows, answers in columns; `two or more` counts any set of effects."),
        *([Figure(figures[1], "Answers in columns by true causes in rows")] if figures[1] else []),
        TextTable("", ("truth", "", *numbers.values()), cells, ("", *numbers.values())),
        Paragraph(f"Columns: {', '.join(f'{number} {name}' for name, number in numbers.items())}."),
    ]
    return "\n".join(head) + "\n\n" + as_markdown(blocks)


def _options(made: MadeWith) -> str:
    """The options of ``tunnel blind make`` that made a set."""
    kinds = ",".join(f"{kind}:{share:g}" for kind, share in made.kinds.items())
    words = f"--count {made.count} --seed {made.seed} --kinds {kinds}"
    shares = {"textbook": made.textbook, "rare": made.rare, "variety": made.variety, "small": made.small}
    shares |= {"departures": made.departures} if made.departures else {}
    words += (
        "".join(f" --{name} {share:g}" for name, share in shares.items()) + f" --scatter {made.scatter:g}"
    )
    if made.scatter:
        words += f" --scatter-level {made.scatter_level} --scatter-normal {made.scatter_normal:g}"
        words += f" --stated {made.stated:g}"
    return words


_HEAD = """# Blind check

The numbers are those of the version of {day:%d %B %Y}.
The campaigns are drawn and simulated by the reference simulator (`tunnel_reference`). It has another
integrator, another friction law, and more forms of every effect than the fitted one. The campaigns
are diagnosed without their truth, and the answers are scored against the sealed key. Half of all
effects have the textbook form; `outside` campaigns have an effect that belongs to no family. Up to four
effects act, each of them well above the noise by itself and beside the others. Some campaigns are of
rigs of another scale of time and moments, of few runs, with coloured noise, with rounded or jittered
time stamps, or with small effects beside. Intervals are Wilson's at 95 %. This page
is written by the commands below; nothing in it is typed by hand.
"""
_ABOUT_SCATTER = """In some campaigns the wind speed, the springs or the damping differ from run to run by chance.
Causes are counted without that scatter, which has a table of its own.
"""


def confusion(score: BlindScore) -> tuple[list[str], list[str], NDArray[np.int_]]:
    """True causes in rows, answers in columns, and the counts, shape (rows, columns)."""
    by_truth = score.confusion()
    names = sorted({*by_truth, *(name for row in by_truth.values() for name in row)}, key=_order)
    rows, columns = (
        [name for name in names if name in by_truth],
        [name for name in names if name != "withheld"],
    )
    return rows, columns, np.array([[by_truth[row].get(column, 0) for column in columns] for row in rows])


def _order(name: str) -> tuple[int, str]:
    """Effects by name, then pairs, none, unknown, and no answer."""
    last = ("two or more", "none", "unknown", "withheld", "no answer")
    return (last.index(name) + 1 if name in last else 0, name)


def _brief(share: Proportion) -> str:
    """Count, total, share and interval in one cell; a dash for no cases."""
    if not share.total:
        return "–"
    count, total, value, interval = _share(share)
    return f"{count}/{total}, {value} ({interval})"


def _share(share: Proportion) -> tuple[str, str, str, str]:
    low, high = share.interval
    value = f"{100.0 * share.value:.1f} %" if share.total else "–"
    return str(share.count), str(share.total), value, f"{100.0 * low:.1f}–{100.0 * high:.1f} %"


@styled
def calibration_figure(score: BlindScore) -> Drawing:
    """The share of correct statements against their stated probability.

    One panel shows the answers, in bins with Wilson's intervals of 95 %. Another shows, without bins, the
    probabilities that each effect is among the causes, if the answers state them.
    """
    error, bins = score.calibration()
    inclusion = score.inclusion()
    fig = figure(WIDTH if inclusion else 0.55 * WIDTH, 4.0)
    panels = fig.subplots(1, 2 if inclusion else 1, squeeze=False)[0]
    mean = np.array([bin_of.mean for bin_of in bins])
    share = np.array([bin_of.right.value for bin_of in bins], np.float64)
    ends = np.array([bin_of.right.interval for bin_of in bins]).reshape(-1, 2)
    spans = np.maximum([share - ends[:, 0], ends[:, 1] - share], 0.0)
    number = sum(bin_of.right.total for bin_of in bins)
    label = f"{number} answers, 95 %"
    panels[0].errorbar(mean, share, yerr=spans, fmt="o-", color=AFTER, ms=4, lw=0.8, label=label)
    for bin_of, x, y in zip(bins, mean, share, strict=True):
        beside = (5, -5 if y > x else 5)  # below high points, which have short intervals
        text = str(bin_of.right.total)
        panels[0].annotate(text, (x, y), beside, textcoords="offset points", fontsize=7, va="center")
    panels[0].set(xlabel="stated probability of the answer", ylabel="share of answers that are right")
    panels[0].set_title(f"{number} answers: expected calibration error {error:.3f}")
    if inclusion is not None:
        stated, number = inclusion.stated, inclusion.statements
        band = {"color": AFTER, "alpha": 0.2, "linewidth": 0.0, "label": "95 %"}
        panels[1].fill_between(stated, inclusion.low, inclusion.high, **band)
        panels[1].plot(stated, inclusion.observed, color=AFTER, label=f"{number} statements")
        panels[1].set(xlabel="stated probability that an effect acts", ylabel="share of effects that do")
        panels[1].set_title(f"{number} effects: smooth calibration error {inclusion.error:.3f}")
    for axes in panels:
        axes.plot(
            [0.0, 1.0], [0.0, 1.0], color=QUIET, linewidth=1.0, linestyle="--", label="calibrated", zorder=1
        )
        axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        grid(axes)
    labels = dict(
        pair[::-1] for axes in panels for pair in zip(*axes.get_legend_handles_labels(), strict=True)
    )
    fig.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=4)
    return fig


@styled
def confusion_figure(score: BlindScore) -> Drawing:
    """The answers by true causes: truths in rows and answers in columns, numbered alike.

    The colour is the share of the row and the number a count. Correct answers are on the diagonal, in blue.
    """
    from matplotlib.patches import Rectangle

    truths, columns, counts = confusion(score)
    right = score.right_by_truth()
    rows = [*columns, *(name for name in truths if name not in columns)]  # rows name the columns
    fig = figure(_NAMES + _CELL * len(columns) + _RIGHT, 0.9 + _CELL * len(rows))
    axes = fig.add_subplot()
    for name, own_counts in zip(truths, counts.tolist(), strict=True):
        row, total = rows.index(name), sum(own_counts)
        for column, count in enumerate(own_counts):
            if not count:
                continue
            is_right = columns[column] == _RIGHT_ANSWER.get(name, name)
            share = count / total
            corner = (column - 0.5, row - 0.5)
            axes.add_patch(
                Rectangle(corner, 1.0, 1.0, color=AFTER if is_right else BEFORE, alpha=share, linewidth=0.0)
            )
            axes.text(
                column, row, str(count), ha="center", va="center", fontsize=6.5,
                color=PAPER if share > _DARK else INK,
            )  # fmt: skip
        low, high = (100.0 * end for end in right[name].interval)
        text = f"{right[name].count}/{right[name].total}  ({low:.0f}–{high:.0f} %)"
        axes.text(len(columns), row, text, va="center", fontsize=7)
    numbers = {name: index for index, name in enumerate(columns, 1)}
    axes.set_yticks(range(len(rows)), [f"{plain(name)}  {numbers.get(name, '')}".rstrip() for name in rows])
    axes.set_xticks(range(len(columns)), [str(number) for number in numbers.values()])
    axes.xaxis.tick_top()
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5), ylabel="truth")
    axes.set_xlabel("answer, by number")
    axes.text(len(columns), -1.0, "right of all (95 %)", va="center", fontsize=7)
    axes.xaxis.set_label_position("top")
    axes.tick_params(length=0)
    for edge in range(1, max(len(rows), len(columns))):
        axes.axhline(edge - 0.5, color="0.9", linewidth=0.4, zorder=0)
        axes.axvline(edge - 0.5, color="0.9", linewidth=0.4, zorder=0)
    return fig
