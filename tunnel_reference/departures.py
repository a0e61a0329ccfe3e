"""Departures from assumptions common to the simulators, the fits and their tests (decision 0005).

Each breaks one assumption that campaigns of the standard rig share, and is an everyday property of a rig and of its
data logger. None of them is a cause: the campaign's statements about it are true, and anything unstated is
optional.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from tunnel_reference.true_conditions import Array, TrueConditions

_BEYOND = 16.0  # Hz as simulated: a hum is drawn only where it appears beyond the motion's third harmonic
_INSIDE = 2.0  # Hz below half the sample rate
_MAINS = (50.0, 60.0)

Change = Callable[[np.random.Generator, TrueConditions], TrueConditions]


def draw_departures(
    rng: np.random.Generator,
    conditions: TrueConditions,
    *,
    probability: float = 0.0,
    certain: Collection[str] = (),
    mains: bool = False,
) -> TrueConditions:
    """Break each assumption with the same probability, independently of the others.

    Args:
        rng: source of all random numbers; not used where no assumption can be broken.
        certain: names in `DEPARTURES` of the assumptions that are always broken.
        mains: whether mains hum acts; the sample rate must then not alias it onto the motion.
    """
    if probability == 0.0 and not set(certain) & set(DEPARTURES):
        return conditions
    found = conditions
    for name, change in DEPARTURES.items():
        if rng.random() >= (1.0 if name in certain else probability):
            continue
        changed = change(rng, found)
        shown = mains and _shows_mains(found)  # otherwise no change may help, and none is drawn again
        while shown and not _shows_mains(changed):
            changed = change(rng, found)
        found = changed
    return found


def _shows_mains(c: TrueConditions) -> bool:
    """Whether every run shows both mains frequencies apart from its motion."""
    for rate in np.unique(c.sample_rate / c.every):
        for mains in np.array(_MAINS) * c.time_scale:
            place = abs(mains - rate * np.round(mains / rate))
            if not _BEYOND <= place <= 0.5 * rate - _INSIDE:
                return False
    return True


def _log_uniform(
    rng: np.random.Generator, low: float, high: float, size: int | tuple[int, ...] = ()
) -> Array:
    """A number drawn uniformly in the logarithm."""
    return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), size)))


def _sample_rate(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """A rate other than 1000 Hz, which aliases the mains where it is below 120 Hz."""
    if c.drive is not None:  # its input is already sampled
        return c
    return replace(c, sample_rate=float(np.round(_log_uniform(rng, 80.0, 800.0))))


def _rates_differ(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """The logger keeps every sample of one run and one of up to four of another."""
    if c.drive is not None:  # thinning would change the input
        return c
    most = max(1, min(4, int(c.sample_rate / 80.0)))
    return replace(c, every=rng.integers(1, most + 1, c.runs))


def _durations_differ(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Between half of the duration and all of it."""
    return replace(c, kept=rng.uniform(0.5, 1.0, c.runs))


