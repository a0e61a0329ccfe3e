"""The score of a blind set: counts, calibration, errors and its page. Truth: hand counts, published intervals."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from diagnosis import Diagnosis, Settings
from diagnosis.answer.held_out import ON_RUNS
from diagnosis.findings.candidates import Candidate
from diagnosis.findings.closure import Confirmation, GapSummary, NoiseSummary
from diagnosis.findings.coefficients import Coefficients
from diagnosis.findings.decision import Predictions, decision
from diagnosis.findings.misfit import Misfit
from diagnosis.where.described import Where
from identification.show.quantity import Quantity
from identification.statistics import Proportion
from tunnel_lab.experiments.blind import score_page as blind
from tunnel_lab.experiments.blind.answers import scored
from tunnel_lab.experiments.blind.cases import case
from tunnel_lab.experiments.blind.set_score import BlindScore, calibration
from tunnel_sim.vocabulary.errors import TunnelError


def document(causes, *, probability=0.9, closed=0.99, rivals=(), cn=(0.45, -0.12), std=(0.001, 0.001)):
    """A diagnosis with given causes, as its JSON."""
    name = " + ".join(causes) or "none"
    values = {k: Quantity(v, s, "1/rad") for k, v, s in zip(("cn_beta", "cn_r"), cn, std, strict=True)}
    return Diagnosis(
        "c", tuple(causes),
        GapSummary(bool(causes), 2.0, 0.1, closed, ON_RUNS, (), 0.001, 0.5, {}, Misfit(5e-4, 0.1, "rad")),
        Where(None, None), (Candidate(name, probability, 0.1, closed),), tuple(rivals), None,
        Coefficients(values, values), Confirmation(True, 0.0, "r01", 0.0, 1e-5),
        NoiseSummary(5e-4, None, "estimated", ""),
        decision([(name, probability)], Settings().answer, Predictions(held_out=closed)),
    ).to_json_dict()  # fmt: skip


def told(causes, **stated):
    """The same as it is scored."""
    return scored(document(causes, **stated), "c.json")


TRUTH = {"cn_beta": 0.45, "cn_r": -0.12, "severity": 4.0}
SAID = [  # truth, answer, probability
    (["coulomb_friction"], ["coulomb_friction"], 0.95),
    (["coulomb_friction"], ["quadratic_damping"], 0.95),
    (["free_play"], ["free_play"], 0.85),
    (["free_play"], ["unknown"], 0.55),
    (["free_play", "mains_hum"], ["free_play", "mains_hum"], 0.95),
    (["free_play", "mains_hum"], ["free_play"], 0.95),
    ([], [], 0.999),
    ([], ["mains_hum"], 0.65),
    (["unknown"], ["unknown"], 0.75),
    (["sensor_drift"], [], 0.999),
]


@pytest.fixture
def score():
    cases = tuple(
        case(f"c{i}", {**TRUTH, "effects": truth}, told(said, probability=p))
        for i, (truth, said, p) in enumerate(SAID)
    )
    return BlindScore(cases, (), "k", "a", None, True)


def test_counts_are_those_made_by_hand(score):
    exact = score.exact()
    assert exact["single"] == exact["single, 1 to 10"] == Proportion(2, 5)
    assert exact["pair"] == Proportion(1, 2)
    assert exact["none"] == Proportion(1, 2)
    assert exact["outside"] == Proportion(1, 1)
    assert exact["all"] == Proportion(5, 10)
    assert score.false_alarms() == Proportion(1, 2)
    assert score.missed() == Proportion(1, 8)
    assert score.pairs()["both"] == 1
    assert score.pairs()["one of them"] == 1
    assert score.confusion() == {
        "coulomb_friction": {"coulomb_friction": 1, "quadratic_damping": 1},
        "free_play": {"free_play": 1, "unknown": 1},
        "two or more": {"two or more": 1, "free_play": 1},
        "none": {"none": 1, "mains_hum": 1},
        "unknown": {"unknown": 1},
        "sensor_drift": {"none": 1},
    }
    assert score.closure()[0] == Proportion(3, 3)


def test_calibration_error_is_that_made_by_hand(score):
    # 0.9 to 1: six answers, three right. Alone in their bins: 0.85 and 0.75 right, 0.65 and 0.55 wrong.
    mean = (4 * 0.95 + 2 * 0.999) / 6
    expected = (6 * abs(0.5 - mean) + 0.15 + 0.25 + 0.65 + 0.55) / 10
    error, bins = score.calibration()
    assert math.isclose(error, expected, rel_tol=1e-12)
    assert sum(b.right.total for b in bins) == 10


def test_a_calibrated_answerer_has_no_calibration_error_but_chance():
    rng = np.random.default_rng(1)
    p = rng.uniform(0.5, 1.0, 20000)
    assert calibration(p, rng.random(p.size) < p)[0] < 0.02
    assert calibration(p, rng.random(p.size) < p - 0.1)[0] > 0.07
    assert calibration([], []) == (0.0, ())


def test_errors_of_coefficients_are_in_standard_deviations():
    said = document(["free_play"], cn=(0.4525, -0.124), std=(0.001, 0.001))
    one = case("c", {**TRUTH, "effects": ["free_play"]}, scored(said, "c.json"))
    beta, rate = one.error("cn_beta", "after"), one.error("cn_r", "before")
    assert (beta.stds, beta.share) == pytest.approx((2.5, 0.0025 / 0.45))
    assert (rate.stds, rate.share) == pytest.approx((-4.0, -0.004 / 0.12))
    found = {(e.group, e.name, e.when): e for e in BlindScore((one,), (), "", "", None, False).coefficients()}
    assert found["named rightly", "cn_beta", "after"].covered == Proportion(0, 1)
    assert found["named rightly", "cn_beta", "after"].rms_z == pytest.approx(2.5)
    said["coefficients"]["after"]["cn_beta"]["interval"] = [0.4499, 0.46]
    one = case("c", {**TRUTH, "effects": ["free_play"]}, scored(said, "c.json"))
    assert one.error("cn_beta", "after").covered


@pytest.mark.parametrize(("named", "cn_r"), [([], -0.21), (["unsteady_aero_lag"], -0.12)])
def test_without_a_named_lag_the_truth_is_the_derivative_in_phase(named, cn_r):
    """A lag of 0.2 l/V: Cnr − 0.2 Cnβ = −0.12 − 0.09."""
    truth = {
        **TRUTH,
        "effects": [],
        "small": ["unsteady_aero_lag"],
        "in_phase": {"cn_beta": 0.449, "cn_r": -0.21},
    }
    one = case("c", truth, told(named, cn=(0.45, cn_r), std=(0.001, 0.001)))
    assert one.error("cn_r", "after").stds == pytest.approx(0.0)


def test_a_rival_is_named_where_the_truth_is_among_those_not_distinguished():
    truth = {**TRUTH, "effects": ["free_play"]}
    assert case("c", truth, told(["cubic_stiffness"], rivals=["free_play"])).rival
    assert not case("c", truth, told(["cubic_stiffness"], rivals=["buffeting"])).rival
    assert not case("c", truth, told(["free_play"])).rival


def test_the_page_holds_every_figure_and_no_empty_cell_of_the_matrix(score):
    page = blind.markdown(score, "set")
    assert "| one effect | 2 | 5 | 40.0 % |" in page
    assert "## Confusion matrix" in page
    rows = [line for line in page.splitlines() if line.startswith("|")]
    for row in rows:
        assert row.count("|") == row.strip().count("|")
    matrix = page[page.index("## Confusion matrix") :].splitlines()
    cells = [
        line.split("|")[3:-1] for line in matrix if line.startswith("| ") and not line.startswith("| truth")
    ]
    counted = sum(int(cell) for row in cells for cell in row if cell.strip().isdigit())
    assert counted == len(SAID)
    json.dumps(score.to_json_dict(), allow_nan=False)


def test_times_are_on_the_page_where_they_are_known(score):
    """Linear interpolation between the order statistics: the 90th percentile of 1, 2, ..., 11 is 10."""
    title = "Seconds for each campaign"
    assert title not in [section.title for section in blind.sections(score)]
    timed = tuple(
        case(f"c{i}", {**TRUTH, "effects": []}, scored(document([]) | {"wall_s": float(i)}, ""))
        for i in range(1, 12)
    )
    (found,) = [s for s in blind.sections(BlindScore(timed, (), "", "", None, False)) if s.title == title]
    assert found.rows == (("6.0", "10.0", "11.0"),)


def test_answers_are_listed_by_truth_with_what_was_answered_otherwise(score):
    (found,) = [s for s in blind.sections(score) if s.title == "Answers by truth"]
    assert set(found.rows) == {
        ("coulomb_friction", "2", "1", "quadratic_damping 1"),
        ("free_play", "2", "1", "unknown 1"),
        ("two or more", "2", "1", "free_play 1"),
        ("none", "2", "1", "mains_hum 1"),
        ("unknown", "1", "1", ""),
        ("sensor_drift", "1", "0", "none 1"),
    }


@pytest.mark.parametrize(
    ("key", "value"),
    [("causes", 3), ("causes", [1]), ("causes", ...), ("candidates", [{"effect": "x"}]), ("candidates", 1),
     ("coefficients", {"before": {"cn_beta": {"value": "x", "std": 1.0}}}), ("coefficients", []), ("gap", None),
     ("gap", {"closed": "1"}), ("wall_s", "x"), ("ambiguous_with", None)],
)  # fmt: skip
def test_an_answer_of_another_kind_is_refused_where_it_is_read(key, value):
    good = document(["free_play"])
    spoilt = {name: one for name, one in good.items() if name != key} | ({} if value is ... else {key: value})
    said = scored(good, "c.json")
    with pytest.raises(TunnelError, match=r"c\.json: is not a"):
        scored(spoilt, "c.json")
    for truth in ({}, {"effects": 1}, {"effects": ["x"], "severity": "y"}, {"effects": [], "cn_r": []}):
        with pytest.raises(ValueError, match="validation error"):
            case("c", truth, said)
