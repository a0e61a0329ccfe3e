"""Trees as TOML and JSON, and texts and bytes with some of them changed."""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

import tomli_w
from hypothesis import strategies as st

from tests.fuzz.values import DEEP, Draw, Tree, odd_words, one_in, place_in, spoilt

_BYTES = (
    b"nan", b"inf", b"1e999", b"9" * 5000, b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b'"', b"'", b"#",
    b"[" * 5000, b"{" * 5000, b"]", b"}", b"=", b",", b";", b"\\", b"\xc3", b"PAR1", b"-", b".", b"\xd9\xa3", b"0x",
    b"_1",
)  # fmt: skip
_TOML, _JSON = ((b"[", b"]"),), ((b"[", b"]"), (b'{"a":', b"}"))
depths = st.integers(1, 20_000) | st.integers(1, 100)


def to_toml(tree: Tree) -> bytes:
    """A tree as TOML; where TOML cannot say it, Python's text of it."""
    try:
        return tomli_w.dumps(_without_none(tree)).encode("utf-8", "surrogatepass")
    except (AttributeError, TypeError, ValueError):
        return repr(tree)[:100_000].encode("utf-8", "surrogatepass")


def to_json(tree: Tree) -> bytes:
    """A tree as JSON, NaN and infinities with it, as Python writes them."""
    return json.dumps(tree, default=str).encode("utf-8", "surrogatepass")


@st.composite
def spoilt_toml(draw: Draw, seed: dict[str, Any] | bytes) -> bytes:
    """The TOML of a spoilt tree, or spoilt TOML."""
    if draw(_trees):
        tree = tomllib.loads(seed.decode()) if isinstance(seed, bytes) else seed
        return draw(_deepened(to_toml(draw(spoilt(tree))), _TOML))
    return draw(spoilt_bytes(seed if isinstance(seed, bytes) else to_toml(seed)))


@st.composite
def spoilt_json(draw: Draw, tree: Tree) -> bytes:
    """The JSON of a spoilt tree, or spoilt JSON."""
    return draw(
        _deepened(to_json(draw(spoilt(tree))), _JSON) if draw(_trees) else spoilt_bytes(to_json(tree))
    )


_trees = st.sampled_from((True, True, True, False))


@st.composite
def _deepened(draw: Draw, text: bytes, brackets: tuple[tuple[bytes, bytes], ...]) -> bytes:
    stands = f'"{DEEP}"'.encode()
    if stands not in text:
        return text
    (opening, closing), depth = draw(st.sampled_from(brackets)), draw(depths)
    return text.replace(stands, opening * depth + b"0" + closing * depth)


@st.composite
def nested(draw: Draw, tree: Tree) -> Tree:
    """A spoilt tree with `DEEP` written out as lists in lists."""

    def deepened(value: Tree) -> Tree:
        if isinstance(value, dict):
            return {key: deepened(one) for key, one in value.items()}
        if isinstance(value, list):
            return [deepened(one) for one in value]
        if not isinstance(value, str) or value != DEEP:
            return value
        deep: Tree = 0.0
        for _ in range(draw(st.integers(1, 2000))):
            deep = [deep]
        return deep

    return deepened(draw(spoilt(tree)))


@st.composite
def spoilt_bytes(draw: Draw, content: bytes, start: int = 0, end: int | None = None) -> bytes:
    """Bytes with one to five places changed, all of them between two places."""
    data = bytearray(content)
    end = len(data) if end is None else end
    for kind in draw(st.lists(st.sampled_from("=-+&^^|"), min_size=1, max_size=5)):
        place = draw(st.integers(start, max(start, min(end, len(data)) - 1)))
        if kind == "=":
            data[place : place + 1] = bytes([draw(st.integers(0, 255))])
        elif kind == "-":
            del data[place : place + draw(st.integers(1, 40))]
        elif kind == "+":
            data[place:place] = draw(st.sampled_from(_BYTES) | st.binary(min_size=1, max_size=8))
        elif kind == "&":
            other = draw(st.integers(0, len(data)))
            data[place:place] = data[other : other + draw(st.integers(1, 40))]
        elif kind == "^" and place < len(data):
            data[place] ^= 1 << draw(st.integers(0, 7))
        elif kind == "|" and draw(one_in(3)):
            del data[place:]
    return bytes(data)


