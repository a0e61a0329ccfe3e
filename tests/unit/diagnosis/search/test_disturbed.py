"""A run that was disturbed is named, and nothing that all runs have in common accuses one.

Truth: blows in closed form, and blows, pushes and bumps beside causes from the reference simulator.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.by_hand import ByHand
from diagnosis.diagnosable import choose
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.verdict import headline, verdict
from diagnosis.search import disturbed as disturbed_runs
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.disturbed import beyond_the_others, disturbances, undisturbed
from diagnosis.search.investigate import nominal_study
from diagnosis.settings import Settings
from diagnosis.where.jumps import Jumps, jumps
from identification.examination.examine import examine
from identification.status import Outcome
from tests.marks import slow
from tests.support.diagnosis_document import document, findings_of
from tests.support.gap_campaigns import campaign, nominal, with_blow
from tunnel_reference.disturbance import FORMS
from tunnel_reference.draw import CampaignDraw, EffectDraw, draw_conditions
from tunnel_reference.forms import forms_of
from tunnel_reference.make import as_campaign
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_sim.effects import Effect, effect_class, effect_from, known_effects
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout", "with_odd_runs")

CHOSEN = Settings().selection
FEW = tuple(map(effect_class, ("coulomb_friction", "cubic_stiffness")))
FOREIGN = Path(__file__).parents[3] / "data" / "foreign"


def reference(*effects: EffectDraw, seed: int = 5) -> Campaign:
    """Twelve runs of the reference simulator with effects of given sizes."""
    conditions = dataclasses.replace(draw_conditions(np.random.default_rng(2)), duration=8.0)
    draw = CampaignDraw("none", conditions, effects, seed)
    (motion,) = simulate_motions([draw])
    return as_campaign(read_and_fit(draw, motion), "reference")


def disturbance(form: str, size: float, at: float = 4.0, run: int = 5) -> EffectDraw:
    shape, length = FORMS[form]
    return EffectDraw(shape, {"run": float(run), "at": at, "length": length}, 1, 1.0, size)


def cause(name: str, size: float) -> EffectDraw:
    return EffectDraw(forms_of(name)[0], {}, 1, 1.0, size)


def accused(data: Campaign) -> tuple[Disturbance, ...]:
    return disturbances(data, nominal(data))


@pytest.mark.parametrize(("run", "impulse"), [("r1", 5e-3), ("r6", 0.02)])
def test_a_blow_to_one_run_is_found_at_its_instant(run: str, impulse: float) -> None:
    (found,) = accused(with_blow(campaign(), impulse, 4.0, run))
    assert found.run == run
    assert found.at_s == pytest.approx(4.0, abs=0.1)
    assert found.kept_until_s is not None
    assert found.kept_until_s < 4.0
    assert found.p_value < CHOSEN.disturbed_rate


def test_a_disturbance_is_stated_by_the_clock_of_its_file(tmp_path: Path) -> None:
    """One file of a logger that was switched on 37.25 s before the release."""
    run = with_blow(campaign(), 0.02, 4.0, "r6").runs[5]
    text = "\n".join(
        f"{t + 37.25:.3f},{y:.8f}" for t, y in zip(run.record.time_s, run.record.yaw_rad, strict=True)
    )
    others = campaign().runs[:5]
    (tmp_path / "logged.csv").write_text(f"time_s,yaw_rad\n{text}\n")
    (read,) = read_records([tmp_path / "logged.csv"]).campaign.runs
    assert read.record.time_s[0] == 0.0
    conditions = {"id": "r6", "spring_stiffness": run.spring_stiffness, "air_density": run.air_density}
    logged = dataclasses.replace(read, wind_speed=run.wind_speed, **conditions)
    data = dataclasses.replace(campaign(), runs=(*others, logged))
    (found,) = accused(data)
    assert found.run == "r6"
    assert found.at_s == pytest.approx(41.25, abs=0.1)
    assert found.kept_until_s is not None
    kept = undisturbed(data, (found,)).runs[5]
    assert kept.record.time_s[-1] + 37.25 == pytest.approx(found.kept_until_s, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["blow", "push", "bump"])
def test_friction_does_not_hide_a_disturbance(form: str) -> None:
    size = {"blow": 0.15, "push": 0.015, "bump": 0.005}[form]
    friction = cause("coulomb_friction", 0.006)
    (found,) = accused(reference(friction, disturbance(form, size)))
    assert found.run == "r06"
    assert found.at_s == pytest.approx(4.0, abs=0.4)


def test_a_blow_to_every_run_accuses_none() -> None:
    assert accused(with_blow(campaign(), 5e-3, 4.0)) == ()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("coulomb_friction", {"friction_moment": 0.01}),
        slow("cubic_stiffness", {"coefficient": 0.5}),
        ("dropped_samples", {"lost_time": 0.01}),
        slow("second_mode", {"amplitude": 0.005, "frequency": 25.0, "damping_ratio": 0.01}),
        slow("free_play", {"half_width": 0.004}),
        ("sensor_clipping", {"limit": 0.25}),
    ],
)
def test_what_acts_in_all_runs_accuses_none(name: str, values: dict[str, float]) -> None:
    effect: Effect = effect_from(name, values)
    assert accused(campaign(effect, seed=1)) == ()


@pytest.mark.parametrize("seeds", [range(2), slow(range(2, 8))])
def test_runs_without_a_gap_accuse_none(seeds: range) -> None:
    for seed in seeds:
        assert accused(campaign(seed=seed, duration=6.0)) == ()


def test_scatter_between_runs_is_no_disturbance() -> None:
    """A frequency and a damping of its own are a difference of the whole run."""
    data = campaign()
    odd = campaign(damping=0.012).runs[3]
    record = odd.record
    faster = np.interp(1.01 * record.time_s, record.time_s, record.yaw_rad)
    runs = (*data.runs[:3], dataclasses.replace(odd, record=Record(record.time_s, faster)), *data.runs[4:])
    assert accused(dataclasses.replace(data, runs=runs)) == ()


def drawn(rng: np.random.Generator, count: int, size: float = 1.0) -> list[Jumps]:
    """Runs that jump by chance alone, all of one size."""
    return [
        Jumps(f"r{number}", np.arange(80.0), (drop := size * rng.chisquare(2.0, 80)), np.exp(-0.5 * drop))
        for number in range(count)
    ]


@pytest.mark.parametrize("count", [3, 6, 12])
@pytest.mark.parametrize("size", [1.0, 30.0])
def test_false_alarms_are_as_rare_as_stated(count: int, size: float) -> None:
    """Also where all runs jump by more than chance, as with a cause that jumps."""
    rng = np.random.default_rng(7)
    loose = dataclasses.replace(CHOSEN, disturbed_rate=0.05)
    alarms = sum(bool(beyond_the_others(drawn(rng, count, size), loose)) for _ in range(400))
    assert alarms <= 33  # 20 are expected at most, and 33 exceeded once in 400


def test_two_of_twelve_do_not_hide_each_other() -> None:
    runs = drawn(np.random.default_rng(3), 12)
    for place in (2, 7):
        drop = runs[place].drop.copy()
        drop[30] = 900.0
        runs[place] = dataclasses.replace(runs[place], drop=drop, chance=np.exp(-0.5 * drop))
    found = beyond_the_others(runs, CHOSEN)
    assert {name for name, _ in found} == {"r2", "r7"}
    assert beyond_the_others(runs[2:4], CHOSEN) == []  # two runs do not say which of them is disturbed


def test_a_run_ends_at_its_disturbance_or_is_left_out() -> None:
    data = campaign()
    late, early = Disturbance("r2", 5.0, 4.5, 1e-9), Disturbance("r3", 1.0, None, 1e-9)
    kept = undisturbed(data, (late, early))
    assert [run.id for run in kept.runs] == ["r1", "r2", "r4", "r5", "r6"]
    assert kept.runs[1].record.time_s[-1] == pytest.approx(4.5, abs=0.005)
    assert kept.runs[0] is data.runs[0]


def test_a_blow_soon_after_the_release_leaves_the_run_out() -> None:
    (found,) = accused(with_blow(campaign(), 5e-3, 1.6, "r1"))
    assert (found.run, found.kept_until_s) == ("r1", None)
    assert found.at_s == pytest.approx(1.6, abs=0.2)


@pytest.mark.slow
def test_the_causes_beside_a_blow_are_those_planted() -> None:
    found = diagnose(read_campaign(FOREIGN / "disturbed")).to_json_dict()
    assert (found["causes"], found["decided"]) == (["coulomb_friction", "cubic_stiffness"], True)
    assert [one["run"] for one in found["disturbed"]] == ["r07"]
    assert found["verdict"].startswith("Run r07 was disturbed at 5.4")
    cubic, dry, repeat, *_ = next_steps(findings_of(found))  # the causes first
    assert cubic.startswith("Model the spring's cubic stiffness")
    assert dry.startswith("Reduce the dry friction")
    assert repeat.startswith("Repeat run r07, which was disturbed at 5.4")
    truth = {"coulomb_friction.friction_moment": 0.004, "cubic_stiffness.coefficient": 0.03}
    for name, value in truth.items():
        given = found["candidates"][0]["parameters"][name]
        assert given["value"] == pytest.approx(value, abs=3.0 * given["std"])


def test_a_blow_is_not_taken_for_a_clock_that_drifts() -> None:
    """The phase over the run is as well fitted by a parabola in time as by a jump."""
    conditions = [(spring, speed) for spring in (16.12, 21.02, 44.84) for speed in (0.0, 15.0, 25.0)]
    struck = with_blow(campaign(seed=0, conditions=conditions), 8e-3, 2.1, "r1")
    assert not any(remark.outcome is Outcome.REFUSED for remark in examine(struck).remarks)
    chosen = choose(struck, known_effects())
    assert [one.run for one in nominal_study(chosen.campaign, chosen.kinds).disturbed] == ["r1"]


def test_without_a_cause_there_is_no_gap_beside_the_blow() -> None:
    found = diagnose(with_blow(campaign(), 5e-3, 4.0, "r2"), kinds=FEW).to_json_dict()
    assert found["causes"] == []
    assert headline(findings_of(found)) == ("No gap; run r2 disturbed", "none")
    assert not found["gap"]["detected"]


def test_by_hand_the_same_runs_are_used() -> None:
    struck = with_blow(campaign(), 5e-3, 4.0, "r2")
    assert nominal(struck).excess > 1.0
    assert ByHand(struck).closure(()).before < 0.1


def test_the_words_say_what_is_left_out_and_what_to_do() -> None:
    one = {"run": "run_7", "at_s": 5.04321, "kept_until_s": None, "p_value": 1e-9, "used": False}
    given = document() | {"disturbed": [one, one | {"run": "r8", "kept_until_s": 4.5}]}
    assert headline(findings_of(given))[0].endswith("; runs run_7, r8 disturbed")
    assert [step for step in next_steps(findings_of(given)) if step.startswith("Repeat")] == [
        "Repeat run run_7, which was disturbed at 5.043 s: all its readings then count.",
        "Repeat run r8, which was disturbed at 5.043 s: all its readings then count.",
    ]


def test_a_run_without_which_the_model_is_not_determined_is_used_and_named(monkeypatch) -> None:
    first = disturbed_runs.prepared_and_tested

    def of_all_runs_only(given, *rest):
        if len(given.runs) < 6 or any(run.record.time_s[-1] < 6.5 for run in given.runs):
            raise TunnelError("cannot fit", where="runs", remedy="add runs")
        return first(given, *rest)

    monkeypatch.setattr(disturbed_runs, "prepared_and_tested", of_all_runs_only)
    struck = with_blow(campaign(), 5e-3, 4.0, "r2")
    assert max(run.record.time_s[-1] for run in struck.runs) > 6.5
    found = diagnose(struck, kinds=FEW).to_json_dict()
    (one,) = found["disturbed"]
    assert (one["run"], one["kept_until_s"], one["used"]) == ("r2", None, True)
    words = verdict(findings_of(found), "")
    assert "It is used nevertheless, because the other runs do not determine the model." in words


def test_rows_too_few_for_the_harmonics_are_not_judged() -> None:
    data = campaign(duration=10.0)
    thin = dataclasses.replace(
        data,
        runs=tuple(
            dataclasses.replace(run, record=Record(run.record.time_s[::40], run.record.yaw_rad[::40]))
            for run in data.runs
        ),
        sensor=dataclasses.replace(data.sensor, sample_rate=data.sensor.sample_rate / 40.0),
    )
    assert jumps(nominal(thin)) == []
