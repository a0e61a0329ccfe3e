"""Blind sets: sealed, answered once, resumed and verified. Truth: hand-made sets."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from identification.statistics import Proportion
from tests.reference.rigs import short_campaigns
from tests.support.gone_reader import unheard
from tests.unit.tunnel_lab.experiments.blind.test_set_score import document
from tunnel_lab.cli import main
from tunnel_lab.experiments.blind import answer_set, make_blind, score_set, sets
from tunnel_lab.experiments.blind import answers as answer
from tunnel_reference.draw import Mixture
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.vocabulary.errors import TunnelError

SET = {
    "count": 3, "seed": 5, "shares": {"single": 2.0, "none": 1.0}, "mixture": Mixture(variety=0.0, small=0.0),
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three campaigns of four short runs, made once; tests copy it."""
    folder = tmp_path_factory.mktemp("blind") / "set"
    with short_campaigns():
        make_blind(folder, **SET)
    return folder


def test_scatter_is_in_the_key_and_what_is_known_of_it_in_the_campaigns(tmp_path):
    mixture = Mixture(textbook=1.0, variety=0.0, scatter=1.0, level="usual", stated=1.0)
    with short_campaigns(runs=3):
        key = make_blind(tmp_path / "set", count=2, seed=5, shares={"none": 1.0}, mixture=mixture)
    document = json.loads(key.read_text())
    assert {document["made_with"][name] for name in ("scatter", "scatter_level", "stated")} == {1.0, "usual"}
    for name, truth in document["truths"].items():
        assert truth["effects"] == []
        assert truth["scatter"] == {
            "wind_speed": 0.003,
            "spring_stiffness": 0.0005,
            "mechanical_damping": 0.01,
        }
        assert list(truth["runs"]) == ["r01", "r02", "r03"]
        stated = read_campaign(tmp_path / "set" / name).repeatability
        assert stated is not None
        assert stated.stated == truth["repeatability"] == truth["scatter"]


@pytest.fixture
def blind(made, tmp_path):
    import shutil

    return Path(shutil.copytree(made, tmp_path / "set"))


def append(path, text):
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


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


def test_the_same_seed_gives_the_same_campaigns_under_another_salt(made, tmp_path):
    with short_campaigns():
        key = make_blind(tmp_path / "b", **SET, key=tmp_path / "away.json")
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


def test_a_campaign_that_the_reader_refuses_is_drawn_again(tmp_path, monkeypatch):
    written = []

    def refuses_the_first(campaign, folder):
        written.append(campaign)
        if len(written) == 1:
            raise TunnelError("about 1.3 cycles of oscillation, fewer than three")
        return write_campaign(campaign, folder)

    monkeypatch.setattr("tunnel_lab.experiments.blind.sets.write_campaign", refuses_the_first)
    with short_campaigns():
        key = make_blind(tmp_path / "set", **SET | {"count": 1, "shares": {"single": 1.0}})
    first, second = (campaign.runs[0].record.yaw_rad for campaign in written)
    assert not np.array_equal(first, second)
    assert np.array_equal(read_campaign(tmp_path / "set" / "c0001").runs[0].record.yaw_rad, second)
    assert list(json.loads(key.read_text())["truths"]) == ["c0001"]


def test_a_set_is_not_made_over_another(blind):
    with pytest.raises(TunnelError, match="exists already"):
        make_blind(blind, count=1, seed=1)


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
    assert score.exact()["all"] == Proportion(0, 3)
    assert {name for row in score.confusion().values() for name in row} == {"no answer"}
    assert "do not help" in (blind / "answers" / "c0002.json").read_text()


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
        (lambda f: (f / "c0001").rename(f / "c0009"), "without an answer"),
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


def test_the_commands_agree_with_one_another(blind, quick, capsys, tmp_path):
    assert main(["blind", "diagnose", str(blind)]) == 0
    printed = capsys.readouterr().out
    assert len(quick) == 3
    sealed = hashlib.sha256((blind / "answers" / "seal.json").read_bytes()).hexdigest()
    assert sealed in printed
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


def test_half_of_the_campaigns_scatter_unless_said_otherwise(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sets, "simulate_set", lambda *_, **__: [])
    for words, made in (
        ([], (0.5, "mixed", 0.5, 0.5)),
        (["--scatter", "0"], (0.0, "mixed", 0.5, 0.5)),
        (["--scatter", "1", "--scatter-level", "usual", "--scatter-normal", "1", "--stated", "0"],
         (1.0, "usual", 1.0, 0.0)),
    ):  # fmt: skip
        folder = tmp_path / str(made)
        assert (
            main(["blind", "make", str(folder), "--count", "2", "--seed", "1", "--kinds", "none", *words])
            == 0
        )
        said = json.loads((folder / "key.json").read_text())["made_with"]
        assert tuple(said[n] for n in ("scatter", "scatter_level", "scatter_normal", "stated")) == made
    said = capsys.readouterr()
    assert f"key.json is the truth: move it out of {folder} before you hand the folder out" in said.out
    named = shlex.quote(str(folder))
    assert f"Next: tunnel blind diagnose {named}, then tunnel blind score {named}\n" in said.out
    assert main(["blind", "make", str(tmp_path / "x"), "--seed", "1", "--scatter", "1.5"]) == 2


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["make", "SET", "--seed", "1", "--kinds", "singel"], "did you mean 'single'?"),
        (["make", "SET", "--seed", "1"], "exists already"),
        (["make", "new", "--seed", "1", "--key", "no/key.json"], "its folder does not exist"),
        (["diagnose", "nowhere"], "does not contain a campaign"),
        (["diagnose", "SET", "--exclude", "mains_hmu"], "did you mean 'mains_hum'?"),
        (["score", "SET"], "answer the set first"),
        (["score", "SET", "--markdown", "no/page.md"], "its folder does not exist"),
        (
            ["score", "SET", "--figure", "a.jpg"],
            "a.jpg: does not end in .png; name a file that ends in .png, the format that is written",
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
