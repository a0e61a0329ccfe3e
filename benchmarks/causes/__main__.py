"""The commands of the benchmark: ``make``, ``run``, ``score`` and ``page``."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.causes.entry import About, answer_all
from benchmarks.causes.entry_score import read_answers, score
from benchmarks.causes.make import CAMPAIGNS, check, make, published
from benchmarks.causes.methods import METHODS
from benchmarks.causes.page import results_of, write_page
from benchmarks.causes.tracks import EDITIONS, VERSION
from tunnel_sim.files.writing import write_json
from tunnel_sim.vocabulary.errors import TunnelError


def _folder(given: argparse.Namespace) -> Path:
    """The folder of the set; by default that of its version."""
    folder: Path | None = given.folder
    return Path("tunnel-output") / f"causes-v{given.version}" if folder is None else folder


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: of the command line; None: the process's own.

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
    folder, seal_of = _folder(given), published(given.version)
    seal = make(folder, version=given.version, seed=given.seed, jobs=given.jobs)
    if given.seed in (None, EDITIONS[given.version].seed) and seal_of.exists():
        check(folder, seal_of)
        print(f"{seal}: the published set, version {given.version}")


def _run(given: argparse.Namespace) -> None:
    method = importlib.import_module(f"benchmarks.causes.methods.{given.method}")
    folder, results = _folder(given), results_of(given.version)
    answers = folder / "answers" / given.method
    answer_all(method.answer, folder / CAMPAIGNS, answers, jobs=given.jobs, first=given.first)
    results.mkdir(exist_ok=True)
    _score_one(folder, answers, given.method, method.ABOUT, results / f"{given.method}.json")


def _score(given: argparse.Namespace) -> None:
    about = About(given.title or given.answers.name, given.setting)
    out = given.out or Path(f"{given.answers.name}.json")
    _score_one(given.folder, given.answers, given.answers.name, about, out)


def _score_one(folder: Path, answers: Path, name: str, about: About, out: Path) -> None:
    found = score(folder, check(folder), read_answers(answers), name, about)
    write_json(out, found)
    exact, of = found["all"]["exact"], found["of"]
    print(f"{out}: {exact['count']} of {exact['total']} sets exact ({found['answered']} of {of} answered)")


def _page(_given: argparse.Namespace) -> None:
    print(write_page())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.causes", description=__doc__)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("make", help="make the set")
    one.add_argument("folder", type=Path, nargs="?")
    one.add_argument("--seed", type=int, help="another seed makes another set")
    one.set_defaults(work=_make)
    two = commands.add_parser(
        "run", help="answer with a method of this project, and score; continues where it ended"
    )
    two.add_argument("method", choices=METHODS)
    two.add_argument("folder", type=Path, nargs="?")
    two.add_argument("--first", type=int, help="only so many campaigns")
    two.set_defaults(work=_run)
    for command in (one, two):
        command.add_argument("--jobs", type=int, default=1, help="processes")
        command.add_argument("--version", type=int, choices=EDITIONS, default=VERSION, help="of the set")
    three = commands.add_parser("score", help="score the answers of any entry")
    three.add_argument("folder", type=Path)
    three.add_argument("answers", type=Path)
    three.add_argument("--title", default="")
    three.add_argument("--setting", default="")
    three.add_argument("--out", type=Path)
    three.set_defaults(work=_score)
    four = commands.add_parser("page", help="draw the table and the figure from results/")
    four.set_defaults(work=_page)
    return parser


if __name__ == "__main__":
    sys.exit(main())
