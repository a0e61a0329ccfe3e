"""The answer in four lines, for every kind of answer, and the next steps in the order of what they buy.

Truth: documents written by hand. A line may state nothing that the verdict does not.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from diagnosis.findings.closure import shares_of_gap
from diagnosis.findings.decision import decision
from diagnosis.findings.head import Head
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.terms import SCATTERS
from diagnosis.settings import Settings
from identification.show.blocks import as_text
from identification.show.numbers import changed_by, to_interval
from identification.show.quantity import Quantity
from tests.support.diagnosis_document import CAUSE, document, findings_of, scattering_document
from tests.support.rendered import consequence, rest_words
from tests.support.shown_numbers import assert_shows

DRY, SPRING = "coulomb_friction", "spring_miscalibration"


def two_causes(**changes: Any) -> dict[str, Any]:
    """Dry friction, and a spring that explains more of the gap, decided."""
    given = document()
    effect = f"{DRY} + {SPRING}"
    parameters = {
        f"{DRY}.friction_moment": {"value": 0.006, "std": 0.0001, "unit": "N m"},
        f"{SPRING}.error": {"value": -0.0191, "std": 0.0001, "unit": "1"},
        f"{SPRING}.spring_stiffness": {"value": 21.02, "std": 0.0, "unit": "N m/rad"},
    }
    first = given["candidates"][0] | {"effect": effect, "probability": 0.97, "parameters": parameters}
    unknown = given["candidates"][2] | {"probability": 0.02}
    given |= {"causes": [DRY, SPRING], "ambiguous_with": [], "candidates": [first, unknown]}
    given["waterfall"] = [
        {"effect": None, "excess": 10.0}, {"effect": SPRING, "excess": 4.0}, {"effect": DRY, "excess": 0.0},
    ]  # fmt: skip
    given["rest"] |= {"significant": False, "material": False}
    given["coefficients"] = {
        "before": {"cn_beta": {"value": 0.478, "std": 0.02, "unit": "1/rad"},
                   "cn_r": {"value": -0.19, "std": 0.02, "unit": "1/rad"}},
        "after": {"cn_beta": {"value": 0.432, "std": 0.0066, "unit": "1/rad"},
                  "cn_r": {"value": -0.152, "std": 0.0046, "unit": "1/rad"}},
    }  # fmt: skip
    return given | changes


def test_two_causes_with_their_sizes_the_probability_the_cost_and_the_first_step() -> None:
    head = Head.of(findings_of(two_causes()))
    assert head.what == (
        "A spring of 21.02 N m/rad that is 1.91 % softer than stated; and dry friction of 0.00600 N m"
    )
    assert head.sure == "97 %; the only other reading: an unknown cause (2 %)"
    assert head.costs == (
        "Cnβ 0.432 ± 0.013 instead of 0.478;\nCnr -0.1520 ± 0.0090 instead of -0.1900 (per rad, 95 %)"
    )
    assert (
        head.first == "Measure the stiffness of the spring of 21.02 N m/rad again: removes 60.0 % of the gap."
    )
    assert head.kind == "found"
    assert not head.warnings


def test_a_spring_is_named_as_it_was_stated() -> None:
    given = two_causes()
    given["candidates"][0]["parameters"][f"{SPRING}.spring_stiffness"]["value"] = 21.0234
    head = Head.of(findings_of(given))
    assert head.what.startswith("A spring of 21.0234 N m/rad that is 1.91 % softer than stated")
    assert head.first.startswith("Measure the stiffness of the spring of 21.0234 N m/rad again")


def test_the_head_is_the_same_in_every_face() -> None:
    answer = findings_of(two_causes())
    head = Head.of(answer)
    assert as_text(head.section.blocks).splitlines()[0].startswith("What: A spring of 21.02 N m/rad")
    assert str(answer).startswith(f"What: {head.what}"[:60])


@pytest.mark.parametrize(
    ("changes", "what", "sure", "costs", "first"),
    [
        ({"causes": []}, "No gap: the model agrees", "Nothing beyond chance: noise", "Nothing: Cn", "Use"),
        ({"causes": ["unknown"], "inclusion": {}}, "A gap that no known effect explains; it acts on the damping",
         "97 %", "Not corr", "Examine what acts on the damping"),
        ({"causes": ["damping_scatter"]}, "The runs differ from each other by chance", "97 %", "Cnβ 0.4", "Run"),
    ],
)  # fmt: skip
def test_other_kinds_of_answers(changes: Any, what: str, sure: str, costs: str, first: str) -> None:
    head = Head.of(findings_of(two_causes(**changes)))
    for line, begins in ((head.what, what), (head.sure, sure), (head.costs, costs), (head.first, first)):
        assert line.startswith(begins)


def test_an_undecided_answer_names_no_cause_and_advises_no_repair() -> None:
    given = two_causes()
    given["candidates"][0]["probability"], given["candidates"][1]["probability"] = 0.45, 0.40
    given |= decision(
        [(f"{DRY} + {SPRING}", 0.45), ("unknown", 0.40), (DRY, 0.15)], Settings().answer
    ).to_json_dict()
    head = Head.of(findings_of(given))
    assert head.what == "A gap of undecided cause"
    assert (
        head.sure
        == "Not yet: 45 % coulomb friction + spring miscalibration; 40 % an unknown cause; 15 % another"
    )
    assert head.costs.startswith("Over the likely answers: ")
    steps = next_steps(findings_of(given))
    assert steps[0].startswith("Make one more run: spring of 81.5 N m/rad, wind at 18.25 m/s")
    assert "Do not repair" in steps[-1]
    assert not any("Reduce the dry friction" in step for step in steps)
    without = next_steps(findings_of(given | {"next_run": None}))
    assert without[0].startswith("Add runs with other springs, wind speeds and release angles")


def test_steps_are_ordered_by_the_share_of_the_gap_and_scatter_comes_after_the_causes() -> None:
    given = two_causes(causes=[DRY, "damping_scatter", SPRING])
    given["candidates"][0]["effect"] += " + damping_scatter"
    answer = findings_of(given)
    parts = shares_of_gap(answer.waterfall)
    assert (parts[SPRING][0], parts[DRY][0]) == (pytest.approx(0.6), pytest.approx(0.4))
    spring, dry, bearing, *_ = next_steps(answer)
    assert spring.endswith("removes 60.0 % of the gap.")
    assert dry.endswith("removes 40.0 % of the gap.")
    assert bearing.startswith("Run the bearing in")
    assert "the runs then repeat in mechanical damping" in bearing
    given["waterfall"][1:] = [{"effect": DRY, "excess": 3.0}, {"effect": SPRING, "excess": 0.0}]
    assert next_steps(findings_of(given))[0].endswith("removes 70.0 % of the gap.")
    assert not any("tunnel" in step for step in next_steps(answer))


def test_a_spring_that_is_open_comes_by_its_share_as_well() -> None:
    given = two_causes()
    given["found"] |= {
        "choices": [
            {"stiffness": 44.84, "error": 0.02, "std": 1e-4, "probability": 0.5},
            {"stiffness": 16.12, "error": -0.0196, "std": 1e-4, "probability": 0.5},
        ]
    }
    first, second, *_ = next_steps(findings_of(given))
    assert first.startswith("Measure the stiffness of both springs again (16.12 and 44.84 N m/rad)")
    assert "friction" in second


def test_the_removal_of_a_cause_leaves_the_scatter_and_no_more() -> None:
    """The runs' scatter, fitted first, absorbs a part of the cause; it is what remains without the cause."""
    given = scattering_document()
    names = [name for name in given["causes"] if name in SCATTERS]
    given["waterfall"] = [
        {"effect": None, "excess": 500.0},
        {"effect": " + ".join(names), "excess": 300.0},
        {"effect": CAUSE, "excess": 0.0},
    ]
    given["without"] = {" + ".join(names): 5.0, CAUSE: 300.0}
    parts = shares_of_gap(findings_of(given).waterfall)
    assert parts[CAUSE][0] == pytest.approx(0.99)
    assert parts[names[0]][0] == pytest.approx(0.01)
    given["waterfall"] = [
        {"effect": None, "excess": 28.0},
        {"effect": " + ".join(names), "excess": 6.0},
        {"effect": CAUSE, "excess": 2.0},
        {"effect": DRY, "excess": 0.0},
    ]
    given["without"] = {" + ".join(names): 16.0, CAUSE: 4.0, DRY: 2.0}
    parts = shares_of_gap(findings_of(given).waterfall)
    assert [parts[name][0] for name in (CAUSE, DRY, names[0])] == pytest.approx([8 / 28, 4 / 28, 16 / 28])


