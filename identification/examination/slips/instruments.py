"""The clock and the sensor of all runs: a clock that drifts along the runs, a sensor that loses constant values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtri

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence
from identification.signal.free_decay import Decay, response_rows
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.quantities import Angles
from tunnel_sim.vocabulary.record import Array, running_integral

_WINDOW = 2.0  # cycles: a Hann window of two cycles removes the zero and twice the frequency
_FEWEST = 6  # minimum number of phases in a run
_PHASE = 1e-3  # rad: remainder of zero and damping after the window
_LEAST_AMPLITUDE = 0.05  # share of the first amplitude: later phases carry little information
#: Powers of the amplitude by which effects change a frequency: free play, an asymmetric spring, a cubic one.
_POWERS = (-1.0, 1.0, 2.0)


@dataclass(frozen=True, eq=False)
class _Phase:
    """The phase of a run relative to a constant frequency, at the middle of windows, and its possible changes.

    Args:
        drift: phase by a clock whose rate changes by 1 over the run, shape (n,), rad.
        amplitude: phase changes by powers of the amplitude, shape (n, powers), rad.
        free: constant and slope, shape (n, 2).
    """

    run: str
    phase: Angles
    std: Angles
    drift: Array
    amplitude: Array
    free: Array


def drifting_clock(evidence: SlipEvidence) -> Remark | None:
    """All runs, or a single one, change their frequency linearly with time, not with the amplitude. Refused.

    An effect changes the frequency with the amplitude, which falls faster in runs of greater damping. The phase
    of each run relative to its own mean frequency shows whether time or amplitude is the cause, unless all runs
    are damped alike.

    A single run with a phase that may as well jump at one instant is not refused: it may have been disturbed.
    """
    phases = [phase for swing in evidence.swings if (phase := _phase(swing)) is not None]
    still = {swing.run.id for swing in evidence.swings if not swing.run.wind_on}
    # one decay does not separate time from amplitude, and without wind-off runs the wind speed may drift
    if len(phases) < 2 or not any(phase.run in still for phase in phases):
        return None
    whole = tuple(range(len(phases)))
    for places in (whole, *((place,) for place in whole if len(phases) > 2)):
        drift, std, squares, freedom = _fitted_drift(phases, places, by_amplitude=False)
        if abs(drift) < policy.LEAST_DRIFT or abs(drift) < policy.REFUSAL_DEVIATIONS * std:
            continue
        good = squares <= float(chdtri(freedom, policy.MISFIT_RATE))
        _, _, other, left = _fitted_drift(phases, (), by_amplitude=True)
        ratio = (other / left) / max(squares / freedom, 1.0)
        if not good or ratio <= float(fdtri(left, freedom, 1.0 - policy.REFUSAL_RATE)):
            continue
        if places != whole and _jumps(phases, places[0], squares):
            continue
        ids = tuple(phases[place].run for place in places)
        who = "every run" if places == whole else "the run"
        air = "" if still.intersection(ids) else ", or the wind speed"
        what = (
            f"the frequency changes by {100.0 * drift:+.2g} % along {who} with time, at every amplitude: "
            f"the clock of the logger drifts, or the stiffness of a spring that warms up{air}"
        )
        remedy = "correct time_s by a reference, let the spring settle, or leave the runs out"
        return Remark(Outcome.REFUSED, ids, what, remedy)
    return None


def _jumps(phases: list[_Phase], place: int, squares: float) -> bool:
    """Whether a jump of a run's phase at one instant, as from a blow, fits no worse than a drift.

    Args:
        place: index of the run among the phases.
        squares: sum of squares of the residuals with the drift, dimensionless.
    """
    one = phases[place]
    after = np.arange(one.phase.size)
    for at in range(1, one.phase.size - 1):
        for smeared in (0.0, 0.5):  # the window around the instant shows a part of the jump
            jump = np.where(after == at, smeared, after > at).astype(np.float64)
            tried = [*phases[:place], replace(one, drift=jump), *phases[place + 1 :]]
            if _fitted_drift(tried, (place,), by_amplitude=False)[2] <= squares:
                return True
    return False


def _phase(swing: Swing) -> _Phase | None:
    """Demodulate a run; None where it has too few cycles."""
    omega = float(np.sqrt(max(swing.stiffness - swing.rate**2, 0.0)))
    if omega == 0.0 or swing.run.drive is not None:
        return None
    time, motion = swing.time, swing.motion
    interval, period = float(time[-1]) / (time.size - 1), 2.0 * np.pi / omega
    width = round(_WINDOW * period / interval)
    count = time.size // max(width // 2, 1) - 1
    if width < 8 or count < _FEWEST:
        return None
    window = np.hanning(width + 1)[:-1]
    starts = np.arange(count) * (width // 2)
    starts = starts[starts + width <= time.size]
    turned = motion * np.exp(-1j * omega * time)
    values = np.array([window @ turned[at : at + width] for at in starts]) * 2.0 / window.sum()
    size = np.abs(values)
    keep = size > _LEAST_AMPLITUDE * size[0]
    if keep.sum() < _FEWEST:
        return None
    middle, values, size = time[starts + width // 2][keep], values[keep], size[keep]
    phase = np.unwrap(np.angle(values))
    rough = motion[1:-1] - 0.5 * (motion[:-2] + motion[2:]) / np.cos(omega * interval)
    noise = float(np.median(np.abs(rough))) / 0.6745 / np.sqrt(1.5)
    std = np.hypot(_PHASE, noise * np.sqrt(3.0 / width) / size)
    relative = middle - middle[0]
    integrals = [running_integral((size / size[0]) ** power, relative) for power in _POWERS]
    length = float(time[-1])
    return _Phase(
        swing.run.id, phase, std, omega * middle * (middle - length) / (2.0 * length),
        omega * np.column_stack(integrals) * np.array([abs(swing.amplitude) ** p for p in _POWERS]),
        np.column_stack((np.ones(middle.size), relative)),
    )  # fmt: skip


def _fitted_drift(
    phases: list[_Phase], drifting: tuple[int, ...], *, by_amplitude: bool
) -> tuple[float, float, float, int]:
    """Common drift of some runs and its standard deviation, sum of squares, degrees of freedom."""
    rows, targets = [], []
    for place, one in enumerate(phases):
        projected = np.linalg.qr(one.free / one.std[:, None])[0]
        columns = [one.drift * float(place in drifting)] if drifting else []
        if by_amplitude:
            columns += list(one.amplitude.T)
        block, target = np.column_stack(columns) / one.std[:, None], one.phase / one.std
        rows.append(block - projected @ (projected.T @ block))
        targets.append(target - projected @ (projected.T @ target))
    matrix, target = np.vstack(rows), np.concatenate(targets)
    sizes = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    solution = np.linalg.lstsq(matrix / sizes, target, rcond=1e-10)[0]
    residual = target - matrix / sizes @ solution
    freedom = target.size - 2 * len(phases) - matrix.shape[1]
    return float(solution[0] / sizes[0]), float(1.0 / sizes[0]), float(residual @ residual), max(freedom, 1)


_CONSTANTS = np.geomspace(0.25, 32.0, 22)  # tried values of τ, as shares of a cycle
_REFINED = 1.3  # factor on τ about the best of these
_SWEEPS = 2  # sweeps of linear corrections of the poles
_SHARE_LEFT = 0.05  # share of the centre's decay that may remain as a zero
_LEAD = 0.2  # relative tolerance of the lead about arctan(1/ωτ)
_LASTING = (
    0.5  # cycles; least τ in a single run. The hold of a hand is over within a cycle (three drawn: 0.19)
)


@dataclass(frozen=True, eq=False)
class _Decaying:
    """A run with a decaying centre.

    Args:
        constant: τ, s.
        period: period of the oscillation, s.
        centre: centre at the start, rad.
        zero, zero_std: zero at the end with its standard deviation, rad.
        lead: phase lead of the oscillation beyond a release from rest, rad.
        expected: lead expected from τ, rad.
    """

    run: str
    constant: float
    period: float
    centre: float
    zero: float
    zero_std: float
    lead: float
    expected: float

    @property
    def coupled(self) -> bool:
        """Whether one high-pass filter explains both centre and lead."""
        ends = abs(self.zero) < policy.MISFIT_DEVIATIONS * self.zero_std + _SHARE_LEFT * abs(self.centre)
        return ends and abs(self.lead - self.expected) < _LEAD * self.expected


def coupled_sensor(evidence: SlipEvidence) -> Remark | None:
    """The centre decays to zero and the oscillation leads, with one time constant. Refused: it looks like a drift.

    The sensor is AC-coupled, with a high-pass filter before the logger. Its reading of a release is an oscillation
    with a phase lead of arctan(1/ωτ), about a centre that decays as exp(-t/τ) to zero. Creep of a spring also moves
    the centre, but without the lead; a drift does not end at zero.
    """
    if evidence.campaign.sensor.derivative or not evidence.swings:
        return None
    decaying = [one for swing in evidence.swings if (one := _decaying(swing)) is not None]
    found = [one for one in decaying if one.coupled]
    if 2 * len(found) <= len(decaying):  # one sensor reads all runs; with a drift some lead by chance
        return None
    if len(found) == 1 < len(evidence.swings) and found[0].constant < _LASTING * found[0].period:
        return None
    constant = float(np.median([one.constant for one in found]))
    what = (
        f"the centre of the motion decays to zero with a time constant of about {constant:.2g} s, and the "
        "reading leads as by a high-pass filter of that constant: the sensor or the logger is AC-coupled"
    )
    remedy = "record with DC coupling, or leave the runs out"
    return Remark(Outcome.REFUSED, tuple(one.run for one in found), what, remedy)


def _decaying(swing: Swing) -> _Decaying | None:
    """The best decaying centre; None if the run has none beyond chance."""
    time, yaw, decay = swing.time, swing.motion + swing.zero, Decay(swing.rate, swing.stiffness)
    if decay.omega_d == 0.0:
        return None
    period, length = 2.0 * np.pi / decay.omega_d, float(time[-1])
    constants = _CONSTANTS[_CONSTANTS * period < 0.5 * length] * period
    freedom = 2.0 * length / period - 6.0  # the residual is correlated over half a cycle
    if freedom < 1.0 or constants.size == 0:
        return None
    # reduction of the sum of squares by each constant, to first order in the poles
    base = np.linalg.qr(response_rows(time, decay, constant=True).T)[0]
    centres = np.exp(-time[:, None] / constants)
    centres = centres - base @ (base.T @ centres)
    left = yaw - base @ (base.T @ yaw)
    drops = (left @ centres) ** 2 / np.sum(centres**2, axis=0)
    best, total = int(np.argmax(drops)), float(left @ left)
    chance = float(fdtri(2, freedom, 1.0 - policy.REFUSAL_RATE))
    if not 0.5 * drops[best] > chance * max(total - drops[best], 0.0) / freedom:
        return None
    near = constants[best] * np.geomspace(1.0 / _REFINED, _REFINED, 9)
    fits = [(tau, *_fit_with_centre(time, yaw, decay, tau)) for tau in near.tolist()]
    tau, squares, decay, solution, inverse = min(fits, key=lambda one: one[1])
    angle, rate, centre, zero = (float(value) for value in solution[[0, 1, -2, -1]])
    quadrature = (rate + decay.rate * angle) / decay.omega_d
    lead = np.arctan2(-quadrature * np.sign(angle), abs(angle)) + np.arctan(decay.rate / decay.omega_d)
    if squares > policy.GROSS_MISFIT * float(np.sum((yaw - yaw.mean()) ** 2)):
        return None  # a filter keeps an oscillation pure; another motion leads and creeps by chance
    std = np.sqrt(squares / freedom * inverse[-1, -1])
    expected = np.arctan(1.0 / (decay.omega_d * tau))
    return _Decaying(swing.run.id, tau, period, centre, zero, float(std), float(lead), float(expected))


def _fit_with_centre(time: Array, yaw: Array, decay: Decay, tau: float) -> tuple[float, Decay, Array, Array]:
    """Sum of squares, corrected poles, solution in the order of the columns, and the inverse normal matrix."""
    for _ in range(_SWEEPS):
        unit, sine, slope, ramp, one = response_rows(time, decay, constant=True)
        matrix = np.column_stack([unit, sine, slope, ramp, np.exp(-time / tau), one])
        sizes = np.linalg.norm(matrix, axis=0)
        solution, *_ = np.linalg.lstsq(matrix / sizes, yaw, rcond=1e-12)
        solution = solution / sizes
        residual = yaw - matrix @ solution
        angle, rate, by_slope, by_ramp = (float(value) for value in solution[:4])
        # y = β₀u + r₀s: ∂y/∂a = β₀(-2kw) + r₀(-ts - 2aw), ∂y/∂k = β₀(aw - ts/2) + r₀w
        system = np.array(
            [
                [-2.0 * decay.stiffness * angle - 2.0 * decay.rate * rate, decay.rate * angle + rate],
                [-rate, -0.5 * angle],
            ]
        )
        try:
            change = np.linalg.solve(system, [by_slope, by_ramp])
        except np.linalg.LinAlgError:
            break
        moved = Decay(decay.rate + float(change[0]), decay.stiffness + float(change[1]))
        if not moved.omega_d > 0.0 or abs(change[1]) > 0.2 * decay.stiffness:
            break
        decay = moved
    inverse = np.linalg.pinv((matrix / sizes).T @ (matrix / sizes)) / np.outer(sizes, sizes)
    return float(residual @ residual), decay, solution, inverse
