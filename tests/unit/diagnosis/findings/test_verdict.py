"""What the answer says of itself: the same words in verdict, JSON, terminal and page."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from diagnosis.answer.held_out import ON_RUNS, Step, Waterfall
from diagnosis.findings.closing import held_out_totals
from diagnosis.findings.closure import FITTED, GapSummary, RunGap
from diagnosis.findings.decision import decision
from diagnosis.findings.head import Head
from diagnosis.findings.judgements import Nearly, immaterial, nearly
from diagnosis.findings.misfit import Misfit
from diagnosis.findings.next_steps import next_steps, rival_lines
from diagnosis.findings.sections import diagnosis_brief
from diagnosis.findings.verdict import headline, verdict
from diagnosis.settings import Settings
from identification.estimate import Quantity
from tests.support.diagnosis_document import campaign, document, findings_of
from tests.support.gap_campaigns import added, answer, nominal, studied
from tests.support.gap_campaigns import campaign as campaign_with
from tests.support.rendered import candidates_table, parameters_table, rest_words, runs_table
from tunnel_lab.report.page import render_report
from tunnel_sim.effects import effect_from, known_effects


def gap(*held_out: bool) -> GapSummary:
    runs = tuple(RunGap(f"r{i}", 2.0, 0.1, held_out=held) for i, held in enumerate(held_out))
    misfit = Misfit(0.002, 0.1, "rad")
    return GapSummary(
        True, 2.0, 0.1, 0.95, ON_RUNS if any(held_out) else FITTED, runs, 0.01, 1e-9, {}, misfit
    )


def answer_of(
    *causes: str,
    size: GapSummary | None = None,
    both_winds: bool = True,
    material: bool = False,
    answers: tuple[tuple[str, float], ...] = (),
    **found: object,
) -> dict[str, Any]:
    """The document of an answer, with what is found beside its numbers."""
    answers = answers or ((" + ".join(causes), 0.9), ("unknown", 0.1))
    one = document()
    one["rest"]["material"] = material
    one["found"] |= {"both_winds": both_winds, **found}
    summary = gap(True) if size is None else size
    decided = decision(answers, Settings().answer).to_json_dict()
    return one | {
        "causes": list(causes),
        "ambiguous_with": [],
        "inclusion": {},
        "gap": summary.to_json_dict(),
        **decided,
    }


def said(*causes: str, **changes: Any) -> str:
    return verdict(findings_of(answer_of(*causes, **changes)), "What remains is small.")


@pytest.mark.parametrize(
    ("held_out", "closed_on"),
    [
        ((True, True), "on held-out runs"),
        ((False,), "in the fitted runs (none could be held out)"),
    ],
)
def test_the_runs_of_the_closure_are_named(held_out, closed_on):
    found = gap(*held_out)
    assert found.closed_on == closed_on
    assert f"of the gap {closed_on}. What remains is small." in said("coulomb_friction", size=found)


def test_the_gap_is_said_in_degrees_and_of_the_swing_first():
    # 0.002 rad · √2 = 0.16206°, over 0.1 rad 2.8 %
    words = "0.162° root mean square, 2.8 % of the swing"
    assert f"The misfit of the nominal model is {words}." in said("coulomb_friction")
    assert f"There is a gap ({words})" in said("unknown")
    found = gap(True).to_json_dict()["misfit"]
    assert found["before"] == pytest.approx(0.002 * 2.0**0.5)
    assert found["after"] == pytest.approx(0.002 * 0.1**0.5)
    rates = replace(gap(True), misfit=Misfit(0.01, 0.5, "rad/s"))
    assert "is 0.810 °/s root mean square, 2.8 % of the swing" in said("coulomb_friction", size=rates)


@pytest.mark.parametrize("held_out", [(True, True), (True, False), (False, False)])
def test_the_totals_are_those_of_the_waterfall(held_out):
    steps = Waterfall((Step(None, 4.0), Step("coulomb_friction", 0.2)), {}, "on stretches of time")
    found = held_out_totals(gap(*held_out), steps)
    assert (found.excess_before, found.excess_after) == (4.0, 0.2)
    assert found.closed == pytest.approx(0.95)
    assert found.closed_on == "on stretches of time"
    unnamed = held_out_totals(gap(*held_out), Waterfall((Step(None, 4.0),), {}, "on stretches of time"))
    assert (unnamed.excess_before, unnamed.excess_after, unnamed.closed) == (4.0, 4.0, 0.0)
    calm = replace(gap(*held_out), detected=False)
    assert held_out_totals(calm, steps) is calm


@pytest.mark.slow
def test_where_no_run_could_be_held_out_nothing_says_that_one_was():
    found = gap(False, False, False)
    given = document()
    given["verdict"] = said("quadratic_damping", size=found)
    given["waterfall_on"] = "on held-out stretches of time"
    given["gap"] |= {"closed_on": found.closed_on}
    for run in given["gap"]["runs"]:
        run["held_out"] = False
    page = render_report(findings_of(given), campaign())
    assert "on held-out runs" not in page
    assert "run held out" not in page
    table = runs_table(findings_of(given)).without_detail()
    assert table.columns == ("run", "before", "after")


def test_every_cause_of_several_is_named_with_what_it_acts_on():
    text = said("coulomb_friction", "cubic_stiffness", "mains_hum", both_winds=False)
    assert "Coulomb friction, cubic stiffness and mains hum explain the gap (probability 90 %)" in text
    for words in (
        "Coulomb friction acts on the damping; cubic stiffness acts on the restoring moment; ",
        "mains hum acts on the sensor reading.",
    ):
        assert words in text
    assert "They explain 95.0 % of the gap" in text
    assert "It explains 95.0 % of the gap" in said("coulomb_friction")


@pytest.mark.parametrize("cause", ["coulomb_friction", "nonlinear_yaw_moment"])
def test_the_wind_is_mentioned_only_where_runs_have_it_on_and_off(cause):
    assert "wind" not in said(cause, both_winds=False)
    assert "with the wind on" in said(cause)
    assert ("with the wind on and off" in said(cause)) == (cause == "coulomb_friction")


def test_what_remains_and_is_material_is_said_in_the_first_sentence():
    first = said("coulomb_friction", material=True).partition(". ")[0]
    assert "Coulomb friction explains nearly all of the gap" in first
    assert "nearly all" not in said("coulomb_friction")
    given = document()
    given["ambiguous_with"] = []
    assert headline(findings_of(given)) == ("quadratic damping", "found")
    assert "explains the gap (" in verdict(findings_of(given), "")
    large = given | {"rest": given["rest"] | {"excess": 2.0}}
    assert "explains nearly all of the gap (" in verdict(findings_of(large), "")
    assert rest_words(findings_of(large)).startswith("Part of the gap remains: the residual")
    given["rest"]["material"] = True
    assert headline(findings_of(given)) == ("quadratic damping, in part", "open")


UNDECIDED = (
    ("coulomb_friction + gravity_stiffness", 0.35),
    ("coulomb_friction + cubic_stiffness", 0.33),
    ("coulomb_friction + quadratic_damping", 0.25),
    ("unknown", 0.07),
)


def test_below_one_half_no_set_is_named_as_the_cause():
    causes = ("coulomb_friction", "gravity_stiffness")
    text = said(*causes, answers=UNDECIDED)
    assert "Its cause is undecided" in text
    assert "explain the gap" not in text
    assert "The likely answers contain coulomb friction (93 %)." in text
    assert (
        "gravity stiffness (35 %); coulomb friction and cubic stiffness (33 %); or coulomb friction" in text
    )
    assert "with a total probability of 93 %" in text
    assert "explain the gap" in said(*causes, answers=((" + ".join(causes), 0.5), ("unknown", 0.5)))


def test_of_many_likely_answers_five_are_said_and_the_others_counted():
    names = (
        "free_play",
        "cubic_stiffness",
        "sensor_drift",
        "mains_hum",
        "coulomb_friction",
        "gravity_stiffness",
    )
    text = said(*names[:1], answers=tuple((name, 1.0 / 6.0) for name in names))
    assert "mains hum (17 %); coulomb friction (17 %); or 1 more." in text
    assert "gravity" not in text


def test_where_no_effect_is_common_the_channel_may_be():
    answers = (("coulomb_friction", 0.45), ("quadratic_damping", 0.46), ("unknown", 0.09))
    found = decision(answers, Settings().answer)
    assert not found.effects
    assert found.channels == pytest.approx({"damping": 0.91})
    assert "act on the damping (91 %)" in said("coulomb_friction", answers=answers)
    apart = said(
        "coulomb_friction", answers=(("coulomb_friction", 0.4), ("free_play", 0.4), ("unknown", 0.2))
    )
    assert "The likely answers" not in apart
    assert "The answer is one of these" in apart


def test_an_undecided_answer_is_undecided_on_every_page():
    given = document()
    given["candidates"][0]["probability"] = 0.41
    answers = [(one["effect"], one["probability"]) for one in given["candidates"]]
    given |= decision(answers, Settings().answer).to_json_dict()
    assert headline(findings_of(given)) == ("Undecided", "open")
    given["common"]["channels"] = {"damping": 0.95}
    assert headline(findings_of(given))[0] == "Undecided: the damping, and more"
    given["common"]["effects"] = {"quadratic_damping": 0.93}
    assert headline(findings_of(given))[0] == "Undecided: quadratic damping, and more"
    head = Head.of(findings_of(given))
    assert head.what == "A gap of undecided cause: quadratic damping, and perhaps more"
    assert head.sure.startswith("Not yet: 41 % quadratic damping; 5 % coulomb friction")
    assert any("Do not repair" in step for step in next_steps(findings_of(given)))
    assert parameters_table(findings_of(given)).title.startswith("Parameters of the most probable answer")


@pytest.mark.usefixtures("undrawn")
def test_titles_and_order_agree_with_the_probabilities_where_an_unknown_cause_is_more_probable():
    given = document()
    for one, value in zip(given["candidates"], (0.33, 0.12, 0.48, 0.07), strict=False):
        one["probability"] = value
    first, most = given["candidates"][0], given["candidates"][2]
    given |= decision(
        [(one["effect"], one["probability"]) for one in given["candidates"]], Settings().answer
    ).to_json_dict()
    listed = [row[:2] for row in candidates_table(findings_of(given)).rows[:2]]
    assert listed == [(most["effect"], "48 %"), (first["effect"], "33 %")]
    assert [row[1] for row in candidates_table(findings_of(given)).rows[:2]] == ["48 %", "33 %"]
    called = "most probable set of effects"
    assert parameters_table(findings_of(given)).title.startswith(f"Parameters of the {called}")
    page = render_report(findings_of(given), campaign())
    assert f"of the {called}</h2>" in page
    assert "most probable answer" not in page + diagnosis_brief(findings_of(given))


def test_causes_that_change_no_coefficient_materially_are_called_immaterial():
    def within_noise(changes):
        one = answer_of("coulomb_friction", immaterial=changes)
        one["rest"]["significant"] = False
        return verdict(findings_of(one), "What remains is small.")

    assert within_noise({"cn_beta": 0.0004 / 0.5, "cn_r": 0.0003 / 0.1}).endswith(
        "What remains is small. The gap is immaterial: its causes change Cnβ by less than 0.08 % and Cnr by less "
        "than 0.3 %."
    )
    assert "immaterial" not in said("coulomb_friction")
    assert "its causes change Cnβ by less than 0.01 %." in within_noise({"cn_beta": 3.6e-9})


NEARLY = {
    "effects": ["quadratic_damping"], "closes": 0.996, "probability": 0.3, "noisy": False, "rival": [],
    "rival_probability": 0.0, "misfit": [],
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, " (probability 30 %), which is too little to name it."),
        (
            {"rival": ["coulomb_friction"], "rival_probability": 0.2},
            ", and coulomb friction explains as much (20 %).",
        ),
        ({"noisy": True}, " of the gap, but irregular noise may explain a gap this small."),
        (
            {"misfit": ["zero", "harmonics"]},
            ", but leaves a significant misfit of the zero and the harmonics.",
        ),
        (
            {"effects": ["quadratic_damping", "free_play"], "misfit": ["damping", "zero", "harmonics"]},
            ", but leave a significant misfit of the damping along the runs, the zero and the harmonics.",
        ),
        (
            {"effects": ["quadratic_damping", "free_play"]},
            " (probability 30 %), which is too little to name them.",
        ),
    ],
)
def test_an_unknown_gap_says_what_would_explain_it_and_why_it_is_not_named(changes, words):
    text = said("unknown", answers=(("unknown", 0.6), ("quadratic_damping", 0.4)), nearly=NEARLY | changes)
    assert "No effect is named as its cause. Quadratic damping " in text
    assert "would explain 99.6 % of the gap" in text
    assert words in text
    assert "No known effect explains it (tunnel effects lists them)" in said("unknown")


OFF = {"stiffness": 16.12, "error": -0.01961, "std": 0.0001, "probability": 0.5}


def test_springs_that_may_be_off_are_said_with_what_would_tell():
    text = said("spring_miscalibration", choices=[OFF, OFF | {"stiffness": 44.84, "error": 0.02}])
    assert (
        "16.12 N m/rad is 1.961 ± 0.010 % softer than stated (50 %), or 44.84 N m/rad is 2.000 ± 0.010 % stiffer "
        "than stated (50 %)"
    ) in text
    alike = said("spring_miscalibration", choices=[OFF | {"stiffness": 16.121}, OFF | {"stiffness": 16.124}])
    assert "16.121 N m/rad is" in alike
    assert "16.124 N m/rad is" in alike


def test_a_rival_says_its_own_words_at_the_end():
    text = said(
        "unknown", rivals=[{"kind": "two springs off", "words": "Two springs would explain the gap."}]
    )
    assert text.endswith(" Two springs would explain the gap.")


def test_second_modes_of_every_run_are_said_before_the_gap():
    main = {"amplitude_rad": 0.3, "frequency_hz": 2.2, "decay_per_s": 0.1}
    second = {"amplitude_rad": 0.02, "frequency_hz": 2.9, "decay_per_s": 0.2}
    runs = [run["id"] for run in answer_of("unknown")["gap"]["runs"]]
    mode = {"main": main, "second": second, "closes": 0.98}
    assert said("unknown", second_modes=[mode | {"run": "swing"}]).startswith("There is a gap")
    text = said("unknown", second_modes=[mode | {"run": run} for run in runs])
    assert text.startswith(f"Run {runs[0]} contains a second mode")


def test_a_hum_in_the_records_is_a_part_of_a_gap_of_unknown_cause():
    given = answer_of("unknown") | {
        "inclusion": {"mains_hum": 0.99, "free_play": 0.4, "damping_scatter": 0.99}
    }
    text = verdict(findings_of(given), "")
    assert "Mains hum is a part of it. No known effect explains the rest (tunnel effects lists them)." in text
    what = Head.of(findings_of(given)).what
    assert what.startswith("Mains hum, and a gap that no known effect explains")


def test_runs_in_limit_cycles_have_a_verdict_of_their_own():
    remark = {"outcome": "noted", "runs": ["r1"], "what": "it settles at 0.1 rad", "remedy": "none"}
    text = said("unknown", limit_cycles=[remark])
    assert text == "No run is a free decay, so no cause is named. r1: it settles at 0.1 rad."
    answer = findings_of(answer_of("unknown", limit_cycles=[remark]))
    assert Head.of(answer).sure == "Every run grows, or oscillates steadily"
    assert next_steps(answer)[0].startswith("Record a free decay at a lower wind speed: ")


def nearly_found(*weighed, noisy=False):
    """What nearly explains a gap of quadratic damping, `unknown` being the answer."""
    data = campaign_with(effect_from("quadratic_damping", {"coefficient": 2e-4}))
    base = nominal(data)
    study = studied(data, base, ("quadratic_damping",), added(base, "quadratic_damping"))
    answers = (answer(("unknown",), 1.0, 0.6), *weighed)
    gap = replace(study.gap, test=replace(study.gap.test, noisy=noisy))
    return nearly(replace(study, answers=answers, gap=gap))


def test_what_nearly_explains_a_gap_is_found_with_the_reason_why_it_is_not_named():
    first = answer(("quadratic_damping",), 0.004, 0.3)
    found = nearly_found(first)
    assert found == Nearly(("quadratic_damping",), 1.0 - 0.004, 0.3)
    rival = answer(("coulomb_friction",), 0.01, 0.2)
    assert nearly_found(first, rival) == replace(found, rival=("coulomb_friction",), rival_probability=0.2)
    assert nearly_found(replace(first, probability=0.0), noisy=True).noisy
    assert nearly_found(replace(first, share=0.4)) is None


def estimates(**values):
    return {name: Quantity(value, 0.01, "1/rad") for name, value in values.items()}


def test_a_change_of_two_per_cent_is_not_immaterial():
    before, after = estimates(cn_beta=0.5, cn_r=-0.1), estimates(cn_beta=0.5004, cn_r=-0.1003)
    found = immaterial(before, after)
    assert found == pytest.approx({"cn_beta": 0.0004 / 0.5, "cn_r": 0.0003 / 0.1})
    assert immaterial(before, after | estimates(cn_r=-0.102)) == {}


def test_what_is_certain_is_said_first_and_what_is_open_by_its_size():
    one = document() | {
        "causes": ["coulomb_friction", "spring_miscalibration"],
        "ambiguous_with": ["gravity_stiffness"],
        "inclusion": {"coulomb_friction": 0.98, "spring_miscalibration": 0.59, "gravity_stiffness": 0.40},
    }
    sizes = {"error": (-0.0196076, 1.7e-6, "1"), "spring_stiffness": (16.12, None, "N m/rad")}
    parameters = {
        f"spring_miscalibration.{name}": {"value": value, "std": std, "unit": unit}
        for name, (value, std, unit) in sizes.items()
    }
    one["candidates"] = [
        {
            "effect": "coulomb_friction + spring_miscalibration",
            "probability": 0.584,
            "parameters": parameters,
        },
        {"effect": "coulomb_friction + gravity_stiffness", "probability": 0.396, "parameters": {}},
        {"effect": "coulomb_friction", "probability": 0.02, "parameters": {}},
    ]
    words = (
        "coulomb friction (98 %), and either a spring of 16.12 N m/rad that is 1.96 % softer than stated (58 %) "
        "or gravity stiffness (40 %)"
    )
    assert headline(findings_of(one)) == (words, "open")
    assert f"The gap is explained by {words}. The misfit" in verdict(findings_of(one), "")
    measure = "Measure the stiffness of the spring of 16.12 N m/rad again: if it is this one."
    assert next_steps(findings_of(one))[2] == measure  # after the run that tells
    one["found"]["choices"] = [OFF, OFF | {"stiffness": 44.84, "error": 0.02}]
    springs = (
        "an error of one of the two springs, 16.12 N m/rad by −1.961 ± 0.010 % or 44.84 N m/rad by "
        "2.000 ± 0.010 %"
    )
    assert (
        headline(findings_of(one))[0]
        == f"coulomb friction (98 %), and either {springs} (58 %) or gravity stiffness (40 %)"
    )
    said_once = "and either an error of one of the two springs (58 %) or gravity stiffness (40 %). The misfit"
    assert said_once in verdict(findings_of(one), "")
    one["candidates"][2:] = [
        {"effect": "coulomb_friction + cubic_stiffness", "probability": 0.2, "parameters": {}},
        {"effect": "coulomb_friction", "probability": 0.1, "parameters": {}},
    ]
    one["ambiguous_with"] = ["cubic_stiffness", "gravity_stiffness"]
    others = "gravity stiffness (40 %), cubic stiffness (20 %) or nothing else (10 %)"
    assert headline(findings_of(one))[0].endswith(f"and one of these: {springs} (58 %), {others}")


def test_what_the_causes_change_is_said_in_per_cent():
    one = answer_of("coulomb_friction")
    values = {"cn_beta": (0.590, 0.537), "cn_r": (-0.2, -0.204)}
    for place, when in enumerate(("before", "after")):
        for name, pair in values.items():
            one["coefficients"][when][name]["value"] = pair[place]
    words = "Cnβ falls by 9 % (0.590 → 0.537) and the size of Cnr rises by 2 % (−0.200 → −0.204)."
    assert words in verdict(findings_of(one), "")
    one["found"]["immaterial"] = {"cn_beta": 0.001}
    one["rest"]["significant"] = False
    assert "Cnβ falls by" not in verdict(findings_of(one), "")


def of_model(armature: float, *free: str, std: float | None = 2e-4) -> dict[str, Any]:
    """A document without a cause of a joint of 0.08 kg m² whose model's file has an armature of 0.01 kg m²."""
    written = [
        {"name": "joint armature", "before": [0.01], "after": [armature], "unit": "kg m2"},
        {"name": "joint frictionloss", "before": [0.0], "after": [0.2], "unit": "N m"},
    ]
    inertia = {"value": 0.08, "std": std, "unit": "kg m2"}
    coefficients = {"before": {}, "after": {"yaw_inertia": inertia}}
    model = {"file": "arm.xml", "free": list(free), "written": written}
    return answer_of() | {"model": model, "coefficients": coefficients}


