"""Two records of one measurement: equal, or with small changes.

Two honest runs have nearly the same motion but never the same noise. The sixth difference of a record contains
only its noise. Two records of one measurement share it, even after rounding, cutting or scaling, or with less noise
added.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from identification.examination.slips.base import RecordSlip
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

Spectrum = NDArray[np.complex128]
_ORDER = 6  # of the difference: the motion of ten samples per cycle is reduced to a twentieth of its size
_BLOCK = 50  # differences scaled to one size: ringing after the release must not outweigh the noise
_LEAST = 500  # differences in common: the best correlation of pure noise over all shifts is then 0.3
#: Correlation from which two noises are one. With added noise of the same size it is 0.7; with rounding to two
#: standard deviations of the noise, 0.87.
_SAME = 0.7
_ALONE = 0.5  # of the correlation: greatest at any other shift; hum common to two runs exceeds it
_NEAR = 12  # shifts about the best that the differencing itself correlates
_THINNED = (2, 3, 4)  # samples of which one is kept
_SAME_RATE = 1e-3
_MOST_PAIRS = 1500  # half a second of comparisons
_ROUNDING = 1e-9  # of the largest reading: smaller differences are rounding errors


@dataclass(frozen=True)
class RepeatedRecord(RecordSlip):
    """Two runs are one measurement: under equal conditions it is counted once, under others refused."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Leave out runs that repeat an earlier one."""
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
    """Free decays with the noise of an earlier run, among those nearest in size and length."""
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
    """The correlation of a record with every second to fourth sample of a faster one; 0 where neither is faster."""
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
    """The correlation of two spectra's series at the best shift; 0 where another shift is as good."""
    series = irfft(one * np.conj(other), size) / max(samples, 1)
    best = int(np.argmax(np.abs(series)))
    found = float(series[best])
    elsewhere = np.abs(np.roll(series, _NEAR - best)[2 * _NEAR + 1 :])
    return 0.0 if float(elsewhere.max(initial=0.0)) > _ALONE * abs(found) else found
