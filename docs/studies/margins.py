"""Which decisions would a setting of half or twice its size change? On campaigns whose truth is open.

    python -m docs.studies.margins FOLDER [FOLDER ...] [--count N] [--kept FILE]

Each folder is a campaign, or a set made by ``tunnel blind make``. Every setting of the diagnosis that is not
whole is replaced by one that remembers what it would be at half and at twice its size. Each comparison that it
takes part in is then made three times, so that one diagnosis of each campaign says of all settings how often a
comparison comes out differently. Where none does, the setting decides nothing in these campaigns. Where some do,
the answer need not change: `docs.studies.ablation` moves one setting at a time and answers again. A setting
that becomes part of an array before it is compared is not followed. FILE keeps the counts of every campaign; the
same command goes on where it was interrupted. They are those of one state of the code.
"""

from __future__ import annotations

import argparse
import json
import operator
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from diagnosis import Settings, diagnose
from tunnel_lab.terminal.outputs import console
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.writing import write_json
from tunnel_sim.vocabulary.errors import TunnelError

FACTORS = (0.5, 2.0)

#: By setting: comparisons made, and how many come out differently at each factor, since `watched` was called.
Counts = defaultdict[str, list[int]]
_counts: Counts = defaultdict(lambda: [0, 0, 0])


class Watched(float):
    """A number that remembers what it would be if settings that it is made from were of another size.

    Args:
        at: by name of a setting, its value at each of `FACTORS`.
    """

    at: Mapping[str, tuple[float, ...]]

    def __new__(cls, value: float, at: Mapping[str, tuple[float, ...]]) -> Watched:
        """The number with its other values."""
        made = super().__new__(cls, value)
        made.at = at
        return made

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Functions and operators of NumPy and SciPy; of arrays and other methods the result is not followed."""
        plain = tuple(map(_plain, inputs))
        result = getattr(ufunc, method)(*plain, **options)
        if method != "__call__" or options:
            return result
        if ufunc in _COMPARISONS:
            return _compared(ufunc, inputs, result)
        return _followed(ufunc, inputs, result) if isinstance(result, float) else result


def _plain(value: Any) -> Any:
    return float(value) if isinstance(value, Watched) else value


def _moved(inputs: Sequence[Any], name: str, place: int) -> list[Any]:
    """The inputs at a factor of a setting; a number that is not made from it stays as it is."""
    return [
        one.at[name][place] if isinstance(one, Watched) and name in one.at else _plain(one) for one in inputs
    ]


def _names(inputs: Sequence[Any]) -> set[str]:
    return {name for one in inputs if isinstance(one, Watched) for name in one.at}


def _followed(operate: Callable[..., Any], inputs: Sequence[Any], result: Any) -> Watched:
    """The result with its other values."""
    places = range(len(FACTORS))
    with np.errstate(all="ignore"):
        at = {n: tuple(float(operate(*_moved(inputs, n, place))) for place in places) for n in _names(inputs)}
    return Watched(float(result), at)


def _compared(compare: Callable[..., Any], inputs: Sequence[Any], result: Any) -> Any:
    """The result; how often it would be another is counted."""
    for name in _names(inputs):
        _counts[name][0] += 1
        for place in range(len(FACTORS)):
            _counts[name][1 + place] += bool(np.any(compare(*_moved(inputs, name, place)) != result))
    return result


def _method(function: Callable[..., Any], finish: Callable[..., Any], *, swapped: bool = False) -> Any:
    def method(self: Watched, *others: Any) -> Any:
        if any(isinstance(one, np.ndarray) for one in others):
            return NotImplemented
        inputs = (*others, self) if swapped else (self, *others)
        return finish(function, inputs, function(*map(_plain, inputs)))

    return method


for _name in ("add", "sub", "mul", "truediv", "pow"):
    setattr(Watched, f"__{_name}__", _method(getattr(operator, _name), _followed))
    setattr(Watched, f"__r{_name}__", _method(getattr(operator, _name), _followed, swapped=True))
setattr(Watched, "__neg__", _method(operator.neg, _followed))  # noqa: B010
for _name in ("lt", "le", "gt", "ge"):
    setattr(Watched, f"__{_name}__", _method(getattr(operator, _name), _compared))
_COMPARISONS = (np.less, np.less_equal, np.greater, np.greater_equal)


def watched() -> tuple[Settings, Counts]:
    """The usual settings, every one that is not whole watched, and the counts of their comparisons from now."""
    _counts.clear()
    usual = Settings()
    numbers = {
        name: Watched(value, {name: tuple(factor * value for factor in FACTORS)})
        for name, value in usual.values().items()
        if isinstance(value, float)
    }
    return usual.changed(numbers), _counts


def table(folders: list[Path], count: int, known: dict[str, Any], kept: Path | None = None) -> Iterator[str]:
    """Rows of Markdown, one of every setting that is not whole.

    Args:
        count: of the campaigns of each folder, from the first.
        known: counts by campaign from before; those of further campaigns are added.
        kept: the file that keeps them.
    """
    campaigns = [path.parent for folder in folders for path in sorted(folder.rglob("campaign.toml"))[:count]]
    total: dict[str, Any] = defaultdict(lambda: np.zeros(5, int))
    for campaign in track(campaigns, "diagnosing", console=console(stderr=True)):
        if str(campaign) not in known:
            settings, found = watched()
            with suppress(TunnelError):
                diagnose(read_campaign(campaign), settings=settings)
            known[str(campaign)] = {name: list(numbers) for name, numbers in found.items()}
            if kept is not None:
                write_json(kept, known)
        for name, numbers in known[str(campaign)].items():
            total[name] += np.array([*numbers, *(number > 0 for number in numbers[1:])])
    yield f"{len(campaigns)} campaigns"
    yield ""
    yield "| setting | comparisons | otherwise at half | in campaigns | otherwise at twice | in campaigns |"
    yield "|---|---:|---:|---:|---:|---:|"
    for name, value in Settings().values().items():
        if isinstance(value, float):
            made, half, twice, by_half, by_twice = total[name].tolist()
            yield f"| `{name}` | {made:,} | {half} | {by_half} | {twice} | {by_twice} |"


def main() -> None:
    """Print the table."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    reader.add_argument("folders", type=Path, nargs="+", help="campaigns, or sets made by tunnel blind make")
    reader.add_argument("--count", type=int, default=1000, help="campaigns of each folder, from the first")
    reader.add_argument("--kept", type=Path, metavar="FILE", help="keep the counts, and go on from them")
    given = reader.parse_args()
    if empty := [str(folder) for folder in given.folders if not any(folder.rglob("campaign.toml"))]:
        reader.error(
            f"no campaign.toml in {', '.join(empty)}; name a campaign, or a set of tunnel blind make"
        )
    try:
        known = json.loads(given.kept.read_text("utf-8")) if given.kept and given.kept.exists() else {}
    except (OSError, ValueError) as error:
        reader.error(f"cannot read the counts in {given.kept} ({error}); name another file")
    for line in table(given.folders, given.count, known, given.kept):
        print(line, flush=True)


if __name__ == "__main__":
    main()
