"""Errors of the networks in white noise against the Cramér–Rao bound, for the tutorial on the paper's networks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.stats import chi2

from identification import identify
from identification.show.quantity import Quantity
from identification.signal.free_decay import Decay, free_decay
from identification.uncertainty.cramer_rao import damped_sinusoid_bound
from tunnel_lab.paper.networks import METHODS, NETWORK
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record


@dataclass(frozen=True)
class Ratio:
    """A root mean square error over the Cramér–Rao bound.

    Args:
        value: the ratio.
        low: lower end of its 95 % interval, ratio.
        high: upper end of its 95 % interval, ratio.
    """

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """Value and interval."""
        return f"{self.value:.2g} ({self.low:.2g}-{self.high:.2g})"


def ratio_of(errors: Array, bound: float) -> Ratio:
    """RMS over a bound, with the interval of a normal error's variance.

    Args:
        errors: errors, shape (n,).
        bound: standard deviation, in the errors' unit.
    """
    value, count = float(np.sqrt(np.mean(errors**2))) / bound, errors.size
    low, high = np.sqrt(count / chi2.ppf([0.975, 0.025], count))
    return Ratio(value, value * float(low), value * float(high))


@dataclass(frozen=True)
class NoiseRow:
    """Errors of ζ in white noise at one damping ratio.

    Args:
        zeta: true damping ratio.
        window: error of the networks on the first three cycles, over the bound of these cycles.
        runs: error by method on the whole record, over the bound of the whole record; None if any fit fails.
        coverage: share of the networks' 95 % intervals that contain the truth, ratio.
    """

    zeta: float
    window: Ratio
    runs: Mapping[str, Ratio | None]
    coverage: float


def noise_row(
    zeta: float,
    rng: np.random.Generator,
    *,
    omega_n: float = 12.5,
    noise: float = 5e-4,
    trials: int = 40,
    duration: float = 10.0,
) -> NoiseRow:
    """Identify closed-form releases from 20° at 1 kHz in white noise.

    Args:
        zeta: damping ratio.
        omega_n: natural frequency, rad/s.
        noise: standard deviation, rad.
        duration: duration of a record, s.
    """
    time, angle = np.arange(round(1000.0 * duration)) / 1000.0, float(np.radians(20.0))
    clean = free_decay(time, Decay.from_modal(omega_n, zeta), angle, 0.0)
    found: dict[str, list[Quantity]] = {method: [] for method in METHODS}
    first: list[Quantity] = []
    for _ in range(trials):
        run = Run("r", Record(time, clean + noise * rng.standard_normal(time.size)), 0.0)
        campaign = Campaign("noise", RigProperties(), SensorProperties(1000.0, None, noise), (run,))
        for method in METHODS:
            (estimate,) = identify(campaign, method, throw=False).runs
            if estimate.zeta is not None:
                found[method].append(estimate.zeta)
            if method == NETWORK and estimate.windows:
                first.append(estimate.windows[0].zeta)
    root = float(np.sqrt(1.0 - zeta**2))
    bound = partial(
        damped_sinusoid_bound, frequency=omega_n * root / (2.0 * np.pi), zeta=zeta, noise_std=noise
    )
    lag = -float(np.arctan2(zeta, root))
    whole = bound(time, amplitude=angle / root, phase=lag).zeta
    # Three cycles after the first zero crossing.
    crossing = (0.5 * np.pi - lag) / (omega_n * root)
    size = angle / root * float(np.exp(-zeta * omega_n * crossing))
    t3 = 6.0 * np.pi / (omega_n * root)
    three = bound(time[time < t3], amplitude=size, phase=-0.5 * np.pi).zeta
    own = found[NETWORK]
    errors = {method: np.array([one.value - zeta for one in values]) for method, values in found.items()}
    return NoiseRow(
        zeta=zeta,
        window=ratio_of(np.array([one.value - zeta for one in first]), three),
        runs={m: ratio_of(e, whole) if e.size == trials else None for m, e in errors.items()},
        coverage=float(np.mean([abs(one.value - zeta) < 1.96 * one.known_std for one in own])),
    )
