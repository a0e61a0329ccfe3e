"""MDF 4 files by two writers: asammdf, and one byte by byte from the standard.

Truth: the numbers that were written, and the import of the same numbers as CSV.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import decay, written
from tests.support.robot_logs import Mdf
from tunnel_lab.cli import main
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.writing import import_records

TIME, ANGLE = decay()
LATE = TIME[::4] + 1e-3
TORQUE = 0.5 * np.cos(3.0 * TIME)
Columns = dict[str, tuple[str, np.ndarray, float | None]]
Groups = dict[str, tuple[np.ndarray, Columns]]
Writer = Callable[[Path, Groups], None]

ONE: Groups = {"joint": (TIME, {"angle": ("rad", ANGLE, None), "torque": ("Nm", TORQUE, None)})}
TWO: Groups = {
    "joint": (TIME, {"angle": ("rad", ANGLE, None)}),
    "amplifier": (LATE, {"torque": ("Nm", 2.0 * LATE, None)}),
}


def by_asammdf(path: Path, groups: Groups) -> None:
    import asammdf  # which takes half a second: only the worker of this file needs it

    with asammdf.MDF(version="4.10") as file:
        for name, (time, columns) in groups.items():
            signals = []
            for label, (unit, values, factor) in columns.items():
                line = None if factor is None else {"a": factor, "b": 0.0}
                raw = values if factor is None else np.round(values / factor).astype(np.int32)
                signals.append(asammdf.Signal(raw, time, name=label, unit=unit, conversion=line))
            file.append(signals, acq_name=name, comment=name)
        file.save(path, overwrite=True)


def by_asammdf_compressed(path: Path, groups: Groups) -> None:
    import asammdf

    by_asammdf(path, groups)
    with asammdf.MDF(path) as file:
        file.save(path.with_suffix(".packed.mf4"), compression=2, overwrite=True)
    path.with_suffix(".packed.mf4").replace(path)


def by_hand(path: Path, groups: Groups) -> None:
    made = Mdf()
    for name, (time, columns) in groups.items():
        made.group(name, time, **columns)
    path.write_bytes(made.data)


WRITERS: dict[str, Writer] = {"asammdf": by_asammdf, "compressed": by_asammdf_compressed, "by hand": by_hand}


@pytest.mark.parametrize("writer", WRITERS)
def test_a_file_gives_the_campaign_of_its_csv(writer: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    WRITERS[writer](path, ONE)
    rows = zip(TIME.tolist(), ANGLE.tolist(), TORQUE.tolist(), strict=True)
    text = "time_s,yaw_rad,moment_nm\n" + "".join(f"{t!r},{y!r},{m!r}\n" for t, y, m in rows)
    choices = ImportChoices(input="torque")
    runs = []
    for name, file in {"mdf": path, "csv": written(tmp_path, "log.csv", text)}.items():
        import_records([file], tmp_path / name, choices if name == "mdf" else ImportChoices())
        runs.append({one.name: one.read_bytes() for one in (tmp_path / name / "runs").iterdir()})
    assert runs[0] == runs[1]


@pytest.mark.parametrize("writer", WRITERS)
def test_integers_are_converted_and_have_the_unit_of_the_file(writer: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    WRITERS[writer](path, {"joint": (TIME, {"position": ("deg", np.rad2deg(ANGLE), 1e-5)})})
    imported = read_records([path])
    (run,) = imported.campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=np.deg2rad(0.51e-5))
    assert imported.parts[0].raw.reading.unit == "deg"


@pytest.mark.parametrize("writer", WRITERS)
def test_a_group_of_another_clock_is_interpolated(writer: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    WRITERS[writer](path, TWO)
    imported = read_records([path], ImportChoices(input="torque"))
    (run,) = imported.campaign.runs
    first, last = LATE[[0, -1]]
    inside = (first <= TIME) & (last >= TIME)
    assert run.drive is not None
    np.testing.assert_allclose(run.drive.values, 2.0 * TIME[inside], rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(run.record.yaw_rad, ANGLE[inside])
    (line,) = (line for line in imported.remarks() if "is interpolated" in line)
    assert "'torque' (400 stamps beside 1600) is interpolated onto the stamps of 'joint'" in line
    assert "off its nearest stamp by 5 ms (median; at most 9 ms)" in line


@pytest.mark.parametrize("shift", [0.0, 1e-3])
def test_a_channel_that_two_groups_have_is_named_with_its_group(shift: float, tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    left: Groups = {"left": (TIME, {"angle": ("rad", 2.0 * ANGLE, None)})}
    by_hand(path, {**left, "right": (TIME + shift, {"angle": ("rad", ANGLE, None)})})
    with pytest.raises(TunnelError, match="2 columns may be the angle: 'left/angle', 'right/angle'"):
        read_records([path])
    (run,) = read_records([path], ImportChoices(angle=("right/angle",))).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, ANGLE)


def test_a_single_sample_states_a_condition(tmp_path: Path) -> None:
    path = tmp_path / "log.mf4"
    stated: Columns = {"wind speed": ("km/h", np.array([36.0]), None)}
    by_hand(path, {**ONE, "rig": (np.zeros(1), stated)})
    choices = ImportChoices(input="none", conditions={"air_density": 1.2})
    (run,) = read_records([path], choices).campaign.runs
    assert run.wind_speed == pytest.approx(10.0)


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("spoilt", ["cut", "end cut off", "magic", "blocks"])
def test_a_broken_file_is_refused_in_one_line(
    writer: str, spoilt: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.mf4"
    WRITERS[writer](path, TWO)
    content = path.read_bytes()
    cuts = {
        "cut": content[: len(content) // 2],
        "end cut off": content[:-60],
        "magic": b"not MDF " * 400,
        "blocks": content.replace(b"##CG", b"##XX"),
    }
    path.write_bytes(cuts[spoilt])
    status = main(["import", str(path), "--out", str(tmp_path / "rig"), "--yes"])
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert path.name in err
    assert not (tmp_path / "rig").exists()
