"""The start, the end and the zero of the free motion in a record.

It begins after a hand, a latch or a sensor at rest. Free motion crosses its centre every half cycle: in a
longer interval between two crossings the body was held, moved by hand, or at rest. A hold in mid-record shorter
than about three quarters of a cycle leaves no such interval and is not detected. A hand that pulls the body
aside at the start of a record is also recognised by its slowness: a free swing takes no longer out than back.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from identification.policy import CLEAR_SWING, EQUAL_SWINGS, LEAST_SAMPLES, MISFIT_DEVIATIONS, MISFIT_RATE
from identification.show.numbers import reading_shown
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.frequency import follow_peaks, starting_decay, starting_frequency
from identification.signal.noise import reading_noise, white_noise
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties, speed_groups
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced

_NEAR_LARGEST = 0.9  # share of the largest swing: the last swing of this size comes after the release
_LEAST_SAMPLES = 16
# width of the moving average, as a share of a cycle: it reduces noise and hum, and hardly the swing
_SMOOTHED = 0.125
_BAND = 0.1  # share of the largest swing: a crossing counts if the motion goes this far beyond the centre
_NOISE_MARGIN = 5.0  # standard deviations of the smoothed noise, if more: no crossing is then due to chance
_WIDEST_BAND = 0.3
# A half cycle may be longer than the next ones because of its amplitude alone: a pendulum released at 160 degrees
# takes twice the time of its small swings.
_LONGER = 2.0
_SLOWER = 1.25  # a pull takes this many times as long as the swing back; a free swing out takes no longer
_GROWTH = 0.02  # e-folds of growth over the fitted half cycles: a growing motion has no release
# Of a half cycle: the release is a quarter cycle back, the previous turning point three quarters.
_CARRIED_BACK = 0.75
_FITTED_HALVES = 4.0  # number of half cycles after the release that are fitted and extrapolated backwards
# number of half cycles of about the usual length before a release; more are an earlier free motion
_REGULAR = 2


def find_release(record: Record, sensor: SensorProperties) -> int:
    """The sample at which the body is released; 0 if the record starts in free motion, or nothing oscillates."""
    if not record.uniform:
        even = evenly_spaced(record)
        return int(np.searchsorted(record.time_s, even.time_s[find_release(even, sensor)]))
    yaw = record.yaw_rad
    away = np.abs(yaw - np.median(yaw[yaw.size // 2 :]))
    # Under very light damping a large swing may come last: half the record is enough to know the motion.
    free = min(int(np.flatnonzero(away >= _NEAR_LARGEST * away.max())[-1]), yaw.size // 2)
    if record.yaw_rad.size - free < _LEAST_SAMPLES:
        return 0
    later = Record(record.time_s[free:], record.yaw_rad[free:])
    frequency = starting_frequency(later)
    if frequency is None:
        return 0
    # Crossings of the smoothed reading through its centre, in samples; the start of the record counts as the first.
    width = max(1, min(round(_SMOOTHED * record.sample_rate / frequency), yaw.size // 4))
    total = np.concatenate([[0.0], np.cumsum(yaw - float(np.median(later.yaw_rad)))])
    smooth = (total[width:] - total[:-width]) / width
    away = np.abs(smooth)
    noise = white_noise(yaw, sensor) / np.sqrt(width)
    band = max(_BAND, min(_NOISE_MARGIN * noise / float(away.max()), _WIDEST_BAND)) * float(away.max())
    outside = np.flatnonzero(away > band)
    change = np.flatnonzero(np.diff(np.sign(smooth[outside])) != 0.0)
    middles = 0.5 * (outside[change] + outside[change + 1]) + 0.5 * width
    crossings = np.concatenate([[0.0], middles])
    steps = float(np.argmax(away))  # to the largest excursion
    turn = steps + 0.5 * width
    largest = int(np.searchsorted(crossings, turn))  # the first crossing after it
    # The last interval before the largest excursion that is too long for free motion.
    lengths = np.diff(crossings)
    for place in range(min(largest, lengths.size - 1) - 1, -1, -1):
        usual = float(lengths[place + 1 : place + 3].max())
        if lengths[place] > _LONGER * usual:
            before = lengths[:place]
            regular = int(np.sum((before > usual / _LONGER) & (before < usual * _LONGER)))
            if regular <= _REGULAR:
                return _standstill(record, crossings, place)
            break
    pulled = largest == 1 and crossings.size > 2 and steps > _SLOWER * (crossings[1] - turn) + 0.5
    return _standstill(record, crossings, 0) if pulled else 0


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
    # β = e^{-at}(C cos ωt + S sin ωt) has its turning points where (Sω - aC) cos ωt = (Cω + aS) sin ωt: the ones
    # from two cycles before the first sample of the fit to one after, in samples.
    run, decay = fit.runs[0], fit.runs[0].decay
    cosine, sine = run.angle, (run.rate + decay.rate * run.angle) / decay.omega_d
    phase = np.arctan2(sine * decay.omega_d - decay.rate * cosine, cosine * decay.omega_d + decay.rate * sine)
    back = (phase + np.pi * np.arange(-4, 3)) / decay.omega_d * record.sample_rate
    earliest = end - _CARRIED_BACK * usual
    after = back[back + first > earliest - 0.5]
    return int(min(max(round(float(after[0]) + first), 0), first)) if after.size else int(end)


_LEAST_CENTRES = 3


@dataclass(frozen=True)
class Centre:
    """The centre of a run's oscillation.

    Args:
        zero: rad (rad/s or rad/s² where the reading is a rate or an acceleration).
        std: standard deviation of the zero, in the same unit; it includes the change along the run.
        swing: half the largest distance of two neighbouring peaks, in the same unit.
        square: mean square of the clear swings, in the square of that unit.
        omega: angular frequency of the oscillation, rad/s.
        by_amplitude: largest shift by the amplitude, in the reading's unit; it would move the centre along the
            run as well.
    """

    run: Run
    zero: float
    std: float
    swing: float
    square: float
    omega: float
    by_amplitude: float


_EXPLAINED_TO = (
    0.01  # relative tolerance between a shift and its cause: a wind varies by some tenths of a per cent
)
# minimum number of runs beyond the number of shifts, for a comparison of the remaining zeros: with shifts by the
# amplitude, and with those bounded by each run itself
_LEAST_BEYOND, _LEAST_BESIDE = 3, 2
# standard deviations of the centre's change along a run for the largest shift by the amplitude, and a factor on
# this change, which follows the square of the amplitude or less
_LARGEST, _CURVED = 3.0, 2.0


def with_zeros(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Give every run its own zero where the records show different zeros, unless the campaign states one.

    Runs of equal spring, wind and swing are compared: with an asymmetric spring the centre depends on the
    amplitude, and in a stream at an angle on the wind. Runs of unequal swing are compared as far as each run bounds
    its shift by the amplitude, since this shift would move the centre along the run, too. Last, all runs are
    compared, without the part of their zeros that such shifts explain.
    """
    if campaign.sensor.zero not in (None, "auto"):
        return campaign, ()
    found = [centre_of(run, campaign.sensor.resolution or 0.0) for run in campaign.runs]
    centres = [centre for centre in found if centre is not None]
    middle = float(np.median([centre.zero for centre in centres])) if centres else 0.0
    centres = [replace(c, std=float(np.hypot(c.std, _EXPLAINED_TO * (c.zero - middle)))) for c in centres]
    bounded = [replace(c, std=float(np.hypot(c.std, c.by_amplitude))) for c in centres]
    words = " under equal conditions"
    for groups in (_of_equal_conditions(centres, EQUAL_SWINGS), _of_equal_conditions(bounded, 0.0)):
        scatter = sum(_scatter(group, np.ones((len(group), 1))) for group in groups)
        freedom = sum(len(group) - 1 for group in groups)
        if freedom and scatter > float(chdtri(freedom, MISFIT_RATE)):
            break
    else:
        shifts, least = _shifts(centres), _LEAST_BEYOND
        if len(centres) - shifts.shape[1] < least:
            centres, shifts, least = bounded, _shifts(centres, by_amplitude=False), _LEAST_BESIDE
        freedom = len(centres) - shifts.shape[1]
        if freedom < least or _scatter(centres, shifts) <= float(chdtri(freedom, MISFIT_RATE)):
            return campaign, ()
        groups, words = [centres], ", more than wind, spring and amplitude shift them"
    largest = max(max(c.zero for c in group) - min(c.zero for c in group) for group in groups)
    compared = {centre.run.id for group in groups for centre in group}
    remark = Remark(
        Outcome.NOTED,
        tuple(run.id for run in campaign.runs if run.id in compared),
        f"they oscillate about zeros that differ by up to {reading_shown(largest, 2, campaign.sensor.unit)}"
        f"{words}; a separate zero is fitted to every run of the campaign",
        "state zero = 'common' under [sensor] if the zero cannot have moved between them",
    )
    return replace(campaign, sensor=replace(campaign.sensor, zero="per_run")), (remark,)


