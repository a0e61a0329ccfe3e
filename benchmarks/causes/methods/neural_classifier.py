"""Simulation-based inference: a neural classifier of causes, trained on campaigns of the reference simulator."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main
from benchmarks.causes.neural_network import Classifier, read_classifier

NAMED = 0.5
_FACTS = read_classifier().facts
ABOUT = About(
    "simulation-based inference, neural classifier",
    f"trained on {_FACTS['campaigns']:.0f} campaigns drawn as the benchmark's are, from another seed: "
    f"{_FACTS['simulation_s'] / 60.0:.0f} min of processor time for simulating, "
    f"{_FACTS['training_s'] / 60.0:.0f} min for training; fixed summary statistics of runs and harmonics "
    "(summaries.py); "
    f"five networks of width {_FACTS['width']:.0f}, chosen on held-out training campaigns; a cause is named above "
    f"{NAMED:g}",
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    from benchmarks.causes.summaries import summaries
    from tunnel_sim.files.campaign_folder import read_campaign

    found = _classifier().probabilities(*summaries(read_campaign(folder)))
    if found[UNKNOWN] > NAMED:
        return answer_of([UNKNOWN], found)
    return answer_of([n for n, p in found.items() if p > NAMED and n != UNKNOWN], found)


@cache
def _classifier() -> Classifier:
    return read_classifier()


if __name__ == "__main__":
    main(answer)
