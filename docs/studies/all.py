"""Make the pages of results, and all generated parts of other pages, by one command.

    python -m docs.studies.all --list            # the pages, their dates, commands and times; nothing is run
    python -m docs.studies.all [PAGE ...]        # the named pages, or all; the same command continues
    python -m docs.studies.all --data FOLDER     # with the measured campaigns that are not packaged

Commands run one after the other from the root of the checkout. ``--work FOLDER`` has their campaigns, their printed
output, and the list of finished ones: an interrupted study continues with the first unfinished command. The list
belongs to one state of the code; after a change, ``--again`` begins anew. A page that is made states the day, the
command and the processor time.

A blind set that has been answered is open. To publish the accuracy of changed code, draw another: ``--seed N``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from docs.studies.page_text import made_on, replaced, stamped, table_in
from tunnel_sim.files.writing import write_json, write_whole
from tunnel_sim.vocabulary.errors import TunnelError

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PACKAGES = ("mjcf", "tunnel_sim", "tunnel_reference", "identification", "diagnosis", "tunnel_lab")
_KINDS = "--kinds single:0.3,pair:0.17,three:0.14,four:0.11,none:0.14,outside:0.14"
_SET = f"{_KINDS} --textbook 0.5 --rare 0.5 --variety 0.25 --small 0.25 --scatter 0"


@dataclass(frozen=True)
class Step:
    """A command of a page.

    Args:
        command: command in a shell's notation; ``{work}`` is the folder of intermediate files, ``{data}`` the
            folder of measured campaigns, ``{seed}`` the seed of a blind set. ``tunnel`` and ``python`` are
            those of this environment.
        table: the mark in the page for the table that the command prints; empty: the command writes the page
            itself, or the page's author reads the output.
    """

    command: str
    table: str = ""


@dataclass(frozen=True)
class ResultPage:
    """A page, or a part of all pages, and the commands that make it.

    Args:
        name: name of the page below ``docs``, without ``.md``.
        steps: steps in this order.
        minutes: processor time of all steps, as stated by the pages and `benchmarks`; 0 if none states it.
        needs: data or extras that not every checkout has.
        dated: whether the page has figures and states the day on which they were made.
        seed: seed of its blind set; None: it has no set that should be fresh.
    """

    name: str
    steps: tuple[Step, ...]
    minutes: float = 0.0
    needs: str = ""
    dated: bool = True
    seed: int | None = None

    @property
    def path(self) -> Path:
        """The file of the page."""
        return DOCS / f"{self.name}.md"


PAGES = (
    ResultPage(
        "blind-check",
        (
            Step(f"tunnel blind make {{work}}/sealed --count 300 --seed {{seed}} {_SET}"),
            Step("tunnel blind diagnose {work}/sealed"),
            Step(
                "tunnel blind score {work}/sealed --markdown docs/blind-check.md "
                "--figure docs/images/blind-check.png"
            ),
        ),
        minutes=80,
        seed=20271125,
    ),
    ResultPage(
        "benchmark-of-causes",
        (
            Step("python -m benchmarks.causes make"),
            Step("python -m benchmarks.causes run ours"),
            Step("python -m benchmarks.causes make --version 2"),
            Step("python -m benchmarks.causes run ours --version 2"),
            Step("python -m benchmarks.causes page"),
        ),
        minutes=70,
    ),
    ResultPage(
        "ablation",
        (
            Step(f"tunnel blind make {{work}}/opened --count 120 --seed 20271126 {_SET}"),
            Step("python -m docs.studies.ablation {work}/opened --count 120", table="weighing"),
            Step(f"tunnel blind make {{work}}/margins --count 120 --seed 20281101 {_SET}"),
            Step(
                "python -m docs.studies.margins {work}/margins --count 60 --kept {work}/counts.json",
                table="margins",
            ),
        ),
        minutes=50,
    ),
    ResultPage(
        "real-records", (Step("python -m docs.studies.real_records --data {data}"),), 3, needs="--data"
    ),
    ResultPage(
        "driven-records",
        (Step("python -m docs.studies.driven_records --data {data} --answers {work}/answers"),),
        30,
        needs="--data",
    ),
    ResultPage(
        "neural-posterior",
        (
            Step(
                "tunnel blind make {work}/blind --count 300 --seed 20261122 "
                "--kinds single:2,pair:2,three:2,four:2,none:1,outside:1 --scatter 0"
            ),
            Step("tunnel blind make {work}/outside --count 16 --seed 4711 --kinds outside --scatter 0"),
            Step(
                "python -m benchmarks.neural_posterior blind {work}/blind {work}/outside "
                "--kinds none,single,pair,three,four,outside --out {work}/blind.jsonl"
            ),
            Step("python -m benchmarks.neural_posterior clean --records 30 --out {work}/clean.jsonl"),
            Step("python -m benchmarks.sbi_posterior record --samples {work}/sbi-record.npz"),
            Step("python -m benchmarks.sbi_posterior windows --samples {work}/sbi-windows.npz"),
        ),
        minutes=45,
        needs="sbi",
    ),
    ResultPage(
        "campaign-design",
        (
            Step("python -m docs.studies.campaign_policies docs"),
            Step("python -m docs.studies.planned_drives docs"),
        ),
        minutes=25,
    ),
    ResultPage(
        "how-to/train-an-agent",
        (
            Step("python -m docs.studies.campaign_agent train {work}/again.safetensors --seed 1"),
            Step(
                "python -m docs.studies.campaign_agent score docs --agent {work}/again.safetensors --seed 1"
            ),
            Step("python -m docs.studies.learning_curves docs"),
        ),
        minutes=30,
        needs="extra train",
    ),
    ResultPage("reference/settings", (Step("python -m docs.studies.settings_page"),), dated=False),
    ResultPage(
        "reference/effects", (Step("tunnel effects --markdown docs/reference/effects.md"),), dated=False
    ),
    ResultPage("explanation/how-the-code-is-laid-out", (Step("python -m docs.studies.layout"),), dated=False),
    ResultPage("gallery", (Step("python -m docs.studies.report_picture"),), needs="Chromium", dated=False),
    ResultPage(
        "README",
        (Step("python -m docs.studies.quotes"), Step("python -m docs.studies.notebooks")),
        needs="extra docs",
        dated=False,
    ),
)
"""The pages of results, and then the generated parts of other pages; the examples of all pages come last."""


def code_digest() -> str:
    """A digest of the sources that determine the figures."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in {".py", ".c", ".h", ".xml", ".safetensors"}:
                digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class Work:
    """The folder of the commands' files.

    Args:
        code: digest of the sources for which the results hold.
    """

    folder: Path
    code: str

    @property
    def _list(self) -> Path:
        return self.folder / "done.json"

    def done(self) -> dict[str, float]:
        """Processor time of every finished command, min.

        Raises:
            TunnelError: when the folder belongs to another state of the code.
        """
        if not self._list.exists():
            return {}
        stored = json.loads(self._list.read_text("utf-8"))
        if stored["code"] != self.code:
            raise TunnelError(
                "the finished commands are of another state of the code",
                where=str(self.folder),
                remedy="begin anew with --again, or name another folder with --work",
            )
        return dict(stored["done"])

    def finish(self, command: str, minutes: float) -> None:
        """Add a command to the finished ones."""
        write_json(self._list, {"code": self.code, "done": {**self.done(), command: minutes}})


