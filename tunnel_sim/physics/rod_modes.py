"""A run with a twisting rod, as a slow motion and a ringing.

A rod rings many times faster than the body swings and decays soon, but an integrator has to resolve it to the
end. Here the two oscillations of the linear rig are separated instead. The slow oscillation is integrated with
a rigid rod; inertia, damping and lead of the body are chosen to give the exact frequency, damping and shape.
The ringing, and its response to the input of a driven run, are added in closed form. Nonlinear terms act only
on the slow motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RodTwist, SettingsTable
from tunnel_sim.vocabulary.quantities import Angles, Rates, Seconds, Times
from tunnel_sim.vocabulary.record import Array, read_only
from tunnel_sim.vocabulary.rig import Rig

#: Minimum ratio of the rod's ringing frequency to the body's for the two to be separated.
SEPARATION = 5.0
_GONE = 1e-9  # rad: smaller ringing is not computed
_MOST_ITERATIONS = 60
_CONVERGED = 1e-14  # relative
_Complex: TypeAlias = NDArray[np.complex128]


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

    @classmethod
    def of(cls, linear: _TwoMasses, drive: InputMoment, root: _Complex, lead: _Complex) -> Response:
        """The response of one linear rig at a root with its lead, shape (1,) each."""
        residue = linear.residue(root, lead, on_body=drive.on_body)
        return cls(drive, complex(root[0]), complex(residue[0]))

    def without_rigid(self, body: float, inertia: float) -> Response:
        """The response without that of the rig with a rigid rod, which is integrated.

        Args:
            body: the body's angle per angle of the upper end.
            inertia: inertia of the rig with the rigid rod, kg m².
        """
        moved = body if self.drive.on_body else 1.0
        return replace(self, residue=self.residue - moved / (2j * self.root.imag * inertia))


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


@dataclass(frozen=True, eq=False)
class SlowMotion:
    """What a rigid rod lacks of the slow oscillation of a flexible one, and the ringing.

    Args:
        lead: lead of the body over the upper end, as a share of the angle there.
        rod_stiffness: stiffness of the leading rod, seen from the upper end, N m/rad.
        body_release: the body's release angle, rad.
    """

    lead: float
    rod_stiffness: float
    body_release: float
    ringing: Ringing


@dataclass(frozen=True, eq=False)
class _TwoMasses:
    """Linear rigs with a flexible rod; their angles are the upper end's and the body's. Arrays by run.

    Args:
        upper, lower: inertia at either end of the rod, kg m².
        spring, loss: stiffness (N m/rad) and damping (N m s/rad) at the upper end.
        rod, rod_loss: stiffness and damping of the rod.
        air, air_damping: Ka and Ca of the air on the body.
    """

    upper: Array
    lower: Array
    spring: Array
    loss: Array
    rod: Array
    rod_loss: Array
    air: Array
    air_damping: Array

    @classmethod
    def of(cls, runs: SettingsTable, rods: Sequence[RodTwist], rig: Rig) -> _TwoMasses:
        """The linear part of the runs' laws."""
        inertia, share = runs["yaw_inertia"], np.array([rod.inertia_share for rod in rods])
        return cls(
            share * inertia,
            (1.0 - share) * inertia,
            runs.spring_stiffness + runs["gravity_stiffness"],
            runs["mechanical_damping"],
            np.array([1.0 / rod.compliance for rod in rods]),
            np.array([rod.damping(own) for rod, own in zip(rods, inertia.tolist(), strict=True)]),
            *runs.air(rig),
        )

    def lead(self, root: _Complex) -> _Complex:
        """The twist per angle of the upper end in an oscillation exp(root · t), from the balance of the body."""
        free = self.air + self.air_damping * root - self.lower * root**2
        return free / (self.rod + self.rod_loss * root - free)

    def roots(self) -> tuple[_Complex, _Complex, NDArray[np.bool_]]:
        """The slow and the fast root, 1/s, and whether both oscillate, far apart from each other."""
        lead: _Complex = np.zeros(len(self.upper), np.complex128)
        slow = lead
        moving = np.ones(len(self.upper), bool)
        for _ in range(_MOST_ITERATIONS):
            # the balance of the whole rig: the body moves 1 + lead times as far as the upper end
            body = 1.0 + lead
            root = _upper_root(
                self.upper + self.lower * body,
                self.loss - self.air_damping * body,
                self.spring - self.air * body,
            )
            # each run stops where it would stop alone
            settled = ~(np.abs(root - slow) > _CONVERGED * np.abs(root))
            slow = np.where(moving, root, slow)
            lead = np.where(moving, self.lead(slow), lead)
            moving &= ~settled
            if not moving.any():
                break
        # The four roots' sum and product give the other two.
        total = (self.loss + self.rod_loss) / self.upper + (self.rod_loss - self.air_damping) / self.lower
        product = self.rod * (self.spring - self.air) - self.air * self.spring
        product /= self.upper * self.lower
        fast = _upper_root(1.0, total + 2.0 * slow.real, product / np.abs(slow) ** 2)
        apart = (slow.imag > 0.0) & (fast.imag > 0.0) & (np.abs(fast) > SEPARATION * np.abs(slow))
        return slow, fast, ~moving & apart

    def row(self, place: int) -> _TwoMasses:
        """One of the rigs."""
        return _TwoMasses(*(values[place : place + 1] for values in vars(self).values()))

    def residue(self, root: _Complex, lead: _Complex, *, on_body: bool) -> _Complex:
        """Residue of the upper end's angle per moment on the body or on the upper end, at a root, rad/(N m s)."""
        body = 1.0 + lead
        turning = 2.0 * root * (self.upper + self.lower * body**2)
        turning += self.loss - self.air_damping * body**2 + self.rod_loss * lead**2
        return (body if on_body else 1.0) / turning


