"""Names that a killed command leaves behind."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tunnel_sim.files.writing import temporary_names


def names_of_the_dead(target: Path) -> tuple[Path, Path]:
    """The temporary names that a process of this machine, ended by now, had for a target."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    partial, replaced = (
        path.with_name(path.name.replace(f"-{os.getpid()}-", f"-{child.pid}-"))
        for path in temporary_names(target)
    )
    return partial, replaced