def test_without_a_gap_the_steps_of_the_readings_are_no_chance() -> None:
    given = document() | {"causes": []}
    given["found"] |= {"place": None, "nowhere": {"runs": 1, "p_value": 1e-19, "within_step": True}}
    assert Head.of(findings_of(given)).sure == (
        "The residual is not noise, but smaller than the steps of the readings"
    )


def test_a_gap_that_an_unnamed_effect_would_explain_is_of_unknown_cause() -> None:
    given = document() | {"causes": ["unknown"], "ambiguous_with": [], "inclusion": {}}
    assert Head.of(findings_of(given)).what.startswith("A gap that no known effect explains; it acts on")
    given["found"]["nearly"] = {
        "effects": [CAUSE], "closes": 0.9, "probability": 0.3, "noisy": False, "rival": [],
        "rival_probability": 0.0, "misfit": [],
    }  # fmt: skip
    assert Head.of(findings_of(given)).what.startswith("A gap of unknown cause; it acts on")


def test_runs_without_coefficients_have_none_to_use() -> None:
    one = two_causes()
    use = "Until then use the coefficients with the causes, not those without"
    assert use in " ".join(next_steps(findings_of(one)))
    one["coefficients"] = one["coefficients"] | {"before": {}, "after": {}}
    assert use not in " ".join(next_steps(findings_of(one)))


