"""Every number of an answer is the one of the document, in its own cell; the words are tested elsewhere.

Truth: a document written by hand. Numbers are read back from the blocks as a person reads them.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import pytest

from diagnosis.findings import sections
from diagnosis.findings.cards import cause_cards, effect_cards
from diagnosis.findings.decision import decision
from diagnosis.findings.head import Head
from diagnosis.findings.next_run import NextRun
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.verdict import headline
from diagnosis.settings import Settings
from identification.show.blocks import Block, Heading, Paragraph, TextTable, lines
from identification.show.numbers import probability
from tests.support import rendered as tables
from tests.support.diagnosis_document import (
    CAUSE,
    CONDITIONS,
    IDS,
    RIVAL,
    both,
    campaign,
    document,
    findings_of,
    scattering_document,
)
from tests.support.shown_numbers import all_blocks, assert_known, assert_shows, assert_units

Document = dict[str, Any]


Answer = dict[str, tuple[Block, ...]]


def row(blocks: Iterable[Block], label: str) -> str:
    """What stands beside a label in a table of a section."""
    rows = [cells for block in blocks if isinstance(block, TextTable) for cells in block.rows]
    (found,) = (others for first, *others in rows if first == label)
    return " ; ".join(found)


def text(blocks: Iterable[Block]) -> str:
    """The cells and sentences of a section."""
    rows = [block.rows if isinstance(block, TextTable) else (lines(block),) for block in blocks]
    return " ".join(" ".join(cells) for cells in chain(*rows))


@pytest.fixture(scope="module")
def given() -> Document:
    return document()


@pytest.fixture(scope="module")
def answer(given: Document) -> Answer:
    return {
        one.key: tuple(all_blocks(one.blocks)) for one in sections.sections(findings_of(given), campaign())
    }


def test_every_number_of_a_table_has_a_unit_and_an_estimate_its_uncertainty(answer: Answer) -> None:
    for table in (block for blocks in answer.values() for block in blocks if isinstance(block, TextTable)):
        assert_units(table)


@pytest.mark.parametrize(("value", "text"), [(0.9634, "96 %"), (0.9951, "> 99 %"), (0.5712, "57 %")])
def test_a_probability_has_one_form_in_tile_sentence_chart_and_tables(
    given: Document, value: float, text: str
) -> None:
    given = copy.deepcopy(given)
    given["candidates"][0]["probability"] = value
    said = decision([("quadratic_damping", value)], Settings().answer).words("the runs")
    assert said.endswith(f": quadratic damping ({text}).")
    assert f"{text}; " in Head.of(findings_of(given | {"ambiguous_with": []})).sure
    assert tables.candidates_table(findings_of(given)).rows[0][1] == text
    drawn = tables.candidates_figure(findings_of(given))
    assert drawn is not None
    assert drawn.axes[0].texts[0].get_text() == text


def test_what_a_last_cause_leaves_within_the_noise_is_not_a_number(given: Document) -> None:
    steps = [given["waterfall"][0], given["waterfall"][1] | {"excess": -0.001}]
    calm = {"waterfall": steps, "rest": given["rest"] | {"significant": False}}
    assert closes(given | calm) == [
        f"Its addition takes the misfit from {both_text(28.45)} to within the noise."
    ]


def test_causes_added_together_close_together(given: Document) -> None:
    given = copy.deepcopy(given)
    names = "buffeting + vortex_shedding"
    given["candidates"][0]["effect"] = given["waterfall"][-1]["effect"] = names
    given["causes"] = names.split(" + ")
    first, second = closes(given)
    assert first == second
    assert first.endswith(", all together.")


def closes(given: Document) -> list[str]:
    """What the addition of each cause does to the misfit."""
    last = [card.blocks[-1] for card in cause_cards(findings_of(given))]
    return [block.text for block in last if isinstance(block, Paragraph)]


def both_text(excess: float) -> str:
    """A gap as a root mean square."""
    return f"{both(excess)[0]:.3f}°"


def test_the_causes_have_their_sizes(given: Document, answer: Answer) -> None:
    (cause,) = cause_cards(findings_of(given))
    heading, _, does, takes = cause.blocks
    assert heading == Heading("quadratic damping", "the damping, with the wind on and off")
    value = row(answer["found"], "quadratic_damping")
    assert value.startswith("coefficient ; ")
    assert_shows(value.replace("s²/rad²", ""), [0.003125, 1.7e-5])
    (size,) = given["sizes"]
    assert isinstance(does, Paragraph)
    assert isinstance(takes, Paragraph)
    assert_shows(
        does.text,
        [
            np.degrees(size["amplitude_rad"]),
            size["damping_ratio_without"],
            size["damping_ratio"],
            100 * size["frequency_change"],
            np.degrees(size["reading_change"]),
            np.degrees(size["stands_rad"]),
        ],
    )
    assert_shows(takes.text, [both(28.45)[0], both(2.75)[0]])
    assert {does, takes} <= set(answer["found"])

    def said(**changes: float) -> str:
        found = findings_of(given | {"sizes": [size | changes]})
        return found.sizes[0].words("rad")

    moved = said(zero_change=-0.00285, stands_rad=0.0)
    assert "the middle moves by -0.16°" in moved
    assert "rest" not in moved
    small = {"damping_ratio": size["damping_ratio_without"], "frequency_change": 1e-6}
    assert "damping" not in said(**small)
    assert "frequency" not in said(**small)
    assert said(**small, reading_change=0.0, zero_change=0.0) == ""
    for causes in ([], ["unknown"]):
        assert cause_cards(findings_of(given | {"causes": causes})) == []


def test_without_wind_no_wind_is_mentioned(given: Document) -> None:
    still = copy.deepcopy(given)
    for run in still["maps"]["runs"]:
        run["wind_speed"] = 0.0
    undecided = {"decided": False, "common": {"effects": {}, "channels": {}}, "next_run": None}
    for one, said in ((given, True), (still, False)):
        heading = cause_cards(findings_of(one))[0].blocks[0]
        assert isinstance(heading, Heading)
        texts = [heading.beside, *next_steps(findings_of(one | undecided))]
        texts += [label for label, _ in tables.place_rows(findings_of(one))]
        assert ("wind" in " ".join(texts).replace(NextRun(**given["next_run"]).conditions(), "")) == said
        assert ("Acts" in texts) == said


def test_a_campaign_without_wind_has_no_column_for_it(given: Document) -> None:
    windy = campaign()
    runs = tuple(replace(run, wind_speed=0.0) for run in windy.runs)
    for data, said in ((windy, True), (replace(windy, runs=runs), False)):
        shown = tuple(sections.sections(findings_of(given | {"maps": None}), data))
        blocks = [block for section in shown for block in all_blocks(section.blocks)]
        assert ("wind [m/s]" in tables.runs_table(findings_of(given), data).columns) == said
        assert ("wind speed, air density" in text(blocks)) == said
        assert "sample rate [Hz]" in tables.runs_table(findings_of(given), data).columns


def test_where_the_gap_is(given: Document) -> None:
    rows = [value for _, value in tables.place_rows(findings_of(given)) if re.search(r"\d", value)]
    where = given["where"]
    ends = (where["time_s"], np.degrees(where["amplitude_rad"]), where["frequency_hz"])
    for text, values in zip(rows, ends, strict=True):
        assert_shows(text, list(values))
    assert ", ".join(where["runs"]) in [value for _, value in tables.place_rows(findings_of(given))]


def test_narrow_lines(given: Document, answer: Answer) -> None:
    for line in given["maps"]["lines"]:
        wanted = [line["frequency_hz"], np.degrees(line["amplitude_rad"]), 100 * line["share"]]
        assert_shows(row(answer["where"], line["run"]), wanted)


def test_answers_weighed(given: Document, answer: Answer) -> None:
    for candidate in given["candidates"][:4]:
        shown = row(answer["which"], candidate["effect"])
        assert probability(candidate["probability"]) in shown
        shown = shown.replace(probability(candidate["probability"]), "", 1)
        wanted = [] if candidate["effect"] in ("none", "unknown") else [100 * candidate["closed"]]
        wanted += [candidate["excess_after"]]
        for estimate in candidate["parameters"].values():
            wanted += [estimate["value"], estimate["std"]] if estimate["std"] else [estimate["value"]]
        assert_shows(re.sub(r"rad²|s²", "", shown), wanted)


def test_a_p_value_is_never_zero(given: Document) -> None:
    none = given | {"gap": given["gap"] | {"tests": {"white": 0.0}}}
    assert row([tables.tests_table(findings_of(none))], "white") == "– ; < 1e-300"


def test_every_run(given: Document, answer: Answer) -> None:
    for name, (spring, speed, duration, rate), gap in zip(IDS, CONDITIONS, given["gap"]["runs"], strict=True):
        wanted = [value for value in (spring, speed or None, duration, rate) if value is not None]
        fitted = "" if gap["held_out"] else " (fitted)"
        shown = row(answer["how-far-section"], f"{name}{fitted}")
        after = both(gap["after"]) if gap["after"] > 0.0 else []
        assert_shows(shown, [*wanted, *both(gap["before"]), *after])
        assert ("none (within the noise)" in shown) == (gap["after"] < 0.0)
        assert ("yes" in shown) == (name in given["where"]["runs"])


def test_a_run_that_the_gap_leaves_out_has_no_excess(given: Document) -> None:
    fewer = given | {"gap": given["gap"] | {"runs": given["gap"]["runs"][1:]}}
    _, first, second, _ = tables.runs_table(findings_of(fewer), campaign()).rows
    assert first[-3:-1] == ("–", "–")
    assert_shows(" ; ".join(second[-3:-1]), [*both(4.583), *both(0.2345)])
    calm = tables.runs_table(findings_of(fewer | {"gap": fewer["gap"] | {"detected": False}}), campaign())
    assert [row[0] for row in calm.rows] == ["alpha", "beta (fitted)", "gamma"]


def test_coefficients(given: Document, answer: Answer) -> None:
    before, after = given["coefficients"]["before"], given["coefficients"]["after"]
    for name, label in (("cn_beta", "Cnβ [1/rad]"), ("cn_r", "Cnr [1/rad]")):
        old, new = before[name], after[name]
        reach = 1.96 * new["std"]
        wanted = [
            old["value"],
            old["std"],
            new["value"],
            new["std"],
            new["value"] - reach,
            new["value"] + reach,
            100 * (abs(new["value"]) / abs(old["value"]) - 1.0),
        ]
        assert_shows(row(answer["coefficients-section"], label).replace("+", ""), wanted)


def test_the_interval_is_that_of_the_nominal_model_where_it_stands_alone(given: Document) -> None:
    alone = given | {"coefficients": given["coefficients"] | {"after": {}}}
    rows = tables.coefficients_table(findings_of(alone)).rows
    assert [row[2] for row in rows] == ["–", "–"]
    assert_shows(rows[0][3], [0.4513 - 1.96 * 0.0024, 0.4513 + 1.96 * 0.0024])
    new = given | {"coefficients": given["coefficients"] | {"before": {}}}
    assert [row[1] for row in tables.coefficients_table(findings_of(new)).rows] == ["–", "–"]
    calm = tables.coefficients_table(findings_of(given | {"causes": []}))
    assert calm.columns == ("coefficient", "estimate", "95 % interval")


def test_tests_and_times(given: Document, answer: Answer) -> None:
    for name, value in given["gap"]["tests"].items():
        assert_shows(row(answer["provenance"], name), [value])
    for name, value in given["seconds"].items():
        assert_shows(row(answer["provenance"], name), [value])
    for name in tables.TESTS:
        document = given | {"gap": given["gap"] | {"tests": {name: 0.5}}}
        ((_, words, p),) = tables.tests_table(findings_of(document)).rows
        assert (words, p) == (tables.TESTS[name], "0.5")
    (alarms,) = re.findall(r"raise a false alarm in (\S+) of the campaigns", text(answer["provenance"]))
    assert_shows(alarms, [given["gap"]["false_alarm_rate"]])


def test_the_uncertainty_budget(given: Document) -> None:
    shares = {"noise": 0.36, "misfit": 0.64, "air density": 0.0}
    after = {"cn_beta": {"value": 0.4789, "std": 0.0013, "unit": "1/rad", "shares": shares}}
    table = tables.budget_table(
        findings_of(given | {"coefficients": given["coefficients"] | {"after": after}})
    )
    assert table.columns == ("source", "Cnβ [1/rad]")
    found = dict(table.rows)
    assert_shows(found["noise of the readings"], [0.6 * 0.0013, 36.0])
    assert_shows(found["model error"], [0.8 * 0.0013, 64.0])
    assert found["rounding of the stated air density"] == "–"
    assert_shows(found["combined standard deviation"], [0.0013])
    assert tables.budget_table(findings_of(given)).rows == ()


LATE = {"outcome": "left out", "runs": ["beta"], "what": "it begins late", "remedy": "cut it"}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"causes": []}, ["Use the coefficients"]),
        ({"causes": ["unknown"]}, ["Examine what acts on the damping, in alpha and gamma"]),
        (
            {"ambiguous_with": []},
            ["Model the damping that grows with the rate: removes 90.3 % of the gap", "measure", "with the causes"],
        ),
        ({}, ["spring of 81.5 N m/rad", "Model the damping that grows", "measure", "with the causes"]),
        ({"causes": [], "rest": None, "remarks": [LATE]}, ["beta: cut it.", "Use the coefficients"]),
        ({"rest": {"material": True}}, ["spring of", "Model", "measure", "with the causes", "Do not trust"]),
    ],
)  # fmt: skip
def test_what_to_do_next(given: Document, changes: Document, words: list[str]) -> None:
    steps = next_steps(findings_of(given | changes))
    assert len(steps) == len(words)
    for step, part in zip(steps, words, strict=True):
        assert part in step


@pytest.mark.parametrize(("runs", "scatter"), [(2, 0.0), (2, 0.2), (3, 0.0)])
def test_two_runs_do_not_show_whether_the_coefficients_may_be_used(
    given: Document, runs: int, scatter: float
) -> None:
    """Unless the campaign states how far its runs differ: the intervals then allow for it."""
    gap = given["gap"] | {"runs": given["gap"]["runs"][:runs]}
    after = {
        name: one | ({"shares": {"scatter": scatter, "noise": 1.0 - scatter}} if scatter else {})
        for name, one in given["coefficients"]["after"].items()
    }
    coefficients = given["coefficients"] | {"after": after}
    steps = next_steps(findings_of(given | {"causes": [], "gap": gap, "coefficients": coefficients}))
    if scatter or runs == 3:
        assert steps[0].startswith("Use the coefficients as they are")
    else:
        assert [step.partition(":")[0] for step in steps] == [
            "Repeat every run, at the same settings", "Until then use the coefficients with care",
        ]  # fmt: skip


def test_no_number_of_the_page_comes_from_elsewhere(given: Document, answer: Answer) -> None:
    """A number in any sentence is one of the document's, or of the records', in per cent or thousandths."""
    values = _all(given) | {float(x) for row in CONDITIONS for x in row if x is not None}
    ends = {e["value"] + s * e["std"] for e in given["coefficients"]["after"].values() for s in (-1.96, 1.96)}
    counts = {1.0, 2.0, 3.0, 4.0, 0.5, 1.5, 2.5, 3.5, 0.0}  # lines, runs, answers; edges of the bands
    shown = {both(v)[0] for v in values} | {100.0 * both(v)[0] / np.degrees(0.0815) for v in values}
    known = values | shown | {1e2 * v for v in values} | set(np.degrees([*values])) | ends | counts
    for shown in (text(answer["how-far-section"]), text(answer["provenance"])):
        assert_known(re.sub(r"95 %|10⁻³|SHA-256", "", shown).replace("1/s", ""), known)


def _all(values: Any) -> set[float]:
    """Every number of a document."""
    if isinstance(values, dict):
        return set().union(*(_all(v) for v in values.values())) if values else set()
    if isinstance(values, list):
        return set().union(*(_all(v) for v in values)) if values else set()
    return {float(values)} if isinstance(values, int | float) else set()


def test_a_line_cannot_hold_more_than_all() -> None:
    given = document()
    given["maps"]["lines"] = [{"run": "alpha", "frequency_hz": 50.0, "amplitude_rad": 1e-3, "share": 1.3}]
    assert tables.lines_table(findings_of(given)).rows[0][-1] == "100 %"
    assert tables.lines_table(findings_of({"maps": None})).rows == ()


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({"causes": []}, "none"),
        ({"causes": ["unknown"]}, "unknown"),
        ({}, "open"),
        ({"ambiguous_with": []}, "found"),
    ],
)
def test_the_kind_of_the_answer(given: Document, changes: Document, kind: str) -> None:
    assert headline(findings_of(given | changes))[1] == kind
    assert Head.of(findings_of(given | changes)).kind == kind


def test_what_is_known_is_stated_of_the_vocabulary_only(given: Document) -> None:
    named = effect_cards(findings_of(given | {"causes": [CAUSE], "ambiguous_with": ["unknown", RIVAL]}))
    assert [str(card.blocks[0]) for card in named] == [
        str(Heading(name.replace("_", " "), "the damping, with the wind on and off"))
        for name in (CAUSE, RIVAL)
    ]


def test_scatter_between_runs_is_the_last_of_the_causes() -> None:
    given = scattering_document()
    first, last = cause_cards(findings_of(given))
    assert first.blocks[0] == Heading("quadratic damping", "the damping, with the wind on and off")
    assert last.blocks[:2] == (
        Heading("scatter between runs", "by chance"),
        Paragraph(
            "Wind speed 0.29 % (0.13 to 0.62 %); mechanical damping 1.0 % (0.62 to 1.8 %)", kind="size"
        ),
    )
    row = tables.candidates_table(findings_of(given)).rows[0]
    assert row[0] == "quadratic_damping +\nscatter between runs"
    assert "wind speed scatter: spread = 0.29 % (0.13 to 0.62 %)" in row[-1].split("\n")