def _of_equal_conditions(centres: list[Centre], swings: float) -> list[list[Centre]]:
    """Groups of two or more centres of equal spring and wind.

    Args:
        swings: minimum ratio of the swings in a group.
    """
    by_condition: dict[tuple[float | None, ...], list[Centre]] = defaultdict(list)
    setting = speed_groups(centre.run.wind_speed for centre in centres)
    for centre in centres:
        run = centre.run
        by_condition[run.spring_stiffness, setting[run.wind_speed], run.air_density].append(centre)
    groups = []
    for one in by_condition.values():
        left = sorted(one, key=lambda centre: -centre.swing)
        while left:
            alike = [centre for centre in left if centre.swing >= swings * left[0].swing]
            left = left[len(alike) :]
            if len(alike) > 1:
                groups.append(alike)
    return groups


def _shifts(centres: list[Centre], *, by_amplitude: bool = True) -> Array:
    """Possible shifts of a run's centre from a common zero, in columns, shape (runs, shifts).

    They are a constant moment, a moment proportional to the dynamic pressure, and the mean moment of an asymmetric
    spring, each over the stiffness, which is proportional to ω²; and an error of the reading proportional to the
    square of the angle. The last two are left out without ``by_amplitude``.
    """
    omega, square = (np.array([getattr(c, name) for c in centres]) for name in ("omega", "square"))
    pressure = np.array([(c.run.air_density or 1.0) * c.run.wind_speed**2 for c in centres])
    columns = [np.ones(len(centres)), omega**-2, pressure * omega**-2]
    columns += [square * omega**-2, square] if by_amplitude else []
    sized = np.column_stack([column / (np.max(np.abs(column), initial=0.0) or 1.0) for column in columns])
    vectors, values, _ = np.linalg.svd(sized, full_matrices=False)
    return np.asarray(vectors[:, values > 1e-6 * values.max(initial=0.0)], np.float64)