def test_no_correction_of_a_coefficient_that_remains_uncertain_is_promised() -> None:
    given = two_causes(causes=[DRY])
    given["candidates"][0] |= {"effect": DRY}
    assert "corrects Cnβ by 10 % and Cnr by 20 %" in next_steps(findings_of(given))[0]
    given["coefficients"]["after"]["cn_r"] |= {"std": 0.1, "interval": [-0.16, -0.01]}
    assert next_steps(findings_of(given))[0].endswith("corrects Cnβ by 10 %.")
    assert "Cnr remains uncertain" in consequence(findings_of(given))


@pytest.mark.parametrize(("source", "step", "left"), [
    ("noise", "Repeat every run three times more", 0.5), ("freed form", "Add runs with other release angles", 0.0),
])  # fmt: skip
def test_a_wide_interval_has_a_step_that_narrows_it(source: str, step: str, left: float) -> None:
    given = two_causes()
    wide = given["coefficients"]["after"]["cn_r"]
    wide |= {"std": 0.03, "shares": {source: 0.9999999}}
    (found,) = (one for one in next_steps(findings_of(given)) if one.startswith(step))
    now = 196.0 * 0.03 / 0.152
    assert_shows(found.partition(": Cnr becomes ")[2].replace("0.01", "0"), [left * now, now])
    if source == "noise":
        runs = {"spring_stiffness": 16.12, "wind_speed": 35.0, "release_angle": 0.35, "duration": 10.0}
        given["further_runs"] = runs | {"count": 2, "left": {"cn_r": 0.3}}
        (found,) = (one for one in next_steps(findings_of(given)) if "becomes" in one)
        assert found.startswith("Make 2 more runs: spring of 16.12 N m/rad, wind at 35 m/s, release at 20°")
        assert_shows(found.partition(": Cnr becomes ")[2], [0.3 * now, now])
        given["further_runs"] = runs | {"count": 2, "left": {"cn_r": 0.9999}}
        assert not any("becomes" in one for one in next_steps(findings_of(given)))  # ± 39 % now and then
    wide["std"] = 0.003
    assert not any(one.startswith(step) for one in next_steps(findings_of(given)))


def test_the_only_cause_names_the_changes_of_the_coefficients_as_the_verdict_does() -> None:
    given = two_causes(causes=[DRY])
    given["candidates"][0] |= {"effect": DRY}
    given["waterfall"] = [{"effect": None, "excess": 10.0}, {"effect": DRY, "excess": 0.0}]
    first = next_steps(findings_of(given))[0]
    assert first == (
        "Reduce the dry friction of the bearing and the sensor: removes the whole gap and corrects Cnβ by "
        "10 % and Cnr by 20 %."
    )
    verdict = consequence(findings_of(given))
    assert re.findall(r"by (\d+) %", verdict) == re.findall(r"by (\d+) %", first) == ["10", "20"]