def separate_ringing(runs: SettingsTable, rig: Rig) -> dict[int, SlowMotion]:
    """Separate the ringing of flexible rods from the motion of the body on its spring.

    Args:
        runs: a table whose runs are released at the angle of the spring's end. Runs that are separated get a
            rigid rod and their slow motion, in place.

    Returns:
        The separated runs by place: without rigid rods, and runs whose two oscillations are not `SEPARATION`
        apart or do not both oscillate.
    """
    places = [place for place, rod in enumerate(runs.rod_twist) if rod is not None]
    if not places:
        return {}
    rods = [rod for rod in runs.rod_twist if rod is not None]
    some = SettingsTable.empty(len(places))
    some.numbers[:] = runs.numbers[places]
    with np.errstate(all="ignore"):  # a fit may try any law
        linear = _TwoMasses.of(some, rods, rig)
        root, fast, able = linear.roots()
        lead, fast_lead = linear.lead(root), linear.lead(fast)
        end = some["release_angle"]
        released = end * (1.0 + some.spring_stiffness * np.array([rod.compliance for rod in rods]))
        # a moment on the body does work on the body's angle
        body = 1.0 + lead.real
        strained = linear.rod * lead.real**2
        inertia = (linear.spring + strained - linear.air * body**2) / np.abs(root) ** 2
    able &= inertia > 0.0
    rows = np.flatnonzero(able)
    root, fast, lead, fast_lead = (one[rows] for one in (root, fast, lead, fast_lead))
    inertia, body, end = inertia[rows], body[rows], end[rows]
    state = np.stack([end, some["release_rate"][rows], released[rows] - end, np.zeros_like(end)], axis=1)
    slow, ringing = _amplitudes(state, (root, fast), (lead, fast_lead))
    at = np.array(places)[rows]
    runs["yaw_inertia"][at] = inertia
    damping = -2.0 * root.real * inertia + linear.air_damping[rows] * body**2
    runs["mechanical_damping"][at] = damping
    runs["release_angle"][at], runs["release_rate"][at] = slow.real, (root * slow).real
    found = {}
    for number, (row, place) in enumerate(zip(rows.tolist(), at.tolist(), strict=True)):
        runs.rod_twist[place] = None
        responses: tuple[Response, ...] = ()
        if (drive := runs.drive[place]) is not None:
            own, one = linear.row(row), slice(number, number + 1)
            of_slow = Response.of(own, drive, root[one], lead[one])
            of_slow = of_slow.without_rigid(float(body[number]), float(inertia[number]))
            responses = of_slow, Response.of(own, drive, fast[one], fast_lead[one])
        found[place] = SlowMotion(
            float(lead[number].real),
            float(strained[row]),
            float(released[row]),
            Ringing(complex(ringing[number]), complex(fast[number]), responses),
        )
    return found


def _amplitudes(
    state: Array, roots: tuple[_Complex, _Complex], leads: tuple[_Complex, _Complex]
) -> tuple[_Complex, _Complex]:
    """Amplitudes of two oscillations that add up to the release, rad, shape (runs,) each.

    Args:
        state: angle of the upper end, its rate, the twist and its rate, shape (runs, 4).
    """
    (root, fast), (lead, fast_lead) = roots, leads
    pairs = [(np.ones_like(root),) * 2, roots, leads, (root * lead, fast * fast_lead)]
    matrix = np.stack([np.stack([a.real, -a.imag, b.real, -b.imag], axis=1) for a, b in pairs], axis=1)
    parts = np.linalg.solve(matrix, state[:, :, None])[:, :, 0]
    return parts[:, 0] + 1j * parts[:, 1], parts[:, 2] + 1j * parts[:, 3]


def _upper_root(
    inertia: _Complex | float, damping: _Complex | Array, stiffness: _Complex | Array
) -> _Complex:
    """The roots of inertia s² + damping s + stiffness with the larger imaginary part, 1/s."""
    half = damping / (2.0 * inertia)
    root: _Complex = -half + 1j * np.sqrt(np.asarray(stiffness / inertia - half * half, complex))
    return root
