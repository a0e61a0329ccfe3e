"""A field of a page from a field of a model, which has its label, kind and hint, and checks its value."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

from nicegui import ui

from tunnel_lab.bench.parts import label_of

if TYPE_CHECKING:
    from pydantic import BaseModel

Changed = Callable[[str, Any], Awaitable[None]]


def field_of(
    model: type[BaseModel], key: str, value: Any, changed: Changed, options: Sequence[str] | None = None
) -> ui.element:
    """A field that calls back with its key and new value; an emptied field calls back with the model's default.

    Args:
        options: values to choose from, if the model accepts any text.
    """
    info, label = model.model_fields[key], label_of(model, key)
    kind = _kind(info.annotation)
    if kind is bool:
        return ui.checkbox(label, value=value, on_change=lambda event: changed(key, event.value))
    empty = info.get_default()

    async def put(field: ui.number | ui.input | ui.select) -> None:
        await changed(key, empty if field.value in (None, "", []) else field.value)

    several = get_origin(kind) is tuple
    listed = get_args(kind) if get_origin(kind) is Literal else options
    field: ui.number | ui.input | ui.select
    if listed is not None:
        chosen = list(value) if several else value
        kept = chosen if several else [chosen] if chosen else []
        field = ui.select(
            list(dict.fromkeys([*listed, *kept])), label=label, value=chosen, multiple=several, clearable=True
        )
        field.on_value_change(lambda: put(field))
        return field.props("dense")
    number = kind is float
    field = ui.number(label, value=value) if number else ui.input(label, value=value or "")
    field.props["hint"] = info.description
    return field.on("change", lambda: put(field)).props("dense bottom-slots step=any")


def _kind(annotation: Any) -> Any:
    """The type of a field, without None and without its bounds."""
    if get_origin(annotation) is Annotated:
        return get_args(annotation)[0]
    if type(None) in get_args(annotation):
        return _kind(next(one for one in get_args(annotation) if one is not type(None)))
    return annotation
