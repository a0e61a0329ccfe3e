"""Sentences from a document: where the gap is, caveats, what remains, and all text fields at once."""

from __future__ import annotations

from typing import Any

import pytest

from diagnosis.findings.candidates import Candidate
from diagnosis.findings.cautions import CAUTIONS, NOISE, PATCH, remark, sentence_of
from diagnosis.findings.closure import Confirmation, GapSummary, NoiseSummary
from diagnosis.findings.coefficients import Coefficients, size_note
from diagnosis.findings.decision import decision
from diagnosis.findings.misfit import Misfit
from diagnosis.findings.place import REASONS, reason, runs_of_the_gap
from diagnosis.findings.terms import KINDS
from diagnosis.findings.whole import Found
from diagnosis.model.fact import Fact, Noted
from diagnosis.result import Diagnosis
from diagnosis.settings import Settings
from diagnosis.where.described import Nowhere, PlaceFound, Where
from identification.estimate import Quantity
from tests.support.diagnosis_document import CAUSE, IDS, RIVAL, document, findings_of
from tests.support.rendered import closable_table, closable_words, coefficient_note, rest_words, where_words

Document = dict[str, Any]


@pytest.fixture
def given() -> Document:
    return document()


def placed(given: Document, **changes: Any) -> str:
    """Where the gap is, with changes of the facts of its place."""
    given["found"]["place"] |= changes
    return where_words(findings_of(given))


def test_where_the_gap_is_says_runs_places_bands_and_reasons(given: Document) -> None:
    assert where_words(findings_of(given)) == (
        "88 % of the gap is in 2 of 3 runs (alpha, gamma); its power is 4.2 times as large with the wind on. Four "
        "fifths of the gap lie between 0.1 and 3.4 s of the record, at amplitudes from 9.9° to 19°, at 1.88 "
        "to 2.62 Hz. By frequency: 73 % at the oscillation itself, 13 % at three times its frequency. It acts on "
        "the damping: the damping shifts along the decay more than the frequency does. It appears with the wind "
        "on and off: the 2 wind-off runs, fitted alone, show it too. That agrees with quadratic damping."
    )


def test_the_runs_that_show_the_gap(given: Document) -> None:
    given["where"]["runs"] = ["alpha"]
    assert placed(given).startswith("88 % of the gap is in one run of 3 (alpha); ")
    assert "nearly all of it with the wind on." in placed(given, wind={"on": 9.0, "off": 0.1})
    given["where"]["runs"] = list(IDS)
    assert placed(given, wind={}).startswith("All 3 runs show the gap. ")
    assert "with the wind" not in placed(given, wind={})
    alike = placed(given, wind={"on": 1.01, "off": 1.0})
    assert "; its power is as large with the wind on as with it off." in alike
    given["found"]["place"]["wind"] = {}
    assert placed(given, runs=13).startswith("88 % of the gap is in 3 of 13 runs (alpha, beta, gamma)")
    given["where"]["runs"] = [f"r{number}" for number in range(13)]
    assert placed(given, runs=20).startswith("88 % of the gap is in 13 of 20 runs.")
    given["where"]["runs"] = []
    assert placed(given).startswith("No single run is beyond chance (false-alarm rate 1 % over all runs)")


def test_a_gap_of_the_wind_off_runs_is_not_that_of_a_cause_that_needs_wind(given: Document) -> None:
    text = placed(given, compared=["nonlinear_yaw_damping"])
    assert text.endswith(
        "That agrees with nonlinear yaw damping. The 2 wind-off runs, fitted alone, show a gap too."
    )
    assert "It appears" not in text


def test_two_runs_that_show_the_gap_are_both(given: Document) -> None:
    given["where"]["runs"] = list(IDS[:2])
    assert placed(given, runs=2).startswith("Both runs show the gap")


def test_only_what_locates_the_gap_is_said(given: Document) -> None:
    assert "of the gap lie at 1.88 to 2.62 Hz." in placed(given, narrow=["frequency_hz"])
    text = placed(given, narrow=[], bands={})
    assert "of the gap lie" not in text
    assert "By frequency" not in text


