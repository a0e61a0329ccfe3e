"""The benchmark of causes. Truth: a set of three campaigns of known causes, and answers worked out by hand."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from benchmarks.causes import make as making
from benchmarks.causes.__main__ import main
from benchmarks.causes.answer_file import read_answers
from benchmarks.causes.entry import NAMES, About, answer_all, answer_of, schema
from benchmarks.causes.entry_score import figures, likely_sets, score
from benchmarks.causes.make import CAMPAIGNS, KEY, check, data_hash, is_edition, make
from benchmarks.causes.page import page_text, read_results
from benchmarks.causes.tracks import EDITIONS, TRACKS, draw_all
from tests.marks import slow
from tests.reference.rigs import short_campaigns
from tunnel_sim.vocabulary.errors import TunnelError

EXAMPLES = Path(__file__).parents[3] / "benchmarks/causes/examples"
COUNTS = {"none": 1, "one": 2}
DRAWN = {1: "43527d67c87f6eb0", 2: "b06dd1b2966296ca"}


def made(folder, **more):
    with short_campaigns(sample_rate=500.0):
        make(folder, seed=3, counts=COUNTS, **more)
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return made(tmp_path_factory.mktemp("causes") / "set")


def perfect(small):
    truths = check(small)["truths"]
    return {
        name: {"campaign": name, **answer_of(t["effects"], dict.fromkeys(t["effects"], 1.0))}
        for name, t in truths.items()
    }


def test_the_published_set_has_every_effect_alone_and_its_tracks():
    drawn = draw_all(1, {name: track.count for name, track in TRACKS.items()})
    alone = {d.draw.effects[0].form.family for d in drawn if d.track == "one"}
    assert alone == set(NAMES)
    assert len(drawn) == 200
    assert len({d.name for d in drawn}) == 200
    for d in drawn:
        c = d.draw.conditions
        assert (c.time_scale != 1.0) == (d.track == "other_scales")
        assert (c.coloured_share > 0.0) == (d.track == "coloured_and_uneven")
        families = {e.form.family for e in d.draw.effects if not e.small}
        assert d.track != "random_moments" or families & {"buffeting", "vortex_shedding"}


@pytest.mark.parametrize("version", EDITIONS)
def test_forms_that_join_later_leave_the_draws_of_published_sets_alone(version):
    """Truth: the draws with which `make` simulates the campaigns of the published seal."""
    edition = EDITIONS[version]
    found = hashlib.sha256()
    for one in draw_all(edition.seed, edition.counts):
        effects = [(e.form.family, e.form.name, e.sign, f"{e.target:.9g}", e.small) for e in one.draw.effects]
        scatter = one.draw.scatter
        width = () if scatter is None else sorted((n, f"{w:.9g}") for n, w in scatter.widths.items())
        found.update(repr((one.name, one.track, effects, width, one.draw.seed)).encode())
    assert found.hexdigest()[:16] == DRAWN[version]


def test_the_second_version_has_runs_that_do_not_repeat():
    edition = EDITIONS[2]
    drawn = draw_all(edition.seed, edition.counts)
    assert len(drawn) == sum(edition.counts.values()) == 64
    for d in drawn:
        scatter, track = d.draw.scatter, edition.tracks[d.track]
        assert (scatter is not None) == track.scatter
        assert (d.draw.kind == "none") == (not d.draw.effects)
        if d.track == "scatter_alone":
            assert (scatter.level, scatter.form, scatter.stated) == ("usual", "normal", {})
        if d.track == "scatter_stated":
            assert scatter.stated
    alone = [d for d in drawn if d.track == "beside_scatter"]
    assert {d.draw.kind for d in alone} == {"single", "pair"}
    assert any(d.draw.scatter.stated for d in alone)
    assert not all(d.draw.scatter.stated for d in alone)


def scattering(folder):
    with short_campaigns(runs=3):
        make(
            folder, version=2, seed=3, counts={"scatter_alone": 2, "scatter_stated": 1, "runs_that_repeat": 1}
        )
    return folder


def test_scatter_is_scored_beside_the_causes(tmp_path):
    """An entry that knows the truth, one that takes scatter for a gap, and one that names scatter everywhere."""
    folder = scattering(tmp_path / "set")
    key = check(folder)
    assert key["made_with"]["version"] == 2
    truths = key["truths"]
    knows, gaps, everywhere = {}, {}, {}
    for name, truth in truths.items():
        width = {
            n: {"value": v, "interval_90": [0.5 * v, 2.0 * v], "named": True}
            for n, v in truth.get("scatter", {}).items()
        }
        unstated = {} if truth.get("repeatability") else width
        knows[name] = {"campaign": name, **answer_of(truth["effects"], {}), "scatter": unstated}
        gaps[name] = {"campaign": name, **answer_of(["unknown"], {"unknown": 1.0})}
        everywhere[name] = {
            "campaign": name,
            **answer_of(["wind_speed_scatter"], {"wind_speed_scatter": 1.0}),
        }
    found = score(folder, key, knows, "knows", About("knows", ""))
    jsonschema.validate(next(iter(knows.values())), schema())
    assert found["version"] == 2
    assert found["all"]["exact"]["count"] == 4
    told = found["scatter"]
    assert [told[name]["count"] for name in ("named_alone", "no_gap", "false_alarms")] == [2, 1, 0]
    assert told["by_number"]["all"]["within"]["count"] == told["by_number"]["all"]["named"]["count"] == 6
    found = score(folder, key, gaps, "gaps", About("gaps", ""))
    assert found["all"]["exact"]["count"] == 0
    assert found["scatter"]["named_alone"]["count"] == found["scatter"]["no_gap"]["count"] == 0
    for answer in everywhere.values():
        jsonschema.validate(answer, schema())
    found = score(folder, key, everywhere, "everywhere", About("everywhere", ""))
    told = found["scatter"]
    assert [told[name]["count"] for name in ("named_alone", "no_gap", "false_alarms")] == [2, 0, 1]
    page = page_text([found], "x.png", [found])
    assert "## Runs that do not repeat exactly" in page
    assert "| everywhere |" in page
    assert "do not repeat" not in page_text([found], "x.png")


def test_the_same_seed_makes_the_same_set_also_where_it_was_interrupted(small, tmp_path, monkeypatch):
    folder = tmp_path / "set"
    monkeypatch.setattr(making, "data_hash", lambda _path: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        made(folder)
    monkeypatch.undo()
    monkeypatch.setattr("tunnel_reference.make.simulate_set", lambda _draws: 1 / 0)  # nothing is made again
    made(folder)
    assert (folder / "seal.json").read_bytes() == (small / "seal.json").read_bytes()


def test_the_truth_is_in_the_key_only(small):
    for folder in (small / CAMPAIGNS).iterdir():
        assert {path.name for path in folder.iterdir()} == {"campaign.toml", "runs"}
    with pytest.raises(TunnelError, match="finished set"):
        make(small)


def test_changed_numbers_and_a_changed_key_are_noticed(small, tmp_path):
    folder = Path(shutil.copytree(small, tmp_path / "set"))
    one = sorted((folder / CAMPAIGNS).iterdir())[0]
    before = data_hash(one)
    text = (one / "campaign.toml").read_text()
    (one / "campaign.toml").write_text(text + "\n# touched\n")
    assert data_hash(one) != before
    with pytest.raises(TunnelError, match="not the campaign that was sealed"):
        check(folder)
    (one / "campaign.toml").write_text(text)
    (folder / KEY).write_text((folder / KEY).read_text().replace('"track"', '"trick"'))
    with pytest.raises(TunnelError, match="not the key that was sealed"):
        check(folder)


def test_a_perfect_entry_has_perfect_scores(small):
    found = score(small, check(small), perfect(small), "perfect", About("perfect", "the key"))
    assert found["all"]["exact"]["count"] == 3
    assert found["tracks"]["one"]["found"] == found["tracks"]["one"]["found"] | {"count": 2, "total": 2}
    assert found["all"]["false"]["count"] == 0
    assert found["all"]["covered"]["count"] == 3
    assert found["all"]["credible_size"] == 1.0
    assert found["all"]["log_score"] == pytest.approx(25 * np.log(0.99))


def test_wrong_and_missing_answers(small):
    answers = perfect(small)
    first = sorted(answers)[0]
    answers[first] = {"campaign": first, "causes": None, "probability": {}}
    found = score(small, check(small), answers, "one fails", About("", ""))
    assert found["all"]["exact"]["count"] == 2
    assert found["all"]["no_answer"] == 1
    partial = score(
        small, check(small), {first: answers[first]}, "partial", About("", "", not_seen=("none",))
    )
    assert partial["answered"] == 1
    assert "none" not in partial["tracks"]
    with pytest.raises(TunnelError, match="'nowhere', which is not in the set"):
        score(small, check(small), {"nowhere": answers[first]}, "", About("", ""))


def test_the_command_states_the_set_and_the_unanswered_and_refuses_with_status_2(small, tmp_path, capsys):
    answers = tmp_path / "mine"
    answers.mkdir()
    for name, answer in sorted(perfect(small).items())[1:]:
        (answers / f"{name}.json").write_text(json.dumps(answer))
    outs = [tmp_path / name for name in ("a.json", "b.json")]
    for out in outs:
        assert (
            main(["score", str(small), str(answers), "--out", str(out), "--program", "https://example.org"])
            == 0
        )
    assert outs[0].read_bytes() == outs[1].read_bytes()
    said = capsys.readouterr().out
    assert "not a published set" in said
    assert "Sets exact: 2 of 2 (95 %: 34 to 100 %)" in said
    assert "Not answered, not scored: 1 campaign (c0001)" in said
    assert json.loads(outs[0].read_text())["program"] == "https://example.org"
    (answers / "c0002.json").write_text("{}")
    assert main(["score", str(small), str(answers), "--out", str(tmp_path / "c.json")]) == 2
    assert not (tmp_path / "c.json").exists()
    assert len(capsys.readouterr().err.splitlines()) == 1
    file = tmp_path / "file"
    file.write_text("")
    for bad, message in (
        (["make", str(file), "--seed", "7"], "file"),
        (["make", "--seed", "7"], "name another"),
        (["make", str(tmp_path / "set"), "--tracks", "one=2"], "needs another seed"),
        (["make", str(tmp_path / "set"), "--seed", "7", "--tracks", "on=2"], "did you mean 'one'"),
        (["run", "lisdd", str(tmp_path / "nowhere")], "make the set first"),
        (
            ["score", str(small), str(answers), "--out", str(tmp_path / "no" / "x.json")],
            "its folder does not exist",
        ),
    ):
        assert main(bad) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
    for bad in (
        ["make", "--seed", "-3"],
        ["make", "x", "--seed", "7", "--tracks", "one"],
        ["run", "lisdd", "--first", "0"],
    ):
        with pytest.raises(SystemExit) as ended:
            main(bad)
        assert ended.value.code == 2


def test_a_set_of_another_seed_is_not_for_the_page(small, tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.causes.__main__.results_of", lambda _version: 1 / 0)
    folder = Path(shutil.copytree(small, tmp_path / "set"))
    assert main(["run", "always_unknown", str(folder)]) == 0
    written = json.loads((folder / "results" / "always_unknown.json").read_text())
    assert written["differing"] is None
    with pytest.raises(TunnelError, match="not a result on the published set, version 1"):
        read_results(folder / "results")


@pytest.mark.parametrize("version", EDITIONS)
def test_a_published_set_is_of_the_seed_and_the_counts_of_its_version(version):
    made_with = {"version": version, "seed": EDITIONS[version].seed, "counts": dict(EDITIONS[version].counts)}
    assert is_edition(json.loads(json.dumps(made_with)))
    assert not is_edition(made_with | {"seed": 7})
    assert not is_edition(made_with | {"counts": {"one": 2}})


def test_a_result_states_the_campaigns_that_differ_from_the_published_ones(small, tmp_path, monkeypatch):
    """Truth: the seal of the set itself is taken as the published one, with one hash changed."""
    seal = json.loads((small / "seal.json").read_text())
    first = sorted(seal["campaigns_sha256"])[0]
    monkeypatch.setattr("benchmarks.causes.entry_score.is_edition", lambda _made_with: True)
    monkeypatch.setattr("benchmarks.causes.entry_score.published", lambda _version: tmp_path / "seal.json")
    for changed in ({}, {first: "0"}):
        document = seal | {"campaigns_sha256": seal["campaigns_sha256"] | changed}
        (tmp_path / "seal.json").write_text(json.dumps(document))
        result = score(
            small, check(small), perfect(small), "ours", About("mine", "", program="https://example.org")
        )
        assert result["differing"] == list(changed)
        text = page_text([result], "")
        assert ("1 campaign differed" in text) == bool(changed)
        assert ("none of its campaigns differed" in text) != bool(changed)


def test_a_row_of_the_second_version_alone_is_described_with_its_program(small):
    result = score(
        small,
        check(small),
        perfect(small),
        "mine",
        About("mine", "its settings", program="https://example.org"),
    )
    ours = result | {"method": "ours", "title": "ours"}
    text = page_text([ours], "", [result | {"version": 2}])
    results = "../benchmarks/causes/results"
    assert (
        f"**mine** ([program](https://example.org), [result]({results}/v2/mine.json)): its settings." in text
    )
    assert (
        f"**ours** ([program](../benchmarks/causes/methods/ours.py), [result]({results}/ours.json))" in text
    )


def test_independent_causes_make_sets():
    sets = likely_sets({"probability": {"mains_hum": 0.9, "free_play": 0.4, "unknown": 0.1}})
    assert dict(sets) == pytest.approx(
        {
            ("mains_hum",): 0.9 * 0.9 * 0.6,
            ("free_play", "mains_hum"): 0.9 * 0.9 * 0.4,
            (): 0.9 * 0.1 * 0.6,
            ("free_play",): 0.9 * 0.1 * 0.4,
            ("unknown",): 0.1,
        }
    )
    assert [p for _, p in sets] == sorted((p for _, p in sets), reverse=True)


def test_a_sure_and_wrong_answer_is_counted_as_stated_wrongly():
    from benchmarks.causes.entry_score import as_case

    truth = {"effects": ["free_play"]}
    sure, unsure = (as_case("c", truth, answer_of(["mains_hum"], {"mains_hum": p})) for p in (0.99, 0.45))
    assert [sure.stated_wrongly, unsure.stated_wrongly] == [True, False]


def test_coefficients_count_within_two_standard_deviations(small):
    from benchmarks.causes.entry_score import as_case

    truth = next(t for t in check(small)["truths"].values() if not t["effects"])
    near = {"value": truth["cn_beta"] * 1.01, "std": truth["cn_beta"] * 0.006}
    far = {"value": truth["cn_beta"] * 1.01, "std": truth["cn_beta"] * 0.004}
    answers = [answer_of([], {}, coefficients={"before": {"cn_beta": far}, "after": {"cn_beta": near}})] * 2
    found = figures([as_case("c", truth, a) for a in answers])["coefficients"]
    assert found["cn_beta before"]["within_2_std"]["count"] == 0
    assert found["cn_beta after"]["within_2_std"]["count"] == 2
    assert found["cn_beta after"]["median_relative_error"] == pytest.approx(0.01)


@pytest.mark.parametrize(
    "command", [[sys.executable, "entry.py"], [sys.executable, "learned.py"], slow(["sh", "entry.sh"])]
)
def test_the_examples_write_valid_answers(small, tmp_path, command):
    training = [str(small)] if command[1] == "learned.py" else []
    subprocess.run(
        [command[0], str(EXAMPLES / command[1]), *training, str(small / CAMPAIGNS), str(tmp_path / "a")],
        check=True,
    )
    found = read_answers(tmp_path / "a")
    assert set(found) == set(check(small)["truths"])
    for answer in found.values():
        jsonschema.validate(answer, schema())
    out = tmp_path / "score.json"
    assert main(["score", str(small), str(tmp_path / "a"), "--title", "mine", "--out", str(out)]) == 0
    assert json.loads(out.read_text())["title"] == "mine"


@pytest.mark.parametrize("method", ["spike_and_slab", "lisdd", "nearest_template", "always_unknown"])
def test_methods_write_valid_answers_and_continue(small, tmp_path, method):
    import importlib

    module = importlib.import_module(f"benchmarks.causes.methods.{method}")
    assert answer_all(module.answer, small / CAMPAIGNS, tmp_path, first=2) == 2
    assert answer_all(module.answer, small / CAMPAIGNS, tmp_path) == 1
    for answer in read_answers(tmp_path).values():
        jsonschema.validate(answer, schema())
        assert answer["causes"] is not None, answer


def test_the_page_says_first_where_another_method_is_ahead(small):
    answers = perfect(small)
    best = score(small, check(small), answers, "best", About("best", ""))
    worst = {name: {**a, "causes": ["unknown"]} for name, a in answers.items()}
    ours = score(small, check(small), worst, "ours", About("tunnel diagnose", ""))
    text = page_text([{**best, "scored": "2026-11-02"}, {**ours, "scored": "2026-10-30"}], "figure.png")
    assert "from answers scored from 30 October 2026 to 2 November 2026;" in text
    assert text.index("**best** has more exact sets: 3 against 0") < text.index("## Sets exactly right")
    first = next(name for name, truth in check(small)["truths"].items() if truth["track"] == "none")
    part = score(small, check(small), {first: answers[first]}, "part", About("part", ""))
    said = page_text([part, ours], "figure.png")
    assert "**part** is ahead on *none*: 1 against 0 of 1 that both answered." in said
    assert "On the 1 campaigns that both answered it has 1 exact sets, and `tunnel diagnose` 0." in said
    assert "No other method is ahead" in page_text(
        [score(small, check(small), answers, "ours", About("", ""))], ""
    )


def test_the_published_metadata_belongs_to_the_published_seal():
    folder = EXAMPLES.parent / "v1"
    seal = (folder / "seal.json").read_bytes()
    croissant = json.loads((folder / "croissant.json").read_text())
    assert croissant["distribution"][0]["sha256"] == hashlib.sha256(seal).hexdigest()
    assert len(json.loads(seal)["campaigns_sha256"]) == 206
    for path in (EXAMPLES.parent / "results").glob("*.json"):
        assert json.loads(path.read_text())["key_sha256"] == json.loads(seal)["key_sha256"], path


def test_each_cause_in_mjcf_is_its_equation(small):
    """Moments of the compiled model at one state, against the equations of docs/reference/effects.md."""
    import mujoco

    from benchmarks.causes.mjcf import _XML, BOUNDS, NOMINAL, ToolboxRig

    c0001 = ToolboxRig(small / CAMPAIGNS / "c0001")
    trial = next(t for t in c0001.trials if t.speed)
    angle, rate, share = 0.2, -1.5, 0.25
    swing, inertia, omega = c0001.swing, c0001.inertia, c0001.omega
    k, ka = trial.spring, trial.wind * trial.speed * c0001.cn["cn_beta"]
    ca = trial.wind * c0001.length * c0001.cn["cn_r"]

    def moment(**causes):
        spec = mujoco.MjSpec.from_string(_XML.format(step=0.001))
        model = c0001.write(spec, trial, dict.fromkeys(NOMINAL, 0.0) | causes)
        data = mujoco.MjData(model)
        data.qpos[0], data.qvel[0], data.ctrl[:] = angle, rate, (1.0, share)
        mujoco.mj_forward(model, data)
        return float(data.qacc[0]) * (inertia + float(model.dof_armature[0])), float(data.sensordata[0])

    p = 0.01  # one hundredth of each scale
    offset = 1.0 + p * c0001.fastest / trial.speed
    expected = {
        "coulomb_friction": p * inertia * omega**2 * swing,
        "quadratic_damping": p * inertia / swing * rate**2,
        "structural_damping": -p * np.sqrt(k * inertia) * rate,
        "cubic_stiffness": -p * k / swing**2 * angle**3,
        "asymmetric_stiffness": -p * k / swing * angle**2,
        "free_play": k * p * swing,
        "rod_flexibility": k * (1.0 - 1.0 / (1.0 + p * k / c0001.springs[-1])) * angle,
        "sensor_clipping": 0.0,
        "nonlinear_yaw_moment": ka * p / swing**2 * angle**3,
        "wind_speed_drift": p * share * (2.0 * ka * angle + ca * rate),
        "unsteady_aero_lag": 0.0,
        "flow_misalignment": ka * p * swing,
        "wind_speed_offset": ka * (offset**2 - 1.0) * angle + ca * (offset - 1.0) * rate,
        "gravity x": -p * inertia * omega**2 * np.sin(angle),
        "gravity y": p * inertia * omega**2 * np.cos(angle),
        f"spring {k:g}": -p * k * angle,
    }
    nominal, _ = moment()
    assert nominal == pytest.approx((ka - k) * angle + (ca - c0001.damping) * rate, rel=1e-9)
    assert set(BOUNDS) <= set(expected)
    for name, value in expected.items():
        # MuJoCo's dry friction is soft: at this rate 0.1 % short
        assert moment(**{name: 1.0})[0] - nominal == pytest.approx(value, rel=3e-3, abs=1e-9 * k), name
    assert moment(sensor_clipping=50.0)[1] == pytest.approx(min(angle, 0.5 * swing))
    spec = mujoco.MjSpec.from_string(_XML.format(step=0.001))
    lagging = c0001.write(spec, trial, dict.fromkeys(NOMINAL, 0.0) | {"unsteady_aero_lag": 1.0})
    assert float(lagging.dof_armature[0]) == pytest.approx(0.01 * inertia)


def test_the_toolbox_fits_the_nominal_model_within_the_noise(small):
    from benchmarks.causes.methods.mujoco_sysid import coefficients
    from benchmarks.causes.mjcf import NOMINAL, ToolboxRig

    truths = check(small)["truths"]
    name = next(n for n, t in truths.items() if t["track"] == "none")
    found = ToolboxRig(small / CAMPAIGNS / name)
    fit = found.fit((), NOMINAL, np.zeros(len(NOMINAL) + 2 * len(found.trials)))
    assert fit.chi2 / fit.residuals.size < 1.15
    for which, given in coefficients(found, fit).items():
        assert abs(given["value"] - truths[name][which]) < 4.0 * given["std"]
