"""Every number of the report's tables is that of the document; the words are tested elsewhere.

Truth: a document written by hand. Numbers are read back as a person reads them.
"""

from __future__ import annotations

import copy
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from diagnosis.facts.decision import decision
from diagnosis.settings import Settings
from diagnosis.words.numbers import left_over
from diagnosis.words.tables import candidates_table, other_answers
from diagnosis.words.verdict import headline, next_steps, run_words, size_words, undecided_words
from tests.support.diagnosis_document import (
    CAUSE,
    RIVAL,
    campaign,
    document,
    scattering_document,
)
from tests.support.shown_numbers import assert_shows
from tunnel_lab.report import page as report_page
from tunnel_lab.report import render_report, view
from tunnel_lab.report.figures import candidates_figure

Document = dict[str, Any]


@pytest.fixture(scope="module")
def given() -> Document:
    return document()


def test_the_head_of_the_page(given: Document) -> None:
    gap = given["gap"]
    before, after, share, probability = view.facts(given)
    for fact, excess in ((before, gap["excess_before"]), (after, gap["excess_after"])):
        degrees, excess = both(excess)
        assert_shows(fact.value, [degrees])
        assert_shows(fact.note, [100 * degrees / np.degrees(gap["misfit"]["swing"]), excess])
    assert before.value.endswith("°")
    assert before.note.startswith("root mean square; ")
    assert_shows(share.value, [100 * gap["closed"]])
    assert share.note == gap["closed_on"]
    assert probability.value == "91 %"
    calm = view.facts(given | {"rest": given["rest"] | {"significant": False}})[1]
    assert calm.value == "within the noise"
    assert_shows(calm.note, [gap["excess_after"]])
    none = view.facts(given | {"causes": []})[0]
    assert none.value == "within the noise"
    assert_shows(none.note, [(1.0 + gap["excess_before"]) ** 0.5])
    assert view.facts(given | {"causes": [], "gap": gap | {"excess_before": -0.694}})[0].note == (
        "residual 0.553 times the noise, root mean square"
    )
    del (old := copy.deepcopy(given))["gap"]["misfit"]
    assert_shows(view.facts(old)[0].value, [gap["excess_before"]])


@pytest.mark.parametrize("value", [-0.002, 0.0004, 0.00496, 0.1478, 9.456, 38.123, 974.88])
def test_what_is_left_has_one_form_in_a_tile(given: Document, value: float) -> None:
    given = copy.deepcopy(given)
    given["gap"]["excess_after"] = value
    assert view.facts(given)[1].note.endswith(f"; {left_over(value)}")
    calm = given | {"rest": given["rest"] | {"significant": False}}
    assert view.facts(calm)[1].note == left_over(value)


@pytest.mark.parametrize(("value", "text"), [(0.9634, "96 %"), (0.9951, "> 99 %"), (0.5712, "57 %")])
def test_a_probability_has_one_form_in_tile_sentence_chart_and_tables(
    given: Document, value: float, text: str
) -> None:
    given = copy.deepcopy(given)
    given["candidates"][0]["probability"] = value
    assert undecided_words(
        decision([("quadratic_damping", value)], Settings().answer).to_json_dict()
    ).endswith(f": quadratic damping ({text}).")
    assert view.facts(given)[-1].value == text
    assert view.candidate_rows(given)[0]["probability"] == text
    assert candidates_table(given).rows[0][1] == text
    drawn = candidates_figure(given)
    assert drawn is not None
    assert drawn.axes[0].texts[0].get_text() == text


def test_what_a_last_cause_leaves_within_the_noise_is_not_a_number(given: Document) -> None:
    steps = [given["waterfall"][0], given["waterfall"][1] | {"excess": -0.001}]
    calm = {"waterfall": steps, "rest": given["rest"] | {"significant": False}}
    (cause,) = view.causes_found(given | calm)
    assert cause["closes"].endswith("° to within the noise")


def test_causes_added_together_close_together(given: Document) -> None:
    given = copy.deepcopy(given)
    names = "buffeting + vortex_shedding"
    given["candidates"][0]["effect"] = given["waterfall"][-1]["effect"] = names
    given["causes"] = names.split(" + ")
    first, second = view.causes_found(given)
    assert first["closes"] == second["closes"]
    assert first["closes"].endswith(", all together")


def test_minus_signs_and_powers_of_ten() -> None:
    assert view.typeset("-0.5 to (1.2 ± 0.3)e-05, 1.910e+06") == "−0.5 to (1.2 ± 0.3) × 10⁻⁵, 1.910 × 10⁶"
    assert view.typeset("wind-on run r-1e5 at 3e") == "wind-on run r-1e5 at 3e"


def both(excess: float) -> list[float]:
    """A gap in degrees, by the noise of the document, and in noise powers."""
    return [float(np.degrees(4.5e-4) * np.sqrt(max(excess, 0.0))), excess]