@st.composite
def damaged(draw: Draw, content: bytes) -> bytes:
    """Bytes changed without being moved: the addresses in a file of blocks stay right, or become wrong."""
    data = bytearray(content)
    last = len(data) - 8
    eights = range(0, last, 8)
    # Few blocks describe a file; most of it is numbers.
    known = [i for i in eights if 3 < data[i : i + 8].count(0) < 8] or list(eights)
    for kind in draw(st.lists(st.integers(0, 4), min_size=1, max_size=8)):
        near = draw(st.sampled_from(known)) + draw(st.integers(-8, 15))
        place = draw(st.integers(0, last)) if draw(one_in(5)) else min(max(near, 0), last)
        if kind == 0:
            data[place] = draw(st.integers(0, 255))
        elif kind == 1:
            data[place] ^= 1 << draw(st.integers(0, 7))
        elif kind == 2:  # another address, a count, or text
            other = draw(st.sampled_from(known))
            data[place : place + 8] = data[other : other + 8]
        elif kind == 3:
            data[place : place + 8] = draw(st.sampled_from(known)).to_bytes(8, "little")
        else:
            size = draw(st.integers(1, 4))
            data[place : place + size] = draw(st.sampled_from((b"\0", b"\xff"))) * size
    return bytes(data)


@st.composite
def spoilt_text(
    draw: Draw, text: str, words: str = r"[^\s:;=,()\[\]]+", odd: st.SearchStrategy[str] = odd_words
) -> str:
    """A text with one to three of its words exchanged, repeated, wrapped, copied from elsewhere or removed.

    Args:
        draw: of the strategy.
        text: any.
        words: a regular expression of a word; what stands between words stays.
        odd: what a word is exchanged for.
    """
    pieces = re.split(f"({words})", text)  # the words at the odd places
    for kind in draw(st.lists(st.sampled_from("====*(&-"), min_size=1, max_size=3)):
        at = 2 * draw(st.integers(0, max(0, len(pieces) // 2 - 1))) + (len(pieces) > 1)
        word = pieces[at]
        if kind == "=":
            pieces[at] = draw(odd)
        elif kind == "*":
            between = draw(st.sampled_from(("", " ", "\n")))
            pieces[at] = between.join([word[:1000]] * draw(st.integers(0, 3) | st.integers(0, 500)))
        elif kind == "(":
            pieces[at] = draw(
                st.sampled_from(("({})", "({0})({0})", "<body>{}</body>", "sqrt({})", "log({})", "tan({})"))
            ).format(word)
        elif kind == "&":
            pieces[at] = pieces[draw(place_in(len(pieces)))]
        else:
            pieces[at] = ""
    return "".join(pieces)


@st.composite
def spoilt_xml(draw: Draw, text: bytes) -> bytes:
    """XML with words in the values of its attributes exchanged, or whole elements repeated, nested or removed."""
    words = draw(st.sampled_from((r'(?<=[" ])[^\s="<>/]+(?=[" ])', r"<\w[^<>]*/>")))
    quoted = odd_words.map(
        lambda word: word.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    )
    return draw(spoilt_text(text.decode(), words, quoted)).encode("utf-8", "surrogatepass")


def _without_none(tree: Tree) -> Tree:
    if isinstance(tree, dict):
        return {str(key): _without_none(value) for key, value in tree.items() if value is not None}
    if isinstance(tree, list):
        return [_without_none(value) for value in tree if value is not None]
    return tree
