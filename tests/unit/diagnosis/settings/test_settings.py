"""The settings: each has an origin and one decision that reads it, and the copy given decides.

The weights are those of the formula in decision 0007, written out here.
"""

import ast
from dataclasses import fields
from math import exp, log
from typing import get_args

import numpy as np
import pytest

from diagnosis import Settings, diagnose
from diagnosis.likelihood.residuals import ChannelMisfit
from diagnosis.search.investigate import investigate
from diagnosis.search.weigh import FittedSet, weigh
from diagnosis.settings import settings_of
from diagnosis.settings.origin import Origin
from diagnosis.words.numbers import part
from docs.studies import settings_page
from tests.support.gap_campaigns import campaign
from tunnel_sim.vocabulary.errors import TunnelError

FIELDS = {
    f"{stage.name}.{one.name}": one
    for stage in fields(Settings)
    for one in fields(getattr(Settings(), stage.name))
}

#: Decisions that more than one function has to know: the reason why they are one.
KNOWN_IN_SEVERAL = {
    "rivals_from": "a rival is stated by its name, and in the sentence with its probability",
    "separated_by": "a run is planned with other springs, and proposed, by one measure",
    "detection_rate": "the rate of the test is also what a campaign without a gap is said to have",
    "grown_from": "on whole runs and on stretches",
    "most_causes": "on whole runs and beside a random moment",
    "form_open": "on whole runs and on stretches",
    "freed_hypotheses": "growth frees the forms of fewer beside other effects",
    "mode_runs": "of a free and of an excited mode",
    "part_price": "a part is tried, taken and compared at one price",
    "term_rate": "a term of a law is taken at one rate, whether the runs are free or driven",
    "model_error": "a misfit that needs no cause needs no form either",
    "form_error": "an error of form, of all sets or of the one that ends a search",
    "leak": "wherever channels are compared",
    "common_first": "the sentence states the share",
    "own_number_gain": "wherever an instant or a phase counts",
    "trend_rate": "one test, for the answer and for its sentence",
    "which_scatters_rate": "shown beside other numbers, or beside a drift",
    "set_price": "scatter pays the price of an effect",
    "steepness": "by the same measure as an effect",
    "chance_stds": "chance, whether of all that is left or of every channel",
    "needless_chi2": "what a needless effect closes, of a channel or of runs by themselves",
    "even_share": "what is spread is taken off again",
    "run_rate": "the sentence states the rate",
    "interval_share": "of time, amplitude and frequency; the sentence states the share",
    "misfit_degrees": "one dispersion, of small causes and of hidden effects",
    "dispersion_stds": "one dispersion, of small causes and of hidden effects",
    "hidden_stds": "the largest size is taken back to a standard deviation",
    "integrator_tolerance": "the caution states the tolerance",
    "steady_line_rate": "the sentence states the rate",
}

#: Where usual settings may be made: what people call, and what has no campaign.
VERBS = {"_diagnose.py", "blocks.py", "by_hand.py", "investigate.py", "__init__.py"}


def sources():
    """Every module that may read a setting, by its path."""
    for package in ("diagnosis", "tunnel_lab"):
        for path in sorted((settings_page.ROOT / package).rglob("*.py")):
            if path.parent.name != "settings":
                yield path, ast.parse(path.read_text("utf-8"))


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


def test_the_page_is_that_of_the_fields():
    assert settings_page.PAGE.read_text("utf-8") == settings_page.page()


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.8, "four fifths"), (0.1, "a tenth"), (0.5, "half"), (0.125, "an eighth"), (0.123, "12.3 %")],
)
def test_a_share_in_words(share, text):
    assert part(share) == text


def test_a_copy_with_other_values_is_told_by_its_differences():
    given = {"weighing.leak": 0.1, "search.grown_by": 7}
    changed = Settings().changed(given)
    assert changed.differences() == given
    assert settings_of({"provenance": {"settings": given}}) == changed
    assert settings_of({}) == Settings()
    assert Settings().differences() == {}


@pytest.mark.parametrize("name", ["leak", "weighing.lea", "weighting.leak", ""])
def test_an_unknown_setting_is_refused_in_one_line(name):
    with pytest.raises(TunnelError, match="there is no setting") as caught:
        Settings().changed({name: 1.0})
    assert "settings.md" in str(caught.value)


