"""The decisions that change when a setting is halved or doubled, on campaigns of known truth.

    python -m docs.studies.margins FOLDER [FOLDER ...] [--count N] [--kept FILE]

Each folder is a campaign, or a set made by ``tunnel blind make``. Every non-integer setting of the diagnosis is
replaced by a number that also tracks its half and double. Each comparison with it is then evaluated three times:
one diagnosis of a campaign shows, for all settings, how often a comparison changes. If none changes, the setting
decides nothing in these campaigns. If some change, the answer need not: `docs.studies.ablation` changes one setting
at a time and repeats the answer. A setting that becomes part of an array before a comparison is not tracked. FILE
keeps the counts of every campaign, for one state of the code; the same command continues after an interruption.
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

#: Number of comparisons by setting, and of changed ones at each factor, since `watched` was called.
Counts = defaultdict[str, list[int]]
_counts: Counts = defaultdict(lambda: [0, 0, 0])


class Watched(float):
    """A number that tracks the values it would have with other sizes of the settings behind it.

    Args:
        at: values at each of `FACTORS`, by name of a setting.
    """

    at: Mapping[str, tuple[float, ...]]

    def __new__(cls, value: float, at: Mapping[str, tuple[float, ...]]) -> Watched:
        """The number with its other values."""
        made = super().__new__(cls, value)
        made.at = at
        return made

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Functions and operators of NumPy and SciPy; results of arrays and other methods are not tracked."""
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
    """The inputs at a factor of a setting; numbers that do not depend on the setting are unchanged."""
    return [
        one.at[name][place] if isinstance(one, Watched) and name in one.at else _plain(one) for one in inputs
    ]


def _names(inputs: Sequence[Any]) -> set[str]:
    return {name for one in inputs if isinstance(one, Watched) for name in one.at}


def _followed(operate: Callable[..., Any], inputs: Sequence[Any], result: Any) -> Watched:
    """The result with its values under other settings."""
    places = range(len(FACTORS))
    with np.errstate(all="ignore"):
        at = {n: tuple(float(operate(*_moved(inputs, n, place))) for place in places) for n in _names(inputs)}
    return Watched(float(result), at)


def _compared(compare: Callable[..., Any], inputs: Sequence[Any], result: Any) -> Any:
    """The result of a comparison; changes at other factors are counted."""
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
    """The usual settings with all non-integer settings watched, and the counts of their comparisons from now."""
    _counts.clear()
    usual = Settings()
    numbers = {
        name: Watched(value, {name: tuple(factor * value for factor in FACTORS)})
        for name, value in usual.values().items()
        if isinstance(value, float)
    }
    return usual.changed(numbers), _counts


def table(folders: list[Path], count: int, known: dict[str, Any], kept: Path | None = None) -> Iterator[str]:
    """Rows of Markdown, one for every non-integer setting.

    Args:
        count: number of campaigns of each folder, counted from the first.
        known: earlier counts by campaign; counts of further campaigns are added.
        kept: the file for the counts.
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
