"""``tunnel`` whose standard output nobody reads any more."""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, cast

from tunnel_lab.cli import main


class GoneReader:
    """Standard output whose reader went away before the first word."""

    encoding = "utf-8"

    def write(self, _: str) -> int:
        raise BrokenPipeError(32, "Broken pipe")

    def flush(self) -> None:
        """Nothing was taken, so nothing is kept back."""

    def fileno(self) -> int:
        return os.open(os.devnull, os.O_WRONLY)

    def isatty(self) -> bool:
        return False


def unheard(*words: str | Path) -> int:
    """The exit status of ``tunnel`` with nobody reading."""
    before = sys.stdout
    try:
        with redirect_stdout(cast("Any", GoneReader())):
            return main([str(word) for word in words])
    finally:
        sys.stdout = before  # Typer puts another one there
