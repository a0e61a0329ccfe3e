"""Trees as TOML and JSON, and bytes with some of them changed."""

from __future__ import annotations

import json
import re

import numpy as np
import tomli_w

from tests.fuzz.values import DEEP, HOSTILE, NUMBERS, Rng, Tree

_WORDS = (
    b"nan", b"inf", b"1e999", b"9" * 5000, b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b'"', b"'", b"#",
    b"[" * 5000, b"{" * 5000, b"]", b"}", b"=", b",", b";", b"\\", b"\xc3", b"PAR1", b"-", b".", b"\xd9\xa3", b"0x",
    b"_1",
)  # fmt: skip


def as_toml(tree: Tree, rng: Rng) -> bytes:
    """A tree as TOML; where TOML cannot say it, the text of a simpler one with bytes changed.

    Args:
        tree: a dictionary, if TOML is to hold it.
        rng: decides how deep `DEEP` is.
    """
    try:
        text = tomli_w.dumps(_without_none(tree)).encode("utf-8", "surrogatepass")
    except (AttributeError, TypeError, ValueError):
        text = repr(tree)[:100_000].encode("utf-8", "surrogatepass")
    return _deepened(text, rng, b"[", b"]")


def as_json(tree: Tree, rng: Rng) -> bytes:
    """A tree as JSON, NaN and infinities with it, as Python writes them.

    Args:
        tree: any.
        rng: decides how deep `DEEP` is.
    """
    text = json.dumps(tree, default=str).encode("utf-8", "surrogatepass")
    return _deepened(text, rng, *((b"[", b"]") if rng.random() < 0.5 else (b'{"a":', b"}")))


def nested(tree: Tree, rng: Rng) -> Tree:
    """The tree with `DEEP` written out as lists in lists.

    Args:
        tree: any.
        rng: decides how deep.
    """
    if isinstance(tree, dict):
        return {key: nested(value, rng) for key, value in tree.items()}
    if isinstance(tree, list):
        return [nested(value, rng) for value in tree]
    if not isinstance(tree, str) or tree != DEEP:
        return tree
    deep: Tree = 0.0
    for _ in range(int(rng.integers(1, 2000))):
        deep = [deep]
    return deep


def changed_bytes(content: bytes, rng: Rng, start: int = 0, end: int | None = None) -> bytes:
    """Bytes with a few places changed.

    Args:
        content: any.
        rng: decides what is changed.
        start: first place that may change (a count of bytes).
        end: past the last one; None for all.
    """
    data = bytearray(content)
    end = len(data) if end is None else end
    for _ in range(int(rng.integers(1, 6))):
        place = int(rng.integers(start, max(start + 1, min(end, len(data) + 1))))
        kind = rng.integers(6)
        if kind == 0:
            data[place : place + 1] = bytes([rng.integers(256)])
        elif kind == 1:
            del data[place : place + int(rng.integers(1, 40))]
        elif kind == 2:
            data[place:place] = _WORDS[rng.integers(len(_WORDS))]
        elif kind == 3:
            other = int(rng.integers(len(data) + 1))
            data[place:place] = data[other : other + int(rng.integers(1, 40))]
        elif kind == 4 and place < len(data):
            data[place] ^= 1 << int(rng.integers(8))
        elif kind == 5 and rng.random() < 0.2:
            del data[place:]
    return bytes(data)


def damaged(content: bytes, rng: Rng) -> bytes:
    """Bytes changed without being moved: the addresses in a file of blocks stay right, or become wrong.

    Args:
        content: any.
        rng: decides what is changed.
    """
    data = bytearray(content)
    last = len(data) - 8
    # Few blocks describe a file; most of it is numbers.
    known = [i for i in range(0, last, 8) if data[i : i + 8].count(0) in (4, 5, 6, 7)] or list(
        range(0, last, 8)
    )
    for _ in range(int(rng.integers(1, 9))):
        near = rng.random() < 0.8
        place = (
            known[rng.integers(len(known))] + int(rng.integers(-8, 16)) if near else int(rng.integers(last))
        )
        place = min(max(place, 0), last)
        kind = rng.integers(5)
        if kind == 0:
            data[place] = int(rng.integers(256))
        elif kind == 1:
            data[place] ^= 1 << int(rng.integers(8))
        elif kind == 2:  # another address, a count, or text
            other = known[rng.integers(len(known))]
            data[place : place + 8] = data[other : other + 8]
        elif kind == 3:
            data[place : place + 8] = int(rng.choice(known)).to_bytes(8, "little")
        else:
            size = int(rng.integers(1, 5))
            data[place : place + size] = (b"\0", b"\xff")[rng.integers(2)] * size
    return bytes(data)


