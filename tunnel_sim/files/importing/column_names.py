"""The meaning of column names: times, angles, rates, the number of a run; and the columns that a user names."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tunnel_sim.files.importing.condition_names import JOINED, condition_of
from tunnel_sim.files.importing.tables import Channel
from tunnel_sim.files.importing.units import claims, kind_of, names_a_time

RUN_MARK = re.compile(
    r"[\s_,;.#(\[-]*(?:run|trial|test|swing|rep|versuch|messung|lauf)[\s_#.-]*(\d+)[)\]]?\s*$", re.IGNORECASE
)
ANGLE = re.compile(
    r"angle|winkel|angolo|yaw|(?<![a-z])(theta|beta|psi|phi|alpha|pitch|roll|pos|position|encoder|rotation|deg|rad)"
    r"(?![a-z])|[θβψφα]",
    re.IGNORECASE,
)
_RATE = re.compile(
    r"velocity|geschwindigkeit|ω|[βθψφ]̇|(?<![a-z])(omega|[xyz]?gyr[oa]?|gyro[a-z]+|speed)(?![a-z])"
    r"|(rate|vel|dot)(?![a-z])",
    re.IGNORECASE,
)
_ACCELERATION = re.compile(
    r"acceleration|beschleunigung|ddot|[βθψφ]̈|(?<![a-z])(angacc|acc|acce?l)(?![a-z])", re.IGNORECASE
)
OTHER = re.compile(
    r"(?<![a-z])(index|idx|sample|samples|nr|no|row|#|frame|temperature|current|force)(?![a-z])", re.I
)


def named_kind(name: str) -> str:
    """The kind of quantity, ``rate`` or ``acceleration``, stated by a column's name; empty: neither."""
    words = JOINED.sub("_", name)
    if _ACCELERATION.search(words):
        return "acceleration"
    return "rate" if _RATE.search(words) else ""


_VOLTAGE = re.compile(
    r"(?i).*(?<![a-z])(voltage|spannung|v_?out|u_?out)(?![a-z]).*|(.*/)?(ai|ch|channel|kanal|adc)[ _]?\d+"
)


def names_voltage(name: str) -> bool:
    """Whether a name denotes a voltage, or a channel of a converter or an oscilloscope."""
    return _VOLTAGE.fullmatch(JOINED.sub("_", name)) is not None


def stem(name: str) -> str:
    """The name of a column without the number of its run."""
    return RUN_MARK.sub("", name)


def is_time(channel: Channel) -> bool:
    """Whether a column contains times, by its unit or its name."""
    kind = kind_of(channel.unit)
    if condition_of(channel.name, channel.unit) is not None:
        return False
    return kind == "time" or (kind == "" and names_a_time(channel.name))


def named(channels: Sequence[Channel], wanted: str) -> list[Channel]:
    """The columns of a name, with or without its unit as written in the file, or of a number from 1 on."""
    found = [channel for channel in channels if matches(channel, wanted)]
    if found or not wanted.isdigit():
        return found
    if any(channel.place for channel in channels):
        return [channel for channel in channels if channel.place == int(wanted)]
    return list(channels[int(wanted) - 1 : int(wanted)]) if int(wanted) > 0 else []


def matches(channel: Channel, wanted: str) -> bool:
    """Whether a user's text names a column, with or without its unit and the number of its run."""
    return claims(wanted, channel.name, channel.unit) or claims(wanted, stem(channel.name), channel.unit)


def listed(channels: Sequence[Channel]) -> str:
    """The names of columns for a message."""
    names = [f"'{channel.name}'" for channel in channels]
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
