"""The laws of mechanics (friction, damping, springs, gravity), of the air and of forcing.

Moments are in N m on the right-hand side of Izz β̈ = …; ``rows`` are the runs that a law applies to, ``p`` its
parameters by run. Moments of the rig act on the rod's upper end (θ); gravity and the air act on the body (β). The θ
of springs and of their loss is the deflection, which differs from it where the root of the spring moves.
"""

from __future__ import annotations

import numpy as np

from tunnel_reference.integrator import Params, Rows, RungeKuttaStage
from tunnel_reference.true_conditions import WIDTH, Array, TrueConditions

# ---- friction: a law only gives the level; the integrator handles its sign and sticking


def coulomb_level(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc."""
    s.level[rows] += p["moment"]


def stribeck_level(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc (1 + b exp(−(θ̇/vs)²))."""
    s.level[rows] += p["moment"] * (1.0 + p["breakaway"] * np.exp(-((s.omega[rows] / p["speed"]) ** 2)))


def sublinear_level(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc |θ̇/(1 rad/s)|^n with n < 1."""
    s.level[rows] += p["moment"] * np.abs(s.omega[rows]) ** p["exponent"]


def loaded_level(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Tc + μ times the greater of the moments of gravity and of the input."""
    s.level[rows] += p["moment"] + p["share"] * np.maximum(np.abs(s.hung[rows]), np.abs(s.driven[rows]))


def reid_level(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """(π/2) η Kr |θ|: Reid's loss, πηKrA² per cycle at any frequency."""
    s.level[rows] += (np.pi / 2) * p["loss"] * s.stiffness[rows] * np.abs(s.deflection[rows])


def scraping_level(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """T exp(−((θ − θs)/w)²): rubbing near one angle only."""
    s.level[rows] += p["moment"] * np.exp(-(((s.theta[rows] - p["place"]) / p["width"]) ** 2))


# ---- damping


def tanh_friction(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Tc tanh(θ̇/v0)."""
    s.top[rows] -= p["moment"] * np.tanh(s.omega[rows] / p["speed"])


def dahl_friction(s: RungeKuttaStage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """−Tc z/zs with ż = θ̇ − |θ̇| z/zs: presliding over zs."""
    omega = s.omega[rows]
    s.top[rows] -= p["moment"] * x[0] / p["slide"]
    dx[0] = omega - np.abs(omega) * x[0] / p["slide"]


def power_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−C |θ̇|^(n−1) θ̇."""
    omega = s.omega[rows]
    s.top[rows] -= p["coefficient"] * np.abs(omega) ** (p["exponent"] - 1.0) * omega


def quadratic_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−C2 |θ̇| θ̇."""
    omega = s.omega[rows]
    s.top[rows] -= p["coefficient"] * np.abs(omega) * omega


def mixed_quadratic_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−C2 (|θ̇| θ̇ + m θ̇³)."""
    omega = s.omega[rows]
    s.top[rows] -= p["coefficient"] * (np.abs(omega) + p["cubic"] * omega * omega) * omega


def viscous(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−c θ̇, with c given by run."""
    s.top[rows] -= p["coefficient"] * s.omega[rows]


def maxwell_elements(s: RungeKuttaStage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """−Σ E (θ − zi) with τi żi = θ − zi, without its elastic part at ωn."""
    theta = s.deflection[rows]
    dx[:] = (theta - x) / p["times"].T
    s.top[rows] -= p["modulus"] * (theta - x).sum(axis=0) - p["static"] * theta


# ---- stiffness


def polynomial_spring(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kr (k2 θ² + k3 θ³ + k4 θ⁴ + k5 θ⁵)."""
    t = s.deflection[rows]
    s.top[rows] -= s.stiffness[rows] * t * t * (p["k2"] + t * (p["k3"] + t * (p["k4"] + t * p["k5"])))


def tanh_spring(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−sgn(κ) Kr (θ − b tanh(θ/b)) with b = 1/√(3|κ|): κ θ³ at small angles, saturating at large ones."""
    t = s.deflection[rows]
    bend = 1.0 / np.sqrt(3.0 * np.abs(p["kappa"]))
    s.top[rows] -= np.sign(p["kappa"]) * s.stiffness[rows] * (t - bend * np.tanh(t / bend))


def sine_spring(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Kr (θ − sin(kθ)/k) with k = √(6|κ|): softening, −κ Kr θ³ with κ < 0 at small angles."""
    t = s.deflection[rows]
    k = np.sqrt(6.0 * np.abs(p["kappa"]))
    s.top[rows] += s.stiffness[rows] * (t - np.sin(k * t) / k)


def bilinear_spring(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kr e |θ|/2: stiffer on one side by e."""
    s.top[rows] -= 0.5 * s.stiffness[rows] * p["difference"] * np.abs(s.deflection[rows])


def dead_zone(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """The spring acts on θ − (1 − r) clip(θ − c, ±δ): a gap at c in which a share r of the stiffness remains."""
    t = s.deflection[rows]
    half = p["half"]
    s.spring_angle[rows] -= (1.0 - p["left"]) * np.clip(t - p["centre"], -half, half)


def soft_dead_zone(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """A dead zone ±δ whose edges are rounded over w = edge·δ (difference of two soft-plus functions)."""
    t = s.deflection[rows]
    width = p["edge"] * p["half"]
    up = np.logaddexp(0.0, (t - p["half"]) / width)
    down = np.logaddexp(0.0, (-t - p["half"]) / width)
    s.spring_angle[rows] = width * (up - down)


def tanh_dead_zone(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """The spring acts on θ − δ tanh(θ/δ)."""
    s.spring_angle[rows] -= p["half"] * np.tanh(s.deflection[rows] / p["half"])


def gravity(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kg (sin(β − βg) + q sin 2(β − βg)/2)."""
    t = s.beta[rows] - p["angle"]
    moment = -p["stiffness"] * (np.sin(t) + 0.5 * p["second"] * np.sin(2.0 * t))
    s.body[rows] += moment
    s.hung[rows] += moment


def detent(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+M (θ/w) exp(½ − θ²/2w²): a magnetic detent about zero (M < 0 holds, M > 0 repels)."""
    t = s.theta[rows] / p["width"]
    s.top[rows] += p["moment"] * t * np.exp(0.5 - 0.5 * t * t)


def creep(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+Kr c (1 − exp(−t/τ)) θ: the spring softens in every run."""
    s.top[rows] += s.stiffness[rows] * p["share"] * (1.0 - np.exp(-s.time / p["time"])) * s.deflection[rows]


def breathing(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """−Kr e sin(2πft + φ) θ: stiffness that varies with time."""
    wave = np.sin(2.0 * np.pi * p["frequency"] * s.time + p["phase"])
    s.top[rows] -= s.stiffness[rows] * p["share"] * wave * s.deflection[rows]


def moving_mass(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Inertia Izz (1 + e sin²(πft)): divides the moments so far by 1 + e sin²(πft), and adds −İ θ̇."""
    arg = np.pi * p["frequency"] * s.time
    growth = 1.0 + p["share"] * np.sin(arg) ** 2
    rate = p["share"] * p["inertia"] * np.pi * p["frequency"] * np.sin(2.0 * arg)
    s.top[rows] = (s.top[rows] - rate * s.omega[rows]) / growth
    s.body[rows] /= growth


# ---- the air and forcing: speed, angle and moments on the body, and random moments in time

RATE = 1000.0


def _length(conditions: TrueConditions) -> int:
    """Number of points in a series that covers a run."""
    return round(conditions.duration * RATE) + 2


def turbulence(kind: str, conditions: TrueConditions, *, seed: int, scale: float) -> Array:
    """Series of unit variance for every run (zero with the wind off), shape (runs, n).

    Args:
        kind: ``band`` (flat up to ``scale`` Hz), ``dryden`` or ``von_karman`` (integral length ``scale`` m),
            ``octave`` (a band of one octave about ``scale`` Hz).
        conditions: speeds and duration.
        scale: frequency, Hz, or length, m, depending on ``kind``.
    """
    n = 2 ** int(np.ceil(np.log2(_length(conditions))))
    frequency = np.fft.rfftfreq(n, 1.0 / RATE)
    rng = np.random.default_rng(seed)
    out = np.zeros((conditions.runs, n))
    for run in np.flatnonzero(conditions.wind_on):
        reduced = frequency * scale / conditions.wind_speed[run]
        if kind == "band":
            power = (frequency < scale).astype(np.float64)
        elif kind == "octave":
            power = ((frequency > scale / 1.414) & (frequency < scale * 1.414)).astype(np.float64)
        elif kind == "dryden":
            power = 1.0 / (1.0 + (2.0 * np.pi * reduced) ** 2)
        else:
            power = 1.0 / (1.0 + 70.8 * reduced**2) ** (5.0 / 6.0)
        out[run] = with_spectrum(power, rng)
    return out[:, : _length(conditions)]


def with_spectrum(power: Array, rng: np.random.Generator) -> Array:
    """A random series of unit variance without a mean, shape (2 (n − 1),).

    Args:
        power: relative, at the frequencies from zero to half the sample rate, shape (n,), dimensionless.
        rng: of its phases and amplitudes.
    """
    n = 2 * (power.size - 1)
    spectrum = np.sqrt(power) * (rng.standard_normal(power.size) + 1j * rng.standard_normal(power.size))
    spectrum[0] = 0.0
    series = np.fft.irfft(spectrum, n)
    return np.asarray(series / (np.sqrt(2.0 * np.sum(power[1:]) * 2.0) / n))


def shaking(kind: str, conditions: TrueConditions, *, seed: int, scale: float, ratio: float) -> Array:
    """Series of about unit variance for every run, whether the wind is on or off, shape (runs, n).

    Args:
        kind: ``flat`` (up to ``scale`` Hz), ``corner`` (falling from ``scale`` Hz on, as of a draught), ``floor``
            (the acceleration of a floor of ``scale`` Hz and damping ratio ``ratio`` under a white force),
            ``octave`` (about ``scale`` Hz), ``traffic`` (flat, swelling and fading by ``ratio`` in some seconds).
        conditions: number of runs and duration.
        scale: frequency, Hz.
        ratio: damping ratio or modulation, depending on ``kind``, dimensionless.
    """
    n = 2 ** int(np.ceil(np.log2(_length(conditions))))
    frequency = np.fft.rfftfreq(n, 1.0 / RATE)
    place = frequency / scale
    power = {
        "corner": 1.0 / (1.0 + place**2),
        "floor": place**4
        / ((1.0 - place**2) ** 2 + (2.0 * ratio * place) ** 2)
        / (1.0 + (frequency / 50.0) ** 4),
        "octave": ((place > 0.707) & (place < 1.414)).astype(np.float64),
    }.get(kind, (frequency < scale).astype(np.float64))
    rng = np.random.default_rng(seed)
    series = np.stack([with_spectrum(power, rng) for _ in range(conditions.runs)])
    if kind == "traffic":
        slow = (frequency < max(0.3, 1.5 * frequency[1])).astype(np.float64)
        series *= np.exp(ratio * np.stack([with_spectrum(slow, rng) for _ in range(conditions.runs)]))
    return np.asarray(series[:, : _length(conditions)])


def wandering_vortex(conditions: TrueConditions, *, seed: int, strouhal: float, wander: float) -> Array:
    """The sine of a phase that advances at St V/width, with a random walk of ``wander`` rad/√s; shape (runs, n)."""
    rng = np.random.default_rng(seed)
    n = _length(conditions)
    frequency = strouhal * conditions.true_speed[:, None] / WIDTH
    walk = np.cumsum(rng.standard_normal((conditions.runs, n)), axis=1) * wander / np.sqrt(RATE)
    start = rng.uniform(0.0, 2.0 * np.pi, (conditions.runs, 1))
    wave = np.sin(2.0 * np.pi * frequency * np.arange(n) / RATE + start + walk)
    return np.asarray(wave * conditions.wind_on[:, None])


def speed_drift(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """V(t)/V = 1 + d g(t), g rising from 0 to 1 over the run as t^n/T^n."""
    s.speed_ratio[rows] *= 1.0 + p["drift"] * np.minimum(s.time / p["span"], 1.0) ** p["exponent"]


def speed_settling(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """V(t)/V = 1 + d (1 − e^(−t/τ))/(1 − e^(−T/τ))."""
    rise = (1.0 - np.exp(-s.time / p["time"])) / (1.0 - np.exp(-p["span"] / p["time"]))
    s.speed_ratio[rows] *= 1.0 + p["drift"] * rise


def gust(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """V(t)/V = 1 + g exp(−((t − t0)/w)²): one slow gust, in the runs where g is not zero."""
    s.speed_ratio[rows] *= 1.0 + p["size"] * np.exp(-(((s.time - p["when"]) / p["width"]) ** 2))


def lag(s: RungeKuttaStage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """Ka acts on (1 − w1 − w2) β + w1 x1 + w2 x2 with τi ẋi = β − xi."""
    beta = s.beta[rows]
    deficiency = p["w1"] * (beta - x[0]) + p["w2"] * (beta - x[1])
    s.air_angle[rows] -= deficiency
    dx[0] = (beta - x[0]) / p["tau1"]
    dx[1] = (beta - x[1]) / p["tau2"]


def lag_one(s: RungeKuttaStage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """Ka acts on β − w (β − x) with τ ẋ = β − x; w = 1 is a lag, w = −1 a lead with the same time constant."""
    gap = s.beta[rows] - x[0]
    s.air_angle[rows] -= p["w1"] * gap
    dx[0] = gap / p["tau1"]


def lag_cascade(s: RungeKuttaStage, rows: Rows, p: Params, x: Array, dx: Array) -> None:
    """Ka acts on x2 with τ/2 ẋ1 = β − x1, τ/2 ẋ2 = x1 − x2: two lags in series."""
    beta = s.beta[rows]
    s.air_angle[rows] += x[1] - beta
    dx[0] = 2.0 * (beta - x[0]) / p["tau1"]
    dx[1] = 2.0 * (x[0] - x[1]) / p["tau1"]


def _pressure_stiffness(s: RungeKuttaStage, rows: Rows) -> Array:
    """Ka at the present speed."""
    return s.air_stiffness[rows] * s.speed_ratio[rows] ** 2


def cubic_air(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Adds Ka (κ β³ + q β⁵)."""
    a = s.air_angle[rows]
    s.body[rows] += _pressure_stiffness(s, rows) * a**3 * (p["kappa"] + p["quintic"] * a * a)


def saturating_air(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Ka β/(1 + k|β|) instead of Ka β; for k < 0 the moment grows faster than linearly."""
    a = s.air_angle[rows]
    s.body[rows] += _pressure_stiffness(s, rows) * (a / (1.0 + p["k"] * np.abs(a)) - a)


def sine_air(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Ka sin(kβ)/k instead of Ka β, k = √(6|κ|)."""
    a = s.air_angle[rows]
    k = np.sqrt(6.0 * np.abs(p["kappa"]))
    s.body[rows] += _pressure_stiffness(s, rows) * (np.sin(k * a) / k - a)


def tangent_air(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Ka arctan(kβ)/k instead of Ka β, k = √(3|κ|); for κ > 0 mirrored: 2β − arctan(kβ)/k."""
    a = s.air_angle[rows]
    k = np.sqrt(3.0 * np.abs(p["kappa"]))
    s.body[rows] += np.sign(p["kappa"]) * _pressure_stiffness(s, rows) * (a - np.arctan(k * a) / k)


def nonlinear_air_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Adds Ca μ β² β̇."""
    s.body[rows] += s.speed_ratio[rows] * s.air_damping[rows] * p["mu"] * s.beta[rows] ** 2 * s.rate[rows]


def absolute_air_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Adds Ca m |β| β̇."""
    s.body[rows] += s.speed_ratio[rows] * s.air_damping[rows] * p["mu"] * np.abs(s.beta[rows]) * s.rate[rows]


def saturating_air_damping(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """Adds Ca μ β²/(1 + (β/b)²) β̇."""
    square = s.beta[rows] ** 2
    shape = p["mu"] * square / (1.0 + square / p["bend"] ** 2)
    s.body[rows] += s.speed_ratio[rows] * s.air_damping[rows] * shape * s.rate[rows]


def steady_moment(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """A steady moment times (V(t)/V)²."""
    s.body[rows] += p["moment"] * s.speed_ratio[rows] ** 2


# ---- forcing


def tabled_moment(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """A moment given at 1 kHz, shape (runs, n), linear in between."""
    table = p["table"]
    place = s.time * RATE + 1e-9
    k = int(place)
    if k >= table.shape[1] - 1:
        s.body[rows] += table[:, -1]
        return
    part = place - k
    s.body[rows] += (1.0 - part) * table[:, k] + part * table[:, k + 1]


def harmonic_moment(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+M (sin(2πft + φ) + h sin(4πft + 2φ))."""
    arg = 2.0 * np.pi * p["frequency"] * s.time + p["phase"]
    s.body[rows] += p["moment"] * (np.sin(arg) + p["second"] * np.sin(2.0 * arg))


def bump(s: RungeKuttaStage, rows: Rows, p: Params, _x: Array, _dx: Array) -> None:
    """+J/(w√π) exp(−((t − t0)/w)²): a pulse of impulse J about t0."""
    shape = np.exp(-(((s.time - p["when"]) / p["width"]) ** 2)) / (p["width"] * np.sqrt(np.pi))
    s.body[rows] += p["impulse"] * shape