@pytest.mark.parametrize(("causes", "explain"), [([DRY, SPRING], "explain"), ([DRY], "explains")])
def test_the_causes_of_a_part_of_the_gap_are_said_to_explain_a_part(causes: list[str], explain: str) -> None:
    given = two_causes(causes=causes)
    given["candidates"][0] |= {"effect": " + ".join(causes)}
    given["rest"] |= {"significant": True, "material": True}
    for closed, part in ((0.9876, "nearly all"), (0.6, "most"), (0.4, "only part")):
        given["gap"] |= {"closed": closed}
        assert Head.of(findings_of(given)).what.endswith(f", which {explain} {part} of the gap")


def test_a_caveat_that_changes_the_answer_stands_in_the_head_and_no_other() -> None:
    given = two_causes()
    given["found"]["cautions"] = [
        {"kind": "only one run", "run": "beta", "effects": [DRY]},
        {"kind": "few runs", "runs": 3, "driven": False, "windy": True},
    ]
    (warning,) = Head.of(findings_of(given)).warnings
    assert warning.startswith("Only run beta shows coulomb friction")


def test_the_head_calls_no_coefficient_unchanged_that_the_first_step_corrects() -> None:
    given = two_causes(causes=[DRY])
    given["candidates"][0] |= {"effect": DRY}
    given["waterfall"] = [{"effect": None, "excess": 10.0}, {"effect": DRY, "excess": 0.0}]
    # A wide deviation and an interval to one side, beyond which the value without the cause lies.
    given["coefficients"]["after"]["cn_beta"] |= {"std": 0.03, "interval": [0.36, 0.45]}
    head = Head.of(findings_of(given))
    assert "Cnβ by 10 %" in head.first
    assert "Cnβ 0.432 (0.360 to 0.450) instead of 0.478" in head.costs
    given["coefficients"]["after"]["cn_beta"]["interval"] = [0.36, 0.49]
    head = Head.of(findings_of(given))
    assert "Cnβ" not in head.first
    assert "Cnβ 0.432 (0.360 to 0.490) instead of 0.478 (within the interval)" in head.costs


@pytest.mark.parametrize(("after", "said", "costs"), [
    (0.4762, "Cnβ changes by less than 1 %", "unchanged"), (0.4747, "Cnβ falls by 0.69 %", "instead of 0.4780"),
])  # fmt: skip
def test_a_small_change_is_stated_alike_in_head_and_verdict(after: float, said: str, costs: str) -> None:
    given = two_causes()
    given["coefficients"]["before"]["cn_beta"]["value"] = 0.478
    given["coefficients"]["after"]["cn_beta"] |= {"value": after, "std": 0.0001}
    answer = findings_of(given)
    assert said in consequence(answer)
    assert f"{costs};" in Head.of(answer).costs.partition("Cnr")[0]


def test_the_head_and_the_verdict_state_one_change_by_the_gap_that_remains() -> None:
    given = two_causes(causes=["unknown"])
    moves = {"cn_beta": {"value": 0.13262, "relative": 0.304, "std": 0.01, "unit": "1/rad", "material": True}}
    given["rest"] |= {"significant": True, "material": True, "moves": moves, "words": ""}
    answer = findings_of(given)
    assert "could change Cnβ by 31 %" in rest_words(answer)
    assert "could change Cnβ by 31 %" in Head.of(answer).costs


@pytest.mark.parametrize(("value", "std", "interval", "shown"), [
    (0.457083, 1.2e-5, None, "0.4571 ± 0.0001"), (0.432, 0.0066, None, "0.432 ± 0.013"),
    (14.2, 0.7, None, "14.2 ± 1.4"),
    (-0.152, 0.0046, None, "-0.1520 ± 0.0090"), (0.0012, 1e-3, (0.0001, 0.0056), "0.0012 (0.0001 to 0.0056)"),
    (0.5, None, None, "0.500"),
])  # fmt: skip
def test_an_interval_has_two_digits_and_its_value_four_at_most(
    value: float, std: float | None, interval: Any, shown: str
) -> None:
    text, places = to_interval(Quantity(value, std, "1/rad", interval))
    assert text == shown
    assert places == len(text.split()[0].partition(".")[2])


def test_changes_have_no_powers_of_ten() -> None:
    for change in (*np.logspace(-9, 3, 60), 0.0, -3.4e-7, -0.02):
        assert "e" not in changed_by(float(change)).replace("less", "")
    assert changed_by(3.4e-7) == "less than 0.01 %"
    assert changed_by(2.1) == "+210 %"
