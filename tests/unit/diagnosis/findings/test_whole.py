"""A diagnosis read from its document: what does not fit its types is refused, with the place."""

from __future__ import annotations

import json
from functools import reduce
from operator import getitem
from typing import Any

import pytest

from diagnosis.result import Diagnosis
from tests.support.diagnosis_document import document, findings_of
from tunnel_sim.vocabulary.errors import TunnelError


@pytest.mark.parametrize(
    ("within", "spoilt", "place"),
    [
        (
            ("candidates", 0),
            {"probability": ..., "probabilty": 0.9},
            "candidates.0.probability: Field required",
        ),
        (
            ("candidates", 0),
            {"probability": "high"},
            "candidates.0.probability: Input should be a valid number",
        ),
        ((), {"coefficients": []}, "coefficients: "),
        (("maps", "time"), {"edges_s": ...}, "maps.time.edges_s: Field required"),
        (("maps", "grid", "excess", 1), {0: "much"}, "maps.grid.excess.1.0: Input should be a valid number"),
        (("maps", "grid", "excess"), {1: [6.25]}, "maps.grid.excess: Value error, setting an array element"),
        ((), {"decided\nby" + 100 * "x": "me"}, ": unknown key"),
        (("found", "place"), {"agrees": ..., "agree": True}, "found.place.agree: unknown key"),
        (("maps", "backbones", 2), {"alone_zetta": 0.01}, "maps.backbones.2.alone_zetta: unknown key"),
    ],
)
def test_a_document_that_does_not_fit_is_refused_with_the_place(
    within: tuple[str | int, ...], spoilt: dict[Any, Any], place: str
) -> None:
    given = document()
    part = reduce(getitem, within, given)
    for key, value in spoilt.items():
        if value is ...:
            del part[key]
        else:
            part[key] = value
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
