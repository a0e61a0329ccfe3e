"""Answer files of the benchmark of causes. Truth: one file written by hand, with one fault put in at a time."""

from __future__ import annotations

import json

import jsonschema
import pytest

from benchmarks.causes.answer_file import read_answers
from benchmarks.causes.entry import schema
from tunnel_sim.vocabulary.errors import TunnelError

GOOD = {"schema_version": 1, "campaign": "c0001", "causes": [], "probability": {"mains_hum": 0.1}}
WIDTH = {"value": 0.1, "interval_90": [0.0, 0.2], "named": True}
NAN = float("nan")
UNLIKE_THE_SCHEMA = (  # what fields allow, and what the message says
    ({"campaign": "c0002"}, "rename it c0002.json"),
    ({"sets": [{"causes": [], "probability": 0.7}, {"causes": ["mains_hum"], "probability": 0.7}]}, "sum to 1.4"),
    ({"sets": [{"causes": ["mains_hum", "free_play"], "probability": 0.3}, {"causes": ["free_play", "mains_hum"],
      "probability": 0.3}]}, "more than once"),
    ({"causes": ["unknown", "mains_hum"]}, "'unknown' beside a cause"),
    ({"sets": [{"causes": ["unknown", "mains_hum"], "probability": 0.3}]}, "sets.0.causes"),
    ({"scatter": {"wind_speed": WIDTH | {"interval_90": [0.2, 0.0]}}}, "lower end first"),
)  # fmt: skip
AGAINST_THE_SCHEMA = (
    ({"schema_version": 2}, "schema_version"),
    ({"campaign": None}, "campaign"),
    ({"causes": "mains_hum"}, "causes"),
    ({"causes": ["coulomb"]}, "did you mean 'coulomb_friction'"),
    ({"causes": ["none"]}, "give \\[\\] for no gap"),
    ({"causes": ["mains_hum", "mains_hum"]}, "a cause twice"),
    ({"probability": {"coulomb": 0.5}}, "probability has 'coulomb'"),
    ({"probability": [0.5]}, "probability"),
    ({"probability": {"mains_hum": 1.5}}, "probability.mains_hum"),
    ({"probability": {"mains_hum": "0.5"}}, "probability.mains_hum"),
    ({"probability": {"mains_hum": None}}, "probability.mains_hum"),
    ({"sets": None}, "sets"),
    ({"sets": [{"causes": ["coulomb"], "probability": 0.3}]}, "sets.0.causes has 'coulomb'"),
    ({"sets": [{"causes": []}]}, "sets.0.probability"),
    ({"seconds": -3.0}, "seconds"),
    ({"seconds": "3 s"}, "seconds"),
    ({"probabilty": {}}, "probabilty"),
    ({"coefficients": {"cn_beta": {"value": 0.4, "std": 0.1}}}, "coefficients.cn_beta"),
    ({"coefficients": {"after": {"cn_beta": {"value": 0.4}}}}, "after.cn_beta.std"),
    ({"coefficients": {"after": {"cn_beta": {"value": 0.4, "std": 0.0}}}}, "after.cn_beta.std"),
    ({"scatter": {"wind": WIDTH}}, "scatter.wind"),
    ({"scatter": {"wind_speed": {"value": 0.1, "named": True}}}, "interval_90"),
    ({"scatter": {"wind_speed": WIDTH | {"interval_90": [0.0, 0.1, 0.2]}}}, "interval_90"),
)


def test_a_file_that_is_not_an_answer_is_refused_in_one_line(tmp_path):
    """The published schema refuses the same, but for rules that a schema cannot state."""
    path = tmp_path / "c0001.json"
    for bad, message in UNLIKE_THE_SCHEMA + AGAINST_THE_SCHEMA:
        path.write_text(json.dumps(GOOD | bad))
        with pytest.raises(TunnelError, match=message) as refused:
            read_answers(tmp_path)
        assert refused.value.where == str(path), bad
        assert refused.value.remedy, bad
        assert jsonschema.Draft202012Validator(schema()).is_valid(GOOD | bad) == (
            (bad, message) in UNLIKE_THE_SCHEMA
        ), bad
    for name in ("schema_version", "campaign", "causes", "probability"):
        path.write_text(json.dumps({key: value for key, value in GOOD.items() if key != name}))
        with pytest.raises(TunnelError, match=f"{name}: Field required"):
            read_answers(tmp_path)
    for text in (
        "",
        '{"a":',
        "[1]",
        json.dumps(GOOD | {"seconds": NAN}),
        json.dumps(GOOD | {"probability": {"mains_hum": NAN}}),
    ):
        path.write_text(text)
        with pytest.raises(TunnelError, match=r"is not (JSON|a JSON object)"):
            read_answers(tmp_path)
    full = GOOD | {
        "scatter": {"wind_speed": WIDTH},
        "causes": ["unknown", "wind_speed_scatter"],
        "seconds": 1,
    }
    path.write_text(json.dumps(full))
    assert read_answers(tmp_path) == {"c0001": full}
    jsonschema.validate(full, schema())
