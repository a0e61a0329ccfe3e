"""Sentences of one answer that cannot both be true."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

Document = Mapping[str, Any]


def _decided(document: Document) -> bool:
    return document.get("decided", True) and document["causes"] not in ([], ["unknown"])


def _elsewhere(document: Document, text: str) -> bool:
    return _decided(document) and "That does not agree with" in text


def _acts(document: Document, text: str) -> bool:
    """The place acts on something that no cause of a decided answer acts on."""
    found = re.search(r"Where: .*? It acts on (the [a-z ]+|a stated value)[:.]", text)
    acting = re.findall(
        r"\bacts? on (the [a-z ]+?|a stated value)(?:, (?:only )?with|[.;])", text.split("Where: ")[0]
    )
    return _decided(document) and found is not None and bool(acting) and found[1] not in acting


def _wind(document: Document, text: str) -> bool:
    """The causes act with the wind on and off, but the gap needs wind; or the other way round."""
    before, _, after = text.partition("Where: ")
    both, only = "with the wind on and off", "with the wind on"
    needs = f"It appears only {only}:" in after
    always = f"It appears {both}:" in after
    acts_always, acts_in_wind = f", {both}" in before, f", only {only}" in before
    return _decided(document) and (
        (needs and acts_always and not acts_in_wind) or (always and acts_in_wind and not acts_always)
    )


def _tried(document: Document, text: str) -> bool:
    """A second mode explains a share, and no set with one was weighed."""
    answers = " + ".join(one["effect"] for one in document["candidates"])
    return bool(re.search("contains? a second mode", text)) and "second_mode" not in answers


PAIRS: Mapping[str, Callable[[Document, str], bool]] = {
    "the place does not agree with decided causes": _elsewhere,
    "the place acts on another channel than all decided causes": _acts,
    "the place needs another wind than all decided causes": _wind,
    "an immaterial gap, and coefficients not to be trusted": lambda _, text: (
        "The gap is immaterial" in text and "Do not trust the coefficients" in text
    ),
    "a cause acts on something, and it cannot be determined on what": lambda _, text: (
        bool(re.search(r"\bacts? on (the|a) ", text)) and "What it acts on cannot be determined" in text
    ),
    "the runs repeat, and no cause explains them": lambda document, text: (
        "no run-to-run scatter" in text
        and (document["causes"] == ["unknown"] or not document.get("decided", True))
    ),
    "the runs repeat, and a gap beyond the noise remains": lambda document, text: (
        "no run-to-run scatter" in text and bool((document.get("rest") or {}).get("significant"))
    ),
    "the runs repeat, and differences between them explain the rest": lambda _, text: (
        "no run-to-run scatter" in text and "stiffness, damping or moment of each run could explain" in text
    ),
    "the runs repeat, without a limit": lambda _, text: "the runs repeat, without scatter" in text,
    "a second mode that was not tried": _tried,
}
"""Pairs of sentences, by what they say together."""


def contradictions(document: Document, text: str) -> list[str]:
    """The pairs in an answer.

    Args:
        document: of the answer.
        text: the answer as printed.
    """
    line = " ".join(text.split())
    return [name for name, both in PAIRS.items() if both(document, line)]