def changed_head(text: str, rng: Rng) -> str:
    """A head of lines with one word exchanged, repeated or removed, or one of its lines moved.

    Args:
        text: lines of words, numbers and units.
        rng: decides which.
    """
    words = re.split(r"([\s:;=,()\[\]]+)", text)
    at = int(rng.integers(len(words)))
    kind = rng.integers(6)
    if kind < 2:
        words[at] = _HEADINGS[rng.integers(len(_HEADINGS))]
    elif kind == 2:
        words[at] = HOSTILE[rng.integers(len(HOSTILE))] if rng.random() < 0.3 else _number(rng)
    elif kind == 3:
        words[at] = words[rng.integers(len(words))]
    elif kind == 4:
        del words[at]
    else:
        lines = text.split("\n")
        lines.insert(int(rng.integers(len(lines))), lines[rng.integers(len(lines))])
        return "\n".join(lines)
    return "".join(words)


_HEADINGS = (
    "time", "t", "Zeit", "yaw", "angle", "run", "Lauf", "fs", "dt", "Ts", "wind_speed", "V", "Kr", "rho", "width",
    "frontal_area", "release_angle", "s", "ms", "h", "rad", "deg", "m/s", "km/h", "counts", "Inkr.", "V", "mV",
    "rad/s", "N m/rad", "kg/m3", "Hz", "kHz", "#1", "Run #2", "(rad)", "[m/s]", "1e999", "-1e999", "1e-320", "0",
    "-0.0", "1e18",
)  # fmt: skip


def changed_line(text: str, rng: Rng) -> str:
    """A text with one word of it exchanged for an odd one; words end at ``:``, ``,``, ``=`` and line ends.

    Args:
        text: any.
        rng: decides which.
    """
    cuts = [0, *(i for i, c in enumerate(text) if c in ":,=\n"), len(text)]
    at = int(rng.integers(len(cuts) - 1))
    odd = HOSTILE[rng.integers(len(HOSTILE))] if rng.random() < 0.5 else _number(rng)
    return text[: cuts[at] + (at > 0)] + odd + text[cuts[at + 1] :]


def changed_xml(text: bytes, rng: Rng) -> bytes:
    """XML with values of attributes exchanged for odd ones, or elements repeated, nested or lost.

    Args:
        text: any.
        rng: decides what is changed.
    """
    whole = text.decode()
    for _ in range(int(rng.integers(1, 4))):
        values = list(re.finditer(r'="[^"]*"', whole))
        elements = list(re.finditer(r"<\w[^<>]*/>", whole))
        if rng.random() < 0.75 and values:
            found = values[rng.integers(len(values))]
            words = found[0][2:-1].split() or [""]
            at = int(rng.integers(len(words)))
            words[at] = HOSTILE[rng.integers(len(HOSTILE))] if rng.random() < 0.3 else _number(rng)
            if rng.random() < 0.1 and len(whole) < 10_000:  # a few MB in the end
                words = [word[:1000] for word in words] * int(rng.integers(2, 2000))
            quoted = " ".join(words).replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
            whole = f'{whole[: found.start()]}="{quoted}"{whole[found.end() :]}'
        elif elements:
            found = elements[rng.integers(len(elements))]
            odd = (f"<body>{found[0]}</body>" * 3, found[0] * int(rng.integers(0, 200)), elements[0][0])
            whole = whole[: found.start()] + odd[rng.integers(3)] + whole[found.end() :]
    return whole.encode("utf-8", "surrogatepass")


def changed_formula(text: str, rng: Rng) -> str:
    """A formula with tokens exchanged, repeated or lost.

    Args:
        text: any.
        rng: decides which.
    """
    tokens = re.findall(r"\w+|\W", text)
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(tokens)))
        token = tokens[at]
        odd = (
            *"+-*/^(),bkwVrt#",
            "**",
            "e",
            "pi",
            "1e999",
            "1e-320",
            "0",
            "lambda:",
            "0/0",
            "b^0.5",
            "(b)",
            _number(rng),
        )
        kinds = (token * int(rng.integers(0, 500)), str(odd[rng.integers(len(odd))]), f"({token})" * 2)
        tokens[at] = f"{FUNCTION[rng.integers(3)]}({token})" if rng.random() < 0.2 else kinds[rng.integers(3)]
    return "".join(tokens)


FUNCTION = ("sqrt", "log", "tan")


def _number(rng: Rng) -> str:
    return str(NUMBERS[rng.integers(len(NUMBERS))])


def _deepened(text: bytes, rng: Rng, opening: bytes, closing: bytes) -> bytes:
    depth = int(np.exp(rng.uniform(0.0, np.log(20_000))))
    return text.replace(f'"{DEEP}"'.encode(), opening * depth + b"0" + closing * depth)


def _without_none(tree: Tree) -> Tree:
    if isinstance(tree, dict):
        return {str(key): _without_none(value) for key, value in tree.items() if value is not None}
    if isinstance(tree, list):
        return [_without_none(value) for value in tree if value is not None]
    return tree
