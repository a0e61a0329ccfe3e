"""Where the free motion of a record begins, after a hand, a latch or a sensor at rest.

Free motion crosses its centre every half cycle, whatever its initial phase. In a longer interval between two
crossings (or between the start of the record and the first one) the body was held, moved by hand, or at rest. The
release is then the turning point of the motion that follows, extrapolated backwards. A hold in mid-record that is
shorter than about three quarters of a cycle leaves no such interval and is not detected. At the start of a record a
hand that pulls the body aside is also known by its slowness: a free swing takes no longer out than back.
"""

from __future__ import annotations

import numpy as np

from identification.decay.decay_fit import Reading, RunFit, fit_run
from identification.decay.first_guess import starting_decay, starting_frequency
from identification.decay.residual_noise import white_noise
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced

_NEAR_LARGEST = 0.9  # of the largest swing: the last swing of this size comes after the release
_LEAST_SAMPLES = 16
_SMOOTHED = 0.125  # of a cycle, width of the moving average: it reduces noise and hum, and hardly the swing
_BAND = 0.1  # of the largest swing: a crossing counts if the motion goes this far beyond the centre
_NOISE_MARGIN = 5.0  # standard deviations of the smoothed noise, if that is more: no crossing by chance
_WIDEST_BAND = 0.3
# A half cycle may be longer than the next ones because of its amplitude alone: a pendulum released at 160 degrees
# takes twice the time of its small swings.
_LONGER = 2.0
_SLOWER = 1.25  # a pull takes this many times as long as the swing back, and a free swing out no longer
_GROWTH = 0.02  # e-folds of growth over the fitted half cycles: a motion that builds up has no release
_CARRIED_BACK = (
    0.75  # of a half cycle: the release lies a quarter cycle back, the previous turning point three quarters
)
_FITTED_HALVES = 4.0  # half cycles after the release that are fitted and extrapolated backwards
_REGULAR = 2  # half cycles of about the usual length before a release; more are an earlier free motion


def find_release(record: Record, sensor: SensorProperties) -> int:
    """The sample at which the body is released.

    Returns:
        Index of the first sample of the free motion; 0 if the record starts in it, or if no oscillation is found.
    """
    if not record.uniform:
        even = evenly_spaced(record)
        return int(np.searchsorted(record.time_s, even.time_s[find_release(even, sensor)]))
    free = _surely_free(record)
    if record.yaw_rad.size - free < _LEAST_SAMPLES:
        return 0
    later = Record(record.time_s[free:], record.yaw_rad[free:])
    frequency = starting_frequency(later)
    if frequency is None:
        return 0
    crossings, largest, out = _crossings(record, sensor, float(np.median(later.yaw_rad)), frequency)
    held = _last_long_stretch(crossings, largest)
    if (
        held is None
        and largest == 1
        and crossings.size > 2
        and out[0] > _SLOWER * (crossings[1] - out[1]) + 0.5
    ):
        held = 0
    return 0 if held is None else _standstill(record, crossings, held)


def _surely_free(record: Record) -> int:
    yaw = record.yaw_rad
    away = np.abs(yaw - np.median(yaw[yaw.size // 2 :]))
    # Under very light damping a large swing may come last: half the record is enough to know the motion.
    return min(int(np.flatnonzero(away >= _NEAR_LARGEST * away.max())[-1]), yaw.size // 2)


def _crossings(
    record: Record, sensor: SensorProperties, centre: float, frequency: float
) -> tuple[Array, int, tuple[float, float]]:
    """Where the smoothed reading crosses its centre, in samples; the start of the record counts as the first.

    The second value is the place of the first crossing after the largest excursion; the third are the samples that
    the smoothed reading takes to get there, and its place in samples.
    """
    yaw = record.yaw_rad
    width = max(1, min(round(_SMOOTHED * record.sample_rate / frequency), yaw.size // 4))
    total = np.concatenate([[0.0], np.cumsum(yaw - centre)])
    smooth = (total[width:] - total[:-width]) / width
    away = np.abs(smooth)
    noise = white_noise(yaw, sensor) / np.sqrt(width)
    band = max(_BAND, min(_NOISE_MARGIN * noise / float(away.max()), _WIDEST_BAND)) * float(away.max())
    outside = np.flatnonzero(away > band)
    change = np.flatnonzero(np.diff(np.sign(smooth[outside])) != 0.0)
    middles = 0.5 * (outside[change] + outside[change + 1]) + 0.5 * width
    crossings = np.concatenate([[0.0], middles])
    steps = float(np.argmax(away))
    turn = steps + 0.5 * width
    return crossings, int(np.searchsorted(crossings, turn)), (steps, turn)


def _last_long_stretch(crossings: Array, largest: int) -> int | None:
    """The last interval before the largest excursion that is too long for free motion; None if there is none."""
    lengths = np.diff(crossings)
    for place in range(min(largest, lengths.size - 1) - 1, -1, -1):
        usual = float(lengths[place + 1 : place + 3].max())
        if lengths[place] > _LONGER * usual:
            before = lengths[:place]
            regular = int(np.sum((before > usual / _LONGER) & (before < usual * _LONGER)))
            return place if regular <= _REGULAR else None
    return None


def _standstill(record: Record, crossings: Array, held: int) -> int:
    """The turning point of the motion after a hold, extrapolated backwards, in samples."""
    usual = float(np.diff(crossings)[held + 1 : held + 3].max())
    end = crossings[held + 1]
    # The interval ends at a crossing of the free motion, or at a jump to its start: fit after the next crossing.
    first = int(crossings[min(held + 2, crossings.size - 1)])
    last = min(record.yaw_rad.size, first + round(_FITTED_HALVES * usual))
    if last - first < _LEAST_SAMPLES:
        return int(end)
    part = Record(record.time_s[first:last], record.yaw_rad[first:last])
    start = starting_decay(part)
    fit = None if start is None else fit_run(Reading.from_record(part), start)
    if fit is None or not fit.runs or fit.runs[0].decay.omega_d == 0.0:
        return int(end)
    if fit.runs[0].decay.rate * part.duration < -_GROWTH:
        return 0
    back = _turning_points(fit.runs[0], record.sample_rate)
    earliest = end - _CARRIED_BACK * usual
    after = back[back + first > earliest - 0.5]
    return int(min(max(round(float(after[0]) + first), 0), first)) if after.size else int(end)


def _turning_points(run: RunFit, sample_rate: float) -> Array:
    """Turning points of a fitted decay from two cycles before its first sample to one after, in samples."""
    decay = run.decay
    # β = e^{-at}(C cos ωt + S sin ωt) has its turning points where (Sω - aC) cos ωt = (Cω + aS) sin ωt.
    cosine, sine = run.angle, (run.rate + decay.rate * run.angle) / decay.omega_d
    phase = np.arctan2(sine * decay.omega_d - decay.rate * cosine, cosine * decay.omega_d + decay.rate * sine)
    return np.asarray((phase + np.pi * np.arange(-4, 3)) / decay.omega_d * sample_rate)