def test_no_gap_is_not_said_of_the_values_in_the_models_file() -> None:
    given = of_model(0.03, "inertia", "damping")
    assert verdict(findings_of(given), "").endswith(
        "arm.xml does not fit: joint armature is 0.0100 kg m² in the file and 0.03000 ± 0.00020 kg m² by the "
        "runs."
    )
    assert next_steps(findings_of(given))[0] == (
        "Correct joint armature in arm.xml; --patch FILE writes a model with these values."
    )
    for fits in (
        of_model(0.0107, "inertia"),  # less than 1 % of the inertia
        of_model(0.03, "damping"),
        of_model(0.03, "inertia", std=0.015),  # these runs do not tell
        of_model(0.03, "inertia", std=None),
        answer_of(),
    ):
        assert "as given" not in verdict(findings_of(fits), "")
        assert not any("Correct joint" in step for step in next_steps(findings_of(fits)))


def test_what_to_do_about_runs_is_said_once() -> None:
    given = document()
    left = {"outcome": "left out", "what": "it stands still", "remedy": "record it again"}
    cut = {
        "outcome": "cut",
        "runs": ["c"],
        "what": "begins at 1 s",
        "remedy": "cut it by hand if that is wrong",
    }
    given["remarks"] = [left | {"runs": ["a"]}, left | {"runs": ["b"]}, cut]
    steps = next_steps(findings_of(given))
    assert steps.count("a, b: record it again.") == 1
    assert not any("cut it by hand" in step for step in steps)  # the run is used as it is cut


