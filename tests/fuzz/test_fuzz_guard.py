"""What counts as a finding, and that spoiling starts from valid inputs. Truth: planted faults, and the readers."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st

from tests.fuzz import campaigns, guard, tables, test_fuzz_readers, texts, values
from tests.fuzz.guard import Hang, answers_or_refuses
from tests.fuzz.test_fuzz_readers import READERS
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record


class Rambling(TunnelError):
    def __str__(self):
        return "several\nlines"


@pytest.mark.parametrize(
    ("raised", "seen"),
    [
        (TunnelError("wrong"), None),
        (Rambling("wrong"), AssertionError),
        (ZeroDivisionError(), ZeroDivisionError),
        (RuntimeWarning(), RuntimeWarning),
    ],
)
def test_only_a_refusal_of_one_line_is_allowed(raised, seen):
    def work():
        with answers_or_refuses():
            raise raised

    if seen is None:
        work()
    else:
        with pytest.raises(seen):
            work()


def test_the_folder_of_an_example_is_removed():
    with answers_or_refuses() as folder:
        (folder / "file").write_bytes(b"")
        raise TunnelError("wrong")
    assert not folder.exists()


def spin() -> None:
    while True:
        pass


@pytest.mark.parametrize("work", [spin, lambda: time.sleep(60.0)], ids=["endless", "waiting"])
def test_an_example_without_end_is_a_finding(work):
    with pytest.raises(Hang), answers_or_refuses(limit=0.2, waiting=2.0):
        work()


def test_an_example_of_too_much_memory_is_a_finding():
    with pytest.raises(MemoryError), answers_or_refuses():
        bytearray(2 * guard.MEMORY)
    bytearray(2**20)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Generating overly large repr")
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__name__)
def test_inputs_that_are_not_spoilt_are_accepted(reader, tmp_path, monkeypatch):
    """Else nothing past the first check of a reader would ever be reached."""
    whole = {
        "spoilt_toml": lambda seed: seed if isinstance(seed, bytes) else texts.to_toml(seed),
        "spoilt_json": texts.to_json,
        "parquets": tables.parquet,
    }
    names = (
        "spoilt",
        "spoilt_bytes",
        "spoilt_text",
        "spoilt_xml",
        "damaged",
        "nested",
        "csv",
        "_spoilt_array",
    )
    whole |= dict.fromkeys(names, lambda value: value)
    for name, keep in whole.items():
        monkeypatch.setattr(test_fuzz_readers, name, lambda value, *_, keep=keep, **__: st.just(keep(value)))
    reader(tmp_path, lambda strategy: find(strategy, lambda _: True))


@given(value=values.odd_numbers, data=st.data())
def test_any_number_can_be_moved(value, data):
    data.draw(values.moved_numbers(value))


@pytest.mark.parametrize("change", campaigns.READINGS)
@pytest.mark.parametrize("count", [2, 8, 300])
@settings(max_examples=20)
@given(data=st.data())
def test_changed_readings_are_still_a_record(change, count, data):
    Record(*change(data.draw, np.arange(count) / 50.0, np.cos(np.arange(count))))
