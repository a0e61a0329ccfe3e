"""``python -m tests.mutation cover`` once, then ``python -m tests.mutation run --count 100 --seed 1``."""

from __future__ import annotations

import argparse
import os
import queue
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from scipy.stats import binomtest

from tests.mutation.choose import Chooser
from tests.mutation.draw import PACKAGES, Mutant, draw
from tests.mutation.trial import Trial, attempt, copy_of_tree, run

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build" / "mutation"


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    cover = commands.add_parser("cover", help="record which test runs which line")
    cover.add_argument("tests", nargs="*", help="only these, added to what is recorded")
    trials = commands.add_parser("run", help="draw mutants and run their tests")
    trials.add_argument("--count", type=int, default=100, help="mutants")
    trials.add_argument("--seed", type=int, default=1, help="of the draw")
    trials.add_argument("--under", nargs="+", default=PACKAGES, help="only modules in these folders")
    trials.add_argument("--only", type=int, nargs="+", help="numbers of the mutants of the draw to try")
    trials.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at a time")
    trials.add_argument("--budget", type=float, default=60.0, help="seconds of tests for a mutant and round")
    trials.add_argument("--limit", type=float, default=180.0, help="seconds of wall time for a round")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    if options.command == "cover":
        return _cover(options.tests)
    return _run(options)


def _cover(tests: list[str]) -> int:
    """The suite, or some of it, with a context for every test."""
    WORK.mkdir(parents=True, exist_ok=True)
    report = WORK / f"durations-{len(list(WORK.glob('*.xml'))) if tests else 0}.xml"
    settings = f"--cov-config={Path(__file__).parent / 'coverage.ini'}"
    command = [sys.executable, "-m", "pytest", "-q", "--cov", settings, "--cov-context=test", "--cov-report="]
    if tests:
        command += ["--cov-append", *tests]
    return subprocess.run([*command, f"--junitxml={report}"], cwd=ROOT, check=False).returncode


def _run(options: argparse.Namespace) -> int:
    chooser = Chooser(ROOT, WORK, options.budget)
    mutants = draw(ROOT, options.count, options.seed, options.under)
    numbers = {mutant: number for number, mutant in enumerate(mutants)}
    if options.only:
        mutants = [mutants[number] for number in options.only]
    with tempfile.TemporaryDirectory() as scratch:
        copies: queue.Queue[Path] = queue.Queue()
        first = copy_of_tree(ROOT, Path(scratch) / "tree0")
        copies.put(first)
        for job in range(1, options.jobs):
            copies.put(Path(shutil.copytree(first, first.with_name(f"tree{job}"))))

        def one(mutant: Mutant) -> Trial:
            copy = copies.get()
            try:
                return attempt(mutant, chooser, copy, options.limit)
            finally:
                copies.put(copy)

        _control(chooser, mutants, copies)
        with ThreadPoolExecutor(options.jobs) as pool:
            trials = []
            for done in as_completed([pool.submit(one, mutant) for mutant in mutants]):
                trials.append(done.result())
                _tell(numbers[trials[-1].mutant], trials[-1])
    _summary(trials)
    return 0


def _control(chooser: Chooser, mutants: list[Mutant], copies: queue.Queue[Path]) -> None:
    """Tests of the first mutants must pass without a change: or else everything would count as killed."""
    tests = {test for mutant in mutants[:5] for group in chooser.rounds(mutant) for test in group[:1]}
    if not tests:  # without a name pytest would run the whole suite
        raise SystemExit("no test is known to run these modules: record the coverage first")
    copy = copies.get()
    outcome, log = run(sorted(tests), copy, 600.0)
    copies.put(copy)
    if outcome != "survived":
        raise SystemExit(f"the tests do not pass without a change ({outcome}):\n{log}")


def _tell(number: int, trial: Trial) -> None:
    cost = f"{trial.tests:5} tests {trial.seconds:6.1f} s"
    print(f"{number:3} {trial.outcome:9}{cost}  {trial.mutant.words(ROOT)}", flush=True)
    killer = next((line for line in trial.log.splitlines() if line.startswith(("FAILED", "ERROR"))), "")
    print(f"    by {killer}"[:200] if killer else "", flush=True)


def _summary(trials: list[Trial]) -> None:
    counts = Counter(trial.outcome for trial in trials)
    caught = counts["killed"]
    shares = binomtest(caught, len(trials)).proportion_ci(method="wilson")
    print(f"\n{dict(counts)}")
    print(
        f"killed {caught} of {len(trials)}: {caught / len(trials):.1%} "
        f"(95 % Wilson {shares.low:.1%} to {shares.high:.1%})"
    )
    for trial in trials:
        if trial.outcome != "killed":
            print(f"{trial.outcome}: {trial.mutant.words(ROOT)}")


if __name__ == "__main__":
    raise SystemExit(main())