def test_a_gap_within_the_noise_is_said_without_a_misfit_of_zero():
    small = replace(gap(True), excess_before=-1e-4, excess_after=-1e-4)
    one = answer_of("unknown", size=small)
    text = verdict(findings_of(one), "")
    assert text.startswith("There is a gap, but its root mean square is within the noise. No ")
    (look, *_) = next_steps(findings_of(one))
    assert look.startswith("Examine ")
    assert "misfit" not in look
    assert "makes a misfit of" in next_steps(findings_of(answer_of("unknown")))[0]


def test_effects_that_the_wind_speed_separates_are_separated_by_another_speed():
    one = answer_of("reynolds_dependence", driven=True) | {
        "next_run": None,
        "ambiguous_with": ["wind_speed_offset"],
    }
    one["candidates"] = [
        {"effect": name, "probability": value, "parameters": {}}
        for name, value in (("reynolds_dependence", 0.6), ("wind_speed_offset", 0.4))
    ]
    assert rival_lines(findings_of(one))[-1].startswith(
        "To distinguish them, record a run at another wind speed"
    )
    one["candidates"][0]["effect"] = "cubic_stiffness"
    other = one | {"causes": ["cubic_stiffness"]}
    assert "another wind speed" not in rival_lines(findings_of(other))[-1]


