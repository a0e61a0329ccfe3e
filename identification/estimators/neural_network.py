"""The paper's neural networks: three cycles at a time, ζ by 100-5-5-1 and ωn by 2-2-5-1.

The run's ζ and ωn are averages over its windows (the paper's Table III), weighted by their noise; eqs 10, 11,
17 and 18 then give Cnβ and Cnr (`identification.campaign.pairing`). A standard deviation combines the noise of
the reading, by the delta method; the posterior of the networks' weights; and the networks' largest error on
test responses. If the windows scatter more, the scatter replaces it and the status says that the model does not
explain the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.special import chdtri

from identification.campaign.derivatives import noise_statuses
from identification.campaign.pairing import Paired, PairedRun
from identification.estimate import RunEstimate, Status, WindowEstimate, by_severity
from identification.neural.networks import Networks, read_networks, shipped_networks
from identification.neural.three_cycles import (
    CYCLES,
    ThreeCycles,
    find_windows,
    network_inputs,
    normalise,
    response_points,
)
from identification.policy import GREATEST_NETWORK_DISTANCE, LEAST_FOR_SCATTER, MISFIT_RATE, SCATTER_TOLERANCE
from identification.show.quantity import Quantity
from identification.signal.free_decay import Decay
from identification.signal.frequency import holds_motion
from identification.signal.noise import reading_noise
from identification.signal.run_fit import modal_quantities, residual_check
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record


@dataclass(frozen=True)
class NeuralNetwork(Paired):
    """The paper's networks.

    Args:
        weights: a safetensors file written by ``tunnel train``; None: the packaged weights.
    """

    name = "neural_network"
    weights: Path | None = None

    @cached_property
    def networks(self) -> Networks:
        """The networks.

        Raises:
            TunnelError: when the weights cannot be read.
        """
        return shipped_networks() if self.weights is None else read_networks(self.weights)

    def _run(self, run: Run, sensor: SensorProperties) -> tuple[RunEstimate, PairedRun | None]:
        networks, white = (
            self.networks,
            reading_noise(run.record, sensor) if holds_motion(run.record) else None,
        )
        readings, cycles = read_windows(run.record, white, networks)
        if not readings:
            short = 0.0 < cycles < CYCLES
            return RunEstimate(run.id, (Status.TOO_FEW_CYCLES if short else Status.NO_OSCILLATION,)), None
        zeta, omega = (_average(readings, row)[0] for row in (0, 1))
        if not networks.trained_for(zeta, omega):
            return RunEstimate(run.id, (Status.OUTSIDE_TRAINING,)), None
        check = residual_check(run, Decay.from_modal(omega, zeta), sensor)
        if check is not None and check.colour is not None:
            coloured, _ = read_windows(run.record, check.noise_std, networks)
            readings = coloured or readings
        zeta, zeta_std, departs = _average(readings, 0)
        omega, omega_std, drifts = _average(readings, 1)
        own_zeta, own_omega = networks.own_stds(zeta, readings[0].window.t3)
        zeta_std = float(np.hypot(zeta_std, own_zeta))
        omega_std = float(np.hypot(omega_std, own_omega * omega))
        statuses = {Status.MODEL_DEPARTS} if departs or drifts else set()
        if check is not None:
            statuses |= noise_statuses([check.noise])
        if check is not None and check.noise.departs:
            least_omega, least_zeta = modal_quantities(Decay.from_modal(omega, zeta), check.covariance)
            zeta_std, omega_std = max(zeta_std, least_zeta.known_std), max(omega_std, least_omega.known_std)
        if run.spring_stiffness is None:
            statuses.add(Status.NO_STIFFNESS)
        shown = []
        for response in readings:
            if not networks.trained_for(response.zeta, response.omega_n):
                continue
            window, of_zeta, of_omega = response.window, *np.sqrt(response.variances)
            own_zeta, own_omega = networks.own_stds(response.zeta, window.t3)
            # The envelope at the first crossing, and from there to mid-window.
            unit = normalise(response_points(np.array([response.zeta]))[0]).scale
            middle = float(np.exp(-np.pi * CYCLES * response.zeta / np.sqrt(1.0 - response.zeta**2)))
            amplitude = window.shape.scale / unit * middle
            level = window.noise.std * float(np.linalg.norm(window.shape.peak_weights @ window.noise.points))
            own_std = float(np.hypot(of_omega, own_omega * response.omega_n))
            shown.append(
                WindowEstimate(
                    start_s=window.start_s,
                    duration_s=window.t3,
                    amplitude=Quantity(amplitude, level / unit * middle, "rad"),
                    omega_n=Quantity(response.omega_n, own_std, "rad/s"),
                    zeta=Quantity(response.zeta, float(np.hypot(of_zeta, own_zeta)), "1"),
                    cycles=CYCLES,
                )
            )
        estimate = RunEstimate(
            id=run.id,
            statuses=by_severity(statuses),
            omega_n=Quantity(omega, omega_std, "rad/s"),
            zeta=Quantity(zeta, zeta_std, "1"),
            noise=None if check is None else check.noise,
            windows=tuple(shown),
        )
        root = float(np.sqrt(1.0 - zeta**2))
        damped_std = float(np.hypot(root * omega_std, zeta / root * omega * zeta_std))
        paired = PairedRun(
            run=run,
            frequency=omega * root / (2.0 * np.pi),
            frequency_std=damped_std / (2.0 * np.pi),
            rate=zeta * omega,
            rate_std=float(np.hypot(omega * zeta_std, zeta * omega_std)),
        )
        return estimate, paired


@dataclass(frozen=True, eq=False)
class WindowReading:
    """The result of the networks for one window.

    Args:
        zeta: damping ratio.
        omega_n: natural frequency, rad/s.
        noise: errors of ζ and ωn per standard deviation of each sample's noise, shape (2, n).
    """

    window: ThreeCycles
    zeta: float
    omega_n: float
    noise: Array

    @property
    def variances(self) -> Array:
        """Variances of ζ and ωn from the reading's noise: shape (2,)."""
        return np.asarray(np.sum(self.noise**2, axis=1))


