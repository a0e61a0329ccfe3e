"""The score of scatter between runs, beside the causes. Truth: hand counts."""

from __future__ import annotations

import json

from diagnosis.findings.terms import SCATTERS
from identification.statistics import Proportion
from tests.unit.tunnel_lab.experiments.blind.test_set_score import TRUTH, document
from tunnel_lab.experiments.blind import score_page as blind
from tunnel_lab.experiments.blind.answers import scored
from tunnel_lab.experiments.blind.cases import case, found_by_group, inclusions
from tunnel_lab.experiments.blind.scatter_score import scatter_score
from tunnel_lab.experiments.blind.set_score import BlindScore

SPEED = {"wind_speed": 0.003}
THREE = {"wind_speed": 0.003, "spring_stiffness": 0.0005, "mechanical_damping": 0.01}


def width(value, low, high, *, shown=True):
    return {"width": value, "interval": [low, high], "shown": shown}


def spreads(said):
    """What an answer says of the scatter, by number."""
    effects = {number: name for name, number in SCATTERS.items()}
    rest = {"stated": None, "deviations": {}}
    return {"spreads": [{"effect": effects[number], **one, **rest} for number, one in said.items()]}


def made(effects, causes, *, widths=None, said=None, stated=None, form="normal", **more):
    """A campaign with the widths drawn, and an answer that names causes and says how the runs scatter."""
    truth = {**TRUTH, "effects": effects, "scatter_form": form, **more}
    truth |= {} if widths is None else {"scatter": widths, "scatter_level": "large"}
    truth |= {} if stated is None else {"repeatability": stated}
    answer = document(causes) | ({} if said is None else {"repeatability": spreads(said)})
    return case("c", truth, scored(answer, "c.json"))


CASES = (
    # no cause, unstated: named rightly (speed within 1.5 and its interval, damping not), and one more falsely
    made([], [], widths=SPEED, said={"wind_speed": width(0.004, 0.002, 0.006),
                                     "mechanical_damping": width(0.01, 0.005, 0.02)}),
    made([], [], widths={"mechanical_damping": 0.01}, said={"mechanical_damping": width(0.02, 0.015, 0.03)}),
    # all three, of which the likeliest widths are said although none is shown
    made([], ["unknown"], widths=THREE, said={name: width(1.2 * w, 0.0, 0.5 * w, shown=False)
                                              for name, w in THREE.items()}),
    made([], ["wind_speed_scatter"], widths=SPEED),  # named among the causes
    made([], ["coulomb_friction", "wind_speed_scatter"], widths=SPEED),
    # stated
    made([], [], widths=SPEED, stated=SPEED),
    made([], [], widths=SPEED, stated=SPEED, said={"wind_speed": width(0.003, 0.002, 0.004)}),
    # beside causes
    made(["coulomb_friction"], ["coulomb_friction"], widths=SPEED),
    made(["coulomb_friction"], ["coulomb_friction", "damping_scatter"], widths={"mechanical_damping": 0.01}),
    made(["coulomb_friction"], ["unknown"], widths=SPEED),
    # another form counts for the causes only
    made([], ["unknown"], widths=SPEED, form="drifting"),
    # runs that repeat
    made([], []),
    made(["free_play"], ["free_play"], said={"spring_stiffness": width(0.001, 0.0005, 0.002)}),
    made(["free_play"], ["mains_hum"]),
)  # fmt: skip


def test_scatter_is_counted_as_by_hand():
    found = scatter_score(CASES)
    assert found.named_alone == Proportion(3, 5)
    assert found.no_gap == Proportion(1, 2)
    assert found.false_alarms == Proportion(1, 3)
    assert found.exact == Proportion(7, 11)
    assert found.exact_repeating == Proportion(2, 3)
    by_number = found.by_number
    assert list(by_number) == ["wind_speed", "spring_stiffness", "mechanical_damping", "all"]
    speed, spring, damping = (by_number[name] for name in THREE)
    # of normal campaigns whose speed scatters unstated: three say so, two of them by naming a cause
    assert speed.named == Proportion(3, 6)
    assert speed.false == Proportion(0, 4)
    assert (speed.within, speed.covered) == (Proportion(2, 6), Proportion(1, 2))
    assert spring.named == Proportion(0, 1)
    assert spring.false == Proportion(1, 1)
    assert (spring.within, spring.covered) == (Proportion(1, 1), Proportion(0, 1))
    assert damping.named == Proportion(2, 3)
    assert damping.false == Proportion(1, 3)
    assert (damping.within, damping.covered) == (Proportion(1, 3), Proportion(0, 2))
    assert by_number["all"].named == Proportion(5, 10)
    assert by_number["all"].false == Proportion(2, 8)


def test_the_causes_are_counted_without_scatter():
    groups = found_by_group(CASES)
    assert groups["one cause beside scatter"].exact == Proportion(2, 3)
    assert groups["one cause beside scatter"].false == Proportion(0, 2)
    assert groups["runs that repeat"].exact == Proportion(2, 3)
    assert groups["scatter, stated"].exact == Proportion(2, 2)
    named = CASES[8]
    assert named.right
    assert named.named_rightly
    assert named.probability == 0.9
    assert named.covered
    answer = document([]) | {"inclusion": {"coulomb_friction": 0.2, "wind_speed_scatter": 0.9}}
    assert inclusions([case("c", {**TRUTH, "effects": []}, scored(answer, "c.json"))]) == [([0.2], [False])]


def test_scatter_has_tables_and_figures_of_its_own():
    score = BlindScore(CASES, (), "k", "a", None, True)
    titles = [section.title for section in blind.sections(score)]
    assert {"Scatter between runs", "Widths of the scatter"} <= set(titles)
    page = blind.markdown(score, "set")
    assert "| no cause, scatter as stated: nothing named | 1 | 2 | 50.0 % |" in page
    assert "differ from run to run by chance" in page
    written = json.loads(json.dumps(score.to_json_dict(), allow_nan=False))
    assert written["scatter"]["false_alarms"]["count"] == 1
    assert written["cases"][0]["scatter_named"] == ["mechanical_damping", "wind_speed"]


def test_a_set_whose_runs_repeat_says_nothing_of_scatter():
    score = BlindScore((made([], []), made(["free_play"], ["free_play"])), (), "k", "a", None, True)
    assert score.scatter() is None
    assert "catter" not in blind.markdown(score, "set").replace("runs that repeat", "")
    assert score.to_json_dict()["scatter"] is None


def test_where_no_width_is_asked_for_none_are_shown():
    drifting = made([], ["unknown"], widths=SPEED, form="drifting")  # another form counts for the causes only
    titles = [
        one.title for one in blind.sections(BlindScore((drifting, made([], [])), (), "k", "a", None, True))
    ]
    assert "Scatter between runs" in titles
    assert "Widths of the scatter" not in titles
    every = blind.sections(BlindScore(CASES, (), "k", "a", None, True))
    (widths,) = (one for one in every if one.title == "Widths of the scatter")
    assert [row[0] for row in widths.rows] == ["wind speed", "spring stiffness", "mechanical damping", "all"]