def test_of_several_causes_it_is_said_which_act_where_the_gap_is(given: Document) -> None:
    text = placed(given, compared=["coulomb_friction", "gravity_stiffness", "quadratic_damping"], agrees=True)
    assert text.endswith(
        "Coulomb friction and quadratic damping act there; gravity stiffness acts on the restoring moment."
    )
    assert "does not agree" not in text
    text = placed(given, compared=["cubic_stiffness", "sensor_drift"], agrees=False, elsewhere=True)
    assert text.endswith(
        "That does not agree with cubic stiffness and sensor drift: cubic stiffness acts on the restoring moment "
        "and sensor drift acts on the sensor reading."
    )


def test_causes_that_act_elsewhere_do_not_agree(given: Document) -> None:
    text = placed(given, compared=["cubic_stiffness"], agrees=False, elsewhere=True)
    assert text.endswith("That does not agree with cubic stiffness: it acts on the restoring moment.")
    assert placed(given, compared=[]).endswith("show it too.")
    given["where"] |= {"channel": None, "condition": None}
    text = placed(
        given, channel={"kind": "frequency between runs"}, condition={"kind": "one run", "run": "beta"}
    )
    assert "The residuals alone do not show what it acts on: each run alone is linear" in text
    assert text.endswith("; whether it needs wind cannot be determined from one run alone (beta).")


@pytest.mark.parametrize(
    ("within_step", "end"),
    [
        (
            False,
            "consistent with the noise (p = 0.42 for the run that differs most, corrected for their number).",
        ),
        (True, "corrected for their number), but within the steps of the readings."),
    ],
)
def test_without_a_gap_it_is_nowhere(given: Document, within_step: bool, end: str) -> None:
    given["found"] |= {"place": None, "nowhere": {"runs": 3, "p_value": 0.42, "within_step": within_step}}
    text = where_words(findings_of(given))
    assert text.startswith("Nowhere: in 3 runs the residual is")
    assert text.endswith(end)
    given["found"]["nowhere"]["p_value"] = 0.004
    assert ("though one alone departs from it (p = 0.004" in where_words(findings_of(given))) != within_step


FIGURES = {
    "runs": 2, "run": "beta", "from_s": 1.0, "to_s": 2.0, "frequency_hz": 50.0, "words": "So it is.", "ratio": 3.5,
    "quantity": "rate", "reason": "it is too heavy", "records_rad": 1e-9, "fits_rad": 1e-5, "failure": "it grows",
    "rms_rad": 2e-5, "tolerance_rad": 1e-5, "tolerance": 0.1, "driven": False, "windy": True, "effects": [RIVAL],
    "std_rad": 1e-3, "fewer": 1, "uncertainty_rad": 1e-5, "stated_rad": 2e-3, "least_rad": 1e-3, "most_rad": 3e-3,
    "moment": "friction", "missed_percent": 1.5, "half_step_ms": 0.5, "share": 0.93, "left": 0.4,
    "below_per_s": 4.2e-3, "unit": "rad", "percent": 99.0, "native_percent": 90.0, "index": 0, "samples": 5,
    "parameters": ["coulomb_friction.exponent"],
}  # fmt: skip


@pytest.mark.parametrize("table", [CAUTIONS, PATCH])
def test_every_caveat_and_note_is_a_sentence_of_its_figures(table: Any) -> None:
    for kind in table:
        text = sentence_of(table, Fact(kind, FIGURES))
        assert text.endswith(".")
        assert text[0].isupper() or text.startswith("frictionloss")
        assert "{" not in text


def test_every_reason_is_a_clause_of_its_figures() -> None:
    for texts in (
        [reason(Fact(kind, FIGURES)) for kind in REASONS],
        [sentence_of(NOISE, Fact(kind, FIGURES)) for kind in NOISE],
    ):
        assert not any(text.endswith(".") or "{" in text or text[0].isupper() for text in texts)
        assert len(set(texts)) == len(texts)