def test_the_causes_have_their_sizes(given: Document) -> None:
    (cause,) = view.causes_found(given)
    assert (cause["name"], cause["acts"]) == ("quadratic damping", "the damping, with or without wind")
    ((name, value),) = cause["parameters"]
    assert name == "coefficient"
    assert_shows(value.replace("s²/rad²", ""), [0.003125, 1.7e-5])
    (size,) = given["sizes"]
    assert_shows(
        cause["does"],
        [
            np.degrees(size["amplitude_rad"]),
            size["damping_ratio_without"],
            size["damping_ratio"],
            100 * size["frequency_change"],
            np.degrees(size["reading_change"]),
            np.degrees(size["stands_rad"]),
        ],
    )
    assert_shows(cause["closes"], [both(28.45)[0], both(2.75)[0]])
    moved = size_words(given, size | {"zero_change": -0.00285, "stands_rad": 0.0})
    assert "the middle moves by -0.16°" in moved
    assert "rest" not in moved
    small = size | {"damping_ratio": size["damping_ratio_without"], "frequency_change": 1e-6}
    assert "damping" not in size_words(given, small)
    assert "frequency" not in size_words(given, small)
    assert size_words(given, small | {"reading_change": 0.0, "zero_change": 0.0}) == ""
    for causes in ([], ["unknown"]):
        assert view.causes_found(given | {"causes": causes}) == []


def test_without_wind_no_wind_is_mentioned(given: Document) -> None:
    still = copy.deepcopy(given)
    for run in still["maps"]["runs"]:
        run["wind_speed"] = 0.0
    undecided = {"decided": False, "common": {"effects": {}, "channels": {}}}
    for one, said in ((given, True), (still, False)):
        texts = [view.causes_found(one)[0]["acts"], *next_steps(one | undecided)]
        texts += [label for label, _ in view.place_rows(one)]
        assert ("wind" in " ".join(texts).replace(run_words(given["next_run"]), "")) == said
        assert ("Acts" in texts) == said


