"""A good campaign for tests to spoil, and how its refusal has to look."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.errors import TunnelError

HEAD = 'schema_version = 1\n[campaign]\nname = "c"\n'
RIG = "[rig]\nyaw_inertia = 0.11\nfrontal_area = 0.036\nreference_length = 0.625\n"
SENSOR = "[sensor]\nresolution = 0.0005\n"
R1 = """[[runs]]
id = "r1"
file = "runs/r1.csv"
spring_stiffness = 16.12
wind_speed = 0.0
release_angle = 0.349
"""
R2 = """[[runs]]
id = "r2"
file = "runs/r2.csv"
spring_stiffness = 16.12
wind_speed = 10.0
air_density = 1.2
"""
TOML = HEAD + RIG + SENSOR + R1 + R2

TIME = np.arange(1000) / 200.0
YAW = 0.349 * np.exp(-0.1 * TIME) * np.cos(12.6 * TIME)


def csv(time: np.ndarray | None, yaw: np.ndarray, column: str = "yaw_rad") -> str:
    table = {column: yaw} if time is None else {"time_s": time, column: yaw}
    return pl.DataFrame(table).write_csv()


GOOD = csv(TIME, YAW)
LINES = GOOD.splitlines()


def good_campaign(parent: Path) -> Path:
    """A campaign of two runs in a new folder, and a run file outside it."""
    folder = parent / "c"
    (folder / "runs").mkdir(parents=True)
    (folder / "campaign.toml").write_text(TOML, encoding="utf-8")
    for run in ("r1", "r2"):
        (folder / "runs" / f"{run}.csv").write_text(GOOD, encoding="utf-8")
    (parent / "outside.csv").write_text(GOOD, encoding="utf-8")
    return folder


def refusal(folder: Path) -> str:
    def listing() -> dict[Path, bytes | None]:
        return {p: p.read_bytes() if p.is_file() else None for p in folder.parent.rglob("*")}

    before = listing()
    with pytest.raises(TunnelError) as caught:
        read_campaign(folder)
    assert listing() == before
    assert caught.value.remedy
    text = str(caught.value)
    assert text.isprintable(), "one line, and nothing a terminal would act on"
    assert len(text) < 400 + len(str(folder))
    return text


def swap(old: str, new: str) -> str:
    assert old in TOML
    return TOML.replace(old, new, 1)


def in_run(old: str, new: str) -> str:
    """The campaign with a change in the second run only."""
    assert old in R2
    return HEAD + RIG + SENSOR + R1 + R2.replace(old, new)
