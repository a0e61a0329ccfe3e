"""Standard output in any encoding, and tables for spreadsheets and Markdown. Truth: bytes by hand."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from identification.show.blocks import TextTable
from tunnel_lab.cli import main
from tunnel_lab.terminal.table_format import TableFormat
from tunnel_lab.terminal.table_layout import rendered

ROOT = Path(__file__).parents[4]
ENCODINGS = {
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "cp1252": {"PYTHONIOENCODING": "cp1252"},
    "strict latin-1": {"PYTHONIOENCODING": "latin-1:strict"},
    "C locale": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}


def printed(encoding: str, *words: object) -> tuple[int, bytes, bytes]:
    """Exit status, standard output and standard error of ``tunnel``, in a process where the locale matters."""
    if name := ENCODINGS[encoding].get("PYTHONIOENCODING"):
        codec, _, errors = name.partition(":")
        out, err = (
            io.TextIOWrapper(io.BytesIO(), codec, errors=how)
            for how in (errors or "strict", "backslashreplace")
        )
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "stdout", out)
            patch.setattr(sys, "stderr", err)
            status = main([str(word) for word in words])
        out.flush()
        err.flush()
        return status, out.buffer.getvalue(), err.buffer.getvalue()  # type: ignore[attr-defined]
    done = subprocess.run(
        [sys.executable, "-m", "tunnel_lab.cli", *map(str, words)],
        cwd=ROOT, env={**os.environ, **ENCODINGS[encoding]}, capture_output=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("encoding", ["strict latin-1", "C locale"])
def test_what_cannot_be_encoded_is_replaced(encoding: str, tiny_campaign: Path) -> None:
    status, out, err = printed(encoding, "identify", tiny_campaign)
    assert (status, err) == (0, b"")
    assert b"Cnbeta" in out
    assert b"omegan" in out


def test_help_lists_and_messages_in_ascii(tmp_path: Path) -> None:
    assert printed("ascii", "--help")[0] == 0
    assert printed("ascii", "effects")[0] == 0
    status, _, err = printed("ascii", "identify", tmp_path / "β€\udcff")
    assert status == 2
    assert err.startswith(b"tunnel: ")
    assert b"Traceback" not in err


def test_json_holds_the_same_document_in_any_encoding(tiny_campaign: Path) -> None:
    done = [printed(e, "identify", tiny_campaign, "--json", "-") for e in ("ascii", "cp1252")]
    assert [(status, err) for status, _, err in done] == [(0, b"")] * 2
    texts = [out for _, out, _ in done]
    assert texts[0].isascii()
    assert json.loads(texts[0]) == json.loads(texts[1].decode("cp1252"))
    _, rows, _ = printed("ascii", "identify", tiny_campaign, "--format", "json")
    assert "Cnβ" in json.dumps([json.loads(line) for line in rows.splitlines()], ensure_ascii=False)


def shown(kind: TableFormat, *cells: str) -> str:
    plain = TextTable("t <b>", tuple(f"c{i}" for i in range(len(cells))), (cells,))
    return rendered(plain, kind).splitlines()[-1]


@pytest.mark.parametrize("cell", ["=1+1", "+x", "-x", "@x", "-2+3+cmd|' /C calc'!A0", "－x", "'=a"])
def test_a_formula_is_a_text_in_csv(cell: str) -> None:
    assert shown(TableFormat.CSV, cell, "b") == f"'{cell},b"


@pytest.mark.parametrize(
    "cell", ["-0.1", "+1e-3", "-.5", "-0.103(12)", "-0.10 ± 0.02", "-40 %", "-3 deg/s", "a=b"]
)
def test_a_negative_number_stays_a_number_in_csv(cell: str) -> None:
    assert shown(TableFormat.CSV, cell) == cell


def test_markdown_holds_no_markup_of_a_cell() -> None:
    line = shown(TableFormat.MD, "<script>&x", "a|b\\|c", "[x](javascript:1)", "ωn [rad/s]")
    assert line == r"| &lt;script&gt;&amp;x | a\|b\\\|c | [x]\(javascript:1) | ωn [rad/s] |"
    assert rendered(TextTable("t <b>", ("c",), ()), TableFormat.MD).startswith("**t &lt;b&gt;**")
