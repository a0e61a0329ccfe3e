"""A fork of a process that has read files answers as its parent does, or refuses. Truth: the parent's answer."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.skips import PLATFORM
from tunnel_sim import read_campaign, write_campaign

ROOT = Path(__file__).parents[3]
MEASURED = ROOT / "identification" / "data" / "measured" / "rotary-pendulum"
LEFT_OUT = "swing-2", "swing-3"
CHILD = f"""
import os, sys, threading
from identification import identify
from tunnel_sim import TunnelError, read_campaign, write_campaign

def answers():
    found = []
    for path in sys.argv[1:4]:
        leave_out = {LEFT_OUT} if os.path.isdir(path) else ()
        found.append(str(identify(path, leave_out=leave_out).to_json_dict()))
    return found

first = answers()
child = os.fork()
if child == 0:
    threading.Timer(60.0, os._exit, (3,)).start()  # a process that waits for ever
    same = answers() == first
    try:
        write_campaign(read_campaign(sys.argv[1]), sys.argv[4])
    except TunnelError as error:
        print(error, flush=True)
        os._exit(0 if same else 4)
    os._exit(5)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason=f"{PLATFORM}: no forks")
def test_a_fork_identifies_files_of_every_kind_and_refuses_to_write(tmp_path: Path) -> None:
    campaign = read_campaign(MEASURED)
    write_campaign(campaign, tmp_path / "parquet", run_format="parquet")
    log = tmp_path / "log.txt"
    log.write_bytes((MEASURED / "runs" / "swing-1.csv").read_bytes())
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CHILD, MEASURED, tmp_path / "parquet", log, tmp_path / "new"],
        cwd=ROOT, capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert done.stdout.count("\n") == 1
    assert "a fork of one that had loaded Polars" in done.stdout
    assert not (tmp_path / "new").exists()