def make(page: ResultPage, work: Work, given: Mapping[str, str]) -> float:
    """Run the commands of a page that are not finished.

    Args:
        given: values of the placeholders in braces in the commands, by name.

    Returns:
        Processor time of all its commands, also of those finished earlier, min.

    Raises:
        TunnelError: when a command fails; the next call begins with this command.
    """
    total = 0.0
    for number, step in enumerate(page.steps, 1):
        command = step.command.format(**given)
        before = work.done()
        if command not in before:
            print(f"  {command}", flush=True)
            printed = work.folder / f"{page.name.replace('/', '-')}-{number}.txt"
            minutes = _run(command, printed)
            if step.table:
                text = replaced(
                    page.path.read_text("utf-8"), step.table, table_in(printed.read_text("utf-8"))
                )
                write_whole(page.path, text.encode())
            work.finish(command, minutes)
        total += work.done()[command]
    if page.dated:
        text = stamped(page.path.read_text("utf-8"), page.name, date.today(), total)
        write_whole(page.path, text.encode())
    return total


def _run(command: str, printed: Path) -> float:
    """Processor time of a command and its children, min."""
    first, *rest = shlex.split(command)
    words = [sys.executable, *(["-m", "tunnel_lab"] if first == "tunnel" else []), *rest]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    before = os.times()
    with printed.open("w", encoding="utf-8") as out:
        status = subprocess.run(
            words, cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, stdout=out, check=False
        ).returncode
    if status:
        raise TunnelError(
            f"the command ended with status {status}: {command}",
            where=str(printed),
            remedy="see its messages above; the same command of this study continues here",
        )
    after = os.times()
    user, system = after.children_user - before.children_user, after.children_system - before.children_system
    return (user + system) / 60.0


