"""A diagnosis read from its document: what does not fit its types is refused, with the place."""

from __future__ import annotations

import copy
import json
from typing import Any

import pytest

from diagnosis.result import Diagnosis
from tests.support.diagnosis_document import document, findings_of
from tunnel_sim.vocabulary.errors import TunnelError


def misspelt(given: dict[str, Any]) -> None:
    given["candidates"][0]["probabilty"] = given["candidates"][0].pop("probability")


def a_word_for_a_number(given: dict[str, Any]) -> None:
    given["candidates"][0]["probability"] = "high"


def a_list_for_a_mapping(given: dict[str, Any]) -> None:
    given["coefficients"] = []


def a_map_without_its_times(given: dict[str, Any]) -> None:
    del given["maps"]["time"]["edges_s"]


def a_word_in_a_map(given: dict[str, Any]) -> None:
    given["maps"]["grid"]["excess"][1][0] = "much"


def rows_of_several_lengths(given: dict[str, Any]) -> None:
    given["maps"]["grid"]["excess"][1] = [6.25]


def an_unknown_key(given: dict[str, Any]) -> None:
    given["decided\nby" + 100 * "x"] = "me"


def a_misspelt_key_with_a_default(given: dict[str, Any]) -> None:
    given["found"]["place"]["agree"] = given["found"]["place"].pop("agrees")


def a_misspelt_key_of_a_map(given: dict[str, Any]) -> None:
    given["maps"]["backbones"][2]["alone_zetta"] = 0.01


@pytest.mark.parametrize(
    ("spoil", "place"),
    [
        (misspelt, "candidates.0.probability: Field required"),
        (a_word_for_a_number, "candidates.0.probability: Input should be a valid number"),
        (a_list_for_a_mapping, "coefficients: "),
        (a_map_without_its_times, "maps.time.edges_s: Field required"),
        (a_word_in_a_map, "maps.grid.excess.1.0: Input should be a valid number"),
        (rows_of_several_lengths, "maps.grid.excess: Value error, setting an array element"),
        (an_unknown_key, ": unknown key"),
        (a_misspelt_key_with_a_default, "found.place.agree: unknown key"),
        (a_misspelt_key_of_a_map, "maps.backbones.2.alone_zetta: unknown key"),
    ],
)
def test_a_document_that_does_not_fit_is_refused_with_the_place(spoil: Any, place: str) -> None:
    given = copy.deepcopy(document())
    spoil(given)
    with pytest.raises(TunnelError, match="is not a diagnosis") as refused:
        Diagnosis.from_json_dict(given)
    assert place in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_diagnosis_is_what_its_document_says() -> None:
    found = findings_of(document())
    written = json.loads(json.dumps(found.to_json_dict(), allow_nan=False))
    assert written["maps"]["grid"] == document()["maps"]["grid"]  # null for an empty cell
    assert Diagnosis.from_json_dict(written) == found
    written["maps"]["grid"]["excess"][0][0] += 0.01
    assert Diagnosis.from_json_dict(written) != found


@pytest.mark.parametrize(
    ("version", "said"), [(99, "is 99"), ("1", "is '1'"), (True, "is True"), (None, "is None")]
)
def test_a_document_of_another_version_is_refused(version: Any, said: str) -> None:
    given = {**document(), "schema_version": version}
    with pytest.raises(TunnelError, match=rf"schema_version {said}, but this program reads version 1"):
        Diagnosis.from_json_dict(given)


def test_a_document_without_a_version_is_refused() -> None:
    given = {key: value for key, value in document().items() if key != "schema_version"}
    with pytest.raises(TunnelError, match="schema_version is not stated"):
        Diagnosis.from_json_dict(given)