def test_caveats_state_their_figures() -> None:
    def few(runs: int, *, driven: bool = False, windy: bool = False) -> str:
        return sentence_of(CAUTIONS, Fact("few runs", {"runs": runs, "driven": driven, "windy": windy}))

    assert few(1).endswith("Add runs with other springs and release angles.")
    assert few(1).startswith("There is one run only: the form of the decay alone distinguishes causes.")
    assert "A fault of this run cannot be told from a cause." in few(1)
    assert "fault" not in few(2)
    assert few(2, windy=True).endswith("springs, wind speeds and release angles.")
    assert few(2, windy=True, driven=True).endswith("springs, wind speeds and inputs.")
    assert few(2, driven=True).endswith(
        "form of the motion alone distinguishes causes. Add runs with other inputs."
    )
    left_out = sentence_of(CAUTIONS, Fact("another mode", {"ratio": 1.5, "runs": ["r1", "r3"]}))
    assert "at least 1.5 times as fast as the same spring with the wind off: r1, r3." in left_out
    differs = Fact("not confirmed", FIGURES)
    assert (
        "by 0.0011° (root mean square over beta), more than a tenth of the noise (0.00057°)."
        in sentence_of(CAUTIONS, differs)
    )
    assert "by 0.0011 °/s (root mean square over beta)" in sentence_of(CAUTIONS, differs, "rad/s")


def test_remarks_on_the_noise_have_their_remedies() -> None:
    found = remark(Noted(("a", "b"), Fact("folded hum", {"line_hz": 100.0, "places_hz": [40.0, 60.0]})))
    assert found.runs == ("a", "b")
    assert found.what.endswith("is above half the sample rate and appears at 40 to 60 Hz")
    assert found.remedy == "sample faster to see it at its true frequency"


@pytest.mark.parametrize(
    ("beta", "words"),
    [
        ("cn_beta", ""),
        ("", ""),
        (
            "cn_beta_area",
            "states no frontal_area, so Cnβ·A and Cnr·A are identified, not Cnβ and Cnr. State it to",
        ),
        ("cn_beta_length", "states no reference_length, so Cnβ·l and Cnr·l² are identified"),
        (
            "cn_beta_area_length",
            "no frontal_area and no reference_length, so Cnβ·A·l and Cnr·A·l² are identified",
        ),
    ],
)
def test_what_unstated_sizes_leave_open(beta: str, words: str) -> None:
    assert words in size_note(beta)
    assert bool(size_note(beta)) == bool(words)


def test_the_note_on_the_coefficients(given: Document) -> None:
    assert coefficient_note(findings_of(given | {"causes": []})) == ""
    assert coefficient_note(findings_of(given | {"causes": ["unknown"]})) == ""
    cycle = {"outcome": "noted", "runs": ["a"], "what": "it settles", "remedy": "none"}
    cycling = given | {"found": given["found"] | {"limit_cycles": [cycle]}}
    assert (
        coefficient_note(findings_of(cycling))
        == "no damping ratio and no derivative is stated, since no run is a free decay"
    )


def test_what_remains(given: Document) -> None:
    assert rest_words(findings_of(given)) == (
        "The residual (0.00946° root mean square) changes Cnβ by less than 0.28 % and Cnr by less than 4.6 %."
    )
    rest = given["rest"]
    large = given | {"rest": rest | {"excess": 445.0}}  # the fit shows it, whatever it does to coefficients
    assert rest_words(findings_of(large)).startswith(
        "Part of the gap remains: the residual (0.544° root mean square, 21 times the noise) changes Cnβ by less "
        "than"
    )
    unknown = given | {"causes": ["unknown"]}
    assert rest_words(findings_of(unknown)).startswith(
        "The gap changes Cnβ by less than 0.28 % and Cnr by less"
    )
    rest["moves"]["cn_r"]["std"] = 0.002
    assert rest_words(findings_of(unknown)).startswith(
        "The gap is immaterial: it changes Cnβ by less than 0.28 %"
    )
    assert rest_words(findings_of(given | {"causes": []})) == "No gap: nothing remains beyond the noise."
    calm = given | {"rest": rest | {"significant": False, "further": "sensor_drift"}}
    assert rest_words(findings_of(calm)) == (
        "The residual is within the noise. Sensor drift is significant, but too small to be named."
    )
    rest["moves"]["cn_r"]["material"] = True
    assert rest_words(findings_of(given)).startswith(
        "Part of the gap remains: the residual (0.00946° root mean square) could change Cnr by 0."
    )
    assert rest_words(findings_of(given | {"rest": None})) == ""


