"""The trained pair of networks: from a shape and t3 to ζ and ωn, with errors and training range."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from identification.neural.network import Network
from identification.neural.shape import cycles_time, network_inputs
from identification.neural.training_set import DataSpec, held_out_points
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class Errors:
    """The errors of the networks over their range, noise-free.

    Args:
        zeta: largest absolute error of ζ, (1).
        zeta_rms: root mean square of it, (1).
        zeta_relative: largest error of ζ over ζ, ratio.
        omega_relative: largest error of ωn over ωn, ratio.
        omega_relative_rms: root mean square of it, ratio.
    """

    zeta: float
    zeta_rms: float
    zeta_relative: float
    omega_relative: float
    omega_relative_rms: float

    @classmethod
    def from_json_dict(cls, data: dict[str, Any]) -> Errors:
        """From the fields by name; raises ValueError or TypeError for a malformed document."""
        if not all(isinstance(value, float | int) and isfinite(value) for value in data.values()):
            raise ValueError("an error that is not a finite number")
        return cls(**data)


@dataclass(frozen=True, eq=False)
class Networks:
    """Both networks.

    Args:
        damping: 100-5-5-1, shape to ζ.
        frequency: 2-2-5-1, ζ and t3 to ωn.
    """

    damping: Network
    frequency: Network
    spec: DataSpec
    errors: Errors

    def zeta(self, inputs: Array) -> Array:
        """ζ of normalised shapes, shape (n, 100): shape (n,)."""
        return self.damping.value(inputs)

    def omega_n(self, zeta: Array, t3: Array) -> Array:
        """ωn in rad/s.

        Args:
            zeta: shape (n,).
            t3: time of three damped cycles, s, shape (n,).
        """
        inputs = np.column_stack((zeta, self.spec.to_network(t3)))
        return self.spec.from_network(self.frequency.value(inputs))

    def omega_slopes(self, zeta: float, t3: float) -> tuple[float, float]:
        """∂ωn/∂ζ [rad/s] and ∂ωn/∂t3 [rad/s²].

        Args:
            zeta: damping ratio.
            t3: s.
        """
        point = np.array([zeta, float(self.spec.to_network(np.array(t3)))])
        by_zeta, by_time = self.frequency.input_gradient(point)
        if self.spec.frequency_scale == "linear":
            return float(by_zeta), float(by_time)
        omega = float(self.omega_n(np.array([zeta]), np.array([t3]))[0])
        return float(by_zeta) * omega, float(by_time) * omega / t3

    def own_stds(self, zeta: float, t3: float) -> tuple[float, float]:
        """Standard deviations due to the networks, of ζ and, relative, of ωn.

        They combine the posterior of the weights at the noise-free response of this ζ and the largest error of the
        test set as the half-width of a rectangular distribution (GUM 4.3.7).

        Args:
            zeta: damping ratio.
            t3: s.
        """
        inside = float(np.clip(zeta, *self.spec.zeta_range))
        of_zeta = self.damping.posterior_std(network_inputs(np.array([inside]))[0])
        point = np.array([inside, float(self.spec.to_network(np.array(t3)))])
        of_omega = self.frequency.posterior_std(point)
        if self.spec.frequency_scale == "linear":
            of_omega /= float(self.omega_n(np.array([zeta]), np.array([t3]))[0])
        floors = self.errors.zeta / np.sqrt(3.0), self.errors.omega_relative / np.sqrt(3.0)
        return float(np.hypot(of_zeta, floors[0])), float(np.hypot(of_omega, floors[1]))

    def trained_for(self, zeta: float, omega_n: float) -> bool:
        """Whether ζ and ωn lie in the training range.

        Args:
            zeta: damping ratio.
            omega_n: rad/s.
        """
        (low, high), (slow, fast) = self.spec.zeta_range, self.spec.omega_range
        return low <= zeta <= high and slow <= omega_n <= fast


def held_out_errors(networks: Networks, rng: np.random.Generator) -> Errors:
    """Errors on responses outside the training set.

    Args:
        networks: both; the second uses the ζ of the first.
    """
    zeta, omega = held_out_points(networks.spec, rng)
    found = networks.zeta(network_inputs(zeta))
    error = found - zeta
    relative = networks.omega_n(found, cycles_time(zeta, omega)) / omega - 1.0
    return Errors(
        zeta=float(np.abs(error).max()),
        zeta_rms=float(np.sqrt(np.mean(error**2))),
        zeta_relative=float(np.abs(error / zeta).max()),
        omega_relative=float(np.abs(relative).max()),
        omega_relative_rms=float(np.sqrt(np.mean(relative**2))),
    )
