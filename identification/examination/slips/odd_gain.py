"""A single run from another gain of the sensor, such as another range of its amplifier.

In a linear decay a gain looks like another release. But it scales the noise of the sensor by the same factor as the
swing, and a release does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.show.numbers import with_std
from identification.signal.noise import measured_noise
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array, Record

_FEWEST = 5  # runs that state their release: three others do not show how widely they scatter
_LEAST_SAMPLES = 2 * policy.LEAST_SAMPLES  # of a record of two halves


@dataclass(frozen=True)
class OtherGain:
    """The gain of one run over the gain of the others.

    Args:
        ratio: of the gains.
        std: its standard deviation.
    """

    run: Run
    ratio: float
    std: float


@dataclass(frozen=True)
class OddGain(StatementSlip):
    """Noise and swing of one run are those of the others times one factor. Named: ωn and ζ do not change."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare noise and swing of every run with the other runs."""
        found = other_gain(seen)
        if found is None:
            return ()
        what = (
            "its noise, and its swing over the stated release_angle, are both "
            f"{with_std(found.ratio, found.std)} times those of the other runs: the sensor had another gain"
        )
        remedy = (
            "check the range of its amplifier and repeat the run, or leave the run out with "
            f"--leave-out {found.run.id}"
        )
        return (Remark(Outcome.NOTED, (found.run.id,), what, remedy),)


def other_gain(seen: SlipEvidence) -> OtherGain | None:
    """The one run with another gain; None where there is none, or where several runs may have one."""
    swings = [s for s in seen.swings if s.run.release_angle and s.run.record.time_s.size >= _LEAST_SAMPLES]
    if len(swings) < _FEWEST:
        return None
    order, step = seen.campaign.sensor.derivative, seen.campaign.sensor.resolution or 0.0
    reach = np.array(
        [s.amplitude * s.stiffness ** (-0.5 * order) / abs(s.run.release_angle or 1.0) for s in swings]
    )
    variances, degrees = _variances(swings)
    # A gain before the converter leaves the rounding as it is; one behind it scales the rounding too.
    roundings = sorted({0.0, step**2 / 12.0})
    found: dict[str, OtherGain] = {}
    for rounding in roundings:
        if np.all(variances > rounding):
            widening = (variances / (variances - rounding)).mean(axis=1)
            noise, noise_std = 0.5 * np.log(variances - rounding), widening / np.sqrt(2.0 * degrees)
            for place, ratio, std in odd_gains(np.log(reach), noise, noise_std, tests=len(roundings)):
                run = swings[place].run
                found[run.id] = OtherGain(run, float(np.exp(ratio)), float(np.exp(ratio)) * std)
    return next(iter(found.values())) if len(found) == 1 else None


def odd_gains(
    swing: Array, noise: Array, noise_std: Array, *, tests: int = 1
) -> tuple[tuple[int, float, float], ...]:
    """The runs whose noise and swing both differ from the other runs, by one factor.

    Both must differ at `policy.DIFFERENCE_RATE` per campaign, so that one of them alone, such as a release from a
    wrong angle, names no run more often; a campaign without either is named at about its square. The factors must
    agree, and the noise must be as large in both halves of the run: in a clipped run it is not, and a fast motion
    that looks like noise decays.

    Args:
        swing: logarithms of the ratios to the stated releases, shape (runs,).
        noise: logarithms of the noise in both halves, shape (runs, 2).
        noise_std: by the number of samples, of a whole run, shape (runs,).
        tests: number of such tests of a campaign.

    Returns:
        Place of each such run, the logarithm of its factor by the swing, and its standard deviation: rounding
        biases the factor by the noise.
    """
    known = np.hypot(noise_std, policy.SCATTER_OF_NOISE)
    excess, excess_std, of_excess = _departures(swing, np.full(swing.size, policy.SCATTER_OF_RELEASE))
    louder, louder_std, of_louder = _departures(noise.mean(axis=1), known)
    rate = 0.5 * policy.DIFFERENCE_RATE / (swing.size * tests)
    agrees = -stdtrit(swing.size - 2 + policy.SCATTER_FREEDOM, 0.5 * policy.MISFIT_RATE)
    odd: NDArray[np.bool_] = (
        (np.abs(excess) > -stdtrit(of_excess, rate) * excess_std)
        & (np.abs(louder) > -stdtrit(of_louder, rate) * louder_std)
        & (np.abs(excess - louder) < agrees * np.hypot(excess_std, louder_std))
        & (np.abs(np.diff(noise, axis=1)[:, 0]) < agrees * 2.0 * known)
    )
    return tuple((int(i), float(excess[i]), float(excess_std[i])) for i in np.flatnonzero(odd))


def _departures(values: Array, usual: Array) -> tuple[Array, Array, Array]:
    """Departure of every value from the mean of the others, its standard deviation and its degrees of freedom.

    The scatter is estimated from the others, with `policy.SCATTER_FREEDOM` degrees of freedom of the usual one
    where they bear it out, else from the others alone. All results have shape (runs,).

    Args:
        usual: usual scatter of each value, shape (runs,).
    """
    others = values.size - 1
    rest = np.array([np.delete(values, place) for place in range(values.size)])
    squares = others * np.var(rest, axis=1)
    borne_out = squares / usual**2 < chdtri(others - 1, policy.SLIP_AGREES)
    extra = np.where(borne_out, policy.SCATTER_FREEDOM, 0)
    freedom = others - 1 + extra
    stds = np.sqrt((squares + extra * usual**2) / freedom * (1.0 + 1.0 / others))
    return values - rest.mean(axis=1), stds, freedom


def _variances(swings: list[Swing]) -> tuple[Array, Array]:
    """Variance of the noise in both halves, shape (runs, 2), rad², and its degrees of freedom in a whole run."""
    variances, degrees = np.empty((len(swings), 2)), np.zeros(len(swings))
    for place, record in enumerate(swing.run.record for swing in swings):
        middle = record.time_s.size // 2
        for half, part in enumerate((slice(None, middle), slice(middle, None))):
            std, free = measured_noise(Record(record.time_s[part], record.yaw_rad[part]))
            variances[place, half] = std**2
            degrees[place] += free
    return variances, degrees
