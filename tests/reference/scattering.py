"""Campaigns of the nominal model in closed form whose runs do not repeat exactly."""

from dataclasses import replace

import numpy as np

from tests.reference.free_decays import Setting, Truth, campaign

USUAL = (0.003, 0.0005, 0.01)
"""Standard deviations of the runs' own wind speed, spring stiffness and mechanical damping, relative."""


def scattering(settings, rng, *, widths=USUAL, truth=None, **shape):
    """A campaign whose runs state the nominal wind speed and spring, and have their own, and their own damping."""
    truth, runs = truth or Truth(), []
    for number, stated in enumerate(settings, 1):
        speed, spring, damping = 1.0 + np.array(widths) * rng.standard_normal(3)
        own = replace(stated, speed=stated.speed * speed, spring=stated.spring * spring)
        turned = replace(truth, mechanical_damping=truth.mechanical_damping * damping)
        one = campaign((own,), truth=turned, rng=rng, **shape)
        known = {"wind_speed": stated.speed, "spring_stiffness": stated.spring}
        runs.append(replace(one.runs[0], id=f"r{number:02d}", **known))
    return replace(one, runs=tuple(runs))


THREE_SPRINGS = tuple(
    Setting(spring, speed) for spring in (16.12, 21.02, 44.84) for speed in (0.0, 12.0, 18.0, 24.0)
)
