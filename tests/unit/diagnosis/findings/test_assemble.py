"""The answer as data: every kind of answer is a document of the published schema."""

import json
from dataclasses import replace
from functools import cache, partial

import jsonschema
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from diagnosis import _diagnose
from diagnosis._diagnose import diagnose, vocabulary
from diagnosis.answer.held_out import excess_base
from diagnosis.compose import Question, composed
from diagnosis.confirmed import Confirmed
from diagnosis.diagnosable import Chosen
from diagnosis.findings.candidates import candidates
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.investigate import investigate
from tests.marks import slow
from tests.support import gap_campaigns
from tests.support.gap_campaigns import FOUR, INTERVAL, answer, with_blow
from tunnel_lab.commands.about import schema_of
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

DURATION = 6.0
campaign = partial(gap_campaigns.campaign, duration=DURATION, conditions=FOUR)
NAMES = [kind.name for kind in ALL_EFFECTS]
FEW = vocabulary(
    ["quadratic_damping", "coulomb_friction", "sensor_drift", "mains_hum", "sensor_quantisation"]
)
TIME = INTERVAL * np.arange(round(DURATION / INTERVAL))


def checked(answer):
    """The answer, which has the published schema and a distribution of probabilities."""
    document = json.loads(json.dumps(answer.to_json_dict(), allow_nan=False))
    jsonschema.Draft202012Validator(schema_of("diagnosis")).validate(document)
    probabilities = [candidate["probability"] for candidate in document["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert abs(sum(probabilities) - 1.0) < 1e-12
    return answer


def answer_of(found):
    """The answer of a study whose campaign is taken as it is."""
    data = found.campaign
    chosen = Chosen(data, data, found.model, (), (), (), limit_cycles=False)
    return composed(Confirmed.of(found), chosen, Question(None, (), (), lambda _: None)).in_words()


def answered(found):
    """The answer of a study."""
    return checked(answer_of(found))


def hum(amplitude):
    return amplitude * np.sin(2.0 * np.pi * 50.0 * TIME + 0.4)


def coarse(data, step):
    """The same campaign read with a step coarser than stated."""
    runs = tuple(
        replace(run, record=Record(run.record.time_s, step * np.round(run.record.yaw_rad / step)))
        for run in data.runs
    )
    return replace(data, runs=runs, sensor=replace(data.sensor, resolution=5.1e-4))


def normalised(effect=None):
    """Two runs of one rig in still air that state no stiffness."""
    runs = tuple(
        replace(campaign(effect, seed=seed).runs[0], id=f"n{seed}", spring_stiffness=None) for seed in (3, 4)
    )
    data = campaign(effect)
    return replace(data, runs=runs, sensor=replace(data.sensor, noise_std=None))


QUADRATIC = effect_from("quadratic_damping", {"coefficient": 0.004})
CASES = {
    "no gap": (campaign, []),
    "named": (lambda: campaign(QUADRATIC), ["quadratic_damping"]),
    "pair": (
        lambda: campaign(QUADRATIC, added=3e-3 * np.linspace(0.0, 1.0, TIME.size)),
        ["quadratic_damping", "sensor_drift"],
    ),
    "unknown": (lambda: with_blow(campaign(), 0.01, 4.0), ["unknown"]),
    "hum only": (lambda: campaign(added=hum(1e-3)), ["mains_hum"]),
    "coarse step only": (lambda: coarse(campaign(), 2e-3), ["sensor_quantisation"]),
    "hum and an effect": (lambda: campaign(QUADRATIC, added=hum(1e-3)), ["mains_hum", "quadratic_damping"]),
    "normalised, no gap": (normalised, []),
    "normalised, named": (lambda: normalised(QUADRATIC), ["quadratic_damping"]),
}


@pytest.mark.usefixtures("causes_alone")
def test_runs_that_are_no_decays_have_no_trade_off_and_no_caveat_on_causes():
    data = campaign(QUADRATIC)
    few, all_runs = (investigate(replace(data, runs=runs), ()) for runs in (data.runs[:2], data.runs))
    for cycles in (True, False):
        chosen = Chosen(few.campaign, few.campaign, few.model, (), (), (), limit_cycles=cycles)
        question = Question(None, (), (), lambda _: None)
        answer = composed(Confirmed.of(few), chosen, question)
        assert ("few runs" in [fact.kind for fact in answer.found.cautions]) is not cycles
        assert answer.trade_off is None or not cycles
        assert (composed(Confirmed.of(all_runs), chosen, question).repeatability is None) is cycles


@cache
def named():
    """The answer that names one effect, the progress that was reported, and the study."""
    steps, studies = [], []

    def studied(*given, **options):
        studies.append(investigate(*given, **options))
        return studies[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_diagnose, "investigate", studied)
        answer = diagnose(campaign(QUADRATIC), kinds=FEW, progress=steps.append)
    return answer, steps, studies[0]


_LONG = ("no gap", "pair", "hum only", "hum and an effect", "coarse step only", "normalised, named")


@pytest.mark.parametrize("name", [slow(name) if name in _LONG else name for name in CASES])
def test_every_kind_of_answer_is_a_document_of_the_schema(name, request):
    if name == "unknown":
        request.getfixturevalue("causes_alone")
    make, causes = CASES[name]
    data = make()
    document = checked(named()[0] if name == "named" else diagnose(data, kinds=FEW))
    assert list(document.causes) == causes
    assert [run.id for run in document.gap.runs] == [run.id for run in data.runs]
    expected = {"omega_n", "zeta"} if name.startswith("normalised") else {"cn_beta", "cn_r"}
    assert set(document.coefficients.before) == set(document.coefficients.after) == expected
    if causes and causes != ["unknown"]:
        assert document.gap.closed > 0.9
        assert document.gap.excess_after < 0.1 * document.gap.excess_before
        if len(causes) == 1:  # two causes of different channels have none in common
            assert document.where.channel is not None
        # one gap: that of the waterfall
        assert document.gap.excess_before == document.waterfall.steps[0].excess
        assert document.gap.excess_after == document.waterfall.steps[-1].excess
    else:
        assert document.gap.closed == 0.0
        assert document.gap.excess_after == document.gap.excess_before
        assert [run.after for run in document.gap.runs] == [run.before for run in document.gap.runs]
    if not causes:
        assert abs(document.gap.excess_before) < 0.1
        assert document.by_run is None


def finely(data, noise, effect=QUADRATIC):
    """The same motions read at 1 kHz, with noise of their own."""
    rng = np.random.default_rng(5)
    fine = np.arange(4 * TIME.size) * INTERVAL / 4.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gap_campaigns, "NOISE", 1e-12)
        quiet = campaign(effect)
    runs = []
    for run, clean in zip(data.runs, quiet.runs, strict=True):
        smooth = CubicSpline(TIME, clean.record.yaw_rad)(fine)
        runs.append(replace(run, record=Record(fine, smooth + rng.normal(0.0, noise, fine.size))))
    sensor = replace(data.sensor, sample_rate=4.0 / INTERVAL, noise_std=None)
    return replace(data, runs=tuple(runs), sensor=sensor)


@pytest.fixture(scope="module")
def found():
    return named()[2]


@pytest.mark.slow
def test_the_excess_is_of_samples_whatever_the_blocks():
    """Four samples to a block: its mean has four times the samples' excess."""
    coarse = campaign(QUADRATIC)
    one, other = (
        checked(diagnose(data, kinds=FEW)).gap.excess_before for data in (coarse, finely(coarse, 4e-4))
    )
    assert other == pytest.approx(one, rel=0.1)


@pytest.mark.slow
def test_rivals_are_named_with_the_run_that_would_distinguish_them(found):
    first, second = (found.of([name]) for name in ("quadratic_damping", "coulomb_friction"))
    assert first.hypothesis is not None
    assert second.hypothesis is not None
    torn = replace(
        found,
        answers=(
            replace(first, share=0.0, probability=0.6),
            replace(second, share=0.01, probability=0.3),
            answer(("unknown",), 0.33, 0.1),
        ),
    )
    document = answered(torn)
    assert list(document.ambiguous_with) == ["coulomb_friction"]
    assert document.next_run is not None
    assert document.next_run.separation > 0.0
    sure = answered(found)
    assert (sure.ambiguous_with, sure.next_run) == ((), None)
    # not knowing which is paid for in the interval
    assert document.coefficients.after["cn_r"].std > sure.coefficients.after["cn_r"].std


def quiet(effect=None):
    """A campaign without any noise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gap_campaigns, "NOISE", 1e-15)
        data = campaign(effect)
    return replace(data, sensor=replace(data.sensor, noise_std=None))


@pytest.mark.parametrize(("effect", "causes"), [(None, []), slow(QUADRATIC, ["quadratic_damping"])])
def test_records_without_noise_are_answered_with_a_status(effect, causes):
    answer = diagnose(quiet(effect), kinds=FEW)
    document = checked(answer)
    assert list(document.causes) == causes
    assert answer.noise.source == "floor"
    assert any("is used instead" in text for text in answer.cautions)
    assert all(0.0 <= p <= 1.0 for p in answer.gap.tests.values())
    if not causes:
        assert answer.gap.p_value == 1.0


def test_the_probability_in_words_is_that_of_the_first_candidate(found):
    answer = named()[0]
    assert f"(probability {100.0 * answer.candidates[0].probability:.0f} %)" in answer.verdict
    doubtful = replace(found, gap=replace(found.gap, test=replace(found.gap.test, p_value=9e-4)))
    (none,) = [c for c in candidates(doubtful, excess_base(doubtful)) if c.effect == "none"]
    assert none.probability == pytest.approx(9e-4 / 1.0009)
    read_off = replace(doubtful, prepared=replace(doubtful.prepared, coarse=True))
    (none,) = [c for c in candidates(read_off, excess_base(read_off)) if c.effect == "none"]
    assert none.probability == 0.0


@pytest.mark.slow
def test_noise_that_misbehaves_is_unknown_once():
    """Every effect is weighed, and none explains noise that swells with the rate."""
    rng = np.random.default_rng(8)
    data = finely(campaign(), 4e-4, None)

    def louder(record):
        level = 1e-3 * np.abs(np.gradient(record.yaw_rad, record.time_s))
        return Record(record.time_s, record.yaw_rad + level * rng.normal(size=level.size))

    data = replace(data, runs=tuple(replace(run, record=louder(run.record)) for run in data.runs))
    document = checked(diagnose(data, kinds=FEW))
    assert list(document.causes) == ["unknown"]


def test_the_chosen_fit_is_that_of_the_answer(found):
    assert found.chosen.problem.effects == (effect_class("quadratic_damping"),)
    hypothesis = found.of(["quadratic_damping"]).hypothesis
    assert isinstance(hypothesis, Hypothesis)
    assert found.chosen is hypothesis.fit
    lost = replace(found, answers=(answer(("unknown",), 1.0, 1.0),))
    assert lost.chosen is found.nominal
    assert lost.causes == ("unknown",)


def test_progress_is_reported_and_steps_are_timed():
    answer, steps, _ = named()
    assert {"noise", "nominal fit", "effects", "quadratic_damping"} <= set(steps)
    assert set(answer.seconds) >= {"noise", "nominal fit", "effects"}
    assert all(seconds >= 0.0 for seconds in answer.seconds.values())


@pytest.mark.usefixtures("causes_alone")
def test_effects_that_are_withheld_are_not_answered_with():
    data = campaign(added=hum(1e-3))
    answer = diagnose(data, kinds=vocabulary(["quadratic_damping", "coulomb_friction"]))
    assert "mains_hum" not in answer.causes
    assert {c.effect for c in answer.candidates} <= {
        "quadratic_damping", "coulomb_friction", "coulomb_friction + quadratic_damping", "unknown", "none"
    }  # fmt: skip


def test_vocabularies():
    assert [kind.name for kind in vocabulary()] == NAMES
    assert [kind.name for kind in vocabulary(["free_play", "buffeting"], ["buffeting"])] == ["free_play"]
    with pytest.raises(TunnelError, match="no effect is left"):
        vocabulary(["free_play"], ["free_play"])
    with pytest.raises(TunnelError, match="did you mean 'free_play'"):
        vocabulary(["free_pley"])
