"""What causes that are read off the records leave under any set of effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import CHANNELS, misfit
from diagnosis.noise.gap import rounding_errors
from diagnosis.noise.sensor_noise import reading_levels, typical_step
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from diagnosis.search.prepared import Prepared

IN_HARMONICS = np.eye(len(CHANNELS))[CHANNELS.index("harmonics")]


def left_by_read_off(prepared: Prepared, base: Fit) -> Array:
    """χ² by channel that no set of effects has to explain, shape (6,), dimensionless.

    The error of a coarse step is not white, and follows a slow motion. A hum that is not a pure line leaves a small
    share of itself.

    Args:
        base: fit of the nominal model to the runs on which sets are compared.
    """
    left = np.zeros(len(CHANNELS))
    if prepared.hum is not None:
        share = prepared.settings.weighing.hum_left
        left += share * prepared.hum.excess * base.count * IN_HARMONICS
    errors = None
    if prepared.coarse:
        levels, stated = reading_levels(prepared.campaign), prepared.campaign.sensor.noise_std
        white = prepared.noise.white(typical_step(levels))
        # a coarse step hides the noise, so that what is stated of it is the better guess
        white = dict.fromkeys(white, stated) if stated else white
        errors = rounding_errors(base, white, prepared.step, levels)
    if errors is not None:
        tries = [
            misfit(base, [run.scaled(e[k]) for run, e in zip(base.problem.data.runs, errors, strict=True)])
            for k in range(len(errors[0]))
        ]
        left += np.maximum(np.mean([one.excess for one in tries], axis=0), 0.0)
    return left
