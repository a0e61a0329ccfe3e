"""Faults of records, found before any measurement: unmeasured samples, wraps, steps, stuck readings, copies."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from identification import policy
from identification.policy import LEAST_SAMPLES
from identification.signal.decay_fit import Reading, fit_run, projected_cost
from identification.signal.frequency import starting_decay, starting_frequency
from identification.signal.noise import measured_noise
from identification.status import Outcome, Remark
from tunnel_sim.files.plausible import clock_jump, jump_words, standing_for_missing, without_jump
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.record import Array, Record

_WORSE = 4.0  # minimum factor by which the jump increases the sum of squares


def clock_jumps(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """The times jump once while the reading continues. Refused: the frequency would be wrong."""
    remedy = "correct the clock of the samples after it, or make two runs of the file"
    remarks = [
        Remark(Outcome.REFUSED, (run.id,), jump_words(run.record, at), remedy)
        for run in campaign.runs
        if run.drive is None and (at := clock_jump(run.record)) is not None and _jumps(run.record, at)
    ]
    return campaign, tuple(remarks)


def _jumps(record: Record, at: int) -> bool:
    """Whether the longer part's decay continues in the other part if the jump is ignored, and not by the times."""
    longer = slice(None, at + 1) if 2 * at > record.time_s.size else slice(at + 1, None)
    part = Record(record.time_s[longer], record.yaw_rad[longer])
    start = starting_decay(part)
    fit = None if start is None else fit_run(Reading.from_record(part), start)
    if fit is None or not fit.runs:
        return True
    decay, power = fit.runs[0].decay, float(np.sum((record.yaw_rad - record.yaw_rad.mean()) ** 2))
    stated, mended = (
        projected_cost(Reading.from_record(one), decay) for one in (record, without_jump(record, at))
    )
    return stated > max(policy.GROSS_MISFIT * power, _WORSE * mended)


def code_for_missing(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """A value far from all others, such as -9.99, stands for missing readings. These samples are left out."""
    runs, remarks = [], []
    for run in campaign.runs:
        record = run.record
        standing = None if run.drive is not None else standing_for_missing(record.yaw_rad)
        if standing is not None:
            value, count = float(record.yaw_rad[standing][0]), int(standing.sum())
            what = (
                f"{counted(count, 'reading')} of {value:.6g} {campaign.sensor.unit}, far from all others, as a "
                "value that stands for a missing one; left out"
            )
            remarks.append(Remark(Outcome.CUT, (run.id,), what, "check the logger and the sensor's cable"))
            run = replace(run, record=Record(record.time_s[~standing], record.yaw_rad[~standing]))
        runs.append(run)
    return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)


_TURN = 2.0 * np.pi
#: Step between samples, less whole turns, as a share of a turn. With ten samples per cycle a swing of a tenth
#: of a turn has no larger steps.
_SMOOTH = 0.1


