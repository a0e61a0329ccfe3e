"""Diagnose measured records, and compare the answers with their sources.

``python -m docs.studies.real_records [--data FOLDER]`` writes ``docs/real-records.md`` and the figures beside it.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from diagnosis import diagnose
from diagnosis.result import Diagnosis
from identification.datasets import MEASURED_CAMPAIGNS, measured_campaign
from identification.show.style import save
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

PAGE = Path(__file__).parents[1] / "real-records.md"
SINE, DRY, QUADRATIC = "gravity_stiffness", "coulomb_friction", "quadratic_damping"
_KEY_PARAMETERS = 4  # number of parameters shown for each answer


@dataclass(frozen=True)
class Expected:
    """The causes in a record, according to its source or an energy balance.

    Args:
        causes: all required causes; ``unknown`` if no effect of the vocabulary explains the record.
        also: further permitted causes.
        words: required text in verdict or cautions; empty: none.
        why: the known facts, in a sentence.
    """

    causes: frozenset[str]
    also: frozenset[str] = frozenset()
    words: str = ""
    why: str = ""


def _expected(causes: Sequence[str], why: str, *, also: Sequence[str] = (), words: str = "") -> Expected:
    return Expected(frozenset(causes), frozenset(also), words, why)


EXPECTED: Mapping[str, Expected] = {
    "kvlcc2-roll-decay-0kn": _expected(
        (QUADRATIC,),
        "Damping with the square of the rate (the source's fit), slight hardening, wiggles from the tank's waves.",
        also=("cubic_stiffness",),
    ),
    "lee-heave-1": _expected(("unknown",), "Two coupled modes, 2.22 and 2.78 Hz.", words="second mode"),
    "lee-pitch-1": _expected(("unknown",), "Two coupled modes, 2.22 and 2.78 Hz.", words="second mode"),
    "rotary-pendulum": _expected(
        (SINE, DRY, QUADRATIC), "Energy balance: dry friction and a quadratic part; gravity's sine."
    ),
    "tartaruga-growth": _expected(
        ("unknown",),
        "Self-excitation that saturates; the frequency rises by a third.",
        words="self-excited: grows",
    ),
    "tartaruga-lco": _expected(
        ("unknown",), "A steady limit cycle: it has no damping ratio.", words="steady oscillation"
    ),
    "cart-thesis-1": _expected(
        (SINE, DRY, QUADRATIC),
        "Energy balance: dry friction 61 %, quadratic damping 37 % of the loss; gravity's sine.",
    ),
    "pasco-raw": _expected((DRY,), "Dry friction alone, between springs."),
    "phy180-raw": _expected(
        (SINE, DRY), "Gravity's sine to 1.2 ms, dry friction, some quadratic damping.", also=(QUADRATIC,)
    ),
}


def judge(expected: Expected, answer: Diagnosis) -> bool:
    """Whether all expected causes and no others are named, and the required words are present."""
    named = set(answer.causes)
    said = " ".join((answer.verdict, *answer.cautions))
    return expected.causes <= named <= expected.causes | expected.also and expected.words in said


def records(folder: Path | None) -> dict[str, Campaign]:
    """The packaged records and the campaigns of a folder that have an entry in `EXPECTED`, by name."""
    found = {name: measured_campaign(name) for name in MEASURED_CAMPAIGNS}
    for path in sorted(folder.iterdir()) if folder is not None else ():
        if path.name in EXPECTED and path.name not in found:
            found[path.name] = read_campaign(path)
    return found


def section(name: str, answer: Diagnosis | str, images: Path) -> tuple[str, str]:
    """One record's row and part of the page, from its diagnosis or the reason for the refusal."""
    expected = EXPECTED[name]
    if isinstance(answer, str):
        row = f"| [{name}](#{name}) | {_names(expected.causes)} | refused | | wrong |"
        return row, f"## {name}\nThe source: {expected.why}\n\nThe diagnosis refuses it: {answer}.\n"
    best = answer.candidates[0]
    right = "right" if judge(expected, answer) else "wrong"
    row = (
        f"| [{name}](#{name}) | {_names(expected.causes)} | {_names(answer.causes)} | "
        f"{best.probability:.2f} | {right} |"
    )
    caution = [text for text in answer.cautions if expected.words and expected.words in text]
    parts = [
        f"## {name}",
        f"The source: {expected.why}\n",
        f"The diagnosis ({right}): {answer.verdict}\n",
    ]
    parts += [f"It adds: {text}\n" for text in caution]
    for key, given in list(best.parameters.items())[:_KEY_PARAMETERS]:
        std = "" if given.std is None else f" ± {given.std:.1g}"
        unit = "" if given.unit == "1" else f" {given.unit}"
        parts.append(f"- `{key}`: {given.value:.4g}{std}{unit}")
    picture = answer.pictures.get("waterfall")
    if picture is not None and (figure := picture.draw()) is not None:
        path = images / f"real-records-{name}.png"
        save(figure, path)
        parts.append(f"\n![The gap of {name} as the causes are added](images/{path.name})")
    return row, "\n".join(parts) + "\n"


def _names(causes: Sequence[str] | frozenset[str]) -> str:
    return " + ".join(name.replace("_", " ") for name in sorted(causes)) or "none"


def page(parts: Sequence[tuple[str, str]]) -> str:
    """The whole page, from the rows and sections of the records."""
    right = sum(row.endswith("right |") for row, _ in parts)
    head = (
        "# Real records\n\nThe diagnosis of measured records, compared with their sources or energy balances. "
        "`python -m docs.studies.real_records --data FOLDER` writes this page; the expected causes are in "
        "[real_records.py](studies/real_records.py). An answer is right if it names all of them and no others and, "
        "where no effect explains the record, names the other motion. The records marked * have no stated "
        "licence and are not packaged.\n\n"
        f"**{right} of {len(parts)} are right.** Moments are per unit of inertia.\n\n"
        "| record | in it | named | probability | |\n|---|---|---|---|---|\n"
    )
    return head + "\n".join(row for row, _ in parts) + "\n\n" + "\n".join(text for _, text in parts)


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="a folder with further campaigns")
    images = PAGE.parent / "images"
    found = records(parser.parse_args().data)
    parts = []
    for name, campaign in found.items():
        try:
            answer: Diagnosis | str = diagnose(campaign)
        except TunnelError as refused:
            answer = str(refused)
        row, text = section(name, answer, images)
        mark = "" if name in MEASURED_CAMPAIGNS else "*"
        parts.append((row.replace(f"(#{name})", f"(#{name}){mark}", 1), text))
        # after each record, since a diagnosis may take minutes
        PAGE.write_text(page(parts), encoding="utf-8")
        print(row, flush=True)


if __name__ == "__main__":
    main()
