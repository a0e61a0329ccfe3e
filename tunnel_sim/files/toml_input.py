"""Strict reading of TOML files: every error is one line that names file, place and remedy."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from tunnel_sim.files.reading import check_shape, read_text
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.errors import one_line as one_line
from tunnel_sim.vocabulary.errors import shown as shown

SCHEMA_VERSION = 1


class StrictModel(BaseModel):
    """A table of a TOML file; unknown keys, wrong types, NaN and infinities are refused.

    The description of a field becomes the remedy shown to the user: ``give <key> as <description>``.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def optional(description: str, title: str | None = None) -> Any:
    """A field that may be left out: then it is None; a page shows it under its title."""
    return Field(default=None, description=description, title=title)


ModelT = TypeVar("ModelT", bound=StrictModel)


def _printable(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise ValueError("is blank or has line breaks or control characters")
    return text


OneLine = Annotated[str, AfterValidator(_printable)]
"""A text without line breaks or control characters."""
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
SampleRate = Annotated[float, Field(ge=limits.SLOWEST_RATE, le=limits.FASTEST_RATE)]
"""A sample rate within its limits, Hz."""

_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{limits.KEY_PARTS},}}", re.ASCII)


def load_toml(path: Path, *, missing: str) -> dict[str, Any]:
    """Read a TOML file, not yet validated; refuse numbers that overflow; ``missing``: remedy for a missing file."""
    where = shown(path)
    text = read_text(path, limits.DOCUMENT_BYTES, missing=missing)
    if not text.strip():
        raise TunnelError("the file is empty", where=where, remedy=missing)
    remedy = "correct the file at that place"
    if _LONG_KEY.search(text):
        raise TunnelError(f"a key of more than {limits.KEY_PARTS} parts", where=where, remedy=remedy)
    try:
        # tomllib raises ValueError for numbers and dates that Python cannot represent.
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise TunnelError(f"not valid TOML: {one_line(error)}", where=where, remedy=remedy) from None
    check_shape(document, where, remedy)
    _check_magnitudes(document, where)
    return document


def _check_magnitudes(value: object, where: str, key: str = "") -> None:
    """Refuse numbers with powers that overflow or underflow; the schema refuses NaN and infinities."""
    if isinstance(value, Mapping):
        for name, one in value.items():
            _check_magnitudes(one, where, name)
    elif isinstance(value, list):
        for one in value:
            _check_magnitudes(one, where, key)
    elif isinstance(value, float) and value and isfinite(value):
        least, most = limits.SMALLEST_NUMBER, limits.LARGEST_NUMBER
        if not least <= abs(value) <= most:
            what = f"'{one_line(key)}' = {value:g} is beyond {least:g} to {most:g} in magnitude"
            raise TunnelError(what, where=where, remedy="correct it (SI units)")


def check_version(document: Mapping[str, Any], path: Path) -> None:
    """Refuse a document with a ``schema_version`` that this program cannot read."""
    remedy = f"put schema_version = {SCHEMA_VERSION} at the top of the file"
    if "schema_version" not in document:
        raise TunnelError("no schema_version", where=shown(path), remedy=remedy)
    version = document["schema_version"]
    if type(version) is not int or version != SCHEMA_VERSION:
        what = f"schema_version is {one_line(repr(version))}, but this program reads version {SCHEMA_VERSION}"
        raise TunnelError(what, where=shown(path), remedy=remedy)


def read_document(model: type[ModelT], path: Path, *, missing: str) -> ModelT:
    """Read and validate a TOML file that states a ``schema_version``; ``missing`` is the remedy without it."""
    document = load_toml(path, missing=missing)
    check_version(document, path)
    return validate(model, document, path)


def validate(model: type[ModelT], document: Mapping[str, Any], path: Path) -> ModelT:
    """Validate a document against the model of its whole file."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        # An unknown key is reported first: it is often the cause of a missing key in the same table.
        problems = error.errors(include_url=False)
        problem = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
        loc, kind = problem["loc"], problem["type"]
        # the place: run 'r01', [[effects]] number 2, [rig], or nothing for the top level
        first, number = loc[0], loc[1] if len(loc) >= 2 else None
        where = shown(path)
        if first == "runs" and isinstance(number, int):
            entry = document["runs"][number]
            name = entry.get("id") if isinstance(entry, Mapping) else None
            named = isinstance(name, str) and bool(name.strip())
            where += f", run '{one_line(name)}'" if named else f", run number {number + 1}"
        elif isinstance(number, int) and isinstance(document.get(str(first)), list):
            where += f", [[{first}]] number {number + 1}"
        elif number is not None:
            where += f", [{first}]"
        key_at = max((i for i, part in enumerate(loc) if isinstance(part, str)), default=0)
        key = str(loc[key_at])
        table: type[StrictModel] | None = model  # the table that contains the key
        for part in loc[:key_at]:
            if isinstance(part, str) and table is not None:
                field = table.model_fields.get(part)
                table = _model_in(field.annotation) if field else None
        fields = {} if table is None else table.model_fields
        if kind == "extra_forbidden":
            what, remedy = f"unknown key '{one_line(key)}'", did_you_mean(key, fields)
            raise TunnelError(what, where=where, remedy=remedy) from None
        if kind == "missing":
            what = f"'{key}' is missing"
        elif kind == "too_short":
            what = f"'{key}' is empty"
        else:
            said = one_line(problem["msg"]).removeprefix("Value error, ")
            reason = _REASONS.get(kind, said.replace("Input should be", "should be", 1))
            what = f"'{key}' = {one_line(repr(problem['input']), limit=40)} {reason}"
        description = (fields[key].description if key in fields else None) or "documented"
        raise TunnelError(what, where=where, remedy=f"give {one_line(key)} as {description}") from None


_REASONS = {
    "finite_number": "is not a finite number",
    "float_type": "is not a number",
    "int_type": "is not a whole number",
    "string_type": "is not text",
    "list_type": "is not a list",
    "model_type": "is not a table",
    "dict_type": "is not a table",
}


def _model_in(annotation: Any) -> type[StrictModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, StrictModel):
        return annotation
    return next((found for a in get_args(annotation) if (found := _model_in(a)) is not None), None)
