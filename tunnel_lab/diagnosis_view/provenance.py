"""What the answer rests on: noise, tests, uncertainty budget, versions and hashes, as rows of the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from identification.printing.numbers import COEFFICIENTS, p_text, significant, unit_mark

Document = Mapping[str, Any]

TESTS = {
    "below": "residual power below half the frequency f₀ of the oscillation",
    "f0": "residual power at f₀, from 0.5 to 1.5 f₀: the oscillation itself",
    "2f0": "residual power at its second harmonic, from 1.5 to 2.5 f₀",
    "3f0": "residual power at its third harmonic, from 2.5 to 3.5 f₀",
    "above": "residual power above 3.5 f₀",
    "offset": "whether the runs have a common zero",
    "noise against amplitude": "whether the noise grows or shrinks with the amplitude of the motion",
    "noise against rate": "whether the noise grows or shrinks with the rate of the motion",
    "noise in bursts": "whether the noise comes in bursts",
    "noise level": "whether the noise is above the level that the campaign states",
}
"""What each test of a gap looks at."""

SOURCES = {
    "noise": "noise of the readings",
    "misfit": "what the model leaves unexplained",
    "air density": "rounding of the stated air density",
    "unseen form": "form of the cause that no free decay shows",
    "freed form": "freedom of the causes' forms",
    "rivals": "other answers, by their probability",
}
"""What each share of a coefficient's variance comes from."""


def test_rows(document: Document) -> list[tuple[str, str, str]]:
    """The tests of the gap: name, what each looks at, and its p-value."""
    return [
        (name, TESTS.get(name, "–"), p_text(value).removeprefix("= "))
        for name, value in document["gap"]["tests"].items()
    ]


def false_alarms(document: Document) -> str:
    """The false-alarm rate of all tests together, in words."""
    return f"{significant(document['gap']['false_alarm_rate'], 2)} of the campaigns without a gap"


def budget(document: Document) -> tuple[list[str], list[tuple[str, ...]]]:
    """The uncertainty budget of the coefficients of the answer.

    Returns:
        Headings, and a row for each source: its standard deviation and its share of the variance, by coefficient.
        No rows where the document has no shares.
    """
    found = {
        name: given
        for name, given in document["coefficients"]["after"].items()
        if given["std"] is not None and given.get("shares")
    }
    heads = [f"{COEFFICIENTS.get(name, name)} [{unit_mark(given['unit'])}]" for name, given in found.items()]
    rows = [
        (words, *(_part(given["std"], given["shares"].get(source, 0.0)) for given in found.values()))
        for source, words in SOURCES.items()
    ]
    whole = ("combined standard deviation", *(significant(given["std"], 2) for given in found.values()))
    return heads, [*rows, whole] if found else []


def _part(std: float, share: float) -> str:
    if share < 5e-4:
        return "–"
    return f"{significant(std * math.sqrt(share), 2)} ({100.0 * share:.1f} %)"


def noise_rows(document: Document) -> list[tuple[str, str]]:
    """The noise that the gap is measured against, and the model behind the excesses."""
    noise = document["noise"]
    stated = noise["stated_std"]
    return [
        ("Noise of one sample", f"{1e3 * noise['std']:.4g} × 10⁻³ rad ({noise['source']})"),
        ("Stated", "–" if stated is None else f"{1e3 * stated:.4g} × 10⁻³ rad"),
        ("Why this one", str(noise["reason"])),
        *_confirmation_rows(document["confirmation"]),
    ]


def _confirmation_rows(found: Document) -> list[tuple[str, str]]:
    """The model behind the excesses, and the difference of the integrator used for fitting."""
    if found["failure"]:
        return [
            ("Excesses computed by", f"the integrator used for fitting; MuJoCo failed: {found['failure']}")
        ]
    apart = f"{found['largest_difference_rad']:.1e} rad at most"
    rms = f"{found['rms_difference_rad']:.1e} rad root mean square in {found['run']}"
    return [
        ("Excesses computed by", "the MuJoCo model"),
        (
            "Difference of the integrator used for fitting",
            f"{apart}; {rms}, {'within' if found['agrees'] else 'beyond'} {found['tolerance_rad']:.1e} rad",
        ),
    ]


def version_rows(document: Document) -> list[tuple[str, str]]:
    """Versions of the program and its libraries, and of the document's schema."""
    versions = (document.get("provenance") or {}).get("versions", {})
    return [*versions.items(), ("schema of the document", str(document["schema_version"]))]


def hash_rows(document: Document) -> list[tuple[str, str]]:
    """Files and their SHA-256."""
    return list((document.get("provenance") or {}).get("sha256", {}).items())
