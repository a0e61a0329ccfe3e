"""The information that a run gives about Cnβ and Cnr, sample by sample.

The reading of a run is y = β(t; p) + zero + noise of variance σ². With the sensitivities s = ∂y/∂p of the
nominal model, the Fisher information of all unknowns is

    J = P⁻¹ + Σ s sᵀ/σ²,

where P is the prior covariance and the sum runs over the samples so far. The unknowns are Izz, Cr, the angle and
rate at the release, the sensor's zero, Cnβ and Cnr. Eliminating the first five gives the Schur complement S;
½ log det S, in nats, measures the information about (Cnβ, Cnr). Its increase over a step is the reward of the step
and cannot be negative. Source: S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory (1993),
ch. 3; ½ log det as a measure of an experiment: D. V. Lindley, Ann. Math. Stat. 27 (1956) 986, doi
10.1214/aoms/1177728069.

Many runs are processed at once; the numbers of a run do not depend on how many there are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import isfinite

import numpy as np

from tunnel_sim.envs.errors import EnvError
from tunnel_sim.envs.sensitivity import NominalRun, Sensitivities
from tunnel_sim.vocabulary.errors import did_you_mean
from tunnel_sim.vocabulary.record import Array

UNKNOWNS = (
    "yaw_inertia", "mechanical_damping", "release_angle", "release_rate", "sensor_zero", "cn_beta", "cn_r",
)  # fmt: skip
"""The order of rows and columns of the information matrix; the first five are eliminated."""


@dataclass(frozen=True)
class Prior:
    """What is known before the run, as standard deviations; 0: known exactly.

    Args:
        yaw_inertia: as a share of Izz, dimensionless; known from wind-off runs with the spring.
        mechanical_damping: as a share of Cr, dimensionless; known from the same runs.
        release_angle: rad.
        release_rate: rad/s.
        sensor_zero: rad.
        cn_beta: 1/rad, above 0.
        cn_r: 1/rad, above 0.
    """

    yaw_inertia: float = 1e-4
    mechanical_damping: float = 1e-3
    release_angle: float = 0.01
    release_rate: float = 0.02
    sensor_zero: float = 0.01
    cn_beta: float = 0.5
    cn_r: float = 0.5

    @staticmethod
    def changed(changes: Mapping[str, float]) -> Prior:
        """The prior with some of its numbers changed.

        Args:
            changes: standard deviations by name, in the units above.

        Raises:
            EnvError: when a name is unknown or a number out of range.
        """
        known = [item.name for item in fields(Prior)]
        for name, value in changes.items():
            if name not in known:
                raise EnvError(f"unknown prior {name!r}", where="prior", remedy=did_you_mean(name, known))
            least = 0.0 if name not in ("cn_beta", "cn_r") else 1e-300
            if not isinstance(value, int | float) or not isfinite(value) or value < least:
                raise EnvError(
                    f"{name} = {value!r} is not a standard deviation",
                    where="prior",
                    remedy="give it, SI units",
                )
        return replace(Prior(), **changes)

    def scales(self, run: NominalRun) -> Array:
        """The standard deviations in the units of the unknowns.

        Returns:
            Shape (7,), in the order of `UNKNOWNS`.
        """
        own = {"yaw_inertia": run.yaw_inertia, "mechanical_damping": abs(run.mechanical_damping)}
        return np.array([getattr(self, name) * own.get(name, 1.0) for name in UNKNOWNS])


class Information:
    """The Fisher information of many runs in progress; ``row`` is the index of a run.

    Args:
        samples: number of samples in one step.
        interval: between samples, s.
        variance: of a reading, rad².
        prior: what is known before a run.
    """

    def __init__(self, count: int, samples: int, interval: float, variance: float, prior: Prior) -> None:
        self._prior = prior
        self._variance = variance
        size = len(UNKNOWNS)
        self._sensitivities = Sensitivities(count, samples, interval)
        self._scale = np.ones((count, size))  # the matrices use the prior standard deviations as units
        self.scaled = np.tile(np.eye(size), (count, 1, 1))
        self.known = np.zeros(count)

    def start(self, row: int, run: NominalRun) -> None:
        """Start a run."""
        self._sensitivities.start(row, run)
        self._scale[row] = self._prior.scales(run)
        self.scaled[row] = np.eye(len(UNKNOWNS))
        self.known[row] = 0.0

    def advance(self, angle: Array, rate: Array, wind_speed: Array, moment: Array) -> Array:
        """Add the samples of one step.

        Args:
            angle: at the samples and at the end of the step, shape (runs, samples + 1), rad.
            rate: at the same times, shape (runs, samples + 1), rad/s.
            wind_speed: mean over the step, shape (runs,), m/s.
            moment: applied by the operator, shape (runs,), N m.

        Returns:
            The information gained about (Cnβ, Cnr), shape (runs,), nats.
        """
        of_reading = self._sensitivities.advance(angle, rate, wind_speed, moment)  # (runs, 7, samples)
        of_reading *= self._scale[:, :, None]
        self.scaled += np.matmul(of_reading, of_reading.transpose(0, 2, 1)) / self._variance
        before, self.known = self.known, half_log_det(self.scaled)
        return np.maximum(self.known - before, 0.0)

    def matrix(self, row: int) -> Array:
        """The Fisher information of one run, including its prior.

        Returns:
            Shape (7, 7), in the order of `UNKNOWNS` and in the inverse products of their units; infinite where
            the prior is exact.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.scaled[row] / np.outer(self._scale[row], self._scale[row]))

    def snapshot(self, row: int) -> dict[str, Array]:
        """Copies of the state of a run in progress."""
        own = {"scale": self._scale[row], "scaled": self.scaled[row], "known": self.known[row]}
        return {name: np.array(value) for name, value in own.items()} | self._sensitivities.snapshot(row)

    def restore(self, row: int, run: NominalRun, state: Mapping[str, Array]) -> None:
        """Restore a run from a snapshot."""
        self._sensitivities.restore(row, run, state)
        self._scale[row], self.scaled[row], self.known[row] = (
            state["scale"],
            state["scaled"],
            state["known"],
        )


def half_log_det(information: Array) -> Array:
    """½ log det of the information about the last two unknowns, with all others eliminated.

    Args:
        information: positive definite, shape (n, m, m).

    Returns:
        Shape (n,), nats.
    """
    rest = information
    for _ in range(information.shape[-1] - 2):
        column = rest[:, 1:, 0]
        rest = rest[:, 1:, 1:] - column[:, :, None] * (column / rest[:, 0, 0, None])[:, None, :]
    determinant = rest[:, 0, 0] * rest[:, 1, 1] - rest[:, 0, 1] * rest[:, 1, 0]
    return np.asarray(0.5 * np.log(determinant))