def _records_are_short(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Few cycles: about five to fifteen."""
    if c.drive is not None:  # its input is already drawn for the duration
        return c
    return replace(c, duration=float(np.round(rng.uniform(2.5, 4.0), 2)))


def _samples_missing(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """One to three gaps of up to a fiftieth of the record, which the time stamps show."""
    if c.drive is not None:  # a gap would change the input
        return c
    start = rng.uniform(0.05, 0.9, int(rng.integers(1, 4)))
    return replace(c, gaps=np.stack([start, start + rng.uniform(0.002, 0.02, start.size)], axis=1))


def _times_start_anywhere(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Time stamps count from the logger's start, not from the release."""
    return replace(c, time_start=np.round(rng.uniform(-50.0, 5000.0, c.runs), 3))


def _both_sides(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Released from either side."""
    side = np.where(rng.permutation(c.runs) < c.runs // 2, -1.0, 1.0)
    return replace(c, release_angle=c.release_angle * side, start_angle=c.start_angle * side)


def _releases_are_other(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """From a fifth of the standard releases to twice as far."""
    factor = float(_log_uniform(rng, 0.2, 2.0))
    return replace(c, release_angle=np.round(c.release_angle * factor, 4), start_angle=c.start_angle * factor)


def _starts_with_a_rate(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """The record starts after the release, with up to a fifth of the rate of a passage through the middle."""
    rate = c.wind_off_omega * np.abs(c.start_angle) * rng.uniform(-0.2, 0.2, c.runs)
    return replace(c, start_rate=rate)


def _densities_differ(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Runs on different days and at different altitudes: each states its own density."""
    return replace(c, air_density=np.round(rng.uniform(0.95, 1.3, c.runs), 4))


def _speeds_unpaired(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """No two runs have the same wind speed."""
    return replace(c, wind_speed=np.round(c.wind_speed * rng.uniform(0.8, 1.1, c.runs), 2))


def _other_springs(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Springs outside the table, at least a tenth apart."""
    springs = np.unique(c.spring_stiffness)
    drawn = np.zeros(springs.size)
    while np.min(np.diff(drawn), initial=np.inf) < 0.1 * drawn[0] or drawn[0] == 0.0:
        drawn = np.sort(np.round(_log_uniform(rng, 13.0, 90.0, springs.size), 2))
    return replace(c, spring_stiffness=drawn[np.searchsorted(springs, c.spring_stiffness)])


def _noise_differs(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """A run's noise is up to twice or half the campaign's, which is then not stated."""
    return replace(c, noise_scale=_log_uniform(rng, 0.5, 2.0, c.runs), stated_noise=None)


def _noise_has_tails(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Noise of Student's t, not normal."""
    return replace(c, noise_tails=float(rng.integers(5, 13)))


def _zeros_differ(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Every run rests at its own zero, which the campaign states."""
    return replace(c, zero_shift=0.004 * rng.standard_normal(c.runs))


def _rests_anywhere(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """The reading at rest is any angle of a turn, as from an encoder without an index."""
    return replace(c, offset=float(np.round(rng.uniform(-np.pi, np.pi), 4)))


def _sensor_is_other(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """Noise above or below the standard, and steps from a twentieth of it to three times as wide."""
    noise = float(_log_uniform(rng, 3e-5, 2e-3))
    resolution = noise * float(_log_uniform(rng, 0.05, 3.0))
    return replace(c, noise_std=noise, resolution=resolution, stated_noise=None)


def _inertia_is_other(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """The true inertia is far from the stated one."""
    return replace(c, yaw_inertia=float(rng.uniform(0.06, 0.2)))


def _air_restores(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """The air restores the yaw angle (Cnβ < 0), and damps little or feeds a little in."""
    return replace(c, cn_beta=float(-rng.uniform(0.05, 0.5)), cn_r=float(rng.uniform(-0.3, 0.01)))


def _damping_is_other(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """From a fiftieth of a per cent of the critical damping to two per cent or so."""
    return replace(c, mechanical_damping=float(_log_uniform(rng, 5e-4, 0.06)))


DEPARTURES: Mapping[str, Change] = {
    "sample_rate": _sample_rate,
    "rates_differ": _rates_differ,
    "durations_differ": _durations_differ,
    "records_are_short": _records_are_short,
    "samples_missing": _samples_missing,
    "times_start_anywhere": _times_start_anywhere,
    "both_sides": _both_sides,
    "releases_are_other": _releases_are_other,
    "starts_with_a_rate": _starts_with_a_rate,
    "densities_differ": _densities_differ,
    "speeds_unpaired": _speeds_unpaired,
    "other_springs": _other_springs,
    "noise_differs": _noise_differs,
    "noise_has_tails": _noise_has_tails,
    "zeros_differ": _zeros_differ,
    "rests_anywhere": _rests_anywhere,
    "sensor_is_other": _sensor_is_other,
    "inertia_is_other": _inertia_is_other,
    "air_restores": _air_restores,
    "damping_is_other": _damping_is_other,
}
"""Departures by the name of the broken assumption."""
