"""Tables of text that no logger writes are refused for little more memory than the file itself takes.

Truth: the memory that the operating system counts, and the page of limits.
"""

import resource
from pathlib import Path

import numpy as np
import pytest

from tunnel_sim import TunnelError
from tunnel_sim.files import import_records
from tunnel_sim.files.importing.tables import Channel
from tunnel_sim.files.importing.units import split_unit
from tunnel_sim.files.reading import check_utf8
from tunnel_sim.files.run_files import read_table
from tunnel_sim.vocabulary import limits

SIZE = 48_000_000
NUL, LONG = "contains NUL bytes", "is longer than 1,048,576 bytes"
HEAD = b"time_s,yaw_rad\n"
CASES = {
    "NULs alone": (lambda size: b"\0" * size, NUL),
    "NULs below a header": (lambda size: HEAD + b"\0" * size, NUL),
    "an open quote": (lambda size: HEAD + b'0,0.1\n1,"' + b"x" * size, LONG),
    "one number": (lambda size: HEAD + b"0," + b"1" * size, LONG),
    "no line break": (lambda size: b"time_s,yaw_rad," + b"x" * size, LONG),
    "blanks": (lambda size: HEAD + b" " * size + b"\n", LONG),
    "empty columns": (
        lambda size: HEAD[:-1] + b"," * 998 + b"\n" + (b"," * 999 + b"\n") * (size // 480),
        "cells, more",
    ),
    "lines without a value": (
        lambda size: HEAD + b"\n" * size,
        "48,000,000 samples, more than 20,000,000",
    ),
}
"""What makes a file of about a size in bytes, and the refusal."""


@pytest.mark.parametrize("case", CASES)
def test_a_run_file_of_another_kind_is_refused_cheaply(case: str, tmp_path: Path) -> None:
    make, expected = CASES[case]
    content = make(SIZE)
    path = tmp_path / "r.csv"
    path.write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(TunnelError, match=expected):
        read_table(path, "here")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2.2 * len(content) / 1024


@pytest.mark.parametrize("case", ["NULs alone", "an open quote", "no line break"])
def test_an_import_refuses_them_too(case: str, tmp_path: Path) -> None:
    make, expected = CASES[case]
    (tmp_path / "r.csv").write_bytes(make(2 * 2**20))
    with pytest.raises(TunnelError, match=expected):
        import_records([tmp_path / "r.csv"], tmp_path / "out")


@pytest.mark.parametrize(
    "heading", ["a" * 200_000, "(" * 200_000, "a_" * 100_000, " per" * 50_000, "1" * 200_000, "," * 200_000]
)
def test_the_time_that_a_heading_takes_does_not_grow_with_its_square(heading: str, tmp_path: Path) -> None:
    """Each takes minutes where any of the searches goes through the rest of the heading from every character."""
    rows = b"".join(b"%d;%d\n" % (i, i % 7) for i in range(400))
    (tmp_path / "r.txt").write_bytes(heading.encode() + b";angle\n" + rows)
    begun = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    with pytest.raises(TunnelError):
        import_records([tmp_path / "r.txt"], tmp_path / "out")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_utime - begun < 10.0


def test_a_long_name_is_cut() -> None:
    assert len(Channel("a_" * 1000, np.zeros(3)).name) == limits.NAME_CHARACTERS
    assert len(split_unit("a_" * 1000)[0]) <= limits.NAME_CHARACTERS


@pytest.mark.parametrize("place", [0, 2**22 - 1, 2**22, 5_000_000])
def test_the_line_that_is_not_utf_8_is_named_wherever_it_lies(place: int) -> None:
    text = ("ä" * 9 + "\n").encode() * 263_158
    check_utf8(text, "here")
    at = text.rfind(b"\n", 0, place) + 1
    line = text[:at].count(10) + 1
    with pytest.raises(TunnelError, match=rf"not UTF-8 text \(line {line}\)"):
        check_utf8(text[:at] + b"\xff" + text[at:], "here")
