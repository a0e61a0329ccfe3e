"""Tables with something wrong in them, as CSV and Parquet."""

from __future__ import annotations

import io

import numpy as np
import polars as pl

from tests.fuzz.texts import changed_bytes, changed_line
from tests.fuzz.values import HOSTILE, NUMBERS, Rng

_TYPES = (
    pl.Float32, pl.Int64, pl.Int8, pl.UInt64, pl.String, pl.Boolean, pl.Binary, pl.Null, pl.Date, pl.Categorical,
    pl.List(pl.Float64), pl.Struct({"a": pl.Float64}), pl.Decimal(10, 2), pl.Datetime, pl.Duration,
)  # fmt: skip
_FLOATS = [float(value) for value in NUMBERS if not (isinstance(value, int) and abs(value) > 2**1000)]


def changed_csv(content: bytes, rng: Rng) -> bytes:
    """A CSV file with cells, columns or lines changed, or its bytes.

    Args:
        content: UTF-8 with commas.
        rng: decides what is changed.
    """
    kind = rng.integers(10)
    if kind < 2:
        return changed_bytes(content, rng)
    if kind == 8:  # what a crash or an open quote leaves
        end = int(rng.integers(len(content) + 1))
        return content[:end] + (b"\0", b'"x', b" ", b",", b"\n", b"1")[rng.integers(6)] * 2 ** int(
            rng.integers(22)
        )
    text = content.decode()
    if kind == 9:
        return _headed_anew(text, rng).encode("utf-8", "surrogatepass")
    rows = [line.split(",") for line in text.splitlines()]
    if kind < 4:
        for _ in range(int(rng.integers(1, 4))):
            row = rows[rng.integers(len(rows))] if rng.random() < 0.7 else rows[0]
            row[rng.integers(len(row))] = _cell(rng)
    elif kind == 4:
        column = int(rng.integers(len(rows[0])))
        value = _cell(rng)
        rows = [rows[0], *([*row[:column], value, *row[column + 1 :]] for row in rows[1:])]
    elif kind == 5:
        order = rng.permutation(len(rows[0]))[: rng.integers(1, len(rows[0]) + 1)]
        rows = [[row[i] for i in order] for row in rows]
    elif kind == 6:
        keep = rng.integers(len(rows), size=rng.integers(0, len(rows)))
        rows = [rows[i] for i in (np.sort(keep) if rng.random() < 0.5 else keep)]
    else:
        return _retyped(text, rng)
    return "\n".join(map(",".join, rows)).encode("utf-8", "surrogatepass")


def changed_frame(frame: pl.DataFrame, rng: Rng) -> pl.DataFrame:
    """A table with types, columns, rows or values changed; unchanged where polars refuses the change.

    Args:
        frame: at least one row and one column.
        rng: decides what is changed.
    """
    for _ in range(int(rng.integers(1, 3))):
        name = frame.columns[rng.integers(frame.width)]
        try:
            frame = _changed_once(frame, name, rng)
        except (pl.exceptions.PolarsError, TypeError, ValueError, OverflowError):
            continue
        if frame.width == 0:
            break
    return frame


def changed_parquet(frame: pl.DataFrame, rng: Rng) -> bytes:
    """A table as Parquet, with the table or the file's bytes changed.

    Args:
        frame: at least one row and one column.
        rng: decides what is changed.

    Returns:
        A file that often still begins and ends as Parquet does.
    """
    kind = rng.integers(6)
    content = parquet(changed_frame(frame, rng) if kind < 3 else frame)
    footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    if kind < 3:
        return content
    if kind == 3:
        return changed_bytes(content, rng)
    if kind == 4:  # the data alone, or the description of it alone
        whole = rng.random() < 0.5
        return changed_bytes(content, rng, 4 if whole else footer, footer if whole else len(content) - 8)
    return content[: rng.integers(len(content))] + b"PAR1"


def parquet(frame: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file.

    Args:
        frame: any.
    """
    buffer = io.BytesIO()
    try:
        frame.write_parquet(buffer)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic of polars is no Exception
        return b"PAR1" + repr(error).encode() + b"PAR1"
    return buffer.getvalue()


def _headed_anew(text: str, rng: Rng) -> str:
    """The same columns with names and units as loggers write them, of which one may be alone or very long."""
    head, _, body = text.partition("\n")
    units = (
        "s",
        "min",
        "h",
        "ms",
        "Grad",
        "grad",
        "°",
        "rad",
        "gon",
        "V",
        "km/h",
        "rad/s",
        "1/min",
        "Foo",
        "N/s",
        "°C",
    )
    names = (
        "Zeit",
        "t",
        "Winkel",
        "angle",
        "φ",
        "run",
        "Lauf",
        "min",
        "V",
        "yaw",
        "drive_hold",
        "=1+1",
        "a_" * 2000,
    )
    forms = ("{}/{}", "{} / {}", "{} in {}", "{} [{}]", "{} ({})", "{}_{}", "{} {}", "{}, {}", "{}", "{1}")
    cells = (
        forms[rng.integers(len(forms))].format(
            names[rng.integers(len(names))], units[rng.integers(len(units))]
        )
        for _ in head.split(",")
    )
    if rng.random() < 0.2:  # one column of several
        return "\n".join([next(cells), *(line.split(",")[-1] for line in body.splitlines())])
    return f"{','.join(cells)}\n{body}"


def _cell(rng: Rng) -> str:
    odd = ('"', '"a', "0x10", "1_000", "1,5", "٣", "1e-400", "NaN", "-inf", " 1.0 ", "1.0f", "\x00")
    pool = (*odd, *map(str, NUMBERS), *HOSTILE)
    return pool[rng.integers(len(pool))]


def _retyped(text: str, rng: Rng) -> bytes:
    """The same text in other clothes: another separator, line end or encoding."""
    kind = rng.integers(6)
    if kind == 0:
        return text.replace(",", ";\t| "[rng.integers(4)]).encode()
    if kind == 1:
        return text.replace("\n", ("\r\n", "\r", "\n\n", "\n#\n")[rng.integers(4)]).encode()
    if kind == 2:
        return text.encode(("utf-16", "utf-8-sig", "utf-32")[rng.integers(3)])
    if kind == 3:
        return (text * int(rng.integers(2, 20))).encode()
    if kind == 4:
        return text.split("\n", 1)[1].encode()
    return changed_line(text, rng).encode("utf-8", "surrogatepass")


def _changed_once(frame: pl.DataFrame, name: str, rng: Rng) -> pl.DataFrame:
    kind = rng.integers(9)
    if kind == 0:
        return frame.with_columns(pl.col(name).cast(_TYPES[rng.integers(len(_TYPES))], strict=False))
    if kind == 1:
        return frame.drop(name)
    if kind == 2:
        return frame.rename({name: HOSTILE[rng.integers(len(HOSTILE))]})
    if kind == 3:
        return frame.head(int(rng.integers(0, 4)))
    if kind == 4:
        return frame[rng.integers(frame.height, size=rng.integers(0, 2 * frame.height))]
    if kind == 5:
        return frame.with_columns(frame[frame.columns[rng.integers(frame.width)]].alias(name))
    if kind == 6:
        return frame.with_columns(pl.lit(None).alias(name))
    pool = HOSTILE if frame.schema[name] == pl.String else _FLOATS
    value = pl.lit(pool[rng.integers(len(pool))])
    where = pl.int_range(frame.height) == int(rng.integers(frame.height)) if kind == 7 else pl.lit(True)
    return frame.with_columns(pl.when(where).then(value).otherwise(pl.col(name)).alias(name))
