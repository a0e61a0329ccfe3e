"""A run with a twisting rod, as a slow motion and a ringing.

A rod rings many times faster than the body swings and decays soon, but an integrator has to resolve it to the
end. Here the two oscillations of the linear rig are separated instead. The slow oscillation is integrated with
a rigid rod; inertia, damping and lead of the body are chosen to give the exact frequency, damping and shape.
The ringing, and its response to the input of a driven run, are added in closed form. Nonlinear terms act only
on the slow motion.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.forward import forward_run
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RodTwist, RunSettings, spring_end_angle
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.quantities import Angles, Rates, Seconds, Times
from tunnel_sim.vocabulary.record import Array, read_only
from tunnel_sim.vocabulary.rig import Rig

#: Minimum ratio of the rod's ringing frequency to the body's for the two to be separated.
SEPARATION = 5.0
_GONE = 1e-9  # rad: smaller ringing is not computed
_MOST_ITERATIONS = 60
_CONVERGED = 1e-14  # relative


@dataclass(frozen=True, eq=False)
class Response:
    """The upper end's angle in an oscillation that an input u excites: 2 Re(residue · z), ż = root · z + u, rad.

    Args:
        drive: the moment u, N m.
        root: 1/s.
        residue: of the angle's transfer function at the root, rad/(N m s).
    """

    drive: InputMoment
    root: complex
    residue: complex


@dataclass(frozen=True, eq=False)
class Ringing:
    """The rod's contribution to the slow motion of its upper end: Re(amplitude · exp(root · t)) and responses, rad.

    Args:
        amplitude: amplitude of the ringing after the release, rad.
        root: 1/s, Im > 0.
        responses: responses to the input of a driven run, in addition to the slow motion's.
    """

    amplitude: complex
    root: complex
    responses: Sequence[Response] = ()

    # a ringing may grow without bound; the caller checks for it
    @np.errstate(over="ignore", invalid="ignore")
    def added(self, angle: Angles, rate: Rates, interval: Seconds) -> tuple[Angles, Rates]:
        """Angle and rate of the slow motion, at equal intervals from the release, with the ringing."""
        size = abs(self.amplitude)
        if size > _GONE:
            lasting = np.log(size / _GONE) / max(-self.root.real * interval, 1e-9)
            count = min(angle.size, int(lasting) + 1)
            ringing = self.amplitude * np.exp(self.root * interval * np.arange(count))
            angle, rate = angle.copy(), rate.copy()
            angle[:count] += ringing.real
            rate[:count] += (self.root * ringing).real
        for one in self.responses:
            answer = 2.0 * one.residue * one.drive.mode(one.root, _ends(interval, angle.size))
            angle, rate = angle + answer.real, rate + (one.root * answer).real
        return angle, rate


@lru_cache(maxsize=16)
def _ends(interval: Seconds, count: int) -> Times:
    """Times at equal intervals from 0, s, shape (count,): one object, by which responses are kept."""
    return read_only(interval * np.arange(count))


@dataclass(frozen=True)
class SlowMotion:
    """A run with a rigid rod and the slow oscillation of the run with a flexible rod.

    Args:
        lead: lead of the body over the upper end, as a share of the angle there.
        rod_stiffness: stiffness of the leading rod, seen from the upper end, N m/rad.
        body_release: the body's release angle, rad.
    """

    run: RunSettings
    lead: float
    rod_stiffness: float
    body_release: float
    ringing: Ringing

    def forward_run(self) -> tuple[NDArray[np.void], Sequence[Array]]:
        """The run for the compiled integrator; result as from `forward_run`."""
        row, keep_alive = forward_run(self.run)
        row["lead"], row["rod_stiffness"], row["lagged"] = self.lead, self.rod_stiffness, self.body_release
        return row, keep_alive


@dataclass(frozen=True)
class _TwoMasses:
    """The linear rig with a flexible rod; its angles are the upper end's and the body's.

    Args:
        upper, lower: inertia at either end of the rod, kg m².
        spring, loss: stiffness (N m/rad) and damping (N m s/rad) at the upper end.
        rod, rod_loss: stiffness and damping of the rod.
        air, air_damping: Ka and Ca of the air on the body.
    """

    upper: float
    lower: float
    spring: float
    loss: float
    rod: float
    rod_loss: float
    air: float
    air_damping: float

    @classmethod
    def of(cls, run: RunSettings, rod: RodTwist, rig: Rig) -> _TwoMasses:
        """The linear part of a run's law."""
        flow = rig.body.flow(run.air_density, run.wind_speed)
        return cls(
            rod.inertia_share * run.yaw_inertia,
            (1.0 - rod.inertia_share) * run.yaw_inertia,
            run.spring_stiffness + run.parameters.get("gravity_stiffness", 0.0),
            run.mechanical_damping,
            1.0 / rod.compliance,
            rod.damping(run.yaw_inertia),
            aerodynamic_stiffness(run.derivatives.cn_beta, **flow),
            aerodynamic_damping(run.derivatives.cn_r, **flow),
        )

    def lead(self, root: complex) -> complex:
        """The twist per angle of the upper end in an oscillation exp(root · t), from the balance of the body."""
        free = self.air + self.air_damping * root - self.lower * root**2
        return free / (self.rod + self.rod_loss * root - free)

    def roots(self) -> tuple[complex, complex] | None:
        """The slow and the fast root, 1/s; None where one does not oscillate, or they are close."""
        lead, slow = 0j, 0j
        for _ in range(_MOST_ITERATIONS):
            previous = slow
            # the balance of the whole rig: the body moves 1 + lead times as far as the upper end
            body = 1.0 + lead
            slow = _upper_root(
                self.upper + self.lower * body,
                self.loss - self.air_damping * body,
                self.spring - self.air * body,
            )
            lead = self.lead(slow)
            if abs(slow - previous) <= _CONVERGED * abs(slow):
                break
        else:
            return None
        if not slow.imag > 0.0:
            return None
        # The four roots' sum and product give the other two.
        total = (self.loss + self.rod_loss) / self.upper + (self.rod_loss - self.air_damping) / self.lower
        product = self.rod * (self.spring - self.air) - self.air * self.spring
        product /= self.upper * self.lower
        fast = _upper_root(1.0, total + 2.0 * slow.real, product / abs(slow) ** 2)
        return (slow, fast) if fast.imag > 0.0 and abs(fast) > SEPARATION * abs(slow) else None

    def residue(self, root: complex, *, on_body: bool) -> complex:
        """Residue of the upper end's angle per moment on the body or on the upper end, at a root, rad/(N m s)."""
        lead = self.lead(root)
        body = 1.0 + lead
        turning = 2.0 * root * (self.upper + self.lower * body**2)
        turning += self.loss - self.air_damping * body**2 + self.rod_loss * lead**2
        return (body if on_body else 1.0) / turning