def read_windows(
    record: Record, noise_std: float | None, networks: Networks
) -> tuple[list[WindowReading], float]:
    """The windows of a record up to the first that does not resemble a damped oscillation, and the clear cycles.

    Args:
        noise_std: noise of one sample, rad; None where nothing moves.
    """
    if noise_std is None:
        return [], 0.0
    windows, cycles = find_windows(record, noise_std)
    readings: list[WindowReading] = []
    for window in windows:
        if (reading := read_window(window, networks)) is None:
            break
        readings.append(reading)
    return readings, cycles


def read_window(window: ThreeCycles, networks: Networks) -> WindowReading | None:
    """Put a window through both networks; None where it does not resemble a damped oscillation."""
    inputs = window.shape.inputs
    zeta = float(networks.zeta(inputs[None])[0])
    clean = network_inputs(np.clip([zeta], *networks.spec.zeta_range))[0]
    if float(np.sqrt(np.mean((inputs - clean) ** 2))) > GREATEST_NETWORK_DISTANCE:
        return None
    omega_n = float(networks.omega_n(np.array([zeta]), np.array([window.t3]))[0])
    weights = window.noise.weights(window.shape, networks.damping.input_gradient(inputs))
    slopes = np.array([[1.0, 0.0], networks.omega_slopes(zeta, window.t3)])
    return WindowReading(window, zeta, omega_n, slopes @ weights)


def _average(readings: Sequence[WindowReading], row: int) -> tuple[float, float, bool]:
    """Weighted mean; its standard deviation, widened if the windows scatter beyond chance; and whether they do."""
    values = np.array([(one.zeta, one.omega_n)[row] for one in readings])
    covariance = np.diag([one.variances[row] for one in readings])
    for place, (one, other) in enumerate(pairwise(readings)):  # neighbours share a crossing and its noise
        offset = other.window.noise.first - one.window.noise.first
        shared = one.noise.shape[1] - offset
        if shared > 0:
            common = float(one.noise[row, offset:] @ other.noise[row, :shared])
            covariance[place, place + 1] = covariance[place + 1, place] = common
    weights = 1.0 / np.diag(covariance)
    weights = weights / weights.sum()
    mean = float(weights @ values)
    std = float(np.sqrt(weights @ covariance @ weights))
    if values.size < LEAST_FOR_SCATTER:
        return mean, std, False
    inverse = np.linalg.inv(covariance)
    away = values - float(inverse.sum(axis=0) @ values) / float(inverse.sum())
    scatter = float(away @ inverse @ away)
    departs = scatter > SCATTER_TOLERANCE * float(chdtri(values.size - 1, 0.5 * MISFIT_RATE))
    return mean, std * float(np.sqrt(scatter / (values.size - 1))) if departs else std, departs
