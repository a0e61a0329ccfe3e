"""Values that break programs, and trees of plain values with some of them put in."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from copy import deepcopy
from typing import Any

from hypothesis import strategies as st

Draw = st.DrawFn
Tree = Any
"""Dictionaries, lists and plain values, as TOML and JSON give them."""

DEEP = "@deeply-nested@"
"""Stands for a value nested thousands of times; `texts` writes it out."""
HOSTILE = (
    "", " ", "[/x]", "[bold]", "$\\foo$", "$", "$\\frac{$", "_", "^", "\\", "%s", "{x}", "{{ 1 }}", "<b>&amp;</b>",
    "a\nb", "\x00", "\x1b[31m", "\u202e", "\u2028", "é" * 300, "x" * 100_000, "..", "../../etc/passwd", "/dev/zero",
    ".", "a/b", "runs", "nan", "inf", "1e400", "none", "unknown", "null", "true", "0", "-1", "ÅÄ", "😀", "\ufeff",
    "CON", "=1+1", "'", '"', "#", ",", ";", "\t", "\ud7ff", DEEP,
)  # fmt: skip
"""Texts that some reader, table or drawing takes for something else."""
NUMBERS = (
    0, -0.0, 1, -1, 2, 0.5, 5e-324, 1e-300, 1e-20, 1e-9, 1e9, 1e20, 1e300, 1.7976931348623157e308, -1e308,
    float("nan"), float("inf"), float("-inf"),
    2**31, 2**53 + 1, 2**63 - 1, 2**63, 2**64, 10**30, 10**400, -(10**400), True, False,
)  # fmt: skip
"""Numbers at the ends of their types, and what passes for a number."""
_OTHERS: tuple[Tree, ...] = (
    [], {}, [[]], [{}], {"": {}}, None, [0.0] * 1000, list(range(2000)),
    datetime.datetime(1, 1, 1), datetime.date(9999, 12, 31), datetime.time(0, 0),
)  # fmt: skip

hostile_texts = st.sampled_from(HOSTILE) | st.text(max_size=8)
odd_numbers = st.sampled_from(NUMBERS) | st.floats() | st.integers()
odd_words = st.sampled_from([str(value) for value in NUMBERS]) | hostile_texts
odd_values = odd_numbers | hostile_texts | st.sampled_from(_OTHERS).map(deepcopy)
"""A value of a kind that is seldom right."""


def one_in(count: int) -> st.SearchStrategy[bool]:
    """True in about one of so many examples; the simplest example is False."""
    return st.integers(1, count).map(lambda number: number == count)


def place_in(count: int) -> st.SearchStrategy[int]:
    """An index into so many things (at least one)."""
    return st.integers(0, count - 1)


@st.composite
def moved_numbers(draw: Draw, value: float) -> Tree:
    """A number near another in some sense: its sign, its size, its type."""
    others: list[Tree] = [-value, str(value), [value, value]]
    if abs(value) < 2**53:
        others.append(int(value))
    if abs(value) <= 1e15:  # beyond, no float may hold it
        others += [value + 1e-9, value - 1e-9, float(value) * 10.0 ** draw(st.integers(-12, 12))]
    return draw(st.sampled_from(others))


@st.composite
def spoilt(draw: Draw, tree: Tree) -> Tree:
    """A tree with one to three places changed, which shares nothing with the given one."""
    if draw(one_in(200)):
        return draw(odd_values)
    tree = deepcopy(tree)
    for change in draw(st.lists(st.sampled_from(_CHANGES), min_size=1, max_size=3)):
        places = list(_places(tree))
        if places:
            change(draw, *places[draw(place_in(len(places)))])
    return tree


def _places(tree: Tree) -> list[tuple[Tree, Any]]:
    """Every place a value stands at: what holds it, and under which key."""
    found: list[tuple[Tree, Any]] = []
    waiting = [tree]
    while waiting:
        owner = waiting.pop()
        for key in list(owner) if isinstance(owner, dict) else range(min(len(owner), 50)):
            found.append((owner, key))
            if isinstance(owner[key], dict | list):
                waiting.append(owner[key])
    return found


def _replace(draw: Draw, owner: Tree, key: Any) -> None:
    owner[key] = draw(odd_values)


def _move(draw: Draw, owner: Tree, key: Any) -> None:
    value = owner[key]
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    owner[key] = draw(moved_numbers(value) if is_number else odd_values)


def _remove(_draw: Draw, owner: Tree, key: Any) -> None:
    del owner[key]


def _rename(draw: Draw, owner: Tree, key: Any) -> None:
    if isinstance(owner, dict):
        owner[draw(hostile_texts | st.just(f"{key}s"))] = owner.pop(key)


def _repeat(draw: Draw, owner: Tree, key: Any) -> None:
    """The same once more, or a list grown long with values of its kind."""
    if isinstance(owner, list):
        owner.insert(key, deepcopy(owner[key]))
    elif isinstance(owner[key], list) and all(isinstance(value, float) for value in owner[key]):
        owner[key] = [1.0 + number for number in range(draw(st.integers(2, 400)))]
    else:
        owner[f"{key}2"] = deepcopy(owner[key])


def _wrap(draw: Draw, owner: Tree, key: Any) -> None:
    owner[key] = [owner[key]] if draw(st.booleans()) else {"a": owner[key]}


def _exchange(draw: Draw, owner: Tree, key: Any) -> None:
    other = draw(st.sampled_from(list(owner) if isinstance(owner, dict) else range(len(owner))))
    owner[key], owner[other] = owner[other], owner[key]


_CHANGES: tuple[Callable[[Draw, Tree, Any], None], ...] = (
    _move, _move, _move, _replace, _replace, _remove, _repeat, _exchange, _rename, _wrap,
)  # fmt: skip
