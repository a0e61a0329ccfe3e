"""Ambient vibration: a record without a release, in which a random moment keeps the body in motion.

The rate of the best-fitting decay is then an accident of the record, not the damping.
"""

from __future__ import annotations

import numpy as np

from identification.signal.frequency import pencil_decay, starting_frequency, thinned_reading
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array, evenly_spaced

# A free decay explains its record, and two free decays explain a beat. Neither explains random motion over
# many times its memory: in 60 simulated records of 3 to 50 times 1/(ζ ω), both explain less than these
# shares.
_ONE_EXPLAINS = 0.6
_TWO_EXPLAIN = 0.85
_BLOCK = 3  # cycles with one value of the amplitude
_LEAST_BLOCKS = 8  # minimum number of such values: fewer do not show that the amplitude varies
_EVEN = 3.0  # ratio of the power in the last third and the first: a decay of any use has more
_START = 2.0  # multiple of the median amplitude: a release is larger
_RISES = 0.6  # rise of the amplitude as a share of its falls; in a decay with noise much less
_LEAST_RISE = 1.0  # total change of the amplitude's logarithm
_FINER = 4  # number of tried frequencies for each of a Fourier transform
_LARGEST = 50.0  # maximum exponent
_SMOOTH = 0.5  # minimum correlation of neighbours in the rest: less is noise of the sensor


def is_ambient(run: Run) -> bool:
    """Whether a run without an input is neither a decay nor a limit cycle, but motion under a random moment."""
    if run.drive is not None:
        return False
    frequency = starting_frequency(run.record)
    if frequency is None:
        return False
    reading = thinned_reading(evenly_spaced(run.record), frequency)
    values = reading.yaw - reading.yaw.mean()
    interval = float(reading.time[-1]) / (reading.time.size - 1)
    size = max(round(_BLOCK / (frequency * interval)), 1)
    if values.size // size < _LEAST_BLOCKS:
        return False
    level = np.log(
        np.sqrt((values[: values.size // size * size].reshape(-1, size) ** 2).mean(axis=1)) + 1e-300
    )
    steps = np.diff(level)
    rise, fall = float(steps[steps > 0.0].sum()), float(-steps[steps < 0.0].sum())
    third = values.size // 3
    ratio = float(np.mean(values[-third:] ** 2) / np.mean(values[:third] ** 2))
    comes_and_goes = rise >= max(_LEAST_RISE, _RISES * fall) and 1.0 / _EVEN < ratio < _EVEN
    if not comes_and_goes or level[0] > np.median(level) + np.log(_START):
        return False
    found: list[tuple[float, float]] = []
    rest = values
    for most in (_ONE_EXPLAINS, _TWO_EXPLAIN):
        poles = pencil_decay(rest, interval, 2.0 * np.pi * frequency)
        if poles is None or not poles.decay.omega_d > 0.0:
            break
        found.append((poles.decay.rate, poles.decay.omega_d))
        rest = _unexplained(values, reading.time, found)
        if float(rest @ rest) < (1.0 - most) * float(values @ values):
            return False
    if not found or float(rest[1:] @ rest[:-1]) < _SMOOTH * float(rest @ rest):
        return False
    lines: list[tuple[float, float]] = []  # two steady oscillations of a beat, between which the poles lie
    rest = values
    for _ in range(2):
        spectrum = np.abs(np.fft.rfft(rest, _FINER * rest.size))
        lines.append((0.0, 2.0 * np.pi * int(np.argmax(spectrum)) / (_FINER * rest.size * interval)))
        rest = _unexplained(values, reading.time, lines)
    return float(rest @ rest) > (1.0 - _TWO_EXPLAIN) * float(values @ values)


def _unexplained(values: Array, time: Array, decays: list[tuple[float, float]]) -> Array:
    """The remainder of a motion after decays of some rates and frequencies (1/s, rad/s) are fitted, shape (n,)."""
    columns = [np.ones(time.size)]
    for rate, omega in decays:
        envelope = np.exp(np.clip(-rate * (time - time[0]), -_LARGEST, _LARGEST))
        columns += [envelope * np.cos(omega * time), envelope * np.sin(omega * time)]
    design = np.stack(columns, axis=1) / np.linalg.norm(columns, axis=1)
    rest: Array = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return rest
