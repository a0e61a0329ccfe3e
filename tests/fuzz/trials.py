"""A trial: a number that decides which target is run on which input, and what became of it."""

from __future__ import annotations

import contextlib
import io
import resource
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.fuzz.readers import READERS, Target
from tests.fuzz.verbs import diagnose_campaign, identify_campaign
from tunnel_sim.vocabulary.errors import TunnelError

SHARES = {"readers": 0.966, "identify": 0.03, "diagnose": 0.004}
"""Which part of the trials goes where; a diagnosis takes seconds, a reader milliseconds."""
LIMIT_S = {"readers": 5.0, "identify": 5.0, "diagnose": 60.0}
"""Processor time after which a trial hangs; a legitimate diagnosis of a small campaign takes up to a minute."""
IDLE_S = 5.0
"""A trial that waits so long, on a pipe say, hangs."""
MEMORY = 2 * 2**30
"""Most memory a process may ever hold, bytes."""
PACKAGES = ("tunnel_sim", "identification", "diagnosis", "tunnel_lab")
_VERBS: dict[str, Target] = {"identify": identify_campaign, "diagnose": diagnose_campaign}


class Hang(BaseException):
    """The time of a trial is over; raised where it is."""


@dataclass(frozen=True)
class Outcome:
    """What became of a trial.

    Args:
        index: of the trial.
        target: what was run.
        verdict: ``accepted``, ``refused`` (one line to the user) or ``finding``.
        error: kind of the finding.
        place: file and line of the project where it was raised.
        deepest: file and line where it was raised, in whatever library.
        message: its first line.
        seconds: processor time.
        memory: most that the process has held so far, bytes.
    """

    index: int
    target: str
    verdict: str
    error: str = ""
    place: str = ""
    deepest: str = ""
    message: str = ""
    seconds: float = 0.0
    memory: int = 0


def chosen(
    seed: int, index: int, shares: dict[str, float] | None = None
) -> tuple[str, str, np.random.Generator]:
    """Group, target and generator of a trial; nothing else decides it.

    Args:
        seed: of all trials.
        index: of the trial.
        shares: of the groups, or of single readers; `SHARES` where not given.
    """
    rng = np.random.default_rng([seed, index])
    shares = shares or SHARES
    weights = np.array(list(shares.values()))
    group = list(shares)[rng.choice(len(weights), p=weights / weights.sum())]
    if group in READERS:
        return "readers", group, rng
    if group != "readers":
        return group, group, rng
    weights = np.array([weight for _, weight in READERS.values()])
    return group, list(READERS)[rng.choice(len(weights), p=weights / weights.sum())], rng


def run_trial(
    seed: int, index: int, shares: dict[str, float] | None = None, *, show: bool = False
) -> Outcome:
    """Run a trial in this process, warnings as errors, with its limits of time and memory.

    Args:
        seed: of all trials.
        index: of the trial.
        shares: of the groups; `SHARES` where not given.
        show: print the traceback of a refusal or a finding.
    """
    group, name, rng = chosen(seed, index, shares)
    target = READERS[name][0] if group == "readers" else _VERBS[group]
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    before = _processor_time()
    raised: BaseException | None = None
    try:
        with _quiet(), _time_limit(LIMIT_S[group]):
            target(folder, rng)
        found = Outcome(index, name, "accepted")
    except TunnelError as error:
        found = _refused(index, name, error)
        raised = error
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic of polars is no Exception
        found = _finding(index, name, error)
        raised = error
    finally:
        _close_figures()
        shutil.rmtree(folder, ignore_errors=True)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    if found.verdict != "finding" and memory > MEMORY:
        found = Outcome(index, name, "finding", "Memory", name, name, f"more than {MEMORY / 2**30:g} GiB")
    if show and raised is not None:
        traceback.print_exception(raised)
    return Outcome(**{**vars(found), "seconds": _processor_time() - before, "memory": memory})


def _refused(index: int, name: str, error: TunnelError) -> Outcome:
    """A refusal is one line that can be printed."""
    text = str(error)
    if text.isprintable():
        return Outcome(index, name, "refused")
    place, deepest = _places(error)
    return Outcome(index, name, "finding", "message of several lines", place, deepest, repr(text)[:160])


def _finding(index: int, name: str, error: BaseException) -> Outcome:
    place, deepest = _places(error)
    lines = str(error).splitlines() or [""]
    return Outcome(index, name, "finding", type(error).__name__, place, deepest, lines[0][:160])


def _places(error: BaseException) -> tuple[str, str]:
    """The innermost line of the project, and the innermost of all."""
    frames = [(Path(frame.filename), frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    shown = [_shown(path, line) for path, line in frames]
    ours = [text for text in shown if text.startswith(PACKAGES)]
    return (ours or shown or [""])[-1], (shown or [""])[-1]


def _shown(path: Path, line: int | None) -> str:
    parts = path.parts
    at = next(
        (i for i, part in enumerate(parts) if part in (*PACKAGES, "tests", "site-packages")), len(parts) - 1
    )
    return f"{'/'.join(parts[at:]).removeprefix('site-packages/')}:{line}"


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Nothing printed; every warning an error."""
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")
        yield


@contextlib.contextmanager
def _time_limit(limit: float) -> Iterator[None]:
    """Raise `Hang` after so many seconds of the processor, or when the processor has nothing to do for `IDLE_S`."""
    used = _processor_time()

    def over(_signal: int, _frame: object) -> None:
        raise Hang(f"more than {limit:g} s")

    def look(_signal: int, _frame: object) -> None:
        nonlocal used
        if _processor_time() - used < 0.02 * IDLE_S:
            raise Hang(f"waits for more than {IDLE_S:g} s")
        used = _processor_time()

    kept = [(signal.SIGPROF, signal.signal(signal.SIGPROF, over))]
    kept.append((signal.SIGALRM, signal.signal(signal.SIGALRM, look)))
    signal.setitimer(signal.ITIMER_PROF, limit)
    signal.setitimer(signal.ITIMER_REAL, IDLE_S, IDLE_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in kept:
            signal.signal(number, handler)


def _processor_time() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _close_figures() -> None:
    """Close what a failed trial has left open."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")
