"""Documents as JSON text: the only JSON encoder of this project."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def json_text(document: Mapping[str, object]) -> str:
    """A document as JSON for a file.

    Args:
        document: plain values and NumPy scalars and arrays, all finite.

    Returns:
        Indented JSON with a final line feed.

    Raises:
        ValueError: when a number is not finite; the message says where. This is a bug in the program.
        TypeError: when a value has a type that JSON does not support.
    """
    return _encoded(document, indent=2) + "\n"


def json_line(document: object, *, sort_keys: bool = False) -> str:
    """A document as JSON on one line, for a field of another file.

    Args:
        document: as for `json_text`.
        sort_keys: whether to sort keys, so that equal documents give equal text.

    Returns:
        JSON without line feeds.

    Raises:
        ValueError: as for `json_text`.
        TypeError: as for `json_text`.
    """
    return _encoded(document, sort_keys=sort_keys)


def as_json(value: object) -> Any:
    """A value in JSON's types: dataclasses by field unless they have a ``to_json_dict``, tuples as lists.

    Args:
        value: dataclasses, mappings, tuples and lists of them, and plain values.
    """
    if hasattr(value, "to_json_dict"):
        return value.to_json_dict()
    if dataclasses.is_dataclass(value):
        return {own.name: as_json(getattr(value, own.name)) for own in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(one) for key, one in value.items()}
    return [as_json(one) for one in value] if isinstance(value, tuple | list) else value


def _encoded(document: object, **layout: Any) -> str:
    try:
        return json.dumps(document, default=_plain, ensure_ascii=False, allow_nan=False, **layout)
    except ValueError as error:
        place = _not_finite(document)
        if place is None:
            raise
        raise ValueError(f"internal error: {place}, which JSON cannot hold") from error


def _plain(value: object) -> object:
    """A NumPy value as plain Python."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"internal error: JSON cannot hold a {type(value).__name__}")


def _not_finite(value: object, place: str = "the document") -> str | None:
    """The place of the first number that is not finite; None where there is none."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float):
        return None if math.isfinite(value) else f"{place} is {value}"
    items: list[tuple[str, object]] = []
    if isinstance(value, Mapping):
        items = [(f"{place}.{key}", item) for key, item in value.items()]
    elif isinstance(value, Sequence) and not isinstance(value, str | bytes):
        items = [(f"{place}[{index}]", item) for index, item in enumerate(value)]
    return next((found for name, item in items if (found := _not_finite(item, name)) is not None), None)
