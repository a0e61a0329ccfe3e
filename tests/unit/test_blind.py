"""Blind sets: sealed, answered once, resumed, verified and counted. Truth: hand-made sets and hand counts."""

from __future__ import annotations

import hashlib
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from diagnosis import result
from diagnosis.blind import answer, answer_set, answers_folder, make_blind, score_set
from diagnosis.blind.cases import case
from diagnosis.blind.score import Score
from diagnosis.blind.statistics import Share, calibration
from tests.reference.rigs import rig
from tests.unit.gone_reader import unheard
from tunnel_lab.cli import main
from tunnel_lab.diagnosis_view import blind_page
from tunnel_reference import draw
from tunnel_reference.draw import Mixture
from tunnel_sim.files.campaign_io import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three campaigns of four short runs, made once; tests copy it."""
    c = rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35,) * 4)
    folder = tmp_path_factory.mktemp("blind") / "set"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draw, "draw_conditions", lambda _rng: c)
        make_blind(
            folder,
            count=3,
            seed=5,
            shares={"single": 2.0, "none": 1.0},
            mixture=Mixture(variety=0.0, small=0.0),
        )
    return folder


@pytest.fixture
def blind(made, tmp_path):
    import shutil

    return Path(shutil.copytree(made, tmp_path / "set"))


def append(path, text):
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


def document(causes, *, probability=0.9, closed=0.99, rivals=(), cn=(0.45, -0.12), std=(0.001, 0.001)):
    """A diagnosis with given causes, as its JSON."""
    name = " + ".join(causes) or "none"
    values = {
        k: result.ParameterEstimate(v, s, "1/rad")
        for k, v, s in zip(("cn_beta", "cn_r"), cn, std, strict=True)
    }
    return result.Diagnosis(
        "c", tuple(causes), "words",
        result.GapSummary(bool(causes), 2.0, 0.1, closed, result.HELD_OUT, (), 0.001, 0.5),
        result.Where(None, None), (result.Candidate(name, probability, 0.1, closed),), tuple(rivals), None,
        result.Coefficients(values, values), result.Confirmation(True, 0.0, "r01", 0.0, 1e-5),
        result.NoiseSummary(5e-4, None, "estimated", ""),
    ).to_json_dict()  # fmt: skip


@pytest.fixture
def quick(monkeypatch):
    """Diagnoses that take no time: the cause is always dry friction; campaigns diagnosed are listed."""
    seen = []

    class Found:
        def to_json_dict(self):
            return document(["coulomb_friction"])

    def diagnose(campaign, kinds):
        seen.append((campaign.name, {kind.name for kind in kinds}))
        return Found()

    monkeypatch.setattr(answer, "diagnose", diagnose)
    return seen


def test_truth_lies_in_the_key_only(blind):
    key = json.loads((blind / "key.json").read_text())
    assert set(key["truths"]) == {"c0001", "c0002", "c0003"}
    assert sorted(len(truth["effects"]) for truth in key["truths"].values()) == [0, 1, 1]
    for name in key["truths"]:
        files = {path.relative_to(blind / name).parts[0] for path in (blind / name).rglob("*")}
        assert files == {"campaign.toml", "runs"}
        assert len(read_campaign(blind / name).runs) == 4
    published = (blind / "seal.json").read_text()
    for word in (key["salt"], '"seed"', "effects", "cn_beta"):
        assert word not in published


def test_the_published_hash_is_that_of_the_salted_key(blind):
    seal = json.loads((blind / "seal.json").read_text())
    content = (blind / "key.json").read_bytes()
    assert hashlib.sha256(content).hexdigest() == seal["key_sha256"]
    salt = json.loads(content)["salt"]
    assert len(bytes.fromhex(salt)) == 32
    other = content.replace(salt.encode(), b"0" * 64)
    assert hashlib.sha256(other).hexdigest() != seal["key_sha256"]


def test_the_same_seed_gives_the_same_campaigns_under_another_salt(made, tmp_path, monkeypatch):
    c = rig((21.02, 67.98, 21.02, 67.98), (0.0, 0.0, 25.0, 15.0), (0.35,) * 4)
    monkeypatch.setattr(draw, "draw_conditions", lambda _rng: c)
    key = make_blind(
        tmp_path / "b", count=3, seed=5, shares={"single": 2.0, "none": 1.0},
        mixture=Mixture(variety=0.0, small=0.0), key=tmp_path / "away.json",
    )  # fmt: skip
    assert key == tmp_path / "away.json"
    assert not (tmp_path / "b" / "key.json").exists()
    one, two = (json.loads(p.read_text()) for p in (made / "key.json", key))
    assert one["truths"] == two["truths"]
    assert one["salt"] != two["salt"]
    for name in one["truths"]:
        a, b = read_campaign(made / name), read_campaign(tmp_path / "b" / name)
        assert all(
            np.array_equal(x.record.yaw_rad, y.record.yaw_rad) for x, y in zip(a.runs, b.runs, strict=True)
        )


def test_an_interrupted_making_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(*_args, **_kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("diagnosis.blind.make.simulate_set", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make_blind(tmp_path / "set", count=1, seed=1)
    assert list(tmp_path.iterdir()) == []


def test_a_set_is_not_made_over_another(blind):
    with pytest.raises(TunnelError, match="exists already"):
        make_blind(blind, count=1, seed=1)


def test_answering_goes_on_where_it_was_interrupted(blind, quick, monkeypatch):
    whole = answer.diagnose

    def second_time(campaign, kinds):
        if len(quick) == 1:
            raise KeyboardInterrupt
        return whole(campaign, kinds)

    monkeypatch.setattr(answer, "diagnose", second_time)
    with pytest.raises(KeyboardInterrupt):
        answer_set(blind)
    assert [name for name, _ in quick] == ["c0001"]
    first = (blind / "answers" / "c0001.json").read_bytes()
    told = []
    monkeypatch.setattr(answer, "diagnose", whole)
    answer_set(blind, progress=lambda *args: told.append(args))
    assert [name for name, _ in quick] == ["c0001", "c0002", "c0003"]
    assert (blind / "answers" / "c0001.json").read_bytes() == first
    assert told == [(1, 3, ""), (2, 3, "c0002"), (3, 3, "c0003")]
    assert {p.name for p in (blind / "answers").iterdir()} == {
        "c0001.json",
        "c0002.json",
        "c0003.json",
        "seal.json",
    }


@pytest.mark.usefixtures("quick")
def test_answering_never_opens_the_key(blind):
    (blind / "key.json").unlink()
    assert len(answer_set(blind)) == 64


def test_a_campaign_that_cannot_be_diagnosed_is_a_wrong_answer(blind, monkeypatch):
    def fails(_campaign, kinds):
        raise TunnelError(f"{len(kinds)} effects do not help")

    monkeypatch.setattr(answer, "diagnose", fails)
    answer_set(blind)
    score = score_set(blind)
    assert score.exact()["all"] == Share(0, 3)
    assert {name for row in score.confusion().values() for name in row} == {"no answer"}
    assert "do not help" in (blind / "answers" / "c0002.json").read_text()


@pytest.mark.slow
def test_processes_give_the_answers_of_one(blind, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    exclude = ("buffeting",)
    alone = [
        answer.answer_campaign(blind / name, exclude)[1]["causes"] for name in ("c0001", "c0002", "c0003")
    ]
    answer_set(blind, excluded=exclude, jobs=2)
    folder = answers_folder(blind, exclude)
    assert folder.name == "answers-without-buffeting"
    assert [json.loads((folder / f"c000{i}.json").read_text())["causes"] for i in (1, 2, 3)] == alone


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (
            lambda f: (f / "key.json").write_text((f / "key.json").read_text().replace("single", "Single")),
            "key",
        ),
        (lambda f: append(f / "c0001" / "campaign.toml", "#"), "not the campaign that was sealed"),
        (lambda f: append(f / "answers" / "c0001.json", " "), "not the answer that was given"),
        (lambda f: (f / "answers" / "seal.json").unlink(), "answer the set first"),
        (lambda f: (f / "key.json").unlink(), "--key"),
        (lambda f: (f / "c0001").rename(f / "c0009"), "no answer"),
    ],
)
def test_nothing_is_scored_that_is_not_as_sealed(blind, spoil, complaint):
    answer_set(blind)
    assert len(score_set(blind).cases) == 3
    spoil(blind)
    with pytest.raises(TunnelError, match=complaint):
        score_set(blind)


@pytest.mark.usefixtures("quick")
def test_a_changed_answer_is_not_gone_on_from(blind):
    answer_set(blind)
    (blind / "answers" / "c0001.json").write_text("{}")
    with pytest.raises(TunnelError, match="not the answer that was given"):
        answer_set(blind)


def test_withheld_effects_are_withheld_and_their_truth_is_unknown(blind, quick):
    truths = json.loads((blind / "key.json").read_text())["truths"]
    hidden = next(truth["effects"][0] for truth in truths.values() if truth["effects"])
    answer_set(blind, excluded=(hidden,))
    assert all(hidden not in kinds for _, kinds in quick)
    score = score_set(blind, excluded=(hidden,))
    assert [c.truth for c in score.cases if c.kind == "withheld"] == [("unknown",)]
    with pytest.raises(TunnelError, match="--exclude rod_flexibility"):
        score_set(blind, excluded=("rod_flexibility",))


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
        case(f"c{i}", {**TRUTH, "effects": truth}, document(said, probability=p))
        for i, (truth, said, p) in enumerate(SAID)
    )
    return Score(cases, (), "k", "a", {}, True)


def test_counts_are_those_made_by_hand(score):
    exact = score.exact()
    assert exact["single"] == exact["single, 1 to 10"] == Share(2, 5)
    assert exact["pair"] == Share(1, 2)
    assert exact["none"] == Share(1, 2)
    assert exact["outside"] == Share(1, 1)
    assert exact["all"] == Share(5, 10)
    assert score.false_alarms() == Share(1, 2)
    assert score.missed() == Share(1, 8)
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
    assert score.closure()[0] == Share(3, 3)


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


def test_wilsons_interval_is_the_published_one():
    # R. G. Newcombe, Stat. Med. 17 (1998) 857–872, table I, method 3: 81/263, 15/148, 0/20, 1/29.
    for count, total, low, high in ((81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611),
                                    (1, 29, 0.0061, 0.1718)):  # fmt: skip
        assert np.allclose(Share(count, total).interval, (low, high), atol=5e-5)


def test_errors_of_coefficients_are_in_standard_deviations():
    said = document(["free_play"], cn=(0.4525, -0.124), std=(0.001, 0.001))
    one = case("c", {**TRUTH, "effects": ["free_play"]}, said)
    assert np.allclose(one.error("cn_beta", "after"), (2.5, 0.0025 / 0.45))
    assert np.allclose(one.error("cn_r", "before"), (-4.0, -0.004 / 0.12))
    found = {(e.group, e.name, e.when): e.within for e in Score((one,), (), "", "", {}, False).coefficients()}
    assert found["named rightly", "cn_beta", "after"] == Share(1, 1)
    assert found["named rightly", "cn_r", "after"] == Share(0, 1)


def test_a_rival_is_named_where_the_truth_is_among_those_not_told_apart():
    truth = {**TRUTH, "effects": ["free_play"]}
    assert case("c", truth, document(["cubic_stiffness"], rivals=["free_play"])).rival
    assert not case("c", truth, document(["cubic_stiffness"], rivals=["buffeting"])).rival
    assert not case("c", truth, document(["free_play"])).rival


def test_the_page_holds_every_figure_and_no_empty_cell_of_the_matrix(score):
    page = blind_page.markdown(score, "set")
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


def test_the_commands_agree_with_one_another(blind, quick, capsys, tmp_path):
    assert main(["blind", "diagnose", str(blind)]) == 0
    told = capsys.readouterr().out
    assert len(quick) == 3
    sealed = hashlib.sha256((blind / "answers" / "seal.json").read_bytes()).hexdigest()
    assert sealed in told
    page, figures = tmp_path / "page.md", tmp_path / "score.json"
    assert unheard("blind", "score", blind, "--markdown", page, "--json", figures) == 0
    assert page.exists()
    assert figures.exists()
    words = ["blind", "score", str(blind), "--markdown", str(page), "--json", str(figures)]
    assert main([*words, "--figure", str(tmp_path / "f.png")]) == 0
    drawn = {path.name for path in tmp_path.iterdir() if path.stem.startswith("f")}
    assert drawn == {"f.png", "f.pdf", "f-confusion.png", "f-confusion.pdf"}
    assert {"](f.png)", "](f-confusion.png)"} <= set(re.findall(r"\]\(f.*?\)", page.read_text("utf-8")))
    out = capsys.readouterr().out
    for text in (sealed, "verified", "Causes exactly right", "Calibration", "Seconds"):
        assert text in out
        assert text in page.read_text(encoding="utf-8") or text == "verified"
    assert json.loads(figures.read_text())["sealed"] is True


def test_an_open_set_is_scored_and_said_to_be_open(blind, quick, capsys):
    truths = json.loads((blind / "key.json").read_text())["truths"]
    for name, truth in truths.items():
        (blind / name / "truth.json").write_text(json.dumps({"effects": truth["effects"]}))
    (blind / "key.json").unlink()
    (blind / "seal.json").unlink()
    assert main(["blind", "diagnose", str(blind)]) == 0
    assert main(["blind", "score", str(blind)]) == 0
    assert len(quick) == 3
    assert "not a blind test" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["make", "SET", "--seed", "1", "--kinds", "singel"], "did you mean 'single'?"),
        (["make", "SET", "--seed", "1"], "exists already"),
        (["make", "new", "--seed", "1", "--key", "no/key.json"], "its folder does not exist"),
        (["diagnose", "nowhere"], "holds no campaign"),
        (["diagnose", "SET", "--exclude", "mains_hmu"], "did you mean 'mains_hum'?"),
        (["score", "SET"], "answer the set first"),
        (["score", "SET", "--markdown", "no/page.md"], "its folder does not exist"),
        (
            ["score", "SET", "--figure", "a.jpg"],
            "--figure a.jpg: is not a .png; name a file that ends in .png",
        ),
    ],
)
def test_bad_input_is_one_line(blind, capsys, words, part):
    assert main(["blind", *(str(blind) if word == "SET" else word for word in words)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert part in captured.err


@pytest.mark.parametrize("name", ["seal.json", "key.json", "answers/seal.json", "answers/c0001.json"])
@pytest.mark.parametrize(
    "content", ["[" * 100_000, "{}", "[]", '{"answers_sha256": [], "truths": [1]}', "\ud800"]
)
@pytest.mark.usefixtures("quick")
def test_a_malformed_document_is_one_line(blind, capsys, name, content):
    assert main(["blind", "diagnose", str(blind)]) == 0
    (blind / name).write_text(content, encoding="utf-8", errors="surrogatepass")
    capsys.readouterr()
    assert main(["blind", "score", str(blind)]) == 2
    assert capsys.readouterr().err.startswith("tunnel: ")


@pytest.mark.parametrize(
    ("key", "value"),
    [("causes", 3), ("causes", [1]), ("causes", ...), ("candidates", [{"effect": "x"}]), ("candidates", 1),
     ("coefficients", {"before": {"cn_beta": {"value": "x", "std": 1.0}}}), ("coefficients", []), ("gap", None),
     ("gap", {"closed": "1"}), ("wall_s", "x"), ("ambiguous_with", None)],
)  # fmt: skip
def test_an_answer_of_another_kind_is_refused_where_it_is_read(key, value):
    good = document(["free_play"])
    spoilt = {name: one for name, one in good.items() if name != key} | ({} if value is ... else {key: value})
    case("c", {**TRUTH, "effects": ["free_play"]}, good)
    with pytest.raises(ValueError, match="validation error"):
        case("c", {**TRUTH, "effects": ["free_play"]}, spoilt)
    for truth in ({}, {"effects": 1}, {"effects": ["x"], "severity": "y"}, {"effects": [], "cn_r": []}):
        with pytest.raises(ValueError, match="validation error"):
            case("c", truth, good)
