"""A random moment of the surroundings in the six runs of `tests.support.gap_campaigns`."""

from __future__ import annotations

import numpy as np

from diagnosis.search.process_noise import ProcessNoise
from diagnosis.search.random_spectra import SURROUNDINGS, SpectrumPart

SHAKEN = SpectrumPart(0.02, 3.0, source=SURROUNDINGS)


def moment(drop: float) -> ProcessNoise:
    """The moment, if it lowers −2 ln L by so much."""
    names, shares = tuple(f"r{i}" for i in range(1, 7)), np.full(6, drop / 6.0)
    return ProcessNoise((SHAKEN,), names, shares, np.ones(6), 0.0, 0.0, [], 0.01, np.ones(3), 0.0)
