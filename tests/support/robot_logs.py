"""Logs of ROS 2 and MDF files; messages, SQLite and MDF are written by the standards, byte by byte."""

from __future__ import annotations

import itertools
import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import mcap.writer
import numpy as np

START_NS = 1_700_000_000_000_000_000
JOINT_STATE = "sensor_msgs/msg/JointState"
FLOAT64 = "std_msgs/msg/Float64"
RULE = "=" * 80
DEFINITIONS = {
    JOINT_STATE: "std_msgs/Header header\nstring[] name\n"
    "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    f"{RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
    FLOAT64: "float64 data\n",
}
Message = tuple[str, str, int, bytes]
"""Topic, type, log stamp in ns, content."""


class Cdr:
    """Content of a message by OMG's CDR, little endian: every number is aligned to its size."""

    def __init__(self) -> None:
        self.data = bytearray()

    def put(self, kind: str, *values: float) -> Cdr:
        for value in values:
            size = struct.calcsize(f"<{kind}")
            self.data += bytes(-len(self.data) % size) + struct.pack(f"<{kind}", value)
        return self

    def text(self, text: str) -> Cdr:
        self.put("I", len(text) + 1)
        self.data += text.encode() + b"\0"
        return self

    def numbers(self, values: Sequence[float]) -> Cdr:
        return self.put("I", len(values)).put("d", *values)

    def content(self) -> bytes:
        return b"\x00\x01\x00\x00" + bytes(self.data)


def joint_state(
    stamp_ns: int,
    names: Sequence[str],
    position: Sequence[float],
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> bytes:
    made = Cdr().put("i", stamp_ns // 10**9).put("I", stamp_ns % 10**9).text("base").put("I", len(names))
    for name in names:
        made.text(name)
    return made.numbers(position).numbers(velocity).numbers(effort).content()


def number(value: float) -> bytes:
    return Cdr().put("d", value).content()


def write_db3(path: Path, messages: Sequence[Message]) -> None:
    """A rosbag2 file of its third version, which has no definitions of messages."""
    topics = {name: kind for name, kind, *_ in messages}
    with closing(sqlite3.connect(path)) as data:
        data.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
            "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
        )
        data.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
            "timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
        )
        rows = [(at, name, kind, "cdr", "") for at, (name, kind) in enumerate(topics.items(), 1)]
        data.executemany("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", rows)
        number_of = {name: at for at, name, *_ in rows}
        data.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
            [(number_of[name], stamp, content) for name, _, stamp, content in messages],
        )
        data.commit()


def write_mcap(path: Path, messages: Sequence[Message]) -> None:
    """An MCAP file with the definitions of its messages."""
    with path.open("wb") as stream:
        writer = mcap.writer.Writer(stream)
        writer.start("ros2", "tests")
        channels: dict[str, int] = {}
        for topic, kind, stamp, content in messages:
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", DEFINITIONS[kind].encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], stamp, content, stamp)
        writer.finish()


class Mdf:
    """An MDF file by ASAM MDF 4.1: blocks of an id, a length, links and data."""

    def __init__(self) -> None:
        self.data = bytearray(b"MDF     4.10    tests   ".ljust(28, b"\0") + struct.pack("<H", 410)).ljust(
            64, b"\0"
        )
        self.last = 0
        self.start = self.block(
            b"HD", [0] * 6, struct.pack("<QhhBBBBdd", START_NS, 0, 0, 0, 0, 0, 0, 0.0, 0.0)
        )
        history = self.block(
            b"FH", [0, self.text("written by a test")], struct.pack("<QhhB3x", START_NS, 0, 0, 0)
        )
        self.link(self.start, 1, history)

    def block(self, kind: bytes, links: Sequence[int], data: bytes) -> int:
        self.data += bytes(-len(self.data) % 8)
        at, size = len(self.data), 24 + 8 * len(links) + len(data)
        self.data += struct.pack("<4sIQQ", b"##" + kind, 0, size, len(links))
        self.data += struct.pack(f"<{len(links)}Q", *links) + data
        return at

    def link(self, block: int, number: int, target: int) -> None:
        struct.pack_into("<Q", self.data, block + 24 + 8 * number, target)

    def text(self, text: str) -> int:
        content = text.encode() + b"\0"
        return self.block(b"TX", [], content + bytes(-len(content) % 8))

    def channel(
        self, name: str, unit: str, kind: int, bits: int, at: int, factor: float | None, *, master: bool
    ) -> int:
        conversion = 0
        if factor is not None:
            conversion = self.block(
                b"CC", [0] * 4, struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, 0.0, factor)
            )
        links = [0, 0, self.text(name), 0, conversion, 0, self.text(unit), 0]
        head = struct.pack("<BBBBIIIIBBH", 2 * master, master, kind, 0, at, bits, 0, 0, 0, 0, 0)
        return self.block(b"CN", links, head + bytes(48))

    def group(self, name: str, time: np.ndarray, **columns: tuple[str, np.ndarray, float | None]) -> None:
        """A channel group: by name, a unit, the numbers, and the factor of a conversion of 32-bit integers."""
        kinds = [("f8" if factor is None else "i4") for _, _, factor in columns.values()]
        rows = np.zeros(
            time.size,
            dtype=[("time", "<f8"), *((one, f"<{k}") for one, k in zip(columns, kinds, strict=True))],
        )
        rows["time"] = time
        at, channels = 8, [self.channel("t", "s", 4, 64, 0, None, master=True)]
        for label, (unit, values, factor) in columns.items():
            rows[label] = values if factor is None else np.round(values / factor)
            bits = 64 if factor is None else 32
            channels.append(
                self.channel(label, unit, 4 if factor is None else 2, bits, at, factor, master=False)
            )
            at += bits // 8
        for one, following in itertools.pairwise(channels):
            self.link(one, 0, following)
        size = struct.pack("<QQHHIII", 0, time.size, 0, 0, 0, rows.itemsize, 0)
        group = self.block(b"CG", [0, channels[0], self.text(name), 0, 0, 0], size)
        data = self.block(b"DT", [], rows.tobytes())
        made = self.block(b"DG", [0, group, data, 0], bytes(8))
        self.link(self.last or self.start, 0, made)
        self.last = made