def test_the_settings_given_decide_and_are_in_the_document():
    data = campaign()
    assert not investigate(data, ()).gap.test.detected
    everything = Settings().changed(
        {"gap.detection_rate": 1e3}
    )  # the tests share it, and no p-value is above 1
    assert investigate(data, (), settings=everything).gap.test.detected
    given = {"words.runs_without_caution": len(data.runs) + 1}
    usual, changed = (diagnose(data, settings=Settings().changed(one)).to_json_dict() for one in ({}, given))
    assert (usual["provenance"]["settings"], changed["provenance"]["settings"]) == ({}, given)
    assert not any(said.startswith("There are") for said in usual["cautions"])
    assert any(said.startswith(f"There are {len(data.runs)} runs only") for said in changed["cautions"])


COUNT = np.array([100.0, 100.0, 10.0, 10.0, 110.0, 10_000.0])
GAP = np.array([3e5, 1e3, 2e3, 50.0, 4e4, 1e4])
SETS = {
    ("a",): (np.array([2e3, 100.0, 40.0, -5.0, 4e4, 200.0]), 0),
    ("a", "b"): (np.array([1e3, 80.0, 30.0, -6.0, 300.0, -80.0]), 0),
    ("b", "c"): (np.array([500.0, 80.0, 30.0, 4.0, 100.0, 100.0]), 2),
}


def misfit(left, scales, chosen, leaking=6):
    """Sum of logarithms over the channels, with the leak between the first few of them."""
    above = [max(x, 0.0) for x in left]
    leaked = [sum(above[:leaking]) - x for x in above[:leaking]] + [0.0] * (6 - leaking)
    return sum(log(1.0 + (x + chosen.leak * y) / s) for x, y, s in zip(above, leaked, scales, strict=True))


#: Every setting of the weighing of its own.
MOVED = {
    "steepness": 1.0, "set_price": 2.0, "form_price": 1.5, "model_error": 2e-3, "form_error": 0.05, "leak": 0.05,
    "needless_chi2": 12.0, "chance_stds": 3.0, "unknown_at": 0.4, "unknown_gap": 0.3, "unknown_left": 1.5,
    "least_closed": 0.03, "even_share": 0.06,
}  # fmt: skip


@pytest.mark.parametrize("moved", [{}, MOVED])
@pytest.mark.parametrize("motion", [4e7, 4e10])
def test_the_probabilities_are_those_of_the_decision(motion, moved):
    chosen = Settings().changed({f"weighing.{name}": value for name, value in moved.items()}).weighing
    least = [min(0.0, *(left[c] for left, _ in SETS.values())) for c in range(6)]
    common = max(min(left[c] for left, _ in SETS.values()) for c in range(6))
    gap_by_channel = [x + chosen.leak * (sum(GAP) - x) for x in GAP]
    errors = [
        min(max(chosen.form_error**2 * x, common), chosen.model_error**2 * motion) for x in gap_by_channel
    ]
    scale = [chosen.needless_chi2 + error for error in errors]
    weights = {
        key: exp(
            -chosen.steepness
            * misfit(left - least, scale, chosen, leaking=4)  # damping and frequency, and of runs
            - chosen.set_price * len(key)
            - chosen.form_price * numbers
        )
        for key, (left, numbers) in SETS.items()
    }
    by_chance = [
        chosen.chance_stds * (2.0 * n) ** 0.5 + error for n, error in zip(COUNT, errors, strict=True)
    ]
    gap = misfit(GAP, by_chance, chosen)
    odds = {}
    for key, (left, _) in SETS.items():
        remains = misfit(left, by_chance, chosen)
        closed = log(max(1.0 - remains / gap, 0.0) + chosen.least_closed)
        odds[key] = exp(
            chosen.unknown_at + chosen.unknown_gap * gap - chosen.unknown_left * (log(1.0 + remains) - closed)
        )
    total = sum(weights.values())
    against = sum(weights[key] * odds[key] for key in SETS) / total
    even, own = chosen.even_share / 4, 1.0 - chosen.even_share
    expected = {
        key: own * against / (1.0 + against) * weight / total + even for key, weight in weights.items()
    }
    expected[("unknown",)] = own / (1.0 + against) + even
    sets = [FittedSet(key, 0.1, left, numbers) for key, (left, numbers) in SETS.items()]
    found = weigh(sets, ChannelMisfit(COUNT + GAP, COUNT, motion), chosen)
    assert {answer.effects: answer.probability for answer in found} == pytest.approx(expected)
