"""A diagnosis read from its document: what does not fit its types is refused, with the place."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from diagnosis.result import Diagnosis
from tests.support.diagnosis_document import document
from tunnel_sim.vocabulary.errors import TunnelError


def misspelt(given: dict[str, Any]) -> None:
    given["candidates"][0]["probabilty"] = given["candidates"][0].pop("probability")


def a_word_for_a_number(given: dict[str, Any]) -> None:
    given["candidates"][0]["probability"] = "high"


def a_list_for_a_mapping(given: dict[str, Any]) -> None:
    given["coefficients"] = []


@pytest.mark.parametrize(
    ("spoil", "place"),
    [
        (misspelt, "candidates.0.probability: Field required"),
        (a_word_for_a_number, "candidates.0.probability: Input should be a valid number"),
        (a_list_for_a_mapping, "coefficients: "),
    ],
)
def test_a_document_that_does_not_fit_is_refused_with_the_place(spoil: Any, place: str) -> None:
    given = copy.deepcopy(document())
    spoil(given)
    with pytest.raises(TunnelError, match="is not a diagnosis") as refused:
        Diagnosis.from_json_dict(given)
    assert place in str(refused.value)
    assert "\n" not in str(refused.value)
