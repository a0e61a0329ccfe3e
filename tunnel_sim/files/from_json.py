"""Values read back from the JSON document of a diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import GetCoreSchemaHandler, model_validator
from pydantic_core import CoreSchema, core_schema

from tunnel_sim.vocabulary.columns import Array


def from_json_fields(read: Callable[[Mapping[str, Any]], Mapping[str, Any]]) -> Any:
    """Mark the function of a class that rearranges its JSON into its fields: the inverse of ``to_json_dict``.

    Args:
        read: gives the fields by name, in JSON's types, from a document of ``to_json_dict``.
    """

    def rearranged(_: type, data: Any) -> Any:
        return _frozen(read(data)) if isinstance(data, Mapping) else data

    as_class_method: Any = classmethod(rearranged)
    return model_validator(mode="before")(as_class_method)


def _frozen(value: Any) -> Any:
    """A JSON value with tuples for its lists, as required by the strict check of a field."""
    if isinstance(value, Mapping):
        return {name: _frozen(one) for name, one in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list | tuple) else value


class _Unwritten:
    """Mark of a field that no document has; it is None in a value read from a document."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.none_schema()


UNWRITTEN = _Unwritten()


class _Numbers:
    """Mark of an array that a document stores as a list of numbers, or of rows; null stands for NaN."""

    def __init__(self, *, rows: bool) -> None:
        self._rows = rows

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        listed: CoreSchema = core_schema.list_schema(
            core_schema.nullable_schema(core_schema.float_schema(allow_inf_nan=False))
        )
        listed = core_schema.list_schema(listed) if self._rows else listed
        return core_schema.no_info_after_validator_function(_as_array, listed)


def _as_array(values: list[Any]) -> Array:
    return np.array(values, dtype=np.float64)


Row = Annotated[Array, _Numbers(rows=False)]
"""Shape (n,)."""
Rows = Annotated[Array, _Numbers(rows=True)]
"""Shape (m, n)."""
