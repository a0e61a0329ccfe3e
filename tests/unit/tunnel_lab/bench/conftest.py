"""One server for the tests of the bench: it takes two seconds to start."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.import_files import decay
from tests.support.served import FULL_DISK, Bench, bench
from tunnel_sim.files import import_records


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """A workspace with three campaigns of two runs; the diagnosis of ``odd`` is not one."""
    folder = tmp_path_factory.mktemp("served") / "workspace"
    folder.mkdir()
    rows = "\n".join(f"{t:.3f},{y:.6f}" for t, y in zip(*decay(1), strict=True))
    for name in ("a", "b"):
        (folder / f"{name}.csv").write_text(f"time_s,yaw_rad\n{rows}\n")
    for name in ("two", "plain", "odd"):
        import_records([folder / "a.csv", folder / "b.csv"], folder / name)
    (folder / "odd.diagnosis.json").write_text('{"verdict": 1, "provenance": []}')
    with bench(folder, prelude=FULL_DISK) as found:
        yield found
