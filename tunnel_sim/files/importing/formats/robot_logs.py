"""Tables of a robot's logs: messages of ROS 2 in MCAP files and in rosbag2's SQLite files, topic by topic."""

from __future__ import annotations

import io
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np

from tunnel_sim.files.importing.formats.stamps import StampedColumns, in_order, stamped_tables
from tunnel_sim.files.importing.tables import LEAST_ROWS, Channel, Table
from tunnel_sim.files.readers import Reader, faults
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, library, one_line

_UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "effort": "N m",
    "acceleration": "rad/s2",
    "angular_velocity": "rad/s",
    "angular_acceleration": "rad/s2",
    "linear_acceleration": "m/s2",
    "torque": "N m",
    "force": "N",
}
"""By field of a message: sensor_msgs/JointState, and REP 103 for the others, which is SI."""
_SINGULAR = {"positions": "position", "velocities": "velocity", "accelerations": "acceleration"}
_NAMES = ("name", "names", "joint_names", "dof_names")
"""Fields that name the joints of the arrays beside them."""
_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
_PLAIN = "std_msgs/msg/"
_OTHER_CLOCK = 1.0  # s between header and log stamps: beyond it one clock is simulated, or not set
_ZSTD = b"\x28\xb5\x2f\xfd"
_CDR = ("cdr", "")
_REMEDY = "record it again, or recover it by `mcap recover` or `ros2 bag reindex`"


class _Topic:
    """The messages of a topic read so far.

    Args:
        definition: definition of its type as text, and the language of the text; empty: the type is one of ROS
            itself.
    """

    def __init__(self, name: str, type: str, definition: str = "", language: str = "") -> None:
        self.name, self.type, self.definition, self.language = name, type, definition, language
        self.log_ns: list[int] = []
        self.header_ns: list[int] = []
        self.columns: dict[str, tuple[str, list[int], list[float]]] = {}
        """By name: the unit, the indices of the messages with a number, and the numbers."""
        self.skipped = ""
        """Why the topic's messages are not read; empty: they are read."""


def _read_mcap(content: bytes, where: str) -> list[Table]:
    """The tables of an MCAP file, also of one that rosbag2 writes."""
    streams = library("mcap.stream_reader", "MCAP", "import", where)
    records = library("mcap.records", "MCAP", "import", where)
    topics: dict[int, _Topic] = {}
    with faults("an MCAP file", where):

        def messages() -> Iterator[tuple[_Topic, int, bytes]]:
            schemas: dict[int, Any] = {}
            ended, count, stated = False, 0, None
            for record in streams.StreamReader(io.BytesIO(content), validate_crcs=True).records:
                if isinstance(record, records.Schema):
                    schemas[record.id] = record
                elif isinstance(record, records.Channel):
                    schema = schemas.get(record.schema_id)
                    own = (
                        _Topic(record.topic, "")
                        if schema is None
                        else _Topic(
                            record.topic, schema.name, schema.data.decode(errors="replace"), schema.encoding
                        )
                    )
                    if record.message_encoding not in _CDR:
                        own.skipped = f"its messages are {one_line(record.message_encoding, 20)}, not CDR"
                    topics.setdefault(record.id, own)
                elif isinstance(record, records.Statistics):
                    stated = record.message_count
                elif isinstance(record, records.Message):
                    count += 1
                    yield topics[record.channel_id], record.log_time, record.data
                ended |= isinstance(record, records.Footer)
            if not ended:
                raise TunnelError("is cut off: it has no end", where=where, remedy=_REMEDY)
            if stated not in (None, count):
                what = f"is damaged: it has {count} of {counted(stated, 'message')}"
                raise TunnelError(what, where=where, remedy=_REMEDY)

        return _tables(messages(), topics.values(), "MCAP file", where)