def _scatter(centres: list[Centre], shifts: Array) -> float:
    """Weighted sum of squares of the zeros about the best-fitting shifts."""
    weight = 1.0 / np.maximum([centre.std for centre in centres], 1e-300)
    zero = weight * np.array([centre.zero for centre in centres])
    columns = weight[:, None] * shifts
    left = zero - columns @ np.linalg.lstsq(columns, zero, rcond=None)[0]
    return float(left @ left)


def centre_of(run: Run, resolution: float) -> Centre | None:
    """The centre of a run's oscillation, from its peaks; None if there are too few clear ones.

    Peaks on both sides are equally far from the centre for any symmetric spring and any damping. This includes dry
    friction, although the body may come to rest elsewhere.

    Args:
        resolution: step of the reading, in its unit; 0 where it is not stated.
    """
    frequency = starting_frequency(run.record)
    if frequency is None:
        return None
    times, heights = follow_peaks(run.record, frequency, sparse=True)
    swings = 0.5 * np.abs(np.diff(heights))
    if swings.size < _LEAST_CENTRES + 1:
        return None
    middles = 0.25 * (heights[:-2] + 2.0 * heights[1:-1] + heights[2:])
    seen = swings[1:] > CLEAR_SWING * swings.max()
    clear = middles[seen]
    if clear.size < _LEAST_CENTRES:
        return None
    half = clear.size // 2
    along = 0.5 * abs(float(clear[:half].mean() - clear[half:].mean()))
    # Neighbouring middles share two of their three peaks: half as many are independent.
    chance = float(clear.std(ddof=1)) * np.sqrt(2.0 / clear.size)
    std = float(np.linalg.norm([along, chance, resolution / np.sqrt(12.0)]))
    omega = np.pi * (times.size - 1) / float(times[-1] - times[0])
    squares = swings[1:][seen] ** 2
    square = float(np.mean(squares))
    fall = 0.5 * float(squares[:half].mean() - squares[half:].mean())
    by_amplitude = float(np.hypot(_CURVED * along, _LARGEST * chance)) * square / max(fall, 1e-9 * square)
    return Centre(run, float(clear.mean()), std, float(swings.max()), square, omega, by_amplitude)


