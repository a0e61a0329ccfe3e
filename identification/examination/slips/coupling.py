"""A sensor that does not pass constant values: AC-coupled, with a high-pass filter before the logger.

Its reading of a release is an oscillation with a phase lead of arctan(1/ωτ), about a centre that decays as
exp(-t/τ) to zero. Creep of a spring also moves the centre, but without the lead; a drift does not end at zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from identification import policy
from identification.examination.self_excited import Swing
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.signal.free_decay import Decay, response_rows
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.record import Array

_CONSTANTS = np.geomspace(0.25, 32.0, 22)  # of a cycle, τ tried
_REFINED = 1.3  # factor on τ about the best of these
_SWEEPS = 2  # of the poles' linear corrections
_SHARE_LEFT = 0.05  # of the centre's decay that may remain as a zero
_LEAD = 0.2  # relative tolerance of the lead about arctan(1/ωτ)


@dataclass(frozen=True, eq=False)
class _Decaying:
    """A run with a decaying centre.

    Args:
        constant: τ, s.
        centre: at the start, rad.
        zero, zero_std: at the end, rad.
        lead: phase lead of the oscillation beyond a release from rest, rad.
        expected: lead from τ, rad.
    """

    run: str
    constant: float
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


@dataclass(frozen=True)
class CoupledSensor(StatementSlip):
    """The centre decays to zero and the oscillation leads, by one time constant. Refused: it looks like a drift."""

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Fit a decaying centre to every free decay of an angle; most of those that have one must agree."""
        if seen.campaign.sensor.derivative or not seen.swings:
            return ()
        decaying = [one for swing in seen.swings if (one := _decaying(swing)) is not None]
        found = [one for one in decaying if one.coupled]
        if 2 * len(found) <= len(decaying):  # one sensor reads all runs; beside a drift some lead by chance
            return ()
        constant = float(np.median([one.constant for one in found]))
        what = (
            f"the centre of the motion decays to zero with a time constant of about {constant:.2g} s, and the "
            "reading leads as by a high-pass filter of that constant: the sensor or the logger is AC-coupled"
        )
        remedy = "record with DC coupling, or leave the runs out"
        return (Remark(Outcome.REFUSED, tuple(one.run for one in found), what, remedy),)


def _decaying(swing: Swing) -> _Decaying | None:
    """The best decaying centre; None where the run has none beyond chance."""
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
    fits = [(tau, *_fit(time, yaw, decay, tau)) for tau in near.tolist()]
    tau, squares, decay, solution, inverse = min(fits, key=lambda one: one[1])
    angle, rate, centre, zero = (float(value) for value in solution[[0, 1, -2, -1]])
    quadrature = (rate + decay.rate * angle) / decay.omega_d
    lead = np.arctan2(-quadrature * np.sign(angle), abs(angle)) + np.arctan(decay.rate / decay.omega_d)
    if squares > policy.GROSS_MISFIT * float(np.sum((yaw - yaw.mean()) ** 2)):
        return None  # a filter keeps an oscillation pure; another motion leads and creeps by chance
    std = np.sqrt(squares / freedom * inverse[-1, -1])
    expected = np.arctan(1.0 / (decay.omega_d * tau))
    return _Decaying(swing.run.id, tau, centre, zero, float(std), float(lead), float(expected))


def _fit(time: Array, yaw: Array, decay: Decay, tau: float) -> tuple[float, Decay, Array, Array]:
    """Sum of squares, corrected poles, solution in the order of the columns, and the normal matrix's inverse."""
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
