"""What the paper's equations give as they are printed, where the truth is known."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log, pi, sqrt

from tunnel_lab.paper.network_study import paper_run_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.aero import aerodynamic_damping, aerodynamic_stiffness

LN2 = log(2.0)


@dataclass(frozen=True)
class Oscillation:
    """A damped oscillation.

    Args:
        omega_n: natural frequency, rad/s.
        rate: decay rate σ, 1/s.
    """

    omega_n: float
    rate: float

    @property
    def frequency(self) -> float:
        """Damped, Hz."""
        return sqrt(self.omega_n**2 - self.rate**2) / (2.0 * pi)

    @property
    def half_time(self) -> float:
        """Time to half amplitude, s."""
        return LN2 / self.rate if self.rate else inf


@dataclass(frozen=True)
class KnownRun:
    """A run whose truth is known, with the wind off and on.

    Args:
        inertia: Izz, kg m².
        stiffness_load: Ka over Cnβ, N m.
        damping_load: Ca over Cnr, N m s.
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
    """

    inertia: float
    stiffness_load: float
    damping_load: float
    cn_beta: float
    cn_r: float
    off: Oscillation
    on: Oscillation

    def cn_r_of(self, normalised: float) -> float:
        """Cnr of eq. 18, 1/rad, from N̂r in 1/s."""
        return normalised * self.inertia / self.damping_load

    def cn_beta_of(self, normalised: float) -> float:
        """Cnβ of eq. 17, 1/rad, from N̂β in 1/s²."""
        return normalised * self.inertia / self.stiffness_load


def known_run() -> KnownRun:
    """Spring 5 at 10 m/s with the paper's coefficients: the run that Table III may be of, an inference."""
    plan, rig = paper_run_plan(1), load_rig()
    truth, on = plan.truth, plan.conditions[1]
    air = rig.body.flow(rig.air.density, on.wind_speed)
    stiffness = float(on.spring_stiffness or 0.0)
    inertia, damping = truth.yaw_inertia, truth.mechanical_damping
    ka, ca = aerodynamic_stiffness(truth.cn_beta, **air), aerodynamic_damping(truth.cn_r, **air)
    return KnownRun(
        inertia, ka / truth.cn_beta, ca / truth.cn_r, truth.cn_beta, truth.cn_r,
        Oscillation(sqrt(stiffness / inertia), damping / (2.0 * inertia)),
        Oscillation(sqrt((stiffness - ka) / inertia), (damping - ca) / (2.0 * inertia)),
    )  # fmt: skip


def eq7(on: Oscillation, off: Oscillation) -> float:
    """N̂β as printed, 1/s²."""
    change = 4.0 * pi**2 * (on.frequency**2 - off.frequency**2)
    return -(change + LN2**2 * (on.half_time**-2 - off.half_time**-2))


def eq8(on: Oscillation, off: Oscillation, *, printed: bool) -> float:
    """N̂r, 1/s; as printed its first term is squared, which is not of that unit."""
    first = on.half_time**-2 if printed else 1.0 / on.half_time
    return -2.0 * LN2 * (first - 1.0 / off.half_time)


def printed_transfer_function(zeta: float, omega_n: float) -> Oscillation:
    """The oscillation of eqs 12 and 16 as printed, with ``2ζωn`` for ``2ζωn s``.

    Args:
        zeta: damping ratio.
        omega_n: natural frequency, rad/s.

    Returns:
        An oscillation without damping, because the denominator has no term in s. Its ωn² (1/s²) and 2ζωn (1/s) are
        added as numbers in SI.
    """
    return Oscillation(sqrt(omega_n**2 + 2.0 * zeta * omega_n), 0.0)
