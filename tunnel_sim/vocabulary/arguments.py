"""Arguments of environments: numbers, lists and mappings of them, each refused in one line with its remedy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np

from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError, counted, did_you_mean


class EnvError(TunnelError, ValueError):
    """A bad argument, option or action of an environment, described in one line."""


@contextmanager
def env_errors(environment: str, argument: str) -> Iterator[None]:
    """Convert errors of a lower layer within the block, so that they name the environment and its argument."""
    try:
        yield
    except EnvError:
        raise
    except TunnelError as error:
        where = f"{environment}, {argument}{error.where and f', {error.where}'}"
        raise EnvError(error.what, where=where, remedy=error.remedy) from error


@dataclass(frozen=True)
class Number:
    """The allowed values of a number.

    Args:
        least, most: bounds, in the unit; infinite: none.
        above: whether the number must exceed ``least``.
        whole: whether it must be a whole number.
        unit: unit, for the remedy.
    """

    least: float = 0.0
    most: float = inf
    above: bool = False
    whole: bool = False
    unit: str = "1"

    @property
    def words(self) -> str:
        """The range in words, such as ``a number above 0``."""
        noun = "a whole number" if self.whole else "a number"
        if self.most < inf:
            bounds = f"above {self.least:g} and at most {self.most:g}"
            return f"{noun} {bounds if self.above else f'from {self.least:g} to {self.most:g}'}"
        if self.least == -inf:
            return noun
        return f"{noun} above {self.least:g}" if self.above else f"{noun} of {self.least:g} or more"

    def checked(self, value: object, name: str, where: str) -> float:
        """The value as a float.

        Raises:
            EnvError: when it is not such a number; booleans, texts, NaN and infinities are not.
        """
        kind = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
        if kind:
            number = float(value)  # type: ignore[arg-type]
            enough = number > self.least if self.above else number >= self.least
            if isfinite(number) and enough and number <= self.most and (not self.whole or number % 1 == 0.0):
                return number
        remedy = f"give {self.words}{beside(self.unit, ', in ')}"
        raise EnvError(f"{name} = {value!r} is not {self.words}", where=where, remedy=remedy)


POSITIVE = Number(above=True)
COUNT = Number(least=1, whole=True)


def checked_numbers(
    values: object, name: str, where: str, kind: Number, *, length: int | None = None
) -> tuple[float, ...]:
    """The numbers of a list, each within its allowed values.

    Args:
        length: required number of values; None: one or more, without repetition.

    Raises:
        EnvError: when it is not a list, or one of its numbers is refused.
    """
    example = "one number or more" if length is None else counted(length, "number")
    remedy = f"give {example} in a list or tuple{beside(kind.unit, ', in ')}"
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or np.ndim(values) == 0:
        raise EnvError(f"{name} = {values!r} is not a list of numbers", where=where, remedy=remedy)
    found = tuple(kind.checked(value, f"{name}[{place}]", where) for place, value in enumerate(list(values)))
    if length is not None and len(found) != length:
        what = f"{name} = {values!r} has {counted(len(found), 'number')}, not {length}"
        raise EnvError(what, where=where, remedy=remedy)
    if length is None and (not found or len(set(found)) != len(found)):
        raise EnvError(f"{name} = {values!r} is empty or contains a value twice", where=where, remedy=remedy)
    return found


def checked_names(given: object, known: Iterable[str], name: str, where: str) -> Mapping[str, Any]:
    """A mapping with known names only.

    Raises:
        EnvError: when it is not a mapping, or for the first unknown name, suggesting the closest one.
    """
    names = tuple(known)
    if not isinstance(given, Mapping):
        remedy = f"give values by name, such as {{{names[0]!r}: …}}"
        raise EnvError(f"{name} = {given!r} is not a mapping", where=where, remedy=remedy)
    for one in given:
        if one not in names:
            raise EnvError(f"{name} has no {one!r}", where=where, remedy=did_you_mean(str(one), names))
    return given


def checked_choice(value: object, known: Sequence[str], name: str, where: str) -> str:
    """One of some words; an `EnvError` for any other word, suggesting the closest one."""
    if not isinstance(value, str) or value not in known:
        raise EnvError(f"unknown {name} {value!r}", where=where, remedy=did_you_mean(str(value), known))
    return value
