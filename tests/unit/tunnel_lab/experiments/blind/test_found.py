"""The score by number of causes, and smooth calibration. Truth: hand counts, and statements drawn as stated."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis import Settings
from diagnosis.findings.decision import decision
from identification.statistics import Proportion
from tests.unit.tunnel_lab.experiments.blind.test_set_score import document, told
from tunnel_lab.experiments.blind import score_page as blind
from tunnel_lab.experiments.blind.answers import scored
from tunnel_lab.experiments.blind.cases import ScoredAnswer, case, found_by_group, inclusions
from tunnel_lab.experiments.blind.score_page import calibration_figure, confusion_figure
from tunnel_lab.experiments.blind.set_score import BlindScore, smooth_calibration

THREE = ["coulomb_friction", "gravity_stiffness", "quadratic_damping"]


def made(truth, said, *, inclusion=None, **more):
    answer = document(said) | ({} if inclusion is None else {"inclusion": inclusion})
    return case("c", {"effects": truth, **more}, scored(answer, "c.json"))


CASES = (
    made(THREE, THREE),
    made(THREE, [*THREE[:2], "mains_hum"], small=["mains_hum"]),  # one missed; the small one does not count
    made(THREE, [THREE[0], "free_play"]),  # two missed, one false
    made([*THREE, "free_play"], ["unknown"], scale={"time": 0.1}),
    made(["free_play"], ["free_play", "mains_hum"], small=["mains_hum"], scale={"time": 10.0}),
    made([], ["sensor_drift"], coloured_share=0.6),
    made([], [], stamps="jittered"),
    made(["unknown"], ["unknown"], few_runs=True),
    made(["unknown"], ["mains_hum"]),
)


def test_causes_found_and_false_are_those_counted_by_hand():
    found = found_by_group(CASES)
    assert found["three causes"].exact == Proportion(1, 3)
    assert found["three causes"].found == Proportion(6, 9)
    assert found["three causes"].false == Proportion(1, 7)
    assert (found["four causes"].found, found["four causes"].false) == (Proportion(0, 4), Proportion(0, 0))
    assert found["one cause"].exact == found["slow rigs"].exact == Proportion(1, 1)
    assert found["fast rigs"].exact == found["none acts, coloured noise"].exact == Proportion(0, 1)
    assert found["none acts, rounded or jittered stamps"].exact == found["few runs"].exact == Proportion(1, 1)
    assert found["none acts"].false == Proportion(1, 1)
    assert found["outside the vocabulary"].false == Proportion(1, 1)
    assert found["all"].exact == Proportion(4, 9)
    assert "two causes" not in found


def test_an_undecided_answer_states_no_set_and_may_cover_the_true_one():
    wrong, truth = "mains_hum", ["free_play"]

    def answered(*answers):
        said = ScoredAnswer((wrong,), decision=decision(answers, Settings().answer))
        return case("c", {"effects": truth, "small": ["sensor_drift"]}, said)

    decided = answered((wrong, 0.6), ("free_play + sensor_drift", 0.35), ("unknown", 0.05))
    undecided = answered((wrong, 0.45), ("free_play", 0.3), ("unknown", 0.25))
    missed = answered((wrong, 0.95), ("free_play", 0.05))
    assert [c.stated_wrongly for c in (decided, undecided, missed)] == [True, False, True]
    assert [c.covered for c in (decided, undecided, missed)] == [True, True, False]
    everything = found_by_group((decided, undecided, missed))["all"]
    assert everything.stated_wrongly == everything.covered == Proportion(2, 3)
    assert everything.credible_size == pytest.approx(2.0)


def test_kinds_go_up_to_four():
    exact = BlindScore(CASES, (), "", "", None, False).exact()
    assert (exact["three"], exact["four"]) == (Proportion(1, 3), Proportion(0, 1))


def test_a_truth_of_the_first_edition_has_no_small_causes_and_an_even_clock():
    one = case("c", {"effects": ["free_play"], "schema_version": 1}, told(["free_play"]))
    stated = (one.stated.stamps, one.stated.scale.time, one.stated.coloured_share)
    assert (one.small, *stated) == ((), "even", 1.0, 0.0)


def test_inclusions_leave_small_causes_out():
    one = made(["free_play"], ["free_play"], small=["mains_hum"],
               inclusion={"free_play": 0.9, "mains_hum": 0.4, "buffeting": 0.1})  # fmt: skip
    assert inclusions([one, CASES[0]]) == [([0.9, 0.1], [True, False])]


def drawn(shift, seed=1, campaigns=600):
    """Campaigns of 24 statements, true as often as stated plus a shift."""
    rng = np.random.default_rng(seed)
    p = rng.uniform(0.2, 0.8, (campaigns, 24))
    return [(list(a), list(b)) for a, b in zip(p, rng.random(p.shape) < p + shift, strict=True)]


def test_a_calibrated_answerer_has_a_small_smooth_error():
    found = smooth_calibration(drawn(0.0))
    assert found.error < 0.02
    assert np.all(np.abs(found.observed - found.stated)[(found.stated > 0.25) & (found.stated < 0.75)] < 0.06)


@pytest.mark.parametrize("shift", [-0.15, 0.15])
def test_the_smooth_error_is_the_shift_of_the_statements(shift):
    found = smooth_calibration(drawn(shift))
    assert found.error == pytest.approx(0.15, abs=0.015)
    assert found.interval[0] < found.error < found.interval[1]
    assert found.error == pytest.approx(found.width, rel=1e-3)


def test_certain_and_wrong_is_the_whole_error():
    assert smooth_calibration([([1.0, 1.0], [False, False])]).error == pytest.approx(1.0, abs=0.01)
    assert smooth_calibration([]) is None


def stated(effect, said, probability):
    """A campaign of one effect, answered with a probability."""
    return case("c", {"effects": effect}, told(said, probability=probability))


ANSWERED = tuple(
    stated(["free_play"], ["free_play"] if right else ["mains_hum"], probability)
    for probability, right in ((0.55, True), (0.57, False), (0.96, True), (0.98, True), (1.0, False))
)


def test_the_calibration_of_the_answers_is_drawn_in_bins_with_wilsons_intervals():
    score = BlindScore(ANSWERED, (), "", "", None, False)
    (axes,) = calibration_figure(score).axes
    (container,) = axes.containers
    line, _, (bars,) = container.lines
    x, y = line.get_data()
    assert list(x) == pytest.approx([0.56, 0.98])
    assert list(y) == pytest.approx([1 / 2, 2 / 3])
    ends = [segment[:, 1].tolist() for segment in bars.get_segments()]
    assert ends == [pytest.approx(Proportion(1, 2).interval), pytest.approx(Proportion(2, 3).interval)]
    assert [text.get_text() for text in axes.texts] == ["2", "3"]


def test_the_confusion_is_drawn_as_counted():
    score = BlindScore((*ANSWERED, CASES[0], CASES[6]), (), "", "", None, False)
    (axes,) = confusion_figure(score).axes
    names = ["free play  1", "mains hum  2", "two or more  3", "none  4"]
    assert [label.get_text() for label in axes.get_yticklabels()] == names
    places = {text.get_position(): text.get_text() for text in axes.texts}
    assert places[0, 0] == "3"
    assert places[1, 0] == "2"  # mains hum answered where free play acts
    assert places[2, 2] == places[3, 3] == "1"
    assert places[4, 0].startswith("3/5 ")
    assert (0, 1) not in places
    assert [(p.get_x() + 0.5, p.get_y() + 0.5) for p in axes.patches] == [(0, 0), (1, 0), (2, 2), (3, 3)]
    assert [p.get_alpha() for p in axes.patches] == pytest.approx([0.6, 0.4, 1.0, 1.0])


def test_the_page_and_the_figure_show_the_calibration_of_inclusion():
    cases = tuple(made(["free_play"], ["free_play"], inclusion={"free_play": 0.9}) for _ in range(5))
    score = BlindScore(cases, (), "", "", None, False)
    page = blind.markdown(score, "set", ("inclusion.png", "confusion.png"))
    assert "## Calibration of inclusion" in page
    assert page.index("](inclusion.png)") < page.index("](confusion.png)")
    assert "5/5, 100.0 %" in page
    title = calibration_figure(score).axes[1].get_title("left")
    assert title == f"5 effects: smooth calibration error {score.inclusion().error:.3f}"
    assert score.to_json_dict()["inclusion_calibration"]["statements"] == 5
    assert "Calibration of inclusion" not in blind.markdown(BlindScore(CASES, (), "", "", None, False), "set")