def listed(pages: Sequence[ResultPage], given: Mapping[str, str]) -> str:
    """The commands to be run, page by page, with the sum of the stated times."""
    lines = []
    for page in pages:
        facts = [
            made_on(page.path.read_text("utf-8")) if page.dated else "generated",
            f"about {page.minutes:g} min" if page.minutes else "",
            f"needs {page.needs}" if page.needs else "",
        ]
        lines.append(f"{page.name}: {', '.join(filter(None, facts))}")
        places = {**given, "seed": given.get("seed") or str(page.seed)}
        lines += [f"  {step.command.format(**places)}" for step in page.steps]
    total = sum(page.minutes for page in pages)
    return "\n".join([*lines, f"Stated processor time together: {total / 60:.1f} h"])


def main(arguments: Sequence[str] | None = None) -> int:
    """List or make the pages; exit status 0, or 2 for a page that cannot be made."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="PAGE", help="pages without .md; default: all")
    parser.add_argument("--list", action="store_true", help="print what would be run")
    parser.add_argument(
        "--work", type=Path, default=ROOT / "tunnel-output" / "pages", help="folder of the commands' files"
    )
    parser.add_argument("--data", type=Path, help="folder of measured campaigns that are not packaged")
    parser.add_argument("--seed", type=int, help="of a fresh blind set; default: that of the page")
    parser.add_argument("--again", action="store_true", help="forget which commands are finished")
    options = parser.parse_args(arguments)
    known = {page.name: page for page in PAGES}
    if unknown := [name for name in options.names if name not in known]:
        parser.error(f"no page of results: {', '.join(unknown)}; choose from {', '.join(known)}")
    pages = [known[name] for name in options.names] or list(PAGES)
    given = {"work": os.path.relpath(options.work, ROOT), "data": str(options.data or "FOLDER")}
    if options.seed is not None:
        given["seed"] = str(options.seed)
    if options.list:
        print(listed(pages, given))
        return 0
    if options.data is None and (lacking := [page.name for page in pages if page.needs == "--data"]):
        parser.error(
            f"{', '.join(lacking)}: measured campaigns are not packaged; give --data, or name other pages"
        )
    options.work.mkdir(parents=True, exist_ok=True)
    work = Work(options.work.resolve(), code_digest())
    if options.again:
        (work.folder / "done.json").unlink(missing_ok=True)
    try:
        for page in pages:
            print(page.name, flush=True)
            minutes = make(page, work, {**given, "seed": given.get("seed") or str(page.seed)})
            print(f"  made, {minutes:.1f} min of processor time", flush=True)
    except TunnelError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
