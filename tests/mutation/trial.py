"""Tries one mutant: changes a copy of the tree, runs the chosen tests there, and puts the file back."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.context import ForkServerContext
from pathlib import Path

from cosmic_ray.mutating import use_mutation
from cosmic_ray.plugins import get_operator

from tests.mutation.choose import Chooser
from tests.mutation.draw import Mutant

#: Libraries loaded once for all trials; never a package under test, nor pytest's plugins.
PRELOADED = ["numpy", "scipy.signal", "scipy.optimize", "scipy.stats", "matplotlib.figure", "polars", "pydantic",
             "torch", "mujoco", "typer", "rich.table"]  # fmt: skip

#: pytest's status: tests passed, failed, or could not be collected. A crash is a negative status.
_MEANING = {0: "survived", 1: "killed", 2: "killed"}
_ELSEWHERE = 99
#: A conftest or a test file that cannot be imported; where single tests of it are named, pytest's status is 4.
_NO_IMPORT = re.compile(r"^(ImportError while loading conftest|ERROR tests/)", re.MULTILINE)


@dataclass(frozen=True)
class Trial:
    """What became of a mutant.

    Args:
        mutant: it.
        outcome: ``killed``, ``timeout``, ``survived``, ``untested`` or ``broken`` (pytest itself failed).
        tests: how many tests were chosen, a count.
        seconds: wall time, s.
        log: the last lines of pytest.
    """

    mutant: Mutant
    outcome: str
    tests: int
    seconds: float
    log: str


def copy_of_tree(root: Path, folder: Path) -> Path:
    """The files git knows of or would add, compiled, in a folder of their own."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root, check=True, capture_output=True, text=True,
    )  # fmt: skip
    for name in filter(None, listed.stdout.split("\0")):
        if (root / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, folder / name)
    subprocess.run([sys.executable, "-m", "compileall", "-q", str(folder)], check=True)
    return folder


def context() -> ForkServerContext:
    """Where the processes of the tests come from, the libraries loaded."""
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(PRELOADED)
    return made


def attempt(mutant: Mutant, chooser: Chooser, copy: Path, limit: float) -> Trial:
    """Run a mutant's tests, round by round until one fails.

    Args:
        mutant: the change.
        chooser: of its tests.
        copy: of the tree.
        limit: of a round, wall time, s.

    Returns:
        What became of it.
    """
    began, count, outcome, log = time.monotonic(), 0, "untested", ""
    with use_mutation(copy / mutant.path, get_operator(mutant.operator)(), mutant.occurrence):
        for tests in chooser.rounds(mutant):
            if tests and outcome in ("untested", "survived"):
                count += len(tests)
                outcome, log = run(tests, copy, limit)
    return Trial(mutant, outcome, count, time.monotonic() - began, log)


def run(tests: Sequence[str], copy: Path, limit: float) -> tuple[str, str]:
    """Run tests in a process of their own; what is left of it is ended with it.

    Returns:
        ``survived``, ``killed``, ``broken`` or ``timeout``, and the end of pytest's output.
    """
    log = copy.with_suffix(".log")
    child = context().Process(target=_tests, args=(list(tests), str(copy), str(log)))
    child.start()
    child.join(limit)
    late = child.is_alive()
    if child.pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
    child.join()
    text = log.read_text("utf-8", errors="replace") if log.exists() else ""
    end = "\n".join(text.splitlines()[-12:])
    if _NO_IMPORT.search(text):
        return "killed", end
    if late:  # a test may have failed before something hung at the end
        return ("killed" if "\nFAILED " in f"\n{end}" else "timeout"), end
    return _MEANING.get(child.exitcode or 0, "killed" if (child.exitcode or 0) < 0 else "broken"), end


def _tests(tests: list[str], copy: str, log: str) -> None:
    os.setsid()
    os.chdir(copy)
    sys.path[:] = [
        copy,
        *(entry for entry in sys.path if entry and not (Path(entry) / "tests/mutation").is_dir()),
    ]
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(out, 1)
    os.dup2(out, 2)
    for name in [name for name in sys.modules if name == "tests" or name.startswith("tests.")]:
        del sys.modules[name]
    import pytest

    import tunnel_sim

    if not str(tunnel_sim.__file__).startswith(copy):  # the finder of an editable installation comes first
        print("the package is imported from elsewhere; install it without -e")
        os._exit(_ELSEWHERE)
    options = ["-x", "-q", "--tb=line", "-p", "no:cacheprovider", "-n", "0", "--no-header"]
    os._exit(int(pytest.main([*options, *tests])))
