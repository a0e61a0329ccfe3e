"""The commands of the benchmark: ``make``, ``run``, ``score`` and ``page``."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.causes.answer_file import read_answers
from benchmarks.causes.entry import About, answer_all
from benchmarks.causes.entry_score import score
from benchmarks.causes.make import CAMPAIGNS, KEY, check, is_edition, make, published
from benchmarks.causes.methods import METHODS
from benchmarks.causes.page import results_of, write_page
from benchmarks.causes.tracks import EDITIONS, VERSION
from tunnel_sim.files.writing import refuse_unwritable, write_json
from tunnel_sim.vocabulary.errors import TunnelError, counted, did_you_mean


def _folder(given: argparse.Namespace) -> Path:
    """The folder of the set; by default the folder of its version."""
    folder: Path | None = given.folder
    return Path("tunnel-output") / f"causes-v{given.version}" if folder is None else folder


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: arguments of the command line; None: the process's.

    Returns:
        The exit status.
    """
    given = _parser().parse_args(arguments)
    try:
        given.work(given)
    except TunnelError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _make(given: argparse.Namespace) -> None:
    folder, seal_of, edition = _folder(given), published(given.version), EDITIONS[given.version]
    own = given.seed not in (None, edition.seed)
    if own and given.folder is None:
        raise TunnelError(
            "needs a folder", where="--seed", remedy=f"{folder} is for the published set: name another"
        )
    if given.tracks and not own:
        raise TunnelError("needs another seed", where="--tracks", remedy="add --seed and a folder")
    counts = dict(given.tracks or edition.counts)
    if strange := sorted(set(counts) - set(edition.tracks)):
        what = f"version {given.version} has no track '{strange[0]}'"
        raise TunnelError(what, where="--tracks", remedy=did_you_mean(strange[0], edition.tracks))
    seal = make(folder, version=given.version, seed=given.seed, counts=counts, jobs=given.jobs)
    if own:
        print(f"{seal}: a set of seed {given.seed}, its truths in {folder / KEY}")
    elif seal_of.exists():
        check(folder, seal_of)
        print(f"{seal}: the published set, version {given.version}")


def _whole(least: int) -> Callable[[str], int]:
    """The type of an option: a whole number."""

    def whole_number(text: str) -> int:
        if int(text) < least:
            raise ValueError
        return int(text)

    whole_number.__name__ = f"whole number from {least}"  # shown in the message of argparse
    return whole_number


def _count_of_track(text: str) -> tuple[str, int]:
    """A track and its number of campaigns."""
    name, _, count = text.partition("=")
    return name, _whole(1)(count)


def _run(given: argparse.Namespace) -> None:
    method = importlib.import_module(f"benchmarks.causes.methods.{given.method}")
    folder = _folder(given)
    key = check(folder)
    answers, made_with = folder / "answers" / given.method, key["made_with"]
    answer_all(method.answer, folder / CAMPAIGNS, answers, jobs=given.jobs, first=given.first)
    results = results_of(made_with["version"]) if is_edition(made_with) else folder / "results"
    results.mkdir(exist_ok=True)
    _score_one(folder, key, answers, method.ABOUT, results / f"{given.method}.json")


def _score(given: argparse.Namespace) -> None:
    answers = given.answers.absolute()
    about = About(given.title or answers.name, given.setting, program=given.program)
    out = given.out or Path(f"{answers.name}.json")
    refuse_unwritable(out)
    _score_one(given.folder, check(given.folder), answers, about, out)


def _score_one(folder: Path, key: Mapping[str, Any], answers: Path, about: About, out: Path) -> None:
    given = read_answers(answers)
    found = score(folder, key, given, answers.name, about)
    write_json(out, found)
    exact, differing, version = found["all"]["exact"], found["differing"], found["version"]
    low, high = exact["wilson_95"]
    of_set = "not a published set" if differing is None else f"the published set, version {version}"
    if differing:
        of_set += f", but for {counted(len(differing), 'campaign')} ({_first(differing)})"
    print(f"Set: {folder}, {of_set}")
    print(f"Sets exact: {exact['count']} of {exact['total']} (95 %: {100 * low:.0f} to {100 * high:.0f} %)")
    for track, of_track in found["tracks"].items():
        print(f"  {track}: {of_track['exact']['count']} of {of_track['exact']['total']}")
    missing = sorted(set(key["truths"]) - set(given))
    if missing:
        print(f"Not answered, not scored: {counted(len(missing), 'campaign')} ({_first(missing)})")
    print(f"Written: {out}")


def _first(names: Sequence[str]) -> str:
    """The first of some names."""
    return ", ".join([*names[:3], *(["…"] if len(names) > 3 else [])])


def _page(_given: argparse.Namespace) -> None:
    print(write_page())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.causes", description=__doc__)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("make", help="make the set")
    one.add_argument("folder", type=Path, nargs="?")
    one.add_argument("--seed", type=_whole(0), help="another seed makes another set, as for training")
    one.add_argument(
        "--tracks",
        nargs="+",
        type=_count_of_track,
        metavar="TRACK=COUNT",
        help="of a set of another seed, such as one=100",
    )
    one.set_defaults(work=_make)
    two = commands.add_parser(
        "run", help="answer with a method of this project, and score; continues where it ended"
    )
    two.add_argument("method", choices=METHODS)
    two.add_argument("folder", type=Path, nargs="?")
    two.add_argument("--first", type=_whole(1), help="only so many campaigns")
    two.set_defaults(work=_run)
    for command in (one, two):
        command.add_argument("--jobs", type=_whole(1), default=1, help="processes")
        command.add_argument("--version", type=int, choices=EDITIONS, default=VERSION, help="of the set")
    three = commands.add_parser("score", help="score the answers of any entry")
    three.add_argument("folder", type=Path, help="of the set, of either version")
    three.add_argument("answers", type=Path, help="folder of one JSON file for each campaign")
    three.add_argument("--title", default="", help="of its row; by default the name of the folder of answers")
    three.add_argument("--setting", default="", help="in a sentence without a full stop, for the page")
    three.add_argument("--program", default="", help="address of the entry's program, for the page")
    three.add_argument("--out", type=Path, help="file of the score; by default ANSWERS.json here")
    three.set_defaults(work=_score)
    four = commands.add_parser("page", help="draw the table and the figure from results/")
    four.set_defaults(work=_page)
    return parser


if __name__ == "__main__":
    sys.exit(main())
