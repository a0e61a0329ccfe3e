"""What is said of runs that do not repeat: causes proper first, then the scatter, the outlier and the drift."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from diagnosis import diagnose
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.repeatability import Spread, width_text
from diagnosis.findings.sections import diagnosis_brief
from diagnosis.findings.verdict import headline, verdict
from tests.support.diagnosis_document import CAUSE, findings_of, scattering_document
from tests.support.rendered import (
    candidates_table,
    closable_words,
    inclusion_line,
    parameters_table,
    repeatability_line,
    repeatability_table,
    scatter_words,
    waterfall_table,
    where_words,
)
from tests.support.scattered_runs import SCATTERED, scattered
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Repeatability

Document = dict[str, Any]
SPEED, SPRING, DAMPING = range(3)


@pytest.fixture
def given() -> Document:
    return scattering_document()


def alone(given: Document) -> Document:
    """The same campaign where nothing but scatter is named."""
    given["causes"].remove(CAUSE)
    given["credible"][0]["effect"] = " + ".join(given["causes"])
    return given


def test_causes_proper_come_first_and_the_scatter_has_a_sentence(given: Document) -> None:
    text = verdict(findings_of(given), "What remains is small.")
    assert (
        "Quadratic damping explains the gap (probability 91 %). The misfit of the nominal model is 0.135° root "
        "mean square, 2.9 % of the swing. The cause acts on the damping, with the wind on and off. In addition"
        in text
    )
    assert (
        "In addition the runs differ by chance: the wind speed by 0.29 % (0.13 to 0.62 %), beta −0.6 % and gamma "
        "+0.5 % most; the mechanical damping by 1.0 % (0.62 to 1.8 %), beta −2 % and alpha +1 % most."
    ) in text
    assert "the intervals of the coefficients allow for them" in text
    assert "Together with these differences it explains 98.8 % of the gap" in text
    assert "What remains is small. Cnβ rises by" in text
    assert headline(findings_of(given)) == ("quadratic damping, and scatter between runs", "found")
    given["causes"].append("coulomb_friction")
    assert "Together with these differences they explain " in verdict(findings_of(given), "")
    given["causes"].pop()
    assert "quadratic damping, and scatter between runs (probability 91 %)" in diagnosis_brief(
        findings_of(given)
    )


def test_scatter_alone_is_said_to_be_all(given: Document) -> None:
    text = verdict(findings_of(alone(given)), "")
    assert "The runs differ from each other by chance only (probability 91 %): the wind" in text
    assert "explains the gap" not in text
    assert headline(findings_of(given)) == ("Scatter between runs", "found")
    given["rest"]["material"] = True
    assert "by chance only" not in verdict(findings_of(given), "")


def test_an_outlier_is_named_with_its_deviation(given: Document) -> None:
    text = verdict(findings_of(given), "")
    assert (
        "Run beta deviates far beyond the others: frequency −1.2 % relative to the model of all runs." in text
    )
    assert any(step.startswith("Repeat run beta, ") for step in next_steps(findings_of(given)))
    given["repeatability"]["outlier"] = ""
    assert "far beyond" not in verdict(findings_of(given), "")
    assert not any("Repeat run" in step for step in next_steps(findings_of(given)))


def test_what_is_stated_is_compared(given: Document) -> None:
    spreads = given["repeatability"]["spreads"]
    spreads[SPEED]["stated"] = 0.001
    assert "0.62 %), beyond the 0.1 % stated, beta" in scatter_words(findings_of(given))
    for one in spreads:
        one |= {"shown": False, "stated": 0.003}
    given["causes"] = []
    text = verdict(findings_of(given), "")
    assert text.startswith("No gap: ")
    assert "differ no more than stated (the wind speed 0.3 %, the spring 0.3 %" in text


def test_numbers_told_apart_poorly_are_said_to_be(given: Document) -> None:
    spreads = given["repeatability"]["spreads"]
    assert "The spring may also differ, by up to 0.064 %; these runs do not show it." in scatter_words(
        findings_of(given)
    )
    spreads[SPRING]["shown"] = True
    assert "may also differ" not in scatter_words(findings_of(given))
    assert "hardly distinguish" not in scatter_words(findings_of(given))
    spreads[SPEED]["interval"] = [1e-4, 2e-3]
    assert "hardly distinguish the wind speed from the spring" in scatter_words(findings_of(given))
    spreads[SPRING]["shown"], spreads[SPEED]["shown"] = True, False
    given["causes"] = sorted({*given["causes"], "stiffness_scatter"} - {"wind_speed_scatter"})
    assert any(step.startswith("Log the wind speed of every run") for step in next_steps(findings_of(given)))


def test_a_drift_alone_is_not_said_to_be_by_chance(given: Document) -> None:
    trend = {"effect": "wind_speed_scatter", "change": 0.0081, "std": 0.0006, "p_value": 1e-5, "left": 0.0002}
    repeatability = given["repeatability"]
    repeatability["trends"] = [trend | {"only": True}]
    repeatability["spreads"] = repeatability["spreads"][:1]
    text = scatter_words(findings_of(given))
    assert text == (
        "The runs drift but do not scatter: the wind speed rises by 0.810 ± 0.060 % from the first to the last run "
        "(does the lab warm up, or the fan drift?). The intervals of the coefficients allow for it."
    )
    repeatability["trends"] = [trend]
    assert "by chance" in scatter_words(findings_of(given))


def test_a_drift_is_not_by_chance(given: Document) -> None:
    trend = {"effect": "wind_speed_scatter", "change": 0.0081, "std": 0.0006, "p_value": 1e-5, "left": 0.0012}
    given["repeatability"]["trends"] = [trend]
    text = scatter_words(findings_of(given))
    assert (
        "Part of this is a drift: the wind speed rises by 0.810 ± 0.060 % from the first to the last run (does "
        "the lab warm up, or the fan drift?). The remaining scatter is 0.12 %."
    ) in text
    assert "gamma +0.5 %" not in text  # the drift says it better
    trend["change"] = -0.0081
    assert "the wind speed falls by" in scatter_words(findings_of(given))


def test_a_pattern_of_the_plan_is_not_by_chance(given: Document) -> None:
    trend = {
        "effect": "wind_speed_scatter",
        "change": -0.0081,
        "std": 0.0006,
        "p_value": 1e-5,
        "left": 0.0012,
    }
    given["repeatability"]["trends"] = [trend | {"along": "spring_stiffness"}]
    text = verdict(findings_of(alone(given)), "")
    assert (
        "Part of this is not by chance: the wind speed is 0.810 ± 0.060 % lower at the greatest stiffness of the "
        "spring than at the least. The remaining scatter is 0.12 %."
    ) in text
    assert "The runs differ from each other, and not by chance alone (probability 91 %): " in text
    assert "by chance only" not in text
    assert headline(findings_of(given)) == ("Scatter between runs, not by chance alone", "found")


def test_what_the_examination_found_is_not_by_chance(given: Document) -> None:
    given["remarks"] = [
        {
            "outcome": "noted",
            "runs": ["beta"],
            "what": "w",
            "remedy": "r",
            "figures": {"systematic": "a wind"},
        }
    ]
    assert "by chance only" not in verdict(findings_of(alone(given)), "")
    assert headline(findings_of(given)) == ("Scatter between runs, not by chance alone", "found")


def test_undecided_answers_share_the_scatter(given: Document) -> None:
    both = " + ".join(sorted(set(given["causes"]) - {CAUSE}))
    given["decided"] = False
    given["credible"] = [
        {"effect": given["candidates"][0]["effect"], "probability": 0.5},
        {"effect": both, "probability": 0.4},
    ]
    given["common"] = {
        "effects": {"wind_speed_scatter": 0.9},
        "channels": {"damping": 0.9, "calibration": 0.9},
    }
    text = findings_of(given).decision.words("the runs")
    assert "quadratic damping (50 %) or scatter between runs (40 %)." in text
    assert "wind speed scatter" not in text
    assert "With every answer the runs differ from each other by chance: " in verdict(findings_of(given), "")


def test_the_place_of_differences_between_runs_is_between_them(given: Document) -> None:
    given["found"]["place"]["channel"] = {"kind": "damping between runs"}
    text = where_words(findings_of(given))
    assert "Most of it is between the runs: each run alone is linear." in text
    assert "not agree with one model" not in text
    assert "That agrees" not in text
    given["causes"] = ["unknown"]
    assert "not agree with one model" in where_words(findings_of(given))


def test_tables_state_widths_in_per_cent(given: Document) -> None:
    rows = {row[0]: row[1:] for row in parameters_table(findings_of(given)).rows}
    assert rows["wind_speed_scatter"] == ("spread", "0.29 % (0.13 to 0.62 %)")
    assert candidates_table(findings_of(given)).rows[0][0] == "quadratic_damping +\nscatter between runs"
    assert waterfall_table(findings_of(given)).rows[1][0] == "scatter between runs"
    given["inclusion"] |= {"wind_speed_scatter": 0.99, CAUSE: 0.93}
    assert inclusion_line(findings_of(given)).endswith("wind speed scatter 99 %.")
    assert width_text(Spread("wind_speed_scatter", 0.003, (0.003, 0.003), 0.003, False, {})) == "0.30 %"


def test_every_run_is_listed_against_the_model(given: Document) -> None:
    table = repeatability_table(findings_of(given))
    assert [row[0] for row in table.rows] == ["alpha", "beta", "gamma"]
    assert table.rows[1][1:] == (
        "on",
        "−1.19000(13) (± 0.039)",
        "−0.4300(97) (± 0.39)",
        "deviates far beyond the others",
    )
    frequency = (1.5e-4**2 + 3.9e-4**2 + 0.0013**2) / 3
    assert f"frequency ± {100 * frequency**0.5:.2g} %" in repeatability_line(findings_of(given))
    assert repeatability_line(findings_of(given)).endswith("; outlier: beta.")
    given["repeatability"] |= {"spreads": [], "limits": {"frequency": 4.81e-4, "damping": 0.0173}}
    given["rest"]["significant"] = False
    assert (
        repeatability_line(findings_of(given))
        == "Repeatability: no run-to-run scatter detected: frequency less than 0.049 %, "
        "damping less than 1.8 % (one standard deviation; 95 % limits)."
    )
    assert not repeatability_table(findings_of(given)).rows
    given["repeatability"] = None
    assert repeatability_line(findings_of(given)) == ""
    assert not repeatability_table(findings_of(given)).rows


def test_what_could_be_closed_of_an_undecided_gap_is_beyond_the_scatter(given: Document) -> None:
    given["closable"] = {
        "excess": 1.2, "ceilings": [{"kind": "angle", "closed": 0.85, "std": 0.02, "held_out": "runs"}],
        "kind": "angle", "words": "", "events": [], "curve": None, "law": None, "alike": [], "next_most": None,
        "line": None,
    }  # fmt: skip
    assert "% of the residual gap (measured on" in closable_words(findings_of(given))
    given["decided"] = False
    assert "% of the gap beyond the scatter between runs (measured on" in closable_words(findings_of(given))


REASONS = [
    ({"causes": ["unknown"]}, "since no known effect explains the gap"),
    ({"decided": False}, "since the answer is undecided"),
    ({"rest": {"significant": True}}, "since the answer leaves a gap beyond the noise"),
    ({"limits": {"frequency": None, "damping": None}}, "since these runs would not show usual scatter"),
    ({"limits": None}, "since these runs would not show usual scatter"),
]


@pytest.mark.parametrize(("change", "why"), REASONS)
def test_that_the_runs_repeat_is_said_only_after_a_test_that_could_see_scatter(
    given: Document, change: Document, why: str
) -> None:
    """The deviations of the runs are -1.2 to 0.05 % in frequency, and -0.4 to 1 % in damping."""
    given["repeatability"] |= {
        "spreads": [],
        "limits": change.get("limits", {"frequency": 1e-4, "damping": 0.01}),
    }
    given["rest"]["significant"] = False
    given |= {name: value for name, value in change.items() if name != "limits"}
    said = repeatability_line(findings_of(given))
    assert said.startswith(
        f"Repeatability: not determined, {why}. The runs, one by one, deviate from the model in "
    )
    assert "frequency by 0.69 % and in damping by 0.66 % (root mean square)" in said
    assert [row[0] for row in repeatability_table(findings_of(given)).rows] == ["alpha", "beta", "gamma"]


def test_one_quantity_that_is_not_determined_is_said(given: Document) -> None:
    given["repeatability"] |= {"spreads": [], "limits": {"frequency": 1e-4, "damping": None}}
    given["rest"]["significant"] = False
    assert "frequency less than 0.01 %, damping not determined, since" in repeatability_line(
        findings_of(given)
    )


def test_scatter_far_beyond_the_usual_is_no_decided_cause_unless_the_campaign_states_it() -> None:
    wide, kinds = scattered(stiffness_scatter=2.5e-3), [effect_class(name) for name in SCATTERED]
    found = diagnose(wide, kinds=kinds, rivals=())
    assert "stiffness_scatter" in found.causes
    assert [doubt.kind for doubt in found.decision.doubts] == ["scatter"]
    assert any("state [repeatability]" in step for step in next_steps(found))
    stated = Repeatability(wind_speed=3e-3, spring_stiffness=2.5e-3, mechanical_damping=1e-2)
    assert diagnose(replace(wide, repeatability=stated), kinds=kinds, rivals=()).decided
    assert diagnose(scattered(), kinds=kinds, rivals=()).decided