CEILINGS = [
    {"kind": "angle", "closed": 0.85, "std": 0.02, "held_out": "runs"},
    {"kind": "rate", "closed": 0.31, "std": 0.03, "held_out": "runs"},
    {"kind": "event", "closed": 0.9, "std": 0.7, "held_out": "short gaps"},
]
CLOSABLE = {
    "kind": "angle", "ceilings": CEILINGS, "events": [], "law": None, "alike": [], "next_most": 0.31, "line": None,
}  # fmt: skip


def test_what_could_be_closed(given: Document) -> None:
    def text(**changes: Any) -> str:
        return closable_words(findings_of(given | {"closable": CLOSABLE | changes}))

    first = "A moment of the angle alone could explain 85.0 ± 2.0 % of the residual gap (measured on held-out"
    assert text().startswith(first)
    assert text().endswith("No other kind measured on runs would explain more than 31.0 %.")
    larger = [*CEILINGS[:2], CEILINGS[2] | {"closed": 0.97, "std": 0.01}]
    said_both = text(ceilings=larger)
    assert said_both.startswith(first)
    assert said_both.endswith(
        "A moment in time of each run would explain 97.0 ± 1.0 %, measured on short gaps. A law "
        "common to all runs is preferred if it explains four fifths of that share or more, since it can be a "
        "property of the rig."
    )
    table = closable_table(findings_of(given | {"closable": CLOSABLE | {"kind": "rate", "ceilings": larger}}))
    assert "at most" not in table.title
    assert table.rows[0] == (KINDS["rate"], "31.0 ± 3.0 %", "runs")  # the kind of the sentence comes first
    assert table.title.startswith("Share of the residual gap that each kind")
    assert text(alike=["rate"]).endswith("cannot distinguish it from a moment of the rate alone.")
    assert text(alike=["rate", "time", "reading"]).endswith(
        "cannot distinguish it from a moment of the rate alone; a moment in time, equal in all runs; or an error "
        "of the reading, equal in all runs."
    )
    general = [*CEILINGS, {"kind": "state", "closed": 0.86, "std": 0.01, "held_out": "runs"}]
    assert text(ceilings=general).endswith(
        "Apart from a moment of angle and rate, which includes it, no other kind measured on runs would explain "
        "more than 31.0 %."
    )
    vague = [*CEILINGS, {"kind": "time", "closed": 0.2, "std": 0.9, "held_out": "runs"}]
    assert text(ceilings=vague, next_most=-0.02).endswith(
        "No other kind measured on runs with a share that is determined would explain any of it."
    )
    timed = [CEILINGS[0] | {"kind": "time"}]
    assert text(kind="time", ceilings=timed).startswith(
        "A moment in time, equal in all runs, could explain 85.0"
    )
    between = [CEILINGS[0] | {"kind": "between"}]
    assert text(kind="between", ceilings=between).startswith(
        "A stiffness, damping or moment of each run could explain 85.0"
    )
    stated = {"moment": "k*b^n", "parameters": {"k": {"unit": "N m"}, "n": {"unit": "1"}}}
    values = {"k": {"value": -0.2457, "std": 0.0012}, "n": {"value": 3.0, "std": 0.02}}
    law = {"effect": stated, "parameters": values, "closed": 0.8, "std": 0.01}
    assert text(law=law).endswith(
        "The formula k*b^n explains 80.0 ± 1.0 %, with k = -0.2457 ± 0.0012 N m and n = 3.000 ± 0.020."
    )
    assert text(law=law).startswith(first.replace("(measured", "(estimated without a formula,"))
    swing = {"omega_n": {"value": 4.5, "std": 0.01, "unit": "rad/s"}}
    per_inertia = given | {"coefficients": {"before": swing, "after": swing}}
    said = closable_words(findings_of(per_inertia | {"closable": CLOSABLE | {"law": law}}))
    assert "with k = -0.2457 ± 0.0012 rad/s² and n = 3.000 ± 0.020." in said
    flat = law | {
        "parameters": values | {"d": {"value": 0.0, "std": 6e135}, "q": {"value": 0.34, "std": 0.0}}
    }
    assert text(law=flat).endswith(
        "with k = -0.2457 ± 0.0012 N m, n = 3.000 ± 0.020 and d and q not determined by these runs."
    )
    with_law = given | {"causes": ["unknown"], "decided": True, "closable": CLOSABLE | {"law": law}}
    assert "Write the formula as an effect with --propose" in str(findings_of(with_law))
    without = with_law | {"closable": CLOSABLE}
    assert "Write the formula" not in str(findings_of(without))
    events = [{"run": "beta", "share": 0.9, "from_s": 1.0, "to_s": 2.5}] * 2
    assert text(events=events).endswith(
        "Most of it is in 2 runs, the largest part in run beta (1.00 to 2.50 s)."
    )
    line = {
        "frequency_hz": 7.2, "frequency_std_hz": 0.0011, "amplitude": 2.4e-4, "amplitude_std": 1e-5, "unit": "rad",
        "false_alarm_rate": 0.01,
    }  # fmt: skip
    assert "The line is at 7.2000 ± 0.0011 Hz. Its amplitude is 0.01375 ± 0.00057°" in text(line=line)
    assert text(kind="noise").startswith(
        "No smooth moment or error of the reading could explain more than 89.0 % of the residual gap:"
    )
    given["decided"] = False
    assert " % of the gap (measured" in text()
    undecided = findings_of(given | {"closable": CLOSABLE}).in_words()
    assert "\nWhat could explain the gap: A moment of the angle alone could" in str(undecided)
    assert closable_table(undecided).title.startswith("Share of the gap that each kind")
    assert closable_words(findings_of(given | {"closable": None})) == ""