OF_A_TUNNEL = (
    "spring",
    "wind",
    "potentiometer",
    "bearing and the sensor",
    "turbulence",
    "rod",
    "level the axis",
    "draught",
)


@pytest.mark.parametrize("driven", [False, True])
def test_a_robot_gets_the_advice_of_a_robot(driven):
    """Of every effect that a joint may have, decided, between two, and undecided."""
    kinds = [kind for kind in known_effects() if kind.condition == "always" and not kind.chosen_spring()]
    for kind in kinds:
        one = answer_of(kind.name, both_winds=False, robot=True, driven=driven)
        one["candidates"] = [{"effect": kind.name, "probability": 0.9, "parameters": {}}]
        one["maps"]["runs"] = [run | {"wind_speed": 0.0} for run in one["maps"]["runs"]]
        one["next_run"] = None if driven else one["next_run"]
        for changed in (one, one | {"ambiguous_with": ["free_play"]}, one | {"decided": False}):
            said = " ".join([*next_steps(findings_of(changed)), *rival_lines(findings_of(changed))]).lower()
            assert not [word for word in OF_A_TUNNEL if word in said], (kind.name, said)
    said = " ".join(
        next_steps(findings_of(one | {"decided": False}))
        + rival_lines(findings_of(one | {"ambiguous_with": ["free_play"]}))
    )
    assert ("another input" in said) == driven
    assert ("release at" in said) != driven