_SQUARABLE = 1e100  # of the reading's unit: squares of larger readings overflow
# share of the largest excursion: the body rests while the reading stays this close to its last value
_RESTING = 0.01
_KEPT = 3.0  # cycles of rest to keep: they show that the motion ended, and where
_SETTLED = 0.25  # share of the distance from the centre: a resting reading that changes more is drifting


def without_rest(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Shorten records that end with a long rest beside the centre, with a remark for each.

    Where dry friction holds the body off centre for longer than the motion lasts, a model without friction would
    mistake the place of rest for the sensor's zero. Only such rests, off the centre beyond chance, are shortened.
    """
    shorter: dict[str, Run] = {}
    remarks = []
    for run in campaign.runs:
        record, resolution = run.record, campaign.sensor.resolution or 0.0
        time, yaw = record.time_s, record.yaw_rad
        if not float(np.abs(yaw).max()) < _SQUARABLE:
            continue  # refused later, for its own reason
        last = float(np.median(yaw[-max(yaw.size // 20, 1) :]))
        near = max(
            _RESTING * float(np.abs(yaw - last).max()),
            resolution,
            5.0 * reading_noise(record, campaign.sensor),
        )
        moving = np.flatnonzero(np.abs(yaw - last) > near)
        if moving.size < LEAST_SAMPLES or 2 * int(moving[-1]) >= yaw.size:
            continue
        end = int(moving[-1]) + 1
        centre = centre_of(replace(run, record=Record(time[:end], yaw[:end])), resolution)
        frequency = starting_frequency(Record(time[:end], yaw[:end]))
        if centre is None or frequency is None:
            continue
        early, late = (float(half.mean()) for half in np.array_split(yaw[end:], 2))
        off = abs(0.5 * (early + late) - centre.zero)
        if off < MISFIT_DEVIATIONS * centre.std or abs(late - early) > _SETTLED * off:
            continue
        kept = int(np.searchsorted(time, time[end] + _KEPT / frequency))
        if kept >= yaw.size:
            continue
        what = (
            f"at rest from {time[end]:.3f} s, {off:.2g} {campaign.sensor.unit} from the centre of the motion; "
            f"the record is used up to {time[kept]:.3f} s"
        )
        remarks.append(Remark(Outcome.CUT, (run.id,), what, "cut the record by hand if that is wrong"))
        shorter[run.id] = replace(run, record=Record(time[:kept], yaw[:kept]))
    runs = tuple(shorter.get(run.id, run) for run in campaign.runs)
    return (replace(campaign, runs=runs) if remarks else campaign), tuple(remarks)
