"""The sensor of some runs differs from the others' in gain, noise, bandwidth, sign, or unit of the angle."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence
from identification.show.numbers import significant, with_std
from identification.signal.noise import measured_noise
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Run, speed_groups
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced

# minimum number of runs that state their release: three others do not show how widely they scatter
_FEWEST_RELEASED = 5
_LEAST_SAMPLES = 2 * policy.LEAST_SAMPLES  # minimum number of samples of a record with two halves


@dataclass(frozen=True)
class OtherGain:
    """The gain of one run relative to the others'.

    Args:
        ratio: ratio of the gains.
        std: standard deviation of the ratio.
    """

    run: Run
    ratio: float
    std: float


def odd_gain(evidence: SlipEvidence) -> Remark | None:
    """Noise and swing of one run are the others' times one factor. Named: ωn and ζ do not change.

    In a linear decay another gain, such as another range of the amplifier, looks like another release. But it
    scales the noise of the sensor by the same factor as the swing, and another release does not.
    """
    found = other_gain(evidence)
    if found is None:
        return None
    what = (
        "its noise, and its swing over the stated release_angle, are both "
        f"{with_std(found.ratio, found.std)} times those of the other runs: the sensor had another gain"
    )
    remedy = (
        "check the range of its amplifier and repeat the run, or leave the run out with "
        f"--leave-out {found.run.id}"
    )
    return Remark(Outcome.NOTED, (found.run.id,), what, remedy)


def other_gain(evidence: SlipEvidence) -> OtherGain | None:
    """The one run with another gain; None if there is none, or if several runs may have one."""
    swings = [
        s for s in evidence.swings if s.run.release_angle and s.run.record.time_s.size >= _LEAST_SAMPLES
    ]
    if len(swings) < _FEWEST_RELEASED:
        return None
    order, step = evidence.campaign.sensor.derivative, evidence.campaign.sensor.resolution or 0.0
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
    """The runs with noise and swing that both differ from the other runs', by one factor.

    Both must differ at `policy.DIFFERENCE_RATE` per campaign. A difference in one of them, such as a release
    from a wrong angle, therefore does not name a run more often; a campaign with neither is named at about the
    square of this rate. The factors must agree, and the noise must be equal in both halves of the run: in a
    clipped run it is not, and a fast motion that looks like noise decays.

    Args:
        swing: logarithms of the ratios to the stated releases, shape (runs,).
        noise: logarithms of the noise in both halves, shape (runs, 2).
        noise_std: standard deviation of the noise's logarithm by the number of samples, of a whole run, shape
            (runs,).
        tests: number of such tests in a campaign.

    Returns:
        For each such run its index, the logarithm of its factor by the swing, and the standard deviation:
            rounding biases the factor by the noise.
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
    """Deviation of every value from the mean of the others, its standard deviation and its degrees of freedom.

    The scatter is estimated from the others, combined with the usual scatter as `policy.SCATTER_FREEDOM`
    degrees of freedom if the two agree, else from the others alone. All results have shape (runs,).

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


_FEWEST_COMPARED = 4  # minimum number of runs
_ABOVE = 8.0  # multiple of the motion's frequency: its harmonics have ended
_BELOW = 0.45  # share of the lowest sample rate
_LEAST_BINS = 16  # minimum number of ordinates of a record in a band: their median scatters by a quarter
_SPREAD = 1.7  # maximum ratio of the other runs' noise: they have one sensor
_SPREADS = 4.0  # logarithms of that ratio


def odd_noise(evidence: SlipEvidence) -> Remark | None:
    """One run has far less or far more noise than all others, in some band of frequencies. Named.

    It has another range, sensor, cable or filter. A run with far less noise is refused: a filter smooths its
    start, which looks like other oscillations.
    """
    if len(evidence.swings) < _FEWEST_COMPARED or other_gain(evidence) is not None:
        return None
    bands, power = _powers(evidence.swings)
    if not bands.size:
        return None
    logs = 0.5 * np.log(power)
    pressure = np.array([(s.run.air_density or 0.0) * s.run.wind_speed**2 for s in evidence.swings])
    for place, swing in enumerate(evidence.swings):
        others, winds = np.delete(logs, place, axis=0), np.delete(pressure, place)
        spread = np.ptp(others, axis=0)
        if np.any(spread > np.log(_SPREAD)):
            continue
        ratio = logs[place] - others.mean(axis=0)
        odd = np.abs(ratio) > np.maximum(np.log(policy.ODD_NOISE), _SPREADS * spread)
        less, more = odd & (ratio < 0.0), odd & (ratio > 0.0)
        if less.any() and np.any(winds <= pressure[place]):
            return _less(swing, float(bands[less][0]), float(ratio.min()))
        if more.any() and np.any(winds >= pressure[place]):
            what = f"its noise is {np.exp(ratio.max()):.2g} times as large as that of every other run"
            remedy = "check the sensor's range, its cable and the unit, or leave the run out"
            return Remark(Outcome.NOTED, (swing.run.id,), what, remedy)
    return None


def _less(swing: Swing, first: float, ratio: float) -> Remark:
    """The remark on a run with less noise; a refusal if the difference is large.

    Args:
        first: lower end of the lowest such band, Hz.
        ratio: logarithm of the smallest ratio of the noise to another run's.
    """
    what = (
        f"above {first:.2g} Hz its noise is 1/{significant(np.exp(-ratio), 2)} of that of every other run: the "
        "logger filtered the run, or its file was smoothed"
    )
    remedy = "record or export it with the bandwidth of the others, or leave the run out"
    outcome = Outcome.REFUSED if ratio < -np.log(policy.FILTERED_NOISE) else Outcome.NOTED
    return Remark(outcome, (swing.run.id,), what, remedy)


def _powers(swings: tuple[Swing, ...]) -> tuple[Array, Array]:
    """Lower ends of octaves above the motion, shape (bands,), Hz, and their powers, shape (runs, bands)."""
    highest = max(float(np.sqrt(max(s.stiffness, 0.0))) for s in swings) / (2.0 * np.pi)
    records = [evenly_spaced(swing.run.record) for swing in swings]
    top = _BELOW * min(record.sample_rate for record in records)
    count = int(np.log2(top / (_ABOVE * highest))) if highest > 0.0 else 0
    if count < 1:
        return np.zeros(0), np.zeros((len(swings), 0))
    edges = np.array([top * 2.0**octave for octave in range(-count, 1)])
    rows = []
    for record in records:
        window = np.hanning(record.yaw_rad.size)
        spectrum = np.abs(np.fft.rfft(window * (record.yaw_rad - record.yaw_rad.mean()))) ** 2
        spectrum /= float(np.sum(window**2)) * record.sample_rate
        frequency = np.fft.rfftfreq(record.yaw_rad.size, 1.0 / record.sample_rate)
        inside = [spectrum[(frequency >= low) & (frequency < high)] for low, high in pairwise(edges.tolist())]
        if any(one.size < _LEAST_BINS for one in inside):
            return np.zeros(0), np.zeros((len(swings), 0))
        rows.append([float(np.median(one)) for one in inside])
    return edges[:-1], np.maximum(np.array(rows), 1e-300)


_FEWEST_SIDES = 3  # minimum number of runs: of two different zeros, either may be right
# maximum scatter of the zeros with right signs, over the zero's size, which keeps the two sides apart
_NEAR = 0.25


def mirrored_run(evidence: SlipEvidence) -> Remark | None:
    """Some runs swing about the zero of the others with its sign inverted. Refused: it looks like an effect.

    A mirrored decay is also a decay. Only asymmetries reveal it: the sensor's zero, which changes its sign in a
    mirrored run, and the release angle, where it is stated.
    """
    swings = evidence.swings
    if len(swings) < _FEWEST_SIDES or evidence.stated.sensor.zero == "per_run":
        return None
    zeros = np.array([swing.zero for swing in swings])
    std = np.array([max(swing.zero_std, 1e-300) for swing in swings])
    size = float(np.median(np.abs(zeros)))
    # the runs that differ; if they are half of all, the runs that begin on the less usual side
    minus = zeros < 0.0
    odd = minus if 2 * minus.sum() < zeros.size else ~minus
    if not odd.any() or odd.all():
        return None
    upright = np.where(odd, -zeros, zeros)
    freedom, allowed = zeros.size - 1, np.hypot(std, policy.ZERO_STEADINESS * size)
    agree = _scatter(upright, allowed) <= float(chdtri(freedom, policy.MISFIT_RATE))
    differ = _scatter(zeros, allowed) > float(chdtri(freedom, policy.REFUSAL_RATE))
    if not (agree and differ) or float(np.ptp(np.abs(zeros))) > _NEAR * size:
        return None
    halves = 2 * int(odd.sum()) == zeros.size
    if _of_wind(swings, odd):
        return None
    names = tuple(s.run.id for s, one in zip(swings, odd, strict=True) if one)
    rest = tuple(s.run.id for s, one in zip(swings, odd, strict=True) if not one)
    ids = names + rest if halves else names
    who = "half of the runs (" + ", ".join(names) + ")" if halves else "the reading"
    what = (
        f"{who} {'swing' if halves else 'swings'} about {_signed(swings, odd)} {evidence.campaign.sensor.unit} "
        f"and the others about {_signed(swings, ~odd)}: the sign of the sensor is inverted between them"
    )
    return Remark(Outcome.REFUSED, ids, what, "invert the sign of these readings, or state zero = 'per_run'")


def _scatter(values: Array, std: Array) -> float:
    weights = std**-2.0
    mean = float(weights @ values / weights.sum())
    return float(weights @ (values - mean) ** 2)


def _signed(swings: tuple[Swing, ...], which: NDArray[np.bool_]) -> str:
    return f"{median(s.zero for s, one in zip(swings, which, strict=True) if one):+.3g}"


def _of_wind(swings: tuple[Swing, ...], odd: NDArray[np.bool_]) -> bool:
    """Whether the wind may have moved the centre: only one group has wind, and its runs share one condition.

    A moment of the air moves the centre by a different angle with another spring or speed.
    """
    windy = np.array([swing.run.wind_on for swing in swings])
    setting = speed_groups(s.run.wind_speed for s in swings)
    conditions = {(s.run.spring_stiffness, setting[s.run.wind_speed]) for s in swings if s.run.wind_on}
    return len(conditions) == 1 and bool(np.all(odd == windy) or np.all(odd == ~windy))


def release_on_the_other_side(evidence: SlipEvidence) -> Remark | None:
    """A stated release angle of the opposite sign to the record. Asked about: no answer depends on it."""
    if evidence.campaign.sensor.derivative:
        return None
    ids = []
    for swing in evidence.swings:
        stated, first = swing.run.release_angle or 0.0, float(swing.motion[0])
        turning = abs(first) > policy.CLEAR_RELEASE * swing.amplitude
        decays = swing.rate > policy.MISFIT_DEVIATIONS * swing.rate_std
        low, high = policy.RELEASE_AS_STATED
        if turning and decays and -high < first / (stated or np.inf) < -low:
            ids.append(swing.run.id)
    if not ids:
        return None
    what = "the record begins on the other side than the stated release_angle"
    remedy = "correct the sign of release_angle, or of the readings"
    return Remark(Outcome.NOTED, tuple(ids), what, remedy)


_SUSPICIOUS = 10.0  # maximum ratio to the amplitudes of other runs; beyond it the noise is compared


def angle_in_degrees(evidence: SlipEvidence) -> Remark | None:
    """Amplitude and noise of some runs are 57.3 times the others', or 1/57.3 of them. Refused.

    For displacements in millimetres the factor is 1000.

    The smaller group of runs is wrong; of two equal groups either may be wrong.
    """
    if len(evidence.swings) < 2 or evidence.campaign.sensor.plausible is False:
        return None
    amplitudes = np.array([swing.amplitude for swing in evidence.swings])
    large = amplitudes > _SUSPICIOUS * float(amplitudes.min())
    if not large.any():
        return None
    noise = np.array([measured_noise(swing.run.record)[0] for swing in evidence.swings])
    ratio = float(np.median(noise[large]) / np.median(noise[~large]))
    alike = [
        np.abs(noise[some] / np.median(noise[some]) - 1.0) < policy.NOISE_RATIO for some in (large, ~large)
    ]
    if abs(ratio / evidence.campaign.sensor.freedom.slip - 1.0) > policy.NOISE_RATIO or not all(
        np.all(one) for one in alike
    ):
        return None
    ids = [
        tuple(s.run.id for s, one in zip(evidence.swings, some, strict=True) if one)
        for some in (large, ~large)
    ]
    exceed = f"amplitude and noise exceed those of the other runs, by {ratio:.3g} times: degrees"
    below = (
        f"amplitude and noise are 1/{ratio:.3g} of those of the other runs: radians in a column of degrees"
    )
    if len(ids[0]) < len(ids[1]):
        remedy = "name the column yaw_deg, or convert it to radians"
        return Remark(Outcome.REFUSED, ids[0], exceed, remedy)
    if len(ids[0]) > len(ids[1]):
        return Remark(Outcome.REFUSED, ids[1], below, "name the column yaw_rad, or convert it to degrees")
    what = f"{exceed}; or, of runs {', '.join(ids[1])}, {below}"
    remedy = "name the columns yaw_deg or yaw_rad by their units"
    return Remark(Outcome.REFUSED, ids[0] + ids[1], what, remedy)
