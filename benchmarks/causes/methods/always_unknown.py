"""Always `unknown`: the score of a method that ignores the data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.causes.entry import NAMES, UNKNOWN, About, answer_of, main

ABOUT = About(
    "always unknown", "no setting; probabilities are the shares of the vocabulary, 1/20 each", (UNKNOWN,)
)


def answer(folder: Path) -> dict[str, Any]:  # noqa: ARG001 — the signature of all methods
    """The same answer to every campaign."""
    return answer_of([UNKNOWN], {**dict.fromkeys(NAMES, 0.05), UNKNOWN: 0.5})


if __name__ == "__main__":
    main(answer)
