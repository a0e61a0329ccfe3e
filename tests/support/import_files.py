"""Records of known numbers, and files of them in the dialects of instruments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

RATE = 200.0


def decay(seed: int = 1, *, duration: float = 8.0, amplitude: float = 0.35) -> tuple[np.ndarray, np.ndarray]:
    """Times in s and angles in rad of a free decay at 2 Hz, in the closed form."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * RATE)) / RATE
    angle = amplitude * np.exp(-0.15 * time) * np.cos(4.0 * np.pi * time)
    return time, angle + 2e-4 * rng.standard_normal(time.size)


@dataclass(frozen=True)
class Text:
    """A dialect, drawn by `any_dialect`."""

    delimiter: str
    decimal: str
    head: str
    unit: str
    bom: bool
    encoding: str
    line_end: str
    padded: bool
    index: bool
    comments: bool

    @property
    def factor(self) -> float:
        return 180.0 / np.pi if self.unit == "deg" else 1.0

    def cell(self, value: float, digits: int) -> str:
        text = f"{value:.{digits}f}".replace(".", self.decimal)
        return f" {text}" if self.padded and self.delimiter != " " else text

    def content(self, time: np.ndarray, angle: np.ndarray) -> bytes:
        names, units = ["Zeit", "Winkel"], ["s", self.unit]
        if self.index:
            names, units = ["Nr", *names], ["-", *units]
        pairs = list(zip(names, units, strict=True))
        lines = {
            "none": [],
            "names": [self.delimiter.join(f"{n}_[{u}]" for n, u in pairs)],
            "units line": [self.delimiter.join(names), self.delimiter.join(f"[{unit}]" for unit in units)],
            "preamble": [
                "Datenlogger für Versuche",
                "Datum: 12. März",
                "",
                self.delimiter.join(
                    f'"{n} ({u})"'.replace(" ", "_") for n, u in zip(names, units, strict=True)
                ),
            ],
        }[self.head]
        if self.comments:
            lines = ["# a comment", *lines]
        for i, (t, y) in enumerate(zip(time, angle * self.factor, strict=True)):
            cells = [self.cell(t, 4), self.cell(y, 7)]
            lines.append(self.delimiter.join([str(i), *cells] if self.index else cells))
        text = self.line_end.join(lines) + self.line_end
        return (b"\xef\xbb\xbf" if self.bom else b"") + text.encode(self.encoding)


def any_dialect(rng: np.random.Generator) -> Text:
    """A dialect that a logger might write."""

    def one_of(*choices: str) -> str:
        return str(rng.choice(choices))

    delimiter = one_of(",", ";", "\t", " ", "|")
    bom = bool(rng.random() < 0.3)
    return Text(
        delimiter,
        "." if delimiter == "," else one_of(".", ","),
        one_of("none", "names", "units line", "preamble"),
        one_of("deg", "rad"),
        bom,
        "utf-8" if bom else one_of("utf-8", "latin-1"),
        one_of("\n", "\r\n"),
        bool(rng.random() < 0.3),
        bool(rng.random() < 0.3),
        bool(rng.random() < 0.3),
    )


def written(folder: Path, name: str, content: bytes | str) -> Path:
    """A file with that content."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def csv(folder: Path, name: str = "log.csv", seed: int = 1) -> Path:
    """A plain file of times and angles in radians."""
    rows = "".join(f"{t:.3f},{y:.8f}\n" for t, y in zip(*decay(seed), strict=True))
    return written(folder, name, f"time_s,yaw_rad\n{rows}")
