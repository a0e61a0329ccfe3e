"""The slow motion of a rig whose rod twists, and the ringing of the rod beside it.

A rod rings many times faster than the body swings and decays soon, but an integrator has to follow it to the end.
Here the two oscillations of the linear rig are separated instead. The slow one is integrated with a rigid rod whose
inertia, damping and lead of the body give its exact frequency, damping and shape. The ringing is added in closed
form. Nonlinear terms act on the slow motion alone.
"""

from __future__ import annotations

import cmath
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.forward import forward_run
from tunnel_sim.physics.run_settings import RunSettings, spring_end_angle
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

#: How many times faster than the body the rod must ring for the two to be separated.
SEPARATION = 5.0
_GONE = 1e-9  # rad: ringing below this is not computed
_MOST_ITERATIONS = 60
_CONVERGED = 1e-14  # relative


@dataclass(frozen=True)
class Ringing:
    """A decaying oscillation of the rod's upper end, Re(amplitude · exp(root · t)).

    Args:
        amplitude: rad.
        root: 1/s, with a positive imaginary part.
    """

    amplitude: complex
    root: complex

    def added(self, angle: Array, rate: Array, interval: float) -> tuple[Array, Array]:
        """Angle and rate with the ringing.

        Args:
            angle: of the slow motion at equal intervals from the release, rad, shape (n,).
            rate: of the slow motion, rad/s, shape (n,).
            interval: s.

        Returns:
            rad and rad/s, each of shape (n,).
        """
        size = abs(self.amplitude)
        if size <= _GONE:
            return angle, rate
        lasting = np.log(size / _GONE) / max(-self.root.real * interval, 1e-9)
        count = min(angle.size, int(lasting) + 1)
        ringing = self.amplitude * np.exp(self.root * interval * np.arange(count))
        angle, rate = angle.copy(), rate.copy()
        angle[:count] += ringing.real
        rate[:count] += (self.root * ringing).real
        return angle, rate


@dataclass(frozen=True)
class SlowMotion:
    """A run with a rigid rod that moves as the slow oscillation of the run with a flexible one.

    Args:
        run: its release angle and rate are those of the rod's upper end.
        lead: of the body before the upper end, as a share of the angle there.
        rod_stiffness: of the rod that leads, seen from the upper end, N m/rad.
        body_release: the body's release angle, rad.
        ringing: what the slow motion lacks at the upper end.
    """

    run: RunSettings
    lead: float
    rod_stiffness: float
    body_release: float
    ringing: Ringing

    def forward_run(self) -> tuple[NDArray[np.void], Sequence[Array]]:
        """The run for the compiled integrator (see `tunnel_sim.physics.forward.forward_run`).

        Returns:
            Array of shape (1,), and the arrays that must stay alive.
        """
        row, keep_alive = forward_run(self.run)
        row["lead"], row["rod_stiffness"], row["lagged"] = self.lead, self.rod_stiffness, self.body_release
        return row, keep_alive


def slow_motion(run: RunSettings, rig: Rig) -> SlowMotion | None:
    """Separate the rod's ringing from the motion of the body on its spring.

    Args:
        run: the physics, its release angle that of the body.
        rig: gives frontal area and reference length.

    Returns:
        The slow motion; None for a rigid rod, and where the two oscillations are not `SEPARATION` apart or one
        of them does not oscillate.
    """
    twist = run.rod_twist
    if twist is None:
        return None
    upper, lower = (share * run.yaw_inertia for share in (twist.inertia_share, 1.0 - twist.inertia_share))
    flow = rig.body.flow(run.air_density, run.wind_speed)
    air = aerodynamic_stiffness(run.derivatives.cn_beta, **flow)
    air_damping = aerodynamic_damping(run.derivatives.cn_r, **flow)
    spring = run.spring_stiffness + run.parameters.get("gravity_stiffness", 0.0)
    loss, rod, rod_loss = run.mechanical_damping, 1.0 / twist.compliance, twist.damping(run.yaw_inertia)

    def lead_at(root: complex) -> complex:
        """The twist per angle of the upper end in an oscillation exp(root · t), from the balance of the body."""
        free = air + air_damping * root - lower * root**2
        return free / (rod + rod_loss * root - free)

    lead, root = 0j, 0j
    for _ in range(_MOST_ITERATIONS):
        previous = root
        # the whole rig's balance, its body moving 1 + lead times as far as the upper end
        root = _upper_root(
            upper + lower * (1.0 + lead), loss - air_damping * (1.0 + lead), spring - air * (1.0 + lead)
        )
        lead = lead_at(root)
        if abs(root - previous) <= _CONVERGED * abs(root):
            break
    else:
        return None
    if not root.imag > 0.0:
        return None
    # The four roots' sum and product give the other two.
    total = (loss + rod_loss) / upper + (rod_loss - air_damping) / lower
    product = (rod * (spring - air) - air * spring) / (upper * lower)
    fast = _upper_root(1.0, total + 2.0 * root.real, product / abs(root) ** 2)
    if not (fast.imag > 0.0 and abs(fast) > SEPARATION * abs(root)):
        return None
    end = spring_end_angle(run)
    parts = _parts((root, fast), (lead, lead_at(fast)), (end, run.release_rate, run.release_angle - end, 0.0))
    shape = (1.0 + lead.real) ** 2  # a moment on the body does work on its own angle
    strained = rod * lead.real**2
    inertia = (spring + strained - air * shape) / abs(root) ** 2
    if not inertia > 0.0:
        return None
    damping = -2.0 * root.real * inertia + air_damping * shape
    rigid = dataclasses.replace(
        run,
        rod_twist=None,
        yaw_inertia=inertia,
        mechanical_damping=damping,
        release_angle=parts[0].real,
        release_rate=(root * parts[0]).real,
    )
    return SlowMotion(rigid, lead.real, strained, run.release_angle, Ringing(parts[1], fast))


def _upper_root(inertia: complex, damping: complex, stiffness: complex) -> complex:
    """The root of inertia s² + damping s + stiffness with the larger imaginary part, 1/s."""
    half = damping / (2.0 * inertia)
    return -half + 1j * cmath.sqrt(stiffness / inertia - half * half)


def _parts(
    roots: tuple[complex, complex], leads: tuple[complex, complex], state: tuple[float, ...]
) -> tuple[complex, complex]:
    """Amplitudes of two oscillations that add up to an angle, its rate, a twist and its rate."""
    rows = [(1.0, 1.0), roots, leads, tuple(a * b for a, b in zip(roots, leads, strict=True))]
    matrix = [[part for value in row for part in (value.real, -value.imag)] for row in rows]
    found = np.linalg.solve(np.array(matrix), np.array(state)).tolist()
    return complex(found[0], found[1]), complex(found[2], found[3])
