"""The process in which libraries read files: what comes back, and what ends it. Truth: what the reader does."""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest

from tests.skips import PLATFORM
from tests.support.odd_readers import TABLES
from tunnel_sim import TunnelError, sandbox
from tunnel_sim.files import kept_process as guard
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.source import read_guarded
from tunnel_sim.files.importing.tables import Table
from tunnel_sim.vocabulary import limits

READER = "tests.support.odd_readers:ODD"


def read(content: bytes) -> list[Table]:
    return read_guarded(READER, content, "log.h5", ImportChoices())[0]


def test_tables_come_back_as_they_were() -> None:
    for found, truth in zip(read(b"good"), TABLES, strict=True):
        assert [(c.name, c.unit) for c in found.channels] == [(c.name, c.unit) for c in truth.channels]
        for one, other in zip(found.channels, truth.channels, strict=True):
            assert one.values.dtype == np.float64
            np.testing.assert_array_equal(one.values, other.values)
            np.testing.assert_array_equal(np.signbit(one.values), np.signbit(other.values))
        assert (found.part, found.remarks, found.headed, found.named) == (
            truth.part, truth.remarks, truth.headed, truth.named
        )  # fmt: skip
        assert str(found.facts) == str(dict(truth.facts))


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"spin", "log.h5: reading it takes more than 0.3 s; split it if it is large; if it is damaged"),
        (b"die", "log.h5: reading it ended its process with 1; split it if it is large"),
        pytest.param(
            b"fill",
            "log.h5: reading it takes more than 0.5 GiB of memory; split it",
            marks=pytest.mark.skipif(sys.platform != "linux", reason=f"{PLATFORM}: only Linux limits memory"),
        ),
        (b"refuse", "log.h5: is odd; mend it"),
    ],
)
def test_a_reader_that_exceeds_its_limits_is_one_line_and_the_next_file_is_read(
    monkeypatch: pytest.MonkeyPatch, content: bytes, what: str
) -> None:
    if content == b"fill":  # a new process, for which filling it takes no seconds
        monkeypatch.setattr(limits, "READER_MEMORY", 2**29)
        while guard._kept:
            guard._kept.pop().end()
    read(b"good")  # starting the process is not judged
    monkeypatch.setattr(limits, "READER_SECONDS", 0.3 if content == b"spin" else 60.0)
    begun = time.monotonic()
    with pytest.raises(TunnelError) as caught:
        read(content)
    assert str(caught.value).startswith(what)
    assert time.monotonic() - begun < 30.0
    monkeypatch.setattr(limits, "READER_SECONDS", 60.0)
    assert len(read(b"good")) == len(TABLES)


def test_one_process_serves_many_files_and_an_interruption_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    read(b"good")
    (server,) = guard._kept
    with pytest.raises(TunnelError):
        read(b"refuse")
    assert guard._kept == [server]

    def interrupted(_stream: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(sandbox, "_received", interrupted)
        with pytest.raises(KeyboardInterrupt):
            read(b"good")
    assert not server.usable  # its answer would be mistaken for the next one
    assert len(read(b"good")) == len(TABLES)
