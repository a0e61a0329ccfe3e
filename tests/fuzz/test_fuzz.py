"""The fuzzers themselves, and a share of their trials. Truth: what is allowed is a TunnelError of one line."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz import campaigns, readers, tables, trials, values
from tests.fuzz.summary import causes, causes_table
from tests.fuzz.trials import Outcome, run_trial
from tests.fuzz.workers import run_trials
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

SEED = 1
READER_TRIALS, IDENTIFY_TRIALS = 1000, 60
"""Beside them, continuous integration runs 2,000 trials by the command."""


@pytest.mark.slow
@pytest.mark.parametrize(("group", "count"), [("readers", READER_TRIALS), ("identify", IDENTIFY_TRIALS)])
def test_nothing_but_one_line_errors(group, count):
    outcomes = run_trials(SEED, range(count), shares={group: 1.0})
    assert [outcome.index for outcome in outcomes] == list(range(count))
    assert not causes(outcomes), "\n" + causes_table(outcomes, SEED, group)
    assert {outcome.verdict for outcome in outcomes} == {"accepted", "refused"}


@pytest.mark.slow
def test_no_diagnosis_raises_anything_but_one_line_errors():
    outcomes = run_trials(SEED, range(20), shares={"diagnose": 1.0})
    assert not causes(outcomes), "\n" + causes_table(outcomes, SEED, "diagnose")


@pytest.mark.parametrize("name", readers.READERS)
def test_inputs_left_as_they_are_are_accepted(name, tmp_path, monkeypatch):
    """Mutation starts from valid inputs, else nothing past the first check would ever be reached."""
    for changed in (
        "mutated",
        "changed_csv",
        "changed_bytes",
        "changed_line",
        "changed_head",
        "damaged",
        "changed_xml",
        "changed_formula",
        "_changed_array",
    ):
        monkeypatch.setattr(readers, changed, lambda value, *_: value)
    monkeypatch.setattr(readers, "changed_parquet", lambda frame, _rng: tables.parquet(frame))
    monkeypatch.setattr(readers, "STRANGE", 0.0)
    target, _ = readers.READERS[name]
    target(tmp_path, np.random.default_rng(2))


def test_seed_and_number_alone_decide_a_trial():
    first = [run_trial(7, index) for index in range(5)]
    assert [run_trial(7, index).verdict for index in reversed(range(5))] == [o.verdict for o in first][::-1]
    assert [trials.chosen(7, index)[1] for index in range(5)] == [o.target for o in first]


@pytest.mark.parametrize(
    "value",
    [10**400, -(10**400), 2**63, 1.7976931348623157e308, 0.5],
    ids=lambda value: f"{len(str(value))} characters",
)
def test_any_number_can_be_moved(value):
    rng = np.random.default_rng(1)
    for _ in range(50):
        values.moved_number(value, rng)


@pytest.mark.parametrize("change", campaigns.READINGS)
@pytest.mark.parametrize("count", [2, 8, 300])
def test_changed_readings_are_still_a_record(change, count):
    for seed in range(30):
        Record(*change(np.arange(count) / 50.0, np.cos(np.arange(count)), np.random.default_rng(seed)))


def planted(folder: Path, _rng: np.random.Generator) -> None:
    raise ZeroDivisionError(f"in {folder.name}")


def refused(_folder: Path, _rng: np.random.Generator) -> None:
    raise TunnelError("wrong")


def warned(_folder: Path, _rng: np.random.Generator) -> None:
    np.float64(1e300) * np.float64(1e300)


def endless(_folder: Path, _rng: np.random.Generator) -> None:
    while True:
        pass


def waiting(_folder: Path, _rng: np.random.Generator) -> None:
    time.sleep(60.0)


@pytest.mark.parametrize(
    ("target", "verdict", "error"),
    [
        (planted, "finding", "ZeroDivisionError"),
        (refused, "refused", ""),
        (warned, "finding", "RuntimeWarning"),
        (endless, "finding", "Hang"),
        (waiting, "finding", "Hang"),
    ],
)
def test_what_is_a_finding(target, verdict, error, monkeypatch, tmp_path):
    monkeypatch.setattr(trials, "READERS", {"planted": (target, 1.0)})
    monkeypatch.setattr(trials, "LIMIT_S", {"readers": 0.2})
    monkeypatch.setattr(trials, "IDLE_S", 0.2)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    outcome = run_trial(1, 0, {"readers": 1.0})
    assert (outcome.verdict, outcome.error) == (verdict, error)
    assert outcome.place.startswith("tests/fuzz/") == bool(error)
    assert not list(tmp_path.iterdir())


def fatal(_seed: int, index: int, _shares: object) -> Outcome:
    if index == 3:
        os.kill(os.getpid(), signal.SIGSEGV)
    return Outcome(index, "fatal", "accepted")


def test_a_process_that_dies_is_reported_with_its_trial_and_replaced():
    outcomes = run_trials(SEED, range(6), trial=fatal)
    assert [outcome.index for outcome in outcomes] == list(range(6))
    assert [outcome.index for outcome in outcomes if outcome.error == "Death"] == [3]
