"""The settings: each has an origin and one decision that reads it, and the copy given decides."""

import ast
from dataclasses import fields
from functools import cache
from typing import get_args

import pytest

from diagnosis import Settings, diagnose, vocabulary
from diagnosis.search.investigate import investigate
from diagnosis.settings.origin import Origin
from docs.studies import settings_page
from identification.show.numbers import part
from tests.support.diagnosis_document import findings_of
from tests.support.gap_campaigns import FOUR, campaign
from tunnel_sim.vocabulary.errors import TunnelError

FIELDS = {
    f"{stage.name}.{one.name}": one
    for stage in fields(Settings)
    for one in fields(getattr(Settings(), stage.name))
}

#: Decisions that more than one function has to know: the reason why they are one.
KNOWN_IN_SEVERAL = {
    "rivals_from": "a rival is stated by its name, and in the sentence with its probability",
    "detection_rate": "the rate of the test is also what a campaign without a gap is said to have",
    "grown_from": "on whole runs and on stretches",
    "part_price": "a part is tried, taken and compared at one price",
    "term_rate": "a term of a law is taken at one rate, whether the runs are free or driven",
    "model_error": "a misfit that needs no cause needs no form either",
    "remains_rate": "whether a residual is beyond chance, with the causes or, for a judgement on them, without",
    "unknown_from": "the rest of the answers are weighed again without a refused one",
    "coefficient_interval": "an interval has one probability, within bounds or without",
    "leak": "wherever channels are compared",
    "own_number_gain": "wherever an instant or a phase counts",
    "which_scatters_rate": "shown beside other numbers, or beside a drift",
    "form_price": "the forms of an answer are not compared with an odd run",
    "disturbed_rate": "one rate, of a jump and of a run that differs as a whole",
    "odd_share": "the price of an odd run, and the doubt about a cause that one run alone shows",
    "set_price": "scatter pays the price of an effect, and so would one that acts later on",
    "steepness": "by the same measure as an effect",
    "chance_stds": "chance, whether of all that is left or of every channel",
    "needless_chi2": "what a needless effect closes, of a channel or of runs by themselves",
    "even_share": "what is spread is taken off again",
    "run_rate": "the sentence states the rate",
    "interval_share": "of time, amplitude and frequency; the sentence states the share",
    "steady_line_rate": "the sentence states the rate",
}

#: Where usual settings may be made: what people call, what has no campaign, and answers that state their changes.
VERBS = {"_diagnose.py", "blocks.py", "by_hand.py", "investigate.py", "__init__.py", "whole.py", "cases.py"}


@cache
def sources():
    """Every module that may read a setting, with its path."""
    return [
        (path, ast.parse(path.read_text("utf-8")))
        for package in ("diagnosis", "tunnel_lab")
        for path in sorted((settings_page.ROOT / package).rglob("*.py"))
        if path.parent.name != "settings"
    ]


def reads(tree, names, owner=""):
    """Name and function of every attribute read."""
    for node in ast.iter_child_nodes(tree):
        inner = f"{owner}.{node.name}" if isinstance(node, ast.FunctionDef | ast.ClassDef) else owner
        if isinstance(node, ast.Attribute) and node.attr in names:
            yield node.attr, inner
        yield from reads(node, names, inner)


def test_a_setting_says_what_it_decides_and_where_it_comes_from():
    for name, setting in FIELDS.items():
        about = setting.metadata
        assert about["meaning"].endswith("."), name
        assert about["unit"], name
        assert about["origin"] in get_args(Origin), name
        assert about["origin"] != "estimated" or about["why"], name


def test_a_constant_says_what_it_decides_and_where_it_comes_from():
    for constant in settings_page.constants():
        meaning, origin = constant.sentences
        assert len(meaning.split()) > 3, constant.name
        assert origin, constant.name


@pytest.mark.parametrize(
    "said", ["", "Share of the gap.", "Judgement. Most of it.", "Share of the gap, judgement."]
)
def test_a_constant_without_its_sentences_is_refused(said):
    with pytest.raises(ValueError, match="SHARE needs a docstring"):
        _ = settings_page.Constant("diagnosis/a.py", "SHARE", 0.5, said).sentences


def test_every_setting_is_read_by_one_decision():
    names = {one.name for one in FIELDS.values()}
    assert len(names) == len(FIELDS)  # a name says which decision
    found = {name: set() for name in names}
    for path, tree in sources():
        for name, owner in reads(tree, names):
            found[name].add((path.name, owner))
    assert {name for name, readers in found.items() if not readers} == set()
    assert {name for name, readers in found.items() if len(readers) > 1} == set(KNOWN_IN_SEVERAL)


def test_what_decides_is_given_its_settings():
    made = {
        path.name
        for path, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "").endswith("Settings")
        if getattr(node.func, "id", "") != "RunSettings"
    }
    assert made <= VERBS


def test_the_page_is_that_of_the_fields_and_the_constants():
    assert settings_page.PAGE.read_text("utf-8") == settings_page.page()


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.8, "four fifths"), (0.1, "a tenth"), (0.5, "half"), (0.125, "an eighth"), (0.123, "12.3 %")],
)
def test_a_share_in_words(share, text):
    assert part(share) == text


def test_a_copy_with_other_values_is_told_by_its_differences():
    given = {"weighing.leak": 0.1, "search.grown_from": 7}
    changed = Settings().changed(given)
    assert changed.differences() == given
    assert findings_of({"provenance": {"settings": given}}).settings == changed
    assert findings_of({}).settings == Settings()
    assert Settings().differences() == {}


@pytest.mark.parametrize("name", ["leak", "weighing.lea", "weighting.leak", "search.grown_by", ""])
def test_an_unknown_setting_is_refused_in_one_line(name):
    with pytest.raises(TunnelError, match="there is no setting") as caught:
        Settings().changed({name: 1.0})
    assert "settings.md" in str(caught.value)


@pytest.mark.parametrize("name", ["search.grown_by", "leak"])
def test_a_document_of_an_earlier_setting_is_refused_in_one_line(name):
    with pytest.raises(TunnelError, match=f"was made with '{name}', which is not a setting") as caught:
        findings_of({"provenance": {"settings": {name: 7}}})
    assert "tunnel diagnose --json" in caught.value.remedy


@pytest.mark.usefixtures("causes_alone")
def test_the_settings_given_decide_and_are_in_the_document():
    data = campaign(duration=5.0, conditions=FOUR)
    assert not investigate(data, ()).gap.test.detected
    everything = Settings().changed(
        {"gap.detection_rate": 1e3}
    )  # the tests share it, and no p-value is above 1
    assert investigate(data, (), settings=everything).gap.test.detected
    given = {"gap.detection_rate": 1e3}
    kinds = vocabulary(["quadratic_damping"])
    usual, changed = (
        diagnose(data, kinds=kinds, rivals=(), settings=Settings().changed(one)).to_json_dict()
        for one in ({}, given)
    )
    assert (usual["provenance"]["settings"], changed["provenance"]["settings"]) == ({}, given)
    assert (usual["gap"]["detected"], changed["gap"]["detected"]) == (False, True)