def wrapped_angle(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """The reading jumps by whole turns, like a restarted encoder's; unwrapped it is smooth. It is unwrapped.

    A record is shifted to the turn of the other runs. Rates, accelerations and displacements do not wrap.
    """
    if campaign.sensor.derivative or not campaign.sensor.freedom.turns:
        return campaign, ()
    turns = {run.id: found for run in campaign.runs if (found := _turns(run.record)) is not None}
    if not turns:
        return campaign, ()
    whole = {
        run.id: run.record.yaw_rad - _TURN * turns[run.id] if run.id in turns else run.record.yaw_rad
        for run in campaign.runs
    }
    rest = [float(np.median(whole[run.id])) for run in campaign.runs if run.id not in turns]
    place = float(np.median(rest)) if rest else float(np.median(whole[next(iter(turns))]))
    runs = []
    for run in campaign.runs:
        yaw = whole[run.id]
        off = _TURN * round((float(np.median(yaw)) - place) / _TURN) if run.id in turns else 0.0
        runs.append(replace(run, record=Record(run.record.time_s, yaw - off)) if run.id in turns else run)
    jumps = sum(int(np.count_nonzero(np.diff(found))) for found in turns.values())
    what = f"the angle jumps by whole turns, {jumps} times, as an encoder's that wraps; it is unwrapped"
    remedy = "write the angle without wraps, or shift its zero"
    return replace(campaign, runs=tuple(runs)), (Remark(Outcome.NOTED, tuple(turns), what, remedy),)


def _turns(record: Record) -> Array | None:
    """The whole turns between each sample and the first; None where the record does not wrap."""
    steps = np.diff(record.yaw_rad)
    turns = np.round(steps / _TURN)
    if not turns.any() or not bool(np.all(np.abs(steps - _TURN * turns) < _SMOOTH * _TURN)):
        return None
    return np.concatenate(([0.0], np.cumsum(turns)))


_LOOKED_AT = 4  # number of records to test: the resolution is common to all
# share of a step: a reading farther from every multiple of the resolution is not on its lattice
_OFF_LATTICE = 0.1
_UNCHANGED = 1e-4  # share of a step: no change
_MOST = 0.2  # share of the changes off the lattice: a filter or a few outliers may move some


def resolution_too_coarse(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """The readings are far finer than their stated resolution. It is not used: as noise it would hide gaps."""
    step = campaign.sensor.resolution
    if not step:
        return campaign, ()
    records = [run.record for run in campaign.runs[:_LOOKED_AT]]
    if not all(_off_lattice(record.yaw_rad, step) for record in records):
        return campaign, ()
    swing = float(np.median([0.5 * np.ptp(record.yaw_rad) for record in records]))
    noise = float(np.median([measured_noise(record)[0] for record in records]))
    if swing > policy.LEAST_STEPS * step and noise > policy.FINER_THAN_STATED * step:
        return campaign, ()
    what = (
        f"resolution = {step:.3g} {campaign.sensor.unit} contradicts the readings, which swing by ±{swing:.3g} "
        f"{campaign.sensor.unit} in far finer steps; it is not used"
    )
    remark = Remark(
        Outcome.NOTED, tuple(run.id for run in campaign.runs), what, "correct resolution, or leave it out"
    )
    return replace(campaign, sensor=replace(campaign.sensor, resolution=None)), (remark,)


def _off_lattice(yaw: Array, step: float) -> bool:
    changes = np.abs(np.diff(yaw)) / step
    changes = changes[changes > _UNCHANGED]
    whole = np.round(changes)
    return (
        changes.size > 0 and float(np.mean((whole == 0.0) | (np.abs(changes - whole) > _OFF_LATTICE))) > _MOST
    )


_STUCK = 0.6  # minimum duration of a stuck stretch, as a share of a cycle
_MOVING = 0.1  # share of the record's range: the swings on both sides of a stuck stretch
# A constant reading stays this close to its last value, as a share of the record's largest excursion,
# or within this many standard deviations of its last fiftieth.
_STANDS, _NOISE = 0.01, 5.0
_LEAST_CYCLES = (
    # minimum duration of a constant reading: at a turning point a swing stays within a hundredth for a
    # twentieth of a cycle
    0.75
)
_LEAST_KEPT = 2.0  # cycles of motion before the tail; their last swings are compared
#: Dry friction reduces every swing by the same step and stops the body from a swing of at most one such step;
#: viscous damping reduces it by a share. A swing of more than three steps does not stop by itself.
_STEPS = 3.0
_CLEAR = 5.0  # multiple of the band of the constant reading that the last swing must exceed


def stuck_reading(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """The reading keeps one value to the last bit for most of a cycle, between swings. These samples are left out.

    A clipped or coarse reading keeps a value for less than half a cycle, at its turning points.
    """
    runs, remarks = [], []
    for run in campaign.runs:
        stuck = None if run.drive is not None else stuck_samples(run.record)
        if stuck is not None:
            time, yaw = run.record.time_s, run.record.yaw_rad
            where = np.flatnonzero(stuck)
            what = (
                f"between {time[where[0]]:.3f} and {time[where[-1]]:.3f} s the reading is constant while the "
                f"body moves; {counted(where.size, 'sample')} left out"
            )
            remarks.append(Remark(Outcome.CUT, (run.id,), what, "check the logger and the sensor's cable"))
            run = replace(run, record=Record(time[~stuck], yaw[~stuck]))
        runs.append(run)
    return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)


def stuck_samples(record: Record) -> NDArray[np.bool_] | None:
    """The samples that repeat one value between swings for `_STUCK` cycles or longer; None if there are none."""
    yaw, time = record.yaw_rad, record.time_s
    starts = np.concatenate(([0], np.flatnonzero(np.diff(yaw)) + 1))  # starts of stretches of one value
    lengths = np.diff(np.concatenate((starts, [yaw.size])))
    longest = int(lengths.max())
    if longest < LEAST_SAMPLES or (frequency := starting_frequency(record)) is None:
        return None
    cycle = max(int(record.sample_rate / frequency), 1)
    long = np.flatnonzero(lengths >= _STUCK * cycle)
    stuck = np.zeros(yaw.size, dtype=np.bool_)
    for place in long.tolist():
        begin, end = int(starts[place]), int(starts[place] + lengths[place])
        before, after = yaw[max(begin - cycle, 0) : begin], yaw[end : end + cycle]
        if before.size < cycle // 2 or after.size < cycle // 2:
            continue  # at an end of the record: before the release, or at rest
        swings = min(float(np.ptp(before)), float(np.ptp(after)))
        if swings > _MOVING * float(np.ptp(yaw)):
            stuck[begin:end] = True
    kept = float(np.sum(~stuck)) * (time[-1] - time[0]) / yaw.size
    return stuck if stuck.any() and kept * frequency > _LEAST_KEPT else None


def constant_tail(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """The reading is constant from one moment on, after swings that cannot have ended so soon. The tail is cut.

    The file is padded, the logger stopped, or a hand holds the body.
    """
    runs, remarks = [], []
    for run in campaign.runs:
        at = None if run.drive is not None else standing_from(run.record)
        if at is not None:
            time, yaw = run.record.time_s, run.record.yaw_rad
            what = (
                f"from {time[at]:.3f} s the reading is constant at {float(np.median(yaw[at:])):.4g} "
                f"{campaign.sensor.unit}, too soon for the motion to have decayed; this part is left out"
            )
            remedy = "check for a padded file, a stopped logger or a body held by hand"
            remarks.append(Remark(Outcome.CUT, (run.id,), what, remedy))
            run = replace(run, record=Record(time[:at], yaw[:at]))
        runs.append(run)
    return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)


def standing_from(record: Record) -> int | None:
    """The first sample of a constant tail after a large swing; None if there is none."""
    yaw, time = record.yaw_rad, record.time_s
    end = yaw[-max(yaw.size // 50, 1) :]
    away = np.abs(yaw - float(np.median(end)))
    band = max(_STANDS * float(away.max()), _NOISE * float(end.std()))
    moving: NDArray[np.intp] = np.flatnonzero(away > band)
    if moving.size < LEAST_SAMPLES or int(moving[-1]) >= yaw.size - LEAST_SAMPLES:
        return None
    at = int(moving[-1]) + 1
    # a body that comes to rest is still for long after small swings: only a sudden end needs a closer look
    frequency = starting_frequency(Record(time[:at], yaw[:at]))
    if frequency is None or (time[-1] - time[at]) * frequency < _LEAST_CYCLES:
        return None
    cycle = int(np.searchsorted(time, time[0] + 1.0 / frequency))
    if at < _LEAST_KEPT * cycle:
        return None
    parts = yaw[at - 2 * cycle : at - cycle], yaw[at - cycle : at]
    before, after = (0.5 * float(np.ptp(part)) for part in parts)
    falls = 0.5 * (before - after)  # fall of the swing in half a cycle
    return at if after > max(_STEPS * falls, _CLEAR * band) else None


Spectrum = NDArray[np.complex128]
_ORDER = 6  # order of the difference: it reduces a motion of ten samples per cycle to a twentieth of its size
# blocks of differences, scaled to one size: ringing after the release must not outweigh the noise
_BLOCK = 50
# minimum number of common differences: the best correlation of pure noise over all shifts is then 0.3
_LEAST = 500
#: Correlation from which two noises are one. With added noise of the same size it is 0.7; with rounding to two
#: standard deviations of the noise, 0.87.
_SAME = 0.7
# maximum correlation at any other shift, as a share of the best; hum common to two runs exceeds it
_ALONE = 0.5
_NEAR = 12  # shifts near the best that the differencing itself correlates
_THINNED = (2, 3, 4)  # one sample of this many is kept
_SAME_RATE = 1e-3
_MOST_PAIRS = 1500  # maximum number of comparisons, half a second
_ROUNDING = 1e-9  # share of the largest reading: smaller differences are rounding errors


def repeated_record(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Two runs are one measurement: under equal conditions it is counted once, under others refused.

    Two honest runs have nearly the same motion but never the same noise. The sixth difference of a record contains
    only its noise. Two records of one measurement share it, even after rounding, cutting or scaling, or with less
    noise added.
    """
    left, remarks = dict[str, Remark](), dict[tuple[str, str], Remark]()
    for earlier, run, said in [*_equal(campaign), *_alike(campaign)]:
        pair = earlier.id, run.id
        if earlier.id in left or run.id in left or pair in remarks:
            continue
        if _conditions(earlier) == _conditions(run):
            remedy = "remove the run, or correct its file name"
            what = f"{said} run {earlier.id}, so counted once"
            left[run.id] = Remark(Outcome.LEFT_OUT, (run.id,), what, remedy)
        else:
            what = f"{said.removesuffix(' as')} with different springs or wind speeds"
            remedy = "correct the file names, or remove one of the runs"
            remarks[pair] = Remark(Outcome.REFUSED, pair, what, remedy)
    runs = tuple(run for run in campaign.runs if run.id not in left)
    return (replace(campaign, runs=runs) if left else campaign), (*left.values(), *remarks.values())


def _conditions(run: Run) -> tuple[float | None, ...]:
    return run.spring_stiffness, run.wind_speed, run.air_density if run.wind_on else None


def _equal(campaign: Campaign) -> Iterator[tuple[Run, Run, str]]:
    """Runs with the samples of an earlier run."""
    first: dict[bytes, Run] = {}
    for run in campaign.runs:
        earlier = first.setdefault(run.record.yaw_rad.tobytes(), run)
        if earlier is not run:
            yield earlier, run, "the same samples as"


def _alike(campaign: Campaign) -> Iterator[tuple[Run, Run, str]]:
    """Free decays with the noise of an earlier run, among the runs nearest in size and length."""
    free = [run for run in campaign.decays if run.record.yaw_rad.size > _LEAST]
    order = sorted(free, key=lambda run: float(np.std(run.record.yaw_rad)))
    reach = max(1, _MOST_PAIRS // max(len(free), 1))
    size = next_fast_len(2 * max((run.record.yaw_rad.size for run in free), default=1), real=True)
    place = {run.id: number for number, run in enumerate(campaign.runs)}
    near: deque[tuple[Run, Spectrum, int]] = deque(maxlen=reach)
    for run in order:
        noise = _noise(run.record.yaw_rad)
        spectrum = rfft(noise, size)
        for other, its, samples in near:
            found = _correlation(spectrum, its, min(samples, noise.size), size)
            if abs(found) <= _SAME:
                found = _thinned_correlation(run, other, size)
            if abs(found) > _SAME:
                first, second = sorted((run, other), key=lambda one: place[one.id])
                yield first, second, f"the same record, by its noise (correlation {found:.2f}), as"
        near.append((run, spectrum, noise.size))


def _thinned_correlation(run: Run, other: Run, size: int) -> float:
    """The correlation of a record with every second to fourth sample of a faster one; 0 if neither is faster."""
    slow, fast = sorted((run, other), key=lambda one: one.record.sample_rate)
    ratio = fast.record.sample_rate / slow.record.sample_rate
    step = round(ratio)
    if step not in _THINNED or abs(ratio / step - 1.0) > _SAME_RATE:
        return 0.0
    noise = _noise(slow.record.yaw_rad)
    spectrum, best = rfft(noise, size), 0.0
    for phase in range(step):
        thin = _noise(fast.record.yaw_rad[phase::step])
        best = max(best, _correlation(spectrum, rfft(thin, size), min(thin.size, noise.size), size), key=abs)
    return best


def _noise(yaw: Array) -> Array:
    """The differences of a record, each block scaled to unit size; 0 where nothing changes."""
    difference = np.diff(yaw, _ORDER)
    blocks = difference[: difference.size // _BLOCK * _BLOCK].reshape(-1, _BLOCK)
    sizes = np.sqrt(np.mean(blocks**2, axis=1, keepdims=True))
    quiet = sizes <= _ROUNDING * float(np.abs(yaw).max())
    return np.asarray(np.where(quiet, 0.0, blocks / np.where(quiet, 1.0, sizes)).ravel())


def _correlation(one: Spectrum, other: Spectrum, samples: int, size: int) -> float:
    """The correlation of two series, given by their spectra, at the best shift; 0 if another shift is as good."""
    series = irfft(one * np.conj(other), size) / max(samples, 1)
    best = int(np.argmax(np.abs(series)))
    found = float(series[best])
    elsewhere = np.abs(np.roll(series, _NEAR - best)[2 * _NEAR + 1 :])
    return 0.0 if float(elsewhere.max(initial=0.0)) > _ALONE * abs(found) else found