def slow_motion(run: RunSettings, rig: Rig) -> SlowMotion | None:
    """Separate the rod's ringing from the motion of the body on its spring; the run's release angle is the body's.

    None for a rigid rod, and where the two oscillations are not `SEPARATION` apart or one of them does not
    oscillate.
    """
    linear = None if run.rod_twist is None else _TwoMasses.of(run, run.rod_twist, rig)
    roots = None if linear is None else linear.roots()
    if linear is None or roots is None:
        return None
    root, fast = roots
    leads = lead, _ = linear.lead(root), linear.lead(fast)
    end = spring_end_angle(run)
    # Amplitudes of two oscillations that add up to the release's angle, its rate, the twist and its rate.
    rows = [(1.0, 1.0), roots, leads, (root * lead, fast * leads[1])]
    matrix = [[part for value in row for part in (value.real, -value.imag)] for row in rows]
    state = np.array((end, run.release_rate, run.release_angle - end, 0.0))
    found = np.linalg.solve(np.array(matrix), state).tolist()
    slow, ringing = complex(found[0], found[1]), complex(found[2], found[3])
    body = 1.0 + lead.real
    air = linear.air * body**2  # a moment on the body does work on the body's angle
    strained = linear.rod * lead.real**2
    inertia = (linear.spring + strained - air) / abs(root) ** 2
    if not inertia > 0.0:
        return None
    rigid = run.table.copy()
    rigid.rod_twist[0], rigid["yaw_inertia"][0] = None, inertia
    rigid["mechanical_damping"][0] = -2.0 * root.real * inertia + linear.air_damping * body**2
    rigid["release_angle"][0], rigid["release_rate"][0] = slow.real, (root * slow).real
    responses: tuple[Response, ...] = ()
    if (drive := run.drive) is not None:
        of_slow, of_fast = (linear.residue(one, on_body=drive.on_body) for one in roots)
        of_slow -= (body if drive.on_body else 1.0) / (2j * root.imag * inertia)  # integrated already
        responses = Response(drive, root, of_slow), Response(drive, fast, of_fast)
    return SlowMotion(rigid.row(0), lead.real, strained, run.release_angle, Ringing(ringing, fast, responses))


def _upper_root(inertia: complex, damping: complex, stiffness: complex) -> complex:
    """The root of inertia s² + damping s + stiffness with the larger imaginary part, 1/s."""
    half = damping / (2.0 * inertia)
    return -half + 1j * cmath.sqrt(stiffness / inertia - half * half)
