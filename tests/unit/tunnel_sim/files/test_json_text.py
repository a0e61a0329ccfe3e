"""One encoder for all JSON that is written."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tunnel_sim.files.writing import json_line, json_text


def test_numpy_values_are_plain_numbers() -> None:
    document = {
        "departs": np.bool_(True),
        "count": np.int64(3),
        "level": np.float64(0.1),
        "single": np.float32(0.5),
        "values": np.array([[1.0, 2.0], [3.0, 4.0]]),
        "name": np.str_("Cnβ"),
    }
    plain = {
        "departs": True,
        "count": 3,
        "level": 0.1,
        "single": 0.5,
        "values": [[1.0, 2.0], [3.0, 4.0]],
        "name": "Cnβ",
    }
    assert json.loads(json_text(document)) == plain
    assert json.loads(json_line(document)) == plain
    assert "\n" not in json_line(document)
    assert json_text(document).endswith("}\n")


@pytest.mark.parametrize(
    "bad", [float("nan"), np.float64("inf"), np.float32("-inf"), np.array([1.0, np.nan])], ids=str
)
def test_what_is_not_finite_is_refused_with_its_place(bad: object) -> None:
    with pytest.raises(ValueError, match=r"internal error: the document\.runs\[1\]\.std.* JSON cannot hold"):
        json_text({"runs": [{"std": 1.0}, {"std": bad}]})


def test_other_types_are_refused() -> None:
    with pytest.raises(TypeError, match="internal error: JSON cannot hold a set"):
        json_text({"a": {1, 2}})
