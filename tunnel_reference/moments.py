"""The mechanical laws: friction, damping, springs and gravity.

Moments are in N m on the right-hand side of Izz β̈ = …; ``rows`` are the runs that a law applies to, ``p`` its
parameters by run. They act on the rod's upper end (θ); gravity acts on the body (β). The θ of springs and
of their loss is the deflection, which differs from it where the root of the spring moves.
"""

from __future__ import annotations

import numpy as np

from tunnel_reference.conditions import Array
from tunnel_reference.integrator import Params, Rows, Stage

# ---- friction: a law only gives the level; the integrator handles its sign and sticking


def coulomb_level(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc."""
    s.level[rows] += p["moment"]


def stribeck_level(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc (1 + b exp(−(θ̇/vs)²))."""
    s.level[rows] += p["moment"] * (1.0 + p["breakaway"] * np.exp(-((s.omega[rows] / p["speed"]) ** 2)))


def reid_level(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """(π/2) η Kr |θ|: Reid's loss, πηKrA² per cycle at any frequency."""
    s.level[rows] += (np.pi / 2) * p["loss"] * s.stiffness[rows] * np.abs(s.deflection[rows])


def scraping_level(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """T exp(−((θ − θs)/w)²): rubbing near one angle only."""
    s.level[rows] += p["moment"] * np.exp(-(((s.theta[rows] - p["place"]) / p["width"]) ** 2))


# ---- damping


def tanh_friction(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Tc tanh(θ̇/v0)."""
    s.top[rows] -= p["moment"] * np.tanh(s.omega[rows] / p["speed"])


def dahl_friction(s: Stage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """−Tc z/zs with ż = θ̇ − |θ̇| z/zs: presliding over zs."""
    omega = s.omega[rows]
    s.top[rows] -= p["moment"] * x[0] / p["slide"]
    dx[0] = omega - np.abs(omega) * x[0] / p["slide"]


def power_damping(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−C |θ̇|^(n−1) θ̇."""
    omega = s.omega[rows]
    s.top[rows] -= p["coefficient"] * np.abs(omega) ** (p["exponent"] - 1.0) * omega


def quadratic_damping(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−C2 |θ̇| θ̇."""
    omega = s.omega[rows]
    s.top[rows] -= p["coefficient"] * np.abs(omega) * omega


def mixed_quadratic_damping(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−C2 (|θ̇| θ̇ + m θ̇³)."""
    omega = s.omega[rows]
    s.top[rows] -= p["coefficient"] * (np.abs(omega) + p["cubic"] * omega * omega) * omega


def viscous(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c θ̇, with c given by run."""
    s.top[rows] -= p["coefficient"] * s.omega[rows]


def maxwell_elements(s: Stage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """−Σ E (θ − zi) with τi żi = θ − zi, without its elastic part at ωn."""
    theta = s.deflection[rows]
    dx[:] = (theta - x) / p["times"].T
    s.top[rows] -= p["modulus"] * (theta - x).sum(axis=0) - p["static"] * theta


# ---- stiffness


def polynomial_spring(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kr (k2 θ² + k3 θ³ + k4 θ⁴ + k5 θ⁵)."""
    t = s.deflection[rows]
    s.top[rows] -= s.stiffness[rows] * t * t * (p["k2"] + t * (p["k3"] + t * (p["k4"] + t * p["k5"])))


def tanh_spring(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−sgn(κ) Kr (θ − b tanh(θ/b)) with b = 1/√(3|κ|): κ θ³ at small angles, saturating at large ones."""
    t = s.deflection[rows]
    bend = 1.0 / np.sqrt(3.0 * np.abs(p["kappa"]))
    s.top[rows] -= np.sign(p["kappa"]) * s.stiffness[rows] * (t - bend * np.tanh(t / bend))


def sine_spring(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Kr (θ − sin(kθ)/k) with k = √(6|κ|): softening, −κ Kr θ³ with κ < 0 at small angles."""
    t = s.deflection[rows]
    k = np.sqrt(6.0 * np.abs(p["kappa"]))
    s.top[rows] += s.stiffness[rows] * (t - np.sin(k * t) / k)


def bilinear_spring(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kr e |θ|/2: stiffer on one side by e."""
    s.top[rows] -= 0.5 * s.stiffness[rows] * p["difference"] * np.abs(s.deflection[rows])


def dead_zone(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """The spring acts on θ − (1 − r) clip(θ − c, ±δ): a gap at c in which a share r of the stiffness remains."""
    t = s.deflection[rows]
    half = p["half"]
    s.spring_angle[rows] -= (1.0 - p["left"]) * np.clip(t - p["centre"], -half, half)


def soft_dead_zone(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """A dead zone ±δ whose edges are rounded over w = edge·δ (difference of two soft-plus functions)."""
    t = s.deflection[rows]
    width = p["edge"] * p["half"]
    up = np.logaddexp(0.0, (t - p["half"]) / width)
    down = np.logaddexp(0.0, (-t - p["half"]) / width)
    s.spring_angle[rows] = width * (up - down)


def tanh_dead_zone(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """The spring acts on θ − δ tanh(θ/δ)."""
    s.spring_angle[rows] -= p["half"] * np.tanh(s.deflection[rows] / p["half"])


def gravity(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kg (sin(β − βg) + q sin 2(β − βg)/2)."""
    t = s.beta[rows] - p["angle"]
    s.body[rows] -= p["stiffness"] * (np.sin(t) + 0.5 * p["second"] * np.sin(2.0 * t))


def detent(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+M (θ/w) exp(½ − θ²/2w²): a magnetic detent about zero (M < 0 holds, M > 0 repels)."""
    t = s.theta[rows] / p["width"]
    s.top[rows] += p["moment"] * t * np.exp(0.5 - 0.5 * t * t)


def creep(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+Kr c (1 − exp(−t/τ)) θ: the spring softens in every run."""
    s.top[rows] += s.stiffness[rows] * p["share"] * (1.0 - np.exp(-s.time / p["time"])) * s.deflection[rows]


def breathing(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kr e sin(2πft + φ) θ: stiffness that varies with time."""
    wave = np.sin(2.0 * np.pi * p["frequency"] * s.time + p["phase"])
    s.top[rows] -= s.stiffness[rows] * p["share"] * wave * s.deflection[rows]


def moving_mass(s: Stage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Inertia Izz (1 + e sin²(πft)): divides the moments so far by 1 + e sin²(πft), and adds −İ θ̇."""
    arg = np.pi * p["frequency"] * s.time
    growth = 1.0 + p["share"] * np.sin(arg) ** 2
    rate = p["share"] * p["inertia"] * np.pi * p["frequency"] * np.sin(2.0 * arg)
    s.top[rows] = (s.top[rows] - rate * s.omega[rows]) / growth
    s.body[rows] /= growth
