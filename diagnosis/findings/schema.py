"""The published JSON schema of a diagnosis, made from the types of its findings."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import TypeAdapter

from diagnosis.findings.closure import WITH_UNIT
from diagnosis.findings.whole import SCHEMA_VERSION, Findings

Schema = dict[str, Any]

_ARGUMENT = re.compile(r"^    (\w+(?:, \w+)*): (.*(?:\n     +.*)*)", re.MULTILINE)


def diagnosis_schema() -> Schema:
    """The JSON schema of `Findings.to_json_dict`; fields are described by the docstrings of their types."""
    found = TypeAdapter(Findings).json_schema()
    for part in (found, *found["$defs"].values()):
        _describe(part)
    for name, rearrange in _REARRANGED.items():
        rearrange(found["$defs"][name])
    fields = found["properties"]
    del fields["data"], fields["decision"], fields["waterfall"]
    found["$defs"]["Maps"]["properties"]["friction"] = fields.pop("friction")
    fields |= {"schema_version": {"const": SCHEMA_VERSION}}
    fields |= _decision(found["$defs"].pop("Decision")) | _waterfall(found["$defs"].pop("Waterfall"))
    # only a displacement has this field
    found["required"] = sorted(fields.keys() - {"motion", "motion_scale"})
    return found


def _describe(part: Schema) -> None:
    """Describe the fields of a type by the arguments in its docstring."""
    said: dict[str, str] = {}
    for names, words in _ARGUMENT.findall(part.get("description", "").partition("Args:\n")[2]):
        said |= dict.fromkeys(names.split(", "), " ".join(words.split()))
    for name, field in part.get("properties", {}).items():
        if name in said:
            field["description"] = said[name]


def _decision(part: Schema) -> Schema:
    """The fields of a decision, which stand beside the other findings."""
    fields = part["properties"]
    answer = {
        "type": "object",
        "properties": {"effect": {"type": "string"}, "probability": {"type": "number"}},
    }
    likely = {"type": "array", "items": answer, "description": fields["credible"]["description"]}
    both = {name: fields[name] for name in ("effects", "channels")}
    kept = {name: fields[name] for name in ("decided", "unpredictive", "doubts")}
    return {**kept, "credible": likely, "common": {"type": "object", "properties": both}}


def _waterfall(part: Schema) -> Schema:
    """The fields of a waterfall, which stand beside the other findings."""
    fields = part["properties"]
    return {"waterfall": fields["steps"], "waterfall_on": fields["held_out"], "without": fields["without"]}


def _renamed(names: Mapping[str, str]) -> Callable[[Schema], None]:
    """Rename fields by the keys that a document has for them."""

    def rename(part: Schema) -> None:
        part["properties"] = {names.get(name, name): field for name, field in part["properties"].items()}
        part["required"] = [names.get(name, name) for name in part["required"]]

    return rename


def _fact(part: Schema) -> None:
    """A fact has its figures and its kind side by side."""
    del part["properties"]["figures"]


def _noted(part: Schema) -> None:
    """A note has the kind and the figures of its fact."""
    part["properties"]["kind"] = {"type": "string"}
    del part["properties"]["fact"]
    part["required"] = ["kind", "runs"]


def _law(part: Schema) -> None:
    """The parameters of a law have names for their value and their standard deviation."""
    number = {"type": "object", "properties": {"value": {"type": "number"}, "std": {"type": "number"}}}
    part["properties"]["parameters"]["additionalProperties"] = number


_REARRANGED: Mapping[str, Callable[[Schema], None]] = {
    "CauseSize": _renamed({"amplitude": "amplitude_rad", "stands": "stands_rad"}),
    "Confirmation": _renamed(WITH_UNIT),
    "Fact": _fact,
    "Law": _law,
    "Noted": _noted,
}
"""By type, the difference between its fields and the keys of a document."""