def test_a_campaign_without_wind_has_no_column_for_it(
    given: Document, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tunnel_lab.report.page.inline_svg", lambda *_: "")
    windy = campaign()
    runs = tuple(replace(run, wind_speed=0.0) for run in windy.runs)
    for data, said in ((windy, True), (replace(windy, runs=runs), False)):
        page = render_report(given | {"maps": None}, data)
        assert ("Wind [m/s]" in page) == said
        assert ("wind speed, air density" in page) == said
        assert "Sample rate [Hz]" in page


def test_where_the_gap_is(given: Document) -> None:
    rows = [value for _, value in view.place_rows(given) if re.search(r"\d", value)]
    where = given["where"]
    ends = (where["time_s"], np.degrees(where["amplitude_rad"]), where["frequency_hz"])
    for text, values in zip(rows, ends, strict=True):
        assert_shows(text, list(values))
    assert ", ".join(where["runs"]) in [value for _, value in view.place_rows(given)]


def test_narrow_lines(given: Document) -> None:
    for shown, line in zip(view.line_rows(given), given["maps"]["lines"], strict=True):
        assert shown.pop("run") == line["run"]
        wanted = [line["frequency_hz"], np.degrees(line["amplitude_rad"]), 100 * line["share"]]
        assert_shows(" ; ".join(shown.values()), wanted)


def test_a_coefficient_that_is_not_determined_has_no_interval(given: Document) -> None:
    after = {"cn_beta": {"value": 1.0, "std": None, "unit": "1/rad", "determined": False}}
    row = view.coefficient_rows(given | {"coefficients": given["coefficients"] | {"after": after}})[0]
    assert (row["after"], row["interval"]) == ("not determined by these runs", "–")


def test_answers_left_out_are_counted(given: Document) -> None:
    assert len(view.candidate_rows(given)) == 4
    # 0.4 + 0.05 + 0.03 thousandths
    assert other_answers(given).startswith("3 more answers have together a probability of less than 1 %. The")
    likely = given["candidates"][:4] + [{**given["candidates"][6], "probability": 0.0095}] * 5
    words = "5 more answers have together a probability of 5 %, none of them more than 1 %. The"
    assert other_answers(given | {"candidates": likely}).startswith(words)
    few = given | {"candidates": given["candidates"][:2]}
    assert other_answers(few) == ""
    assert len(view.candidate_rows(few)) == 2
    improbable = given | {"candidates": [c | {"probability": 0.001} for c in given["candidates"]]}
    assert len(view.candidate_rows(improbable)) == 3
    even = given | {"candidates": [c | {"probability": 0.01} for c in given["candidates"]]}
    assert other_answers(even) == ""
    assert other_answers(given | {"candidates": given["candidates"][:5]}).startswith("1 more answer has a ")


def test_a_run_that_the_gap_leaves_out_has_no_excess(given: Document) -> None:
    fewer = given | {"gap": given["gap"] | {"runs": given["gap"]["runs"][1:]}}
    first, second, _ = view.run_rows(fewer, campaign())
    assert (first["before"], first["after"]) == ("–", "–")
    assert_shows(f"{second['before']} ; {second['after']}", [*both(4.583), *both(0.2345)])


def test_the_interval_is_that_of_the_nominal_model_where_it_stands_alone(given: Document) -> None:
    alone = given | {"coefficients": given["coefficients"] | {"after": {}}}
    rows = view.coefficient_rows(alone)
    assert [row["after"] for row in rows] == ["–", "–"]
    assert_shows(rows[0]["interval"], [0.4513 - 1.96 * 0.0024, 0.4513 + 1.96 * 0.0024])
    new = given | {"coefficients": given["coefficients"] | {"before": {}}}
    assert [row["before"] for row in view.coefficient_rows(new)] == ["–", "–"]


def test_the_tests_have_words_and_p_values(given: Document) -> None:
    for name in report_page.TESTS:
        for value, text in ((0.5, "0.5"), (0.0, "< 1e-300")):
            document = given | {"gap": given["gap"] | {"tests": {name: value}}}
            assert report_page.test_rows(document) == [(name, report_page.TESTS[name], text)]


def test_the_uncertainty_budget(given: Document) -> None:
    shares = {"noise": 0.36, "misfit": 0.64, "air density": 0.0}
    after = {"cn_beta": {"value": 0.4789, "std": 0.0013, "unit": "1/rad", "shares": shares}}
    heads, rows = report_page.budget(given | {"coefficients": given["coefficients"] | {"after": after}})
    assert heads == ["Cnβ [1/rad]"]
    found = dict(rows)
    assert_shows(found["noise of the readings"], [0.6 * 0.0013, 36.0])
    assert_shows(found["what the model leaves unexplained"], [0.8 * 0.0013, 64.0])
    assert found["rounding of the stated air density"] == "–"
    assert_shows(found["combined standard deviation"], [0.0013])
    assert report_page.budget(given) == ([], [])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"causes": []}, ["nominal model"]),
        ({"causes": ["unknown"]}, ["examine the rig", "--effects-file"]),
        ({"ambiguous_with": []}, ["Model the damping that grows", "compare", "with the causes"]),
        ({}, ["spring of 81.5 N m/rad", "Model the damping that grows", "compare", "with the causes"]),
        ({"causes": [], "rest": None, "remarks": [{"outcome": "left out", "runs": ["beta"], "remedy": "cut it"}]},
         ["beta: cut it.", "nominal model"]),
        ({"causes": ["unknown"], "rest": {"material": True}}, ["examine", "--effects-file", "Do not trust"]),
    ],
)  # fmt: skip
def test_what_to_do_next(given: Document, changes: Document, words: list[str]) -> None:
    steps = next_steps(given | changes)
    run = given["next_run"] is not None and "ambiguous_with" not in changes and changes
    steps = [step for step in steps if not (run and "distinguishes" in step)]
    assert len(steps) == len(words)
    for step, part in zip(steps, words, strict=True):
        assert part in step


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.0, "0 %"), (0.0004, "< 0.1 %"), (0.0005, "0.1 %"), (0.5, "50.0 %"), (0.9994, "99.9 %"),
     (0.9996, "> 99.9 %"), (1.0, "100 %")],
)  # fmt: skip
def test_shares_next_to_nothing_or_all(share: float, text: str) -> None:
    assert view.percent(share) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.9994, "0.999"), (-0.0567, "−0.057"), (1.0, "1.00"), (31.72, "31.7"), (-2.5, "−2.50")],
)
def test_excesses(value: float, text: str) -> None:
    assert view.excess(value) == text


def test_a_line_cannot_hold_more_than_all() -> None:
    line = {"run": "alpha", "frequency_hz": 50.0, "amplitude_rad": 1e-3, "share": 1.3}
    assert view.line_rows({"gap": {}, "maps": {"lines": [line]}})[0]["share"] == "100 %"
    assert view.line_rows({"maps": None}) == []


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
    assert headline(given | changes)[1] == kind
    facts = [fact.value for fact in view.facts(given | changes)]
    assert ("98.8 %" in facts) == (kind in ("open", "found"))


def test_a_value_that_was_held_has_five_digits() -> None:
    text = view.estimate({"value": -0.123456789, "std": 0.0, "unit": "1"})
    assert "0.12346" in text
    assert "0.123457" not in text


def test_what_is_known_is_stated_of_the_vocabulary_only(given: Document) -> None:
    named = view.cause_paragraphs(given | {"causes": [CAUSE], "ambiguous_with": ["unknown", RIVAL]})
    assert [cause["name"] for cause in named] == [CAUSE.replace("_", " "), RIVAL.replace("_", " ")]


def test_scatter_between_runs_is_the_last_of_the_causes() -> None:
    given = scattering_document()
    first, last = view.causes_found(given)
    assert first["name"] == "quadratic damping"
    assert last["name"] == "scatter between runs"
    assert last["parameters"] == [
        ("wind speed", "0.29 % (0.13 to 0.62 %)"),
        ("mechanical damping", "1.0 % (0.62 to 1.8 %)"),
    ]
    row = view.candidate_rows(given)[0]
    assert row["name"] == "quadratic damping + scatter between runs"
    assert ("wind speed scatter: spread", "0.29 % (0.13 to 0.62 %)") in row["parameters"]
