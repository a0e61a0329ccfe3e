"""A run that differs from the others is left out and named, unless it stands alone or a cause explains all runs.

Truth: decays of the same rig, of which one was held at its start, or read by a filtered or clipped sensor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lfilter_zi

from diagnosis import diagnose
from diagnosis.findings.disturbed_runs import disturbed_step, disturbed_words, odd_runs
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.verdict import headline
from diagnosis.result import Diagnosis
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.disturbed import disturbances, undisturbed
from diagnosis.search.investigate import investigate, nominal_study
from diagnosis.search.odd_run import replaceable
from identification.show.quantity import Quantity
from tests.marks import slow
from tests.support.diagnosis_document import findings_of
from tests.support.gap_campaigns import INTERVAL, NOISE, campaign, nominal
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout", "with_odd_runs")

FEW = tuple(map(effect_class, ("coulomb_friction", "cubic_stiffness", "buffeting")))


def spoilt(data: Campaign, run: str, change: Callable[[Array], Array]) -> Campaign:
    """The campaign with other readings of one run."""
    runs = []
    for one in data.runs:
        yaw = change(one.record.yaw_rad) if one.id == run else one.record.yaw_rad
        runs.append(replace(one, record=Record(INTERVAL * np.arange(yaw.size), yaw)))
    return replace(data, runs=tuple(runs))


def held(yaw: Array) -> Array:
    """Held for 0.3 s after the record begins."""
    noise = np.random.default_rng(1).normal(0.0, NOISE, 75)
    return np.concatenate([0.35 + noise, yaw])


def filtered(yaw: Array) -> Array:
    """Low-passed at 4 Hz."""
    numerator, denominator = butter(2, 2.0 * 4.0 * INTERVAL)
    return np.asarray(lfilter(numerator, denominator, yaw, zi=lfilter_zi(numerator, denominator) * yaw[0])[0])


def settled(yaw: Array) -> Array:
    """Low-passed, from a second after the release on, so that the filter's transient is over."""
    return filtered(yaw)[round(1.0 / INTERVAL) :]


def clipped(yaw: Array) -> Array:
    return np.clip(yaw, -0.2, 0.2)


@pytest.fixture(scope="module")
def plain() -> Campaign:
    return campaign(duration=7.0)


@pytest.mark.parametrize("change", [filtered, slow(clipped)])
def test_without_the_odd_run_there_is_no_gap(plain: Campaign, change: Callable[[Array], Array]) -> None:
    found = nominal_study(spoilt(plain, "r5", change), FEW)
    assert [(one.run, one.at_s) for one in found.disturbed] == [("r5", None)]
    assert not found.gap.test.detected
    assert found.disturbed[0].p_value < found.settings.selection.disturbed_rate


def test_of_a_held_start_the_free_motion_is_kept(plain: Campaign) -> None:
    found = nominal_study(spoilt(plain, "r5", held), FEW)
    (one,) = found.disturbed
    assert (one.run, one.at_s) == ("r5", None)
    assert not found.gap.test.detected
    assert one.kept_from_s is not None
    assert 0.3 <= one.kept_from_s < 1.3
    kept = next(run for run in found.campaign.runs if run.id == "r5")
    assert kept.record.time_s[0] >= one.kept_from_s


def test_a_hold_of_more_than_a_cycle_is_left_out_whole(plain: Campaign) -> None:
    """Beside a cause, which hides a run that differs as a whole."""
    friction = campaign(effect_from("coulomb_friction", {"friction_moment": 0.003}), duration=6.0)

    def still(yaw: Array) -> Array:
        return np.concatenate([np.full(round(0.8 / INTERVAL), yaw[0]), yaw])

    for data in (plain, friction):
        (one,) = disturbances(spoilt(data, "r2", still), nominal(spoilt(data, "r2", still)))
        assert one.run == "r2"
        assert one.kept_from_s is None or one.kept_from_s >= 0.8
    assert disturbances(friction, nominal(friction)) == ()


def test_a_start_that_is_used_nevertheless_is_not_said_to_be_left_out() -> None:
    words = disturbed_words(Disturbance("r2", None, None, 1e-5, used=True, kept_from_s=0.8), no_gap=False)
    assert words.startswith("Run r2 does not move as the others do at its start. It is used nevertheless")
    assert "not used" not in words
    whole = disturbed_words(Disturbance("r2", None, None, 1e-5), no_gap=False)
    assert whole.startswith("Run r2 differs from the others. It is not used.")
    late = Disturbance("r3", None, None, 1e-5, kept_from_s=0.8)
    assert odd_runs([replace(late, run="r2", used=True), late]) == (
        "; the start of run r3 not used; run r2 differs from the others"
    )


