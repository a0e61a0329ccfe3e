"""Run the examples of the pages and write their printed output below them.

``python -m docs.studies.quotes`` in the source tree; with names, only those pages, such as ``how-to/run-the-demo``.

An example is a command in a ``console`` block with the lines below it, or ``python`` blocks with the ``text`` below
them. Text that differs by the last digits of its numbers is kept, because another processor may round otherwise.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TRAINED = "how-to/train-an-agent"
"""A page whose examples take minutes; ``tests/architecture/test_agent_page.py`` runs shorter ones."""
_END = "-- end of a step --"
_MORE = "…\n"  # mark of the last line of an excerpt
_COMMAND = re.compile(r"^\$ (.*)\n", re.MULTILINE)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?")
_LAST_DIGITS = 3  # number of last digits that may differ; shown values have two digits of the std


@dataclass(frozen=True)
class Quote:
    """An example on a page.

    Args:
        source: command, or Python code.
        console: whether it is a command.
        shown: the text shown below it; empty where there is none.
        place: start and end of that text in the page; for code without text, the end of its block, twice.
    """

    source: str
    console: bool
    shown: str
    place: tuple[int, int]


def quotes(page: str) -> list[Quote]:
    """The examples of a page, in order."""
    found: list[Quote] = []
    for block in BLOCK.finditer(page):
        kind, (first, last) = block[1], block.span(2)
        if kind == "console":
            commands = list(_COMMAND.finditer(page, first, last))
            ends = [one.start() for one in commands[1:]] + [last]
            for command, end in zip(commands, ends, strict=True):
                place = (command.end(), end)
                found.append(Quote(command[1], True, page[slice(*place)], place))
        elif kind == "python":
            found.append(Quote(block[2], False, "", (block.end(), block.end())))
        elif kind == "text" and found and not found[-1].console and not found[-1].shown:
            found[-1] = Quote(found[-1].source, False, block[2], (first, last))
    return found


def pages() -> list[str]:
    """The pages with examples, by path without ending: in ``docs``, and ``README``."""
    files = {path.relative_to(DOCS).with_suffix("").as_posix(): path for path in sorted(DOCS.rglob("*.md"))}
    files["README"] = ROOT / "README.md"  # the index of docs has no example
    quoting = [
        name for name, path in files.items() if any(one.shown for one in quotes(path.read_text("utf-8")))
    ]
    return [name for name in quoting if name != TRAINED]


def path_of(name: str) -> Path:
    """The file of a page."""
    return (ROOT if name == "README" else DOCS) / f"{name}.md"


def outputs(page: str, folder: Path) -> list[str]:
    """The output of a page's examples, in order: first its commands are run in the folder, then its code."""
    examples = quotes(page)
    said = {}
    if any(one.console for one in examples):
        _prepare(page, folder)
    for number, one in enumerate(examples):
        if one.console:
            program, *words = shlex.split(one.source)
            said[number] = _run(["-m", {"tunnel": "tunnel_lab"}[program], *words], folder)
    steps = [number for number, one in enumerate(examples) if not one.console]
    if any(examples[number].shown for number in steps):
        said |= dict(zip(steps, printed([examples[number].source for number in steps], folder), strict=True))
    return [said.get(number, "") for number in range(len(examples))]


def printed(codes: Sequence[str], folder: Path) -> list[str]:
    """The output of the steps of a script, without a warning."""
    script = "".join(f"{code}\nprint({_END!r})\n" for code in codes)
    return _run(["-W", "error", "-c", script], folder).split(_END + "\n")[:-1]


def refreshed(page: str, said: Sequence[str]) -> str:
    """A page with the output of its examples.

    Args:
        said: output by example, from `outputs`.
    """
    for one, real in reversed(list(zip(quotes(page), said, strict=True))):
        excerpt = one.shown.endswith(_MORE)
        if excerpt:
            real = "".join(real.splitlines(keepends=True)[: one.shown.count("\n") - 1]) + _MORE
        if difference(one.shown.splitlines(), real.splitlines()):
            first, last = one.place
            text = real if one.shown or one.console else f"\n\n```text\n{real}```"
            page = page[:first] + text + page[last:]
    return page


def difference(shown: Sequence[str], real: Sequence[str]) -> str:
    """The first lines that differ in a word, or in a number by more than a few of its last digits; else empty."""
    one, other = _comparable(shown), _comparable(real)
    for a, b in zip(one, other, strict=False):
        words = [_NUMBER.sub("#", line).split() for line in (a, b)]
        numbers = zip(_NUMBER.findall(a), _NUMBER.findall(b), strict=False)
        if words[0] != words[1] or any(_apart(*both) for both in numbers):
            return f"shown: {a}\nreal:  {b}"
    if len(one) != len(other):
        return f"shown: {len(one)} lines\nreal:  {len(other)} lines"
    return ""


def _apart(one: str, other: str) -> bool:
    allowed = _LAST_DIGITS * max(last_digit(one), last_digit(other)) * 1.001
    return abs(float(one) - float(other)) > allowed


def last_digit(number: str) -> float:
    """The weight of the last digit of a number."""
    mantissa, _, power = number.partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def _comparable(lines: Sequence[str]) -> list[str]:
    """Lines without trailing blanks and without the line that depends on the machine's OpenGL."""
    kept = [line.rstrip() for line in lines if "icture of the rig" not in line]
    return "\n".join(kept).strip("\n").splitlines()


def _prepare(page: str, folder: Path) -> None:
    """The files for the commands of a page: the plan of the README, measured data, and tables of the page."""
    readme = BLOCK.findall((ROOT / "README.md").read_text("utf-8"))
    (plan,) = (text for kind, text in readme if kind == "toml" and "wind_speeds" in text)
    (folder / "plan.toml").write_text(plan, "utf-8")
    for original in (DOCS / "how-to" / "data").glob("*.mat"):
        shutil.copy(original, folder)
    for kind, text in BLOCK.findall(page):
        if kind == "csv":
            (folder / "runs.csv").write_text(text, "utf-8")
        if kind == "toml":
            name = "my.toml" if text.startswith("[[effects]]") else "known.toml"
            (folder / name).write_text(text, "utf-8")


def _run(words: Sequence[str], folder: Path) -> str:
    """The output of Python, in a terminal of 80 columns without colours."""
    shown = {"PYTHONPATH": str(ROOT), "COLUMNS": "80", "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, **shown},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)[:80]}: {done.stderr}")
    return "".join(f"{line.rstrip()}\n" for line in done.stdout.splitlines())


def main() -> None:
    """Refresh the named pages, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="pages without .md; default: all")
    failed = 0
    for name in parser.parse_args().names or pages():
        path = path_of(name)
        page = path.read_text("utf-8")
        try:
            with tempfile.TemporaryDirectory() as folder:
                new = refreshed(page, outputs(page, Path(folder)))
        except RuntimeError as error:
            failed += 1
            print(f"Failed: {path}: {error}", flush=True)
            continue
        if new != page:
            path.write_text(new, "utf-8")
        print(f"{'Written' if new != page else 'Unchanged'}: {path}", flush=True)
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
