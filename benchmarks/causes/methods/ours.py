"""The project's own diagnosis, as ``tunnel diagnose`` runs it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.causes.entry import KINDS, About, answer_of, main
from diagnosis.findings.terms import SCATTERS
from identification.estimate import Quantity

ABOUT = About("tunnel diagnose", "as delivered, no option")


def answer(folder: Path) -> dict[str, Any]:
    """Diagnose one campaign."""
    from diagnosis import diagnose

    found = diagnose(folder, kinds=KINDS)
    sets = [(_names(one.effect), one.probability) for one in found.candidates]
    probability = dict(found.inclusion)
    probability["unknown"] = sum(p for names, p in sets if names == ("unknown",))
    total = max(sum(p for _, p in sets), 1.0)  # rounding
    stated = {"before": _stated(found.coefficients.before), "after": _stated(found.coefficients.after)}
    answered = answer_of(list(found.causes), probability, [(n, p / total) for n, p in sets], stated)
    spreads = () if found.repeatability is None else found.repeatability.spreads
    scatter = {
        SCATTERS[one.effect]: {
            "value": one.width,
            "interval_90": list(one.interval),
            "named": one.shown,
        }
        for one in spreads
    }
    return answered | ({"scatter": scatter} if scatter else {})


def _names(effect: str) -> tuple[str, ...]:
    return () if effect == "none" else tuple(effect.split(" + "))


def _stated(values: Mapping[str, Quantity]) -> dict[str, Any]:
    """The coefficients stated with a standard deviation."""
    given = {name: values.get(name) for name in ("cn_beta", "cn_r")}
    return {
        n: {"value": v.value, "std": v.std}
        for n, v in given.items()
        if v is not None and (v.std or 0.0) > 0.0
    }


if __name__ == "__main__":
    main(answer)