def test_a_run_that_differs_is_said_with_its_own_frequency_and_damping() -> None:
    odd = Disturbance(
        "r2", None, None, 1e-5, frequency=Quantity(-0.0025, 0.0001, "1"), damping=Quantity(0.01, 0.01, "1")
    )
    linear, other = (
        replace(odd, as_they=True),
        "Run r2 differs from the others, and not in frequency and damping alone.",
    )
    assert disturbed_words(linear, no_gap=False) == (
        "Run r2 differs from the others: its frequency is 0.250 ± 0.010 % lower than the model of the others "
        "predicts. It is not used."
    )
    assert disturbed_words(odd, no_gap=False).startswith(other)
    assert "its spring, its clock" in disturbed_step(linear).what
    assert "its release, its unit" in disturbed_step(odd).what


def test_a_run_alone_at_its_spring_or_without_wind_is_not_odd(plain: Campaign) -> None:
    kept = replace(plain, runs=(*plain.runs[:3], plain.runs[4]))
    assert replaceable(nominal(kept).problem.data) == [1, 2]
    assert nominal_study(spoilt(kept, "r5", settled), FEW).disturbed == ()
    assert replaceable(nominal(replace(plain, runs=plain.runs[:2])).problem.data) == []


def test_a_cause_of_all_runs_accuses_none() -> None:
    """One run alone swings far enough for the cubic spring: without it there is no gap."""
    cubic = campaign(effect_from("cubic_stiffness", {"coefficient": 0.3}), duration=6.0)
    rng, zero = np.random.default_rng(4), 0.001
    small = [
        replace(run, record=Record(run.record.time_s, zero + 0.05 * (run.record.yaw_rad - zero) + own))
        for run in campaign(duration=6.0).runs
        for own in [rng.normal(0.0, NOISE, run.record.yaw_rad.size)]
    ]
    found = investigate(replace(cubic, runs=(*small[:4], cubic.runs[4], small[5])), FEW, rivals=())
    assert found.disturbed == ()
    assert found.causes == ("cubic_stiffness",)
    assert found.single == {"cubic_stiffness": "r5"}
    assert found.answer is not None
    assert found.answer.probability < 0.95


def test_a_run_that_spoils_the_fit_of_two_causes_is_left_out() -> None:
    """The limit of all runs is far from the limit of the others: no fit that starts there comes down to chance."""
    causes = {"sensor_clipping": {"limit": 0.25}, "coulomb_friction": {"friction_moment": 0.003}}
    data = campaign(*(effect_from(name, given) for name, given in causes.items()), duration=6.0)
    amplified = spoilt(data, "r5", lambda yaw: yaw / 1.3)
    found = investigate(amplified, tuple(map(effect_class, causes)), rivals=())
    assert [(one.run, one.left_out) for one in found.disturbed] == [("r5", True)]
    assert found.causes == tuple(sorted(causes))


@pytest.fixture(scope="module")
def answer(plain: Campaign) -> Diagnosis:
    return diagnose(spoilt(plain, "r5", clipped), kinds=FEW, rivals=())


def test_the_words_name_the_odd_run(answer: Diagnosis) -> None:
    document = answer.to_json_dict()
    assert headline(answer) == ("No gap; run r5 differs from the others", "none")
    assert answer.verdict.startswith(
        "Run r5 differs from the others, and not in frequency and damping alone. Without it there is no gap"
    )
    assert next_steps(answer)[0].startswith("Repeat run r5, which differs from the others")
    assert document["disturbed"][0]["at_s"] is None
    part = document | {"disturbed": [document["disturbed"][0] | {"kept_from_s": 0.4}]}
    assert next_steps(findings_of(part))[0].startswith(
        "Look at the release of run r5, whose free motion begins only at 0.4 s: "
    )


def test_an_odd_run_is_left_out_or_its_start(plain: Campaign, answer: Diagnosis) -> None:
    (odd,) = answer.disturbed
    assert odd.left_out
    assert "r5" not in [run.id for run in undisturbed(plain, [odd]).runs]
    begun = replace(odd, kept_from_s=1.0)
    assert undisturbed(plain, [begun]).runs[4].record.time_s[0] == pytest.approx(1.0)
