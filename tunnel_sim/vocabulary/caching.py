"""Results that are kept as long as the object from which they come is in use."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

K = TypeVar("K")
P = ParamSpec("P")
R = TypeVar("R")


def cached_while_in_use(function: Callable[Concatenate[K, P], R]) -> Callable[Concatenate[K, P], R]:
    """Compute a function once for each object given first; the results vanish with the object.

    Args:
        function: a pure function of an immutable object that is compared by identity, and of hashable further
            arguments. Its results hold no reference to the object, since neither would then be freed.
    """
    known: WeakKeyDictionary[K, dict[object, R]] = WeakKeyDictionary()

    @wraps(function)
    def cached(first: K, /, *others: P.args, **options: P.kwargs) -> R:
        results, key = known.setdefault(first, {}), (others, tuple(sorted(options.items())))
        if key not in results:
            results[key] = function(first, *others, **options)
        return results[key]

    return cached
