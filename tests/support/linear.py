"""Campaigns of a displacement, integrated by SciPy: the independent source of truth of a linear freedom."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from tunnel_sim.vocabulary.campaign import Campaign, Quantity, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

FORBIDDEN = (
    r"(?<![\w])m?rad(?![a-z]{2})|°|N m\b|[Aa]ngle|[Aa]ngular|\b[Yy]aw|Cn|cn_|Izz|[Ii]nertia|[Tt]orque|\b[Ww]ind\b|"
    r"β|\b[Dd]egrees\b|\bKr\b|\bCr\b"
)
"""What no text about a displacement contains: units, words and symbols of an angle or of the air."""

Force = Callable[[float, float, float], float]
"""The force beside spring and damper, N, of displacement (m), velocity (m/s) and the spring's stiffness (N/m)."""


def no_force(x: float, v: float, k: float) -> float:
    """None."""
    del x, v, k
    return 0.0


def linear_campaign(
    mass: float,
    frequencies: Sequence[float],
    releases: Sequence[float],
    force: Force = no_force,
    *,
    zeta: float = 0.005,
    quantity: Quantity = "angle",
    noise: float = 1e-3,
    cycles: int = 15,
) -> Campaign:
    """A mass that is released on springs.

    Args:
        mass: kg.
        frequencies: of the springs with this mass, Hz.
        releases: displacements, m.
        zeta: damping ratio on the first spring.
        noise: standard deviation over the greatest reading.
    """
    rng, runs = np.random.default_rng(3), []
    damping = 2.0 * zeta * mass * 2.0 * np.pi * frequencies[0]
    for frequency in frequencies:
        k = mass * (2.0 * np.pi * frequency) ** 2
        time = np.arange(40 * cycles) / (40.0 * frequency)

        def slope(_: float, state: np.ndarray, k: float = k) -> list[float]:
            x, v = state
            return [v, (force(x, v, k) - damping * v - k * x) / mass]

        for release in releases:
            ends = (0.0, float(time[-1]))
            found = solve_ivp(
                slope, ends, [release, 0.0], t_eval=time, method="LSODA", rtol=1e-9, atol=1e-12 * release
            )
            acceleration = np.array([slope(0.0, state)[1] for state in found.y.T])
            reading = {"angle": found.y[0], "rate": found.y[1], "acceleration": acceleration}[quantity]
            reading = reading + noise * np.abs(reading).max() * rng.standard_normal(reading.size)
            runs.append(Run(f"r{len(runs) + 1:02d}", Record(time, reading), 0.0, spring_stiffness=k))
    sensor = SensorProperties(motion="displacement", quantity=None if quantity == "angle" else quantity)
    return Campaign("mass on a spring", RigProperties(yaw_inertia=mass), sensor, tuple(runs))
