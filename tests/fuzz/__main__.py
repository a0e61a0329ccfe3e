"""Mutated files and degenerate campaigns against every reader, ``identify`` and ``diagnose``.

Allowed is a `TunnelError` of one line. Findings are any other exception, a warning, a trial of more than 5 s of
the processor (60 s for a diagnosis) or one that waits, more than 2 GiB, and a process that dies. Seed and number
alone decide a trial: --trial N repeats it in this process, with its traceback.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time

from tests.fuzz.readers import READERS
from tests.fuzz.summary import causes_table, counts_table
from tests.fuzz.trials import SHARES, Outcome


def main(arguments: list[str] | None = None) -> int:
    """Run trials and say what was found.

    Args:
        arguments: those of the process where not given.

    Returns:
        0 where nothing was found, 1 otherwise.
    """
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of all trials")
    parser.add_argument("--count", type=int, default=2000, help="number of trials")
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--workers", type=int, default=2, help="number of processes")
    parser.add_argument("--only", choices=[*SHARES, *READERS], help="one group or reader alone")
    parser.add_argument("--trial", type=int, help="repeat this trial alone, and show its traceback")
    given = parser.parse_args(arguments)
    shares = SHARES if given.only is None else {given.only: 1.0}
    if given.trial is not None:
        return _repeat(given.seed, given.trial, shares)
    begun = time.monotonic()
    outcomes: list[Outcome] = []
    with contextlib.suppress(KeyboardInterrupt):  # what was found until then is shown
        _run(given, shares, outcomes)
    print(counts_table(outcomes))
    found = sum(outcome.verdict == "finding" for outcome in outcomes)
    peak = max((outcome.memory for outcome in outcomes), default=0) / 2**20
    spent = f"{time.monotonic() - begun:.0f} s, {peak:.0f} MiB at most"
    print(f"\n{len(outcomes)} trials, seed {given.seed}, {spent}; {found} findings")
    if found:
        print("\n" + causes_table(outcomes, given.seed, given.only))
    return 1 if found else 0


def _run(given: argparse.Namespace, shares: dict[str, float], outcomes: list[Outcome]) -> None:
    from tests.fuzz.workers import run_trials
    from tunnel_lab.terminal.outputs import bar

    with bar("fuzzing", given.count) as advance:
        advance(0, given.count, "")

        def progress(outcome: Outcome) -> None:
            outcomes.append(outcome)
            advance(len(outcomes), given.count, "")

        indices = range(given.first, given.first + given.count)
        run_trials(given.seed, indices, workers=given.workers, shares=shares, progress=progress)


def _repeat(seed: int, index: int, shares: dict[str, float]) -> int:
    from tests.fuzz.trials import run_trial

    outcome = run_trial(seed, index, shares, show=True)
    print(outcome)
    return 1 if outcome.verdict == "finding" else 0


if __name__ == "__main__":
    sys.exit(main())