def _read_rosbag2(content: bytes, where: str) -> list[Table]:
    """The tables of a rosbag2 file of SQLite, ``*.db3``."""
    kind = "a rosbag2 file (.db3)"
    with faults(kind, where), closing(sqlite3.connect(":memory:")) as data:
        # A database in memory has no write-ahead log; the header says where one is expected.
        data.deserialize(content[:18] + b"\x01\x01" + content[20:])
        data.execute("PRAGMA trusted_schema = OFF")
        tables = {name for (name,) in data.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise TunnelError(
                f"is not {kind}: it has no tables topics and messages", where=where, remedy=_REMEDY
            )
        texts = {}
        if "message_definitions" in tables:
            query = "SELECT topic_type, encoded_message_definition, encoding FROM message_definitions"
            texts = {one: (text, language) for one, text, language in data.execute(query)}
        query = "SELECT id, name, type, serialization_format FROM topics"
        topics = {at: _Topic(name, one, *texts.get(one, ())) for at, name, one, _ in data.execute(query)}
        for at, _, _, encoding in data.execute(query):
            if encoding not in _CDR:
                topics[at].skipped = f"its messages are {one_line(encoding, 20)}, not CDR"
        rows = data.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id")
        return _tables(
            ((topics[at], stamp, raw) for at, stamp, raw in rows), topics.values(), "rosbag2 file", where
        )


def _tables(
    messages: Iterable[tuple[_Topic, int, bytes]], topics: Iterable[_Topic], kind: str, where: str
) -> list[Table]:
    """The tables of some messages, each with its topic and its log stamp in ns.

    Args:
        topics: all topics, once the messages have been read.
    """
    decoders: dict[str, Any] = {}
    for number, (topic, log_ns, raw) in enumerate(messages):
        check_count(number, limits.RUN_SAMPLES, "messages", where, "split the recording")
        if not topic.skipped:
            _add(topic, log_ns, raw, decoders, where)
    read = [topic for topic in topics if topic.columns]
    if not read:
        names = ", ".join(f"'{topic.name}' ({topic.type})" for topic in topics)
        what = f"no topic with numbers in known messages (topics: {one_line(names, 200) or 'none'})"
        raise TunnelError(what, where=where, remedy="record joint states, sensor_msgs/msg/JointState")
    tables = stamped_tables(_clocks(read), kind, where)
    skipped = [f"'{topic.name}' is left out: {topic.skipped}" for topic in topics if topic.skipped]
    return [replace(table, remarks=(*table.remarks, *skipped)) for table in tables]


def _add(topic: _Topic, log_ns: int, raw: bytes, decoders: dict[str, Any], where: str) -> None:
    """Add the numbers of a message to its topic; a topic of an unknown type, or without numbers, is skipped."""
    if topic.type not in decoders:
        decoders[topic.type] = _decoder(topic, where)
    decode = decoders[topic.type]
    if decode is None:
        topic.skipped = f"its type {one_line(topic.type, 60)} is not known, and the file does not define it"
        return
    if raw.startswith(_ZSTD):
        unpack = library("zstandard", "a compressed message", "import", where).ZstdDecompressor()
        raw = unpack.decompress(raw, max_output_size=limits.DOCUMENT_BYTES)
    message = decode(raw)
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    header_ns = 0 if stamp is None else 1_000_000_000 * int(stamp.sec) + int(stamp.nanosec)
    points = message.points if topic.type == _TRAJECTORY else [message]
    if len(points) > 1:
        topic.skipped = (
            "its messages are trajectories of several points, and the controller interpolates them"
        )
        topic.columns.clear()
        return
    at = len(topic.log_ns)
    topic.log_ns.append(log_ns)
    topic.header_ns.append(header_ns)
    above = ("command",) if topic.type == _TRAJECTORY else ()
    joints = next((getattr(message, key) for key in _NAMES if hasattr(message, key)), ())
    for point in points:
        for label, unit, value in _numbers(point, joints, above, plain=topic.type.startswith(_PLAIN)):
            name = f"{topic.name.lstrip('/')}{label}"
            _, rows, values = topic.columns.setdefault(name, (unit, [], []))
            rows.append(at)
            values.append(value)
    check_count(len(topic.columns), limits.COLUMNS, "columns", where, "record fewer topics")
    if not topic.columns and at >= LEAST_ROWS:  # the first messages may be empty
        topic.skipped = f"its messages {one_line(topic.type, 60)} hold no numbers that are read"


def _decoder(topic: _Topic, where: str) -> Any:
    """A function from the bytes of a message to the message; None for an unknown type."""
    types = library("rosbags.typesys", "a log of ROS 2", "import", where)
    kind = topic.type if topic.type.count("/") != 1 else topic.type.replace("/", "/msg/")
    if topic.definition:
        store = types.get_typestore(types.Stores.EMPTY)
        parse = types.get_types_from_idl if topic.language == "ros2idl" else types.get_types_from_msg
        store.register(
            parse(topic.definition) if topic.language == "ros2idl" else parse(topic.definition, kind)
        )
    else:
        store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    return (lambda raw: store.deserialize_cdr(raw, kind)) if kind in store.fielddefs else None


def _numbers(
    message: Any, joints: Sequence[str], above: tuple[str, ...], *, plain: bool
) -> Iterator[tuple[str, str, float]]:
    """The numbers of a message: name after the topic, unit, value.

    Args:
        above: the fields that contain the message.
        plain: whether it is a number without a specific meaning, which may be whole, such as std_msgs/Int32.
    """
    for key, value in vars(message).items():
        if key.startswith("__") or key in ("header", "layout", *_NAMES) or key.endswith("covariance"):
            continue
        word = _SINGULAR.get(key, key)
        unit = next((_UNITS[one] for one in (word, *above[::-1]) if one in _UNITS), "")
        label = "" if plain else "/" + " ".join((*above, word))
        if hasattr(value, "__msgtype__"):
            yield from _numbers(value, joints, (*above, word), plain=False)
        elif isinstance(value, float) or (plain and type(value) is int):
            yield label, unit, float(value)
        elif isinstance(value, np.ndarray) and value.dtype.kind in ("fiu" if plain else "f"):
            if len(joints) == value.size and joints:
                yield from (
                    (f"/{joint} {label[1:]}", unit, float(one))
                    for joint, one in zip(joints, value, strict=True)
                )
            else:
                yield from ((f"{label}[{k}]", unit, float(one)) for k, one in enumerate(value, 1))


def _clocks(topics: Sequence[_Topic]) -> list[StampedColumns]:
    """The columns of topics with their stamps: from the header, or else from the log."""
    logs = [np.array(topic.log_ns, dtype=np.int64) for topic in topics]
    headers = [np.array(topic.header_ns, dtype=np.int64) for topic in topics]
    headed = [bool((header != 0).all()) for header in headers]
    late = [1e-9 * (log - header).astype(np.float64) for log, header in zip(logs, headers, strict=True)]
    apart = max(
        (abs(float(np.median(one))) for one, own in zip(late, headed, strict=True) if own), default=0.0
    )
    mixed = not all(headed) and apart > _OTHER_CLOCK
    used = [
        header if own and not mixed else log for log, header, own in zip(logs, headers, headed, strict=True)
    ]
    origin = min(int(one.min()) for one in used)
    clocks = []
    for topic, stamps, delay, own in zip(topics, used, late, headed, strict=True):
        columns = []
        for name, (unit, at, numbers) in topic.columns.items():
            values = np.full(stamps.size, np.nan)
            values[at] = numbers
            columns.append(Channel(name, values, unit))
        # a quotient is the nearest number to the decimal fraction, like the same time in a text
        time_s, channels, repeated = in_order((stamps - origin) / 1e9, columns)
        remarks = [_of_stamps(topic, delay, own, mixed=mixed, several=len(topics) > 1)]
        if repeated:
            remarks.append(
                f"'{topic.name}': {counted(repeated, 'message')} with the stamp of the next one left out"
            )
        clocks.append(StampedColumns(topic.name, time_s, channels, tuple(remarks)))
    return clocks


def _of_stamps(topic: _Topic, delay: np.ndarray, headed: bool, *, mixed: bool, several: bool) -> str:
    """The remark on the stamps of a topic.

    Args:
        delay: delay of its log stamps after its header stamps, s.
        mixed: whether header stamps are ignored because their clock differs from a topic's log stamps.
        several: whether other topics are aligned with it.
    """
    usual, least, most = (1e3 * float(of(delay)) for of in (np.median, np.min, np.max))
    behind = f"the log stamps are later by {usual:.4g} ms (median; {least:.4g} to {most:.4g} ms)"
    if headed and not mixed:
        return f"times of '{topic.name}' from the header stamps; {behind}"
    if headed:
        why = "because the messages of another topic have no header stamp, and the two clocks differ"
        return f"times of '{topic.name}' from the log stamps, {why}: {behind}"
    text = f"times of '{topic.name}' from the log stamps: its messages have no header stamp"
    return f"{text}, so the delay of the log is not known" if several else text


MCAP = Reader("an MCAP file", limits.DATA_BYTES, (b"\x89MCAP0\r\n",), read_tables=_read_mcap)
ROSBAG2 = Reader("a rosbag2 file", limits.DATA_BYTES, (b"SQLite format 3\x00",), read_tables=_read_rosbag2)
