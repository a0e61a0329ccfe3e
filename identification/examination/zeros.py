"""Whether the runs have a common zero or one each, as where the sensor is set to zero before every run."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from identification.decay.first_guess import starting_frequency
from identification.decay.peaks import follow_peaks
from identification.policy import CLEAR_SWING, EQUAL_SWINGS, MISFIT_RATE
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run

_LEAST_CENTRES = 3


@dataclass(frozen=True)
class Centre:
    """The centre of a run's oscillation.

    Args:
        zero: rad (rad/s or rad/s² where the reading is a rate or an acceleration).
        std: its standard deviation, in the same unit; it includes the change along the run.
        swing: half the largest distance of two neighbouring peaks, in the same unit.
    """

    run: Run
    zero: float
    std: float
    swing: float


def with_zeros(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Give every run its own zero where the records show that they have one, unless the campaign states it.

    Args:
        campaign: the runs, from their releases on.

    Returns:
        The campaign, itself if the runs may have a common zero, and one remark if they have not. Only runs of
        equal spring, wind and swing are compared: with an asymmetric spring the centre depends on the amplitude,
        and in a stream at an angle on the wind.
    """
    if campaign.sensor.zero not in (None, "auto"):
        return campaign, ()
    found = [centre_of(run, campaign.sensor.resolution or 0.0) for run in campaign.runs]
    groups = list(_alike([centre for centre in found if centre is not None]))
    freedom = sum(len(group) - 1 for group in groups)
    if freedom == 0 or sum(map(_scatter, groups)) <= float(chdtri(freedom, MISFIT_RATE)):
        return campaign, ()
    largest = max(max(c.zero for c in group) - min(c.zero for c in group) for group in groups)
    compared = {centre.run.id for group in groups for centre in group}
    remark = Remark(
        Outcome.NOTED,
        tuple(run.id for run in campaign.runs if run.id in compared),
        f"they oscillate about zeros that differ by up to {largest:.2g} {campaign.sensor.unit} under equal "
        f"conditions; every run of the campaign is fitted with a zero of its own",
        "state zero = 'common' under [sensor] if the zero cannot have moved between them",
    )
    return replace(campaign, sensor=replace(campaign.sensor, zero="per_run")), (remark,)


def centre_of(run: Run, resolution: float) -> Centre | None:
    """The centre that a run oscillates about, from its peaks.

    Peaks on both sides are equally far from the centre under any symmetric spring and any damping, dry friction
    included, which may hold the body at another place in the end.

    Args:
        run: from its release on.
        resolution: step of the reading, in its unit; 0 where it is not stated.

    Returns:
        The centre; None where there are too few clear peaks.
    """
    frequency = starting_frequency(run.record)
    if frequency is None:
        return None
    heights = follow_peaks(run.record, frequency, sparse=True)[1]
    swings = 0.5 * np.abs(np.diff(heights))
    if swings.size < _LEAST_CENTRES + 1:
        return None
    middles = 0.25 * (heights[:-2] + 2.0 * heights[1:-1] + heights[2:])
    clear = middles[swings[1:] > CLEAR_SWING * swings.max()]
    if clear.size < _LEAST_CENTRES:
        return None
    half = clear.size // 2
    along = 0.5 * abs(float(clear[:half].mean() - clear[half:].mean()))
    # Neighbouring middles share two of their three peaks: half as many are independent.
    chance = float(clear.std(ddof=1)) * np.sqrt(2.0 / clear.size)
    std = float(np.linalg.norm([along, chance, resolution / np.sqrt(12.0)]))
    return Centre(run, float(clear.mean()), std, float(swings.max()))


def _alike(centres: Sequence[Centre]) -> Iterable[list[Centre]]:
    """Groups of two runs or more with equal spring, wind and swing."""
    by_condition: dict[tuple[float | None, ...], list[Centre]] = defaultdict(list)
    for centre in centres:
        run = centre.run
        by_condition[run.spring_stiffness, run.wind_speed, run.air_density].append(centre)
    for group in by_condition.values():
        left = sorted(group, key=lambda centre: -centre.swing)
        while left:
            alike = [centre for centre in left if centre.swing >= EQUAL_SWINGS * left[0].swing]
            left = left[len(alike) :]
            if len(alike) > 1:
                yield alike


def _scatter(group: Sequence[Centre]) -> float:
    """Weighted sum of squared distances from the group's mean."""
    zero = np.array([centre.zero for centre in group])
    weight = 1.0 / np.maximum([centre.std for centre in group], 1e-300) ** 2
    return float(weight @ (zero - weight @ zero / weight.sum()) ** 2)
