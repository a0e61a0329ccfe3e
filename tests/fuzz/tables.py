"""Tables with something wrong in them, as CSV and Parquet."""

from __future__ import annotations

import io

import polars as pl
from hypothesis import strategies as st

from tests.fuzz.texts import spoilt_bytes, spoilt_text
from tests.fuzz.values import HOSTILE, NUMBERS, Draw, odd_words, one_in, place_in

_TYPES = (
    pl.Float32, pl.Int64, pl.Int8, pl.UInt64, pl.String, pl.Boolean, pl.Binary, pl.Null, pl.Date, pl.Categorical,
    pl.List(pl.Float64), pl.Struct({"a": pl.Float64}), pl.Decimal(10, 2), pl.Datetime, pl.Duration,
)  # fmt: skip
_FLOATS = [float(value) for value in NUMBERS if not (isinstance(value, int) and abs(value) > 2**1000)]
_CELLS = ('"', '"a', "0x10", "1_000", "1,5", "٣", "1e-400", "NaN", "-inf", " 1.0 ", "1.0f", "\x00")
_UNITS = (
    "s", "min", "h", "ms", "Grad", "grad", "°", "rad", "gon", "V", "km/h", "rad/s", "1/min", "Foo", "N/s", "°C",
)  # fmt: skip
_NAMES = (
    "Zeit", "t", "Winkel", "angle", "φ", "run", "Lauf", "min", "V", "yaw", "drive_hold", "=1+1", "a_" * 2000,
)  # fmt: skip
_FORMS = ("{}/{}", "{} / {}", "{} in {}", "{} [{}]", "{} ({})", "{}_{}", "{} {}", "{}, {}", "{}", "{1}")
_LINE_ENDS = ("\r\n", "\r", "\n\n", "\n#\n")
cells = st.sampled_from(_CELLS) | odd_words


@st.composite
def csv(draw: Draw, content: bytes) -> bytes:
    """A CSV file (UTF-8, commas) with cells, columns, lines, its head, its dialect or its bytes changed."""
    kind = draw(
        st.sampled_from(
            ("bytes", "bytes", "cut", "head", "dialect", "cell", "cell", "column", "columns", "lines")
        )
    )
    text = content.decode()
    if kind == "bytes":
        return draw(spoilt_bytes(content))
    if kind == "cut":  # what a crash or an open quote leaves
        filler = draw(st.sampled_from((b"\0", b'"x', b" ", b",", b"\n", b"1")))
        return content[: draw(st.integers(0, len(content)))] + filler * 2 ** draw(st.integers(0, 21))
    if kind == "head":
        return draw(_headed_anew(text)).encode("utf-8", "surrogatepass")
    if kind == "dialect":
        return draw(_retyped(text))
    rows = [line.split(",") for line in text.splitlines()]
    width = st.integers(0, len(rows[0]) - 1)
    if kind == "cell":
        for number in draw(st.lists(st.just(0) | place_in(len(rows)), min_size=1, max_size=3)):
            rows[number][draw(place_in(len(rows[number])))] = draw(cells)
    elif kind == "column":
        column, value = draw(width), draw(cells)
        rows = [rows[0], *([*row[:column], value, *row[column + 1 :]] for row in rows[1:])]
    elif kind == "columns":
        order = draw(st.lists(width, unique=True, min_size=1))
        rows = [[row[i] for i in order] for row in rows]
    else:
        keep = draw(st.lists(place_in(len(rows)), max_size=40))
        rows = [rows[i] for i in (sorted(keep) if draw(st.booleans()) else keep)]
    return "\n".join(map(",".join, rows)).encode("utf-8", "surrogatepass")


@st.composite
def _headed_anew(draw: Draw, text: str) -> str:
    """The same columns with names and units as loggers write them, or one of the columns alone."""
    head, _, body = text.partition("\n")
    parts = st.tuples(st.sampled_from(_FORMS), st.sampled_from(_NAMES), st.sampled_from(_UNITS))
    names = [form.format(name, unit) for form, name, unit in (draw(parts) for _ in head.split(","))]
    if draw(one_in(5)):
        return "\n".join([names[0], *(line.split(",")[-1] for line in body.splitlines())])
    return f"{','.join(names)}\n{body}"


@st.composite
def _retyped(draw: Draw, text: str) -> bytes:
    """The same text with another separator, line end or encoding, repeated, without its head, or with odd words."""
    return draw(
        st.sampled_from(";\t| ").map(lambda mark: text.replace(",", mark).encode())
        | st.sampled_from(_LINE_ENDS).map(lambda end: text.replace("\n", end).encode())
        | st.sampled_from(("utf-16", "utf-8-sig", "utf-32")).map(text.encode)
        | st.integers(2, 19).map(lambda count: (text * count).encode())
        | st.just(text.split("\n", 1)[1].encode())
        | spoilt_text(text, r"[^:,=\n]+").map(lambda changed: changed.encode("utf-8", "surrogatepass"))
    )


@st.composite
def frames(draw: Draw, frame: pl.DataFrame) -> pl.DataFrame:
    """A table with types, columns, rows or values changed; unchanged where polars refuses the change."""
    for _ in range(draw(st.integers(1, 2))):
        if frame.width:
            name = draw(st.sampled_from(frame.columns))
            try:
                frame = _changed_once(draw, frame, name)
            except (pl.exceptions.PolarsError, TypeError, ValueError, OverflowError):
                continue
    return frame


def _changed_once(draw: Draw, frame: pl.DataFrame, name: str) -> pl.DataFrame:
    kind = draw(st.integers(0, 8))
    if kind == 0:
        return frame.with_columns(pl.col(name).cast(draw(st.sampled_from(_TYPES)), strict=False))
    if kind == 1:
        return frame.drop(name)
    if kind == 2:
        return frame.rename({name: draw(st.sampled_from(HOSTILE))})
    if kind == 3:
        return frame.head(draw(st.integers(0, 3)))
    if kind == 4:
        return frame[draw(st.lists(place_in(max(frame.height, 1)), max_size=40))]
    if kind == 5:
        return frame.with_columns(frame[draw(st.sampled_from(frame.columns))].alias(name))
    if kind == 6:
        return frame.with_columns(pl.lit(None).alias(name))
    value = pl.lit(draw(st.sampled_from(HOSTILE if frame.schema[name] == pl.String else _FLOATS)))
    where = pl.int_range(frame.height) == draw(place_in(max(frame.height, 1))) if kind == 7 else pl.lit(True)
    return frame.with_columns(pl.when(where).then(value).otherwise(pl.col(name)).alias(name))


@st.composite
def parquets(draw: Draw, frame: pl.DataFrame) -> bytes:
    """A table as Parquet, with the table or the file's bytes changed; it often still begins and ends as Parquet."""
    kind = draw(st.integers(0, 5))
    if kind < 3:
        return parquet(draw(frames(frame)))
    content = parquet(frame)
    footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    if kind == 3:
        return draw(spoilt_bytes(content))
    if kind == 4:  # the data alone, or the description of it alone
        return draw(spoilt_bytes(content, 4, footer) | spoilt_bytes(content, footer, len(content) - 8))
    return content[: draw(place_in(len(content)))] + b"PAR1"


def parquet(frame: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file."""
    buffer = io.BytesIO()
    try:
        frame.write_parquet(buffer)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic of polars is no Exception
        return b"PAR1" + repr(error).encode() + b"PAR1"
    return buffer.getvalue()
