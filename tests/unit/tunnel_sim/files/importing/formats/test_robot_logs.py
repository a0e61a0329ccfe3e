"""Logs of ROS 2 in MCAP and rosbag2 files, by two writers each: rosbags, and one without it.

Truth: the numbers that were written, and the import of the same numbers as CSV.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rosbags.rosbag2
import zstandard
from rosbags.typesys import Stores, get_typestore

from tests.support.import_files import decay, written
from tests.support.robot_logs import (
    FLOAT64,
    JOINT_STATE,
    START_NS,
    Message,
    joint_state,
    number,
    write_db3,
    write_mcap,
)
from tunnel_lab.cli import main
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.formats.robot_logs import MCAP
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.files.importing.writing import import_records

TIME, ANGLE = decay()
STAMPS = START_NS + np.round(1e9 * TIME).astype(np.int64)
DELAY_NS = 2_000_000
EFFORT = 0.5 * np.cos(3.0 * TIME)
Writer = Callable[[Path, Sequence[Message]], Path]


def states(
    names: Sequence[str] = ("elbow",), topic: str = "/joint_states", *, effort: bool = False
) -> list[Message]:
    """Joint states, of which the first joint swings."""
    return [
        (
            topic,
            JOINT_STATE,
            stamp + DELAY_NS,
            joint_state(
                stamp,
                names,
                [angle, *(0.5 * angle for _ in names[1:])],
                (),
                [torque, *(0.0 for _ in names[1:])] if effort else (),
            ),
        )
        for stamp, angle, torque in zip(STAMPS.tolist(), ANGLE.tolist(), EFFORT.tolist(), strict=True)
    ]


def by_mcap(folder: Path, messages: Sequence[Message]) -> Path:
    path = folder / "log.mcap"
    write_mcap(path, messages)
    return path


def by_sqlite(folder: Path, messages: Sequence[Message]) -> Path:
    path = folder / "log.db3"
    write_db3(path, messages)
    return path


def by_rosbags(plugin: Any) -> Writer:
    def write(folder: Path, messages: Sequence[Message]) -> Path:
        """Every message is decoded and encoded again by rosbags."""
        store = get_typestore(Stores.ROS2_HUMBLE)
        with rosbags.rosbag2.Writer(folder / "bag", version=9, storage_plugin=plugin) as bag:
            opened = {
                topic: bag.add_connection(topic, kind, typestore=store)
                for topic, kind in dict.fromkeys((topic, kind) for topic, kind, *_ in messages)
            }
            for topic, kind, stamp, content in messages:
                again = store.serialize_cdr(store.deserialize_cdr(content, kind), kind)
                bag.write(opened[topic], stamp, again)
        (path,) = (path for path in (folder / "bag").iterdir() if path.suffix in (".db3", ".mcap"))
        return path

    return write


WRITERS: dict[str, Writer] = {
    "mcap": by_mcap,
    "mcap by rosbags": by_rosbags(rosbags.rosbag2.StoragePlugin.MCAP),
    "sqlite": by_sqlite,
    "sqlite by rosbags": by_rosbags(rosbags.rosbag2.StoragePlugin.SQLITE3),
}


def campaigns(
    folder: Path, log: Path, text: str, choices: ImportChoices, of_text: ImportChoices
) -> list[Imported]:
    """The same numbers as a log and as CSV, imported into ``log`` and ``csv``."""
    plain = written(folder, f"{log.stem}.csv", text)
    return [
        import_records([log], folder / "of log", choices),
        import_records([plain], folder / "of csv", of_text),
    ]


def runs_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / "runs").iterdir())}


@pytest.mark.parametrize("writer", WRITERS)
def test_a_joint_state_gives_the_campaign_of_its_csv(writer: str, tmp_path: Path) -> None:
    log = WRITERS[writer](tmp_path, states())
    rows = "".join(f"{t:.3f},{y!r}\n" for t, y in zip(TIME, ANGLE.tolist(), strict=True))
    still = ImportChoices(conditions={"wind_speed": 0.0})
    of_log, of_csv = campaigns(tmp_path, log, f"time_s,yaw_rad\n{rows}", still, still)
    assert runs_of(tmp_path / "of log") == runs_of(tmp_path / "of csv")
    (run,), (same,) = of_log.campaign.runs, of_csv.campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, same.record.yaw_rad)
    np.testing.assert_array_equal(run.record.time_s, same.record.time_s)
    assert of_log.campaign.sensor == of_csv.campaign.sensor
    (line,) = (line for line in of_log.remarks() if "header stamps" in line)
    assert "the log stamps are later by 2 ms (median; 2 to 2 ms)" in line


@pytest.mark.parametrize("writer", WRITERS)
def test_a_driven_joint_gives_the_campaign_of_its_csv(writer: str, tmp_path: Path) -> None:
    log = WRITERS[writer](tmp_path, states(effort=True))
    rows = zip(TIME, ANGLE.tolist(), EFFORT.tolist(), strict=True)
    text = "time_s,yaw_rad,moment_nm\n" + "".join(f"{t:.3f},{y!r},{m!r}\n" for t, y, m in rows)
    of_log = ImportChoices(input="joint_states/elbow effort")
    found = campaigns(tmp_path, log, text, of_log, ImportChoices())
    assert runs_of(tmp_path / "of log") == runs_of(tmp_path / "of csv")
    assert [run.drive.column for one in found for run in one.campaign.runs if run.drive] == ["moment_nm"] * 2


def test_several_joints_are_listed_and_picked(tmp_path: Path) -> None:
    log = by_mcap(tmp_path, states(("elbow", "wrist")))
    with pytest.raises(
        TunnelError, match=r"2 columns may be the angle: 'joint_states/elbow position', 'joint_states/wr"
    ):
        read_records([log])
    (run,) = read_records([log], ImportChoices(angle=("joint_states/wrist position",))).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, 0.5 * ANGLE)


def test_joints_in_another_order_keep_their_names(tmp_path: Path) -> None:
    """As from several publishers of one topic, whose messages name their own joints."""
    messages = [
        (
            topic,
            kind,
            stamp,
            joint_state(
                stamp - DELAY_NS, *(("elbow", "wrist"), (y, 9.0)) if k % 2 else (("wrist", "elbow"), (9.0, y))
            ),
        )
        for k, ((topic, kind, stamp, _), y) in enumerate(zip(states(), ANGLE.tolist(), strict=True))
    ]
    (run,) = read_records([by_mcap(tmp_path, messages)]).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, ANGLE)


def test_two_topics_of_joint_states_are_listed(tmp_path: Path) -> None:
    log = by_sqlite(tmp_path, [*states(topic="/left/joint_states"), *states(topic="/right/joint_states")])
    with pytest.raises(
        TunnelError, match=r"'left/joint_states/elbow position', 'right/joint_states/elbow position'"
    ):
        read_records([log])


@pytest.mark.parametrize("writer", ["mcap", "sqlite by rosbags"])
def test_a_command_topic_is_held_onto_the_stamps_of_the_joint(writer: str, tmp_path: Path) -> None:
    """Its messages have no header; they are logged 2 ms after every tenth joint state."""
    commands = [
        ("/elbow/effort_command", FLOAT64, stamp + DELAY_NS, number(torque))
        for stamp, torque in zip(STAMPS[::10].tolist(), EFFORT[::10].tolist(), strict=True)
    ]
    log = WRITERS[writer](tmp_path, sorted([*states(), *commands], key=lambda one: one[2]))
    choices = ImportChoices(input="elbow/effort_command", input_as="moment_nm")
    imported = read_records([log], choices)
    (run,) = imported.campaign.runs
    assert run.drive is not None
    # 2 ms are less than a step of 5 ms: each command is first seen one sample after its own joint state.
    np.testing.assert_array_equal(run.drive.values, EFFORT[(np.arange(TIME.size - 1) // 10) * 10])
    np.testing.assert_array_equal(run.record.yaw_rad, ANGLE[1:])
    (line,) = (line for line in imported.remarks() if "is held onto" in line)
    assert "'elbow/effort_command' (160 stamps beside 1600)" in line
    assert "after its last stamp by 23 ms (median; at most 48 ms)" in line
    assert any("no header stamp, so the delay of the log is not known" in line for line in imported.remarks())


def test_a_few_commands_are_held_between_them(tmp_path: Path) -> None:
    steps = [0.0, 1.0, -1.0]
    commands = [
        ("/effort_command", FLOAT64, stamp + DELAY_NS, number(step))
        for stamp, step in zip(STAMPS[[0, 500, 1000]].tolist(), steps, strict=True)
    ]
    log = by_mcap(tmp_path, [*states(), *commands])
    choices = ImportChoices(input="effort_command", input_as="moment_nm")
    (run,) = read_records([log], choices).campaign.runs
    assert run.drive is not None
    np.testing.assert_array_equal(run.drive.values, np.repeat(steps, [500, 500, 599]))


def test_the_log_stamps_count_where_only_one_clock_is_simulated(tmp_path: Path) -> None:
    later = 10**18
    joint = [(topic, kind, stamp + later, content) for topic, kind, stamp, content in states()]
    commands = [("/command", FLOAT64, stamp, number(0.0)) for _, _, stamp, _ in joint]
    imported = read_records([by_mcap(tmp_path, [*joint, *commands])], ImportChoices(input="none"))
    assert any("from the log stamps, because" in line for line in imported.remarks())


def test_an_empty_first_message_does_not_hide_a_topic(tmp_path: Path) -> None:
    first, *others = states()
    empty = joint_state(STAMPS[0], (), ())
    (run,) = read_records([by_mcap(tmp_path, [(*first[:3], empty), *others])]).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, ANGLE[1:])


def test_messages_that_a_recorder_compressed_are_read(tmp_path: Path) -> None:
    pack = zstandard.ZstdCompressor().compress
    log = by_sqlite(tmp_path, [(*head, pack(content)) for *head, content in states()])
    (run,) = read_records([log]).campaign.runs
    np.testing.assert_array_equal(run.record.yaw_rad, ANGLE)


def test_other_topics_are_left_out_with_the_reason(tmp_path: Path) -> None:
    others: list[Message] = [("/plan", "my_msgs/msg/Plan", START_NS, b"\0\1\0\0")]
    lines = read_records([by_sqlite(tmp_path, [*states(), *others])]).remarks()
    assert any("'/plan' is left out: its type my_msgs/msg/Plan is not known" in line for line in lines)


@pytest.mark.parametrize("module", ["mcap", "rosbags"])
def test_a_missing_library_is_said(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = by_mcap(tmp_path, states()[:20])
    for name in ("mcap.stream_reader", "rosbags.typesys"):
        if name.startswith(module):
            monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(TunnelError, match=rf"needs the package {module}.*pip install '\.\[import\]'"):
        MCAP.read_tables(path.read_bytes(), path.name)


def test_a_log_without_numbers_lists_its_topics(tmp_path: Path) -> None:
    log = by_sqlite(tmp_path, [("/plan", "my_msgs/msg/Plan", START_NS, b"\0\1\0\0")])
    with pytest.raises(TunnelError, match=r"no topic with numbers .*'/plan' \(my_msgs/msg/Plan\)"):
        read_records([log])


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("spoilt", ["cut", "end cut off", "magic", "torn"])
def test_a_broken_log_is_refused_in_one_line(
    writer: str, spoilt: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = WRITERS[writer](tmp_path, states())
    content = bytearray(path.read_bytes())
    if spoilt == "torn":  # within the data
        content[len(content) // 3 : len(content) // 2] = bytes(len(content) // 2 - len(content) // 3)
    cuts = {
        "cut": content[: len(content) // 2],
        "end cut off": content[:-20],
        "magic": b"not a log " * 400,
        "torn": content,
    }
    path.write_bytes(cuts[spoilt])
    status = main(["import", str(path), "--out", str(tmp_path / "rig"), "--yes"])
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert path.name in err
    assert "()" not in err
    assert not (tmp_path / "rig").exists()
