"""Values that break programs, and trees of plain values with some of them put in."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np

Rng = np.random.Generator
Tree = Any
"""Dictionaries, lists and plain values, as TOML and JSON give them."""

DEEP = "@deeply-nested@"
"""Stands for a value nested thousands of times; `fuzz.texts` writes it out."""
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


def odd_value(rng: Rng) -> Tree:
    """A value of a kind that is seldom right."""
    kind = rng.integers(10)
    if kind < 5:
        return NUMBERS[rng.integers(len(NUMBERS))]
    if kind < 8:
        return HOSTILE[rng.integers(len(HOSTILE))]
    others: tuple[Tree, ...] = (
        [], {}, [[]], [{}], {"": {}}, None, [0.0] * 1000, list(range(2000)),
        datetime.datetime(1, 1, 1), datetime.date(9999, 12, 31), datetime.time(0, 0),
    )  # fmt: skip
    return deepcopy(others[rng.integers(len(others))])


def moved_number(value: float, rng: Rng) -> Tree:
    """A number near another in some sense: its sign, its size, its type."""
    kind = rng.integers(8)
    if kind == 0:
        return -value
    if kind == 1:
        return str(value)
    if kind == 2:
        return [value, value]
    if kind == 3 and abs(value) < 2**53:
        return int(value)
    if abs(value) > 1e15:  # a whole number that no float holds is neither moved nor scaled
        return 0
    if kind == 4:
        return value + float(rng.normal()) * 1e-9
    return float(value) * 10.0 ** float(rng.integers(-12, 13))


def mutated(tree: Tree, rng: Rng, edits: int | None = None) -> Tree:
    """A tree with a few places changed.

    Args:
        tree: left as it is.
        rng: decides what is changed.
        edits: how many changes (a count); one to three where not given.

    Returns:
        Another tree, which shares nothing with the first.
    """
    tree = deepcopy(tree)
    for _ in range(edits or int(rng.integers(1, 4))):
        places = list(_places(tree))
        if not places or rng.random() < 0.005:
            return odd_value(rng)
        owner, key = places[rng.integers(len(places))]
        CHANGES[rng.choice(len(CHANGES), p=_WEIGHTS)](owner, key, rng)
    return tree


def _places(tree: Tree) -> list[tuple[Tree, Any]]:
    """Every place a value stands at: what holds it, and under which key."""
    found: list[tuple[Tree, Any]] = []
    left = [tree]
    while left:
        owner = left.pop()
        keys = list(owner) if isinstance(owner, dict) else range(min(len(owner), 50))
        for key in keys:
            found.append((owner, key))
            if isinstance(owner[key], dict | list):
                left.append(owner[key])
    return found


def _replace(owner: Tree, key: Any, rng: Rng) -> None:
    owner[key] = odd_value(rng)


def _move(owner: Tree, key: Any, rng: Rng) -> None:
    value = owner[key]
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    owner[key] = moved_number(value, rng) if is_number else odd_value(rng)


def _remove(owner: Tree, key: Any, _rng: Rng) -> None:
    del owner[key]


def _rename(owner: Tree, key: Any, rng: Rng) -> None:
    if isinstance(owner, dict):
        name = HOSTILE[rng.integers(len(HOSTILE))] if rng.random() < 0.5 else f"{key}s"
        owner[name] = owner.pop(key)


def _repeat(owner: Tree, key: Any, rng: Rng) -> None:
    """The same once more, or a list grown long with values of its kind."""
    if isinstance(owner, list):
        owner.insert(key, deepcopy(owner[key]))
    elif isinstance(owner[key], list) and all(isinstance(value, float) for value in owner[key]):
        owner[key] = [float(value) for value in 1.0 + np.arange(rng.integers(2, 400))]
    else:
        owner[f"{key}2"] = deepcopy(owner[key])


def _wrap(owner: Tree, key: Any, rng: Rng) -> None:
    owner[key] = [owner[key]] if rng.random() < 0.5 else {"a": owner[key]}


def _exchange(owner: Tree, key: Any, rng: Rng) -> None:
    keys = list(owner) if isinstance(owner, dict) else list(range(len(owner)))
    other = keys[rng.integers(len(keys))]
    owner[key], owner[other] = owner[other], owner[key]


CHANGES: tuple[Callable[[Tree, Any, Rng], None], ...] = (
    _replace, _move, _remove, _rename, _repeat, _wrap, _exchange
)  # fmt: skip
_WEIGHTS = (0.25, 0.35, 0.1, 0.05, 0.1, 0.05, 0.1)
