"""The command that starts the bench. Truth: how the command line ends with bad input."""

from __future__ import annotations

import importlib.util
import socket
from pathlib import Path
from typing import Any

import pytest

from tunnel_lab import cli


@pytest.mark.parametrize(("module", "said"), [("nicegui", "[bench]"), ("fcntl", "needs Linux or macOS")])
def test_what_is_missing_is_said_in_one_line(
    module: str,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    real = importlib.util.find_spec

    def find(name: str, *rest: Any) -> Any:
        return None if name == module else (real(name, *rest) or True)

    monkeypatch.setattr(importlib.util, "find_spec", find)
    assert cli.main(["bench", str(tmp_path / "new")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("tunnel: tunnel bench: ")
    assert said in err
    assert not (tmp_path / "new").exists()


def test_a_port_that_is_taken_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Before anything is served: this process keeps its own application."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert cli.main(["bench", str(tmp_path), "--port", port, "--no-browser"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"tunnel: --port {port}: cannot be opened")
    assert err.count("\n") == 1
