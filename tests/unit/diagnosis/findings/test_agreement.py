"""No sentence of an answer contradicts another: verdict, place and probability follow one judgement."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import pytest

from diagnosis import diagnose
from diagnosis.findings.decision import Predictions, decision
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.verdict import headline, verdict
from diagnosis.settings import Settings
from diagnosis.where.described import judged
from diagnosis.where.place import locate
from tests.support.contradictions import contradictions
from tests.support.diagnosis_document import document, findings_of
from tests.support.gap_campaigns import campaign as gap_campaign
from tests.support.gap_campaigns import nominal
from tests.support.rendered import place_rows, where_words
from tunnel_sim.effects import BetweenRuns, Effect, effect_class, effect_from, known_effects
from tunnel_sim.effects.random_moments import RandomMoment

ROOT = Path(__file__).parents[4]
FIGURES = {"from_s": 1.0, "to_s": 2.0, "frequency_hz": 2.0, "runs": 2, "run": "beta"}
CHANNELS = (None, "stiffness", "damping", "forcing", "sensor")
OF_CHANNEL = ("blow", "damping along the decay", "frequency between runs", "harmonics")
WINDS = {"always": "wind-off runs show it", "wind_on": "wind-off runs show none"}


def answered(
    names: tuple[str, ...], channel: str | None, reason: str, condition: str, probability: float = 0.9
) -> dict[str, Any]:
    """The document of causes beside a place."""
    one, kinds = (
        document() | {"maps": None},
        [effect_class(name) for name in names],
    )  # no sentence reads the maps
    against = judged(channel, reason, kinds, scattering=False)
    place = one["found"]["place"] | vars(against) | {"compared": list(names)}
    place |= {"channel": {"kind": reason, **FIGURES}, "condition": {"kind": WINDS[condition], **FIGURES}}
    one["found"] |= {"place": place, "both_winds": True}
    one["where"] |= {"channel": channel, "condition": condition}
    answers = [(" + ".join(names), probability), ("unknown", 1.0 - probability)]
    decided = decision(answers, Settings().answer, Predictions(elsewhere=against.elsewhere)).to_json_dict()
    one["candidates"] = [{"effect": name, "probability": value, "parameters": {}} for name, value in answers]
    return one | {"causes": list(names), "ambiguous_with": []} | decided


def printed(one: dict[str, Any]) -> str:
    found = findings_of(one)
    rows = " ".join(f"{label}: {value}." for label, value in place_rows(found))
    return f"{verdict(found, '')} Where: {where_words(found)} {rows} {' '.join(next_steps(found))}"


def sets() -> Iterator[tuple[tuple[type[Effect], ...], int]]:
    """Every effect and pairs of neighbours, and how many reasons to try: all with one effect of each place.

    Every third pair will do: nearly all have two channels or two winds.
    """
    kinds = [kind for kind in known_effects() if not issubclass(kind, BetweenRuns)]
    of_place = {(kind.channel, kind.condition, issubclass(kind, RandomMoment)): kind for kind in kinds}
    yield from (((kind,), 4 if kind in of_place.values() else 1) for kind in kinds)
    yield from ((pair, 1) for pair in islice(pairwise(kinds), 0, None, 3))


def test_no_place_contradicts_decided_causes() -> None:
    """With every place, reason and wind."""
    faults, undecided = set(), 0
    for kinds, reasons in sets():
        names = tuple(kind.name for kind in kinds)
        for channel in CHANNELS:
            for reason in OF_CHANNEL[:reasons]:
                for condition in WINDS:
                    one = answered(names, channel, reason, condition)
                    undecided += not one["decided"]
                    faults |= {(names, channel, reason, fault) for fault in contradictions(one, printed(one))}
    assert not faults
    assert undecided > 100


def test_causes_that_do_not_agree_with_the_place_are_undecided_between_them_and_a_look_at_the_runs() -> None:
    one = answered(("cubic_stiffness",), "forcing", "blow", "always", 0.97)
    assert (one["decided"], one["unpredictive"]) == (False, "cubic_stiffness")
    assert [doubt["kind"] for doubt in one["doubts"]] == ["elsewhere"]
    assert headline(findings_of(one)) == ("Undecided: cubic stiffness, and more", "open")
    said = verdict(findings_of(one), "")
    assert "explain the gap" not in said
    assert "Cubic stiffness fits best, but the residuals point elsewhere: look at runs " in said
    steps = " ".join(next_steps(findings_of(one)))
    assert "Look at runs " in steps
    assert "Do not repair the rig on this answer" in steps
    agreed = answered(("cubic_stiffness",), "stiffness", "frequency along the decay", "always", 0.97)
    assert (agreed["decided"], agreed["doubts"]) == (True, [])


@pytest.mark.parametrize("reason", ["frequency along the decay", "damping along the decay"])
def test_a_random_moment_may_shift_frequency_and_damping(reason: str) -> None:
    """It changes both along the decay of every run by chance, so such a place does not speak against it."""
    channel = reason.split()[0].replace("frequency", "stiffness")
    for name in ("buffeting", "ambient_vibration"):
        one = answered((name,), channel, reason, "wind_on", 0.97)
        assert one["decided"]
        assert "It looks like a change of the" in where_words(findings_of(one))
        assert not contradictions(one, printed(one))
    assert not answered(("buffeting",), "sensor", "harmonics", "wind_on", 0.97)["decided"]


def test_a_gap_whose_rest_could_change_the_coefficients_is_not_immaterial() -> None:
    one = answered(("cubic_stiffness",), "stiffness", "frequency along the decay", "always")
    one["found"]["immaterial"] = {"cn_beta": 1e-4, "cn_r": 1e-4}
    one["rest"]["material"] = False
    assert "The gap is immaterial" not in verdict(findings_of(one), "")  # it may change Cnr by 4.6 %
    one["rest"]["moves"]["cn_r"]["std"] = 0.002
    assert "The gap is immaterial" in verdict(findings_of(one), "")
    one["rest"]["material"] = True
    assert "The gap is immaterial" not in verdict(findings_of(one), "")
    assert not contradictions(one, printed(one))


ALONE = [
    k for k in known_effects() if not (issubclass(k, BetweenRuns) or k.driven or issubclass(k, RandomMoment))
]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ALONE, ids=lambda kind: kind.name)
@pytest.mark.parametrize("size", [1.0, 0.3])
def test_the_place_does_not_contradict_the_true_cause(kind: type[Effect], size: float) -> None:
    """Every effect alone, at a visible size and at a third of it."""
    values = dict(zip((info.name for info in kind.parameters()), kind.example, strict=False))
    values[kind.parameters()[0].name] *= size
    data = gap_campaign(effect_from(kind.name, values), duration=8.0, seed=5)
    place = locate(data, nominal(data))
    assert not judged(place.channel.value, place.channel.reason.kind, [kind], scattering=False).elsewhere


def test_no_page_has_a_sentence_of_a_pair() -> None:
    """Answers in the documentation: of the packaged examples, of real records and of driven ones."""
    never = ("the runs repeat, without scatter", "What it acts on cannot be determined")
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    found = {
        (page.name, words) for page in pages for words in never if words in " ".join(page.read_text().split())
    }
    assert not found


def campaigns() -> list[Path]:
    """Those of the tests, and of the folder beside the checkout where there is one."""
    folders = [ROOT / "tests" / "data" / "foreign", ROOT.parent / "shared" / "data" / "foreign"]
    return [one.parent for folder in folders for one in sorted(folder.glob("*/campaign.toml"))]


@pytest.mark.slow
@pytest.mark.parametrize("folder", campaigns(), ids=lambda folder: folder.name)
def test_no_answer_to_a_campaign_of_another_simulator_contradicts_itself(folder: Path) -> None:
    found = diagnose(folder)
    assert not contradictions(found.to_json_dict(), str(found))