def test_all_text_fields_are_written_from_the_facts(given: Document) -> None:
    found = findings_of(given).in_words()
    assert found.verdict.startswith(
        "The gap is explained by either quadratic damping (91 %) or coulomb friction"
    )
    assert found.rest is not None
    assert found.rest.words in found.verdict
    assert found.where.words == where_words(findings_of(given))
    assert found.noise.reason == "the campaign states no noise"
    assert [text.partition(":")[0] for text in found.cautions] == ["There are 2 runs only"]
    assert found.remarks[-1].what.startswith("sampled too slowly")
    assert (found.closable, found.model) == (None, None)
    assert CAUSE.replace("_", " ") in found.verdict


def test_numbers_in_sentences_are_those_of_the_settings(given: Document) -> None:
    changed = given | {"provenance": {"settings": {"where.interval_share": 0.75}}}
    found = findings_of(changed)
    assert found.settings.where.interval_share == 0.75
    assert "Three quarters of the gap lie between" in where_words(found)


def test_an_answer_in_words_has_all_of_them_and_writes_them_once() -> None:
    noise = NoiseSummary(4e-4, None, "estimated")
    value = {"cn_beta": Quantity(0.5, 0.001, "1/rad")}
    found = Found(
        nowhere=Nowhere(3, 0.5, within_step=False),
        noise=Fact("not stated"),
        cautions=(Fact("cut"),),
        noted=(Noted(("a",), Fact("not judged")),),
    )
    answer = Diagnosis(
        "c", (), GapSummary(False, 0.01, 0.01, 0.0, "", (), 1e-3, 0.5, {}, Misfit(5e-4, 0.1, "rad")),
        Where(None, None),
        (Candidate("none", 1.0, 0.01, 0.0),), (), None,
        Coefficients(value, value), Confirmation(True, 0.0, "a", 0.0, 1e-5), noise,
        decision((("none", 1.0),), Settings().answer), found=found,
    )  # fmt: skip
    once = answer.in_words()
    assert once.verdict.startswith("No gap: ")
    assert once.where.words.startswith("Nowhere: in 3 runs")
    assert once.noise.reason == "the campaign states no noise"
    assert [text.partition(" ")[0] for text in once.cautions] == ["The"]
    assert [remark.runs for remark in once.remarks] == [("a",)]
    assert once.in_words() == once


@pytest.mark.parametrize(
    ("shown", "said"), [(0, "the runs"), (2, "runs r0, r1"), (11, "the 11 runs"), (16, "the runs")]
)
def test_a_step_names_a_few_runs_and_counts_more(shown: int, said: str) -> None:
    place = PlaceFound(16, 0.9, 0.01, {}, (), {}, Fact("none"), Fact("none"))
    assert runs_of_the_gap(Where(None, None, tuple(f"r{i}" for i in range(shown))), place) == said
