"""The Cramér–Rao bound: the smallest standard deviations any unbiased estimator can reach.

The Fisher information is exact, for real damped sinusoids and for motions under an input, in white Gaussian noise
at given sample times. For long records of light damping the bound tends to

    std(ζ)/ζ = 4 (S/A) √(σ/fs),   std(f)/f = ζ · std(ζ)/ζ,

with noise S, initial amplitude A, decay rate σ = ζωn and sample rate fs. Source: S. M. Kay, Fundamentals of
Statistical Signal Processing: Estimation Theory (1993), ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.campaign.derivatives import Design, build_design, derivatives, has_size
from identification.campaign.linked_runs import with_gains
from identification.campaign.run_scatter import moves_of
from identification.estimate import PARAMETERS
from identification.signal.decay_fit import Reading, information_at, run_at, shared_system
from identification.signal.filter import discretised, steady_filters
from identification.signal.free_decay import Decay
from identification.signal.run_unknowns import RunUnknowns
from identification.statistics import eliminate, inverse
from tunnel_sim.vocabulary.between_runs import SCATTERED
from tunnel_sim.vocabulary.campaign import Campaign, Repeatability, Run
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import Truth
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class SinusoidBound:
    """Smallest standard deviations of any unbiased estimator of one damped sinusoid.

    Args:
        amplitude: amplitude of the envelope at the first sample, rad.
        phase: phase at the first sample, rad.
        frequency: damped frequency, Hz.
        omega_n: natural angular frequency, rad/s.
        zeta: damping ratio.
        offset: offset, rad; 0 if it is known.
    """

    amplitude: float
    phase: float
    frequency: float
    omega_n: float
    zeta: float
    offset: float


def damped_sinusoid_bound(
    time: Array,
    *,
    amplitude: float,
    phase: float,
    frequency: float,
    zeta: float,
    noise_std: float,
) -> SinusoidBound:
    """The bound for y = A e^{−σt} cos(2πf t + φ) + offset + noise, all five unknown.

    Args:
        time: sample times from the instant of amplitude and phase, shape (n,), s.
        amplitude: A, rad, above 0.
        phase: φ, rad.
        frequency: damped frequency f, Hz, above 0.
        zeta: damping ratio, below 1.
        noise_std: S, rad.

    Raises:
        ValueError: for an amplitude or frequency that is not positive, or |ζ| of 1 or more.
    """
    if amplitude <= 0.0 or frequency <= 0.0 or abs(zeta) >= 1.0:
        raise ValueError("amplitude and frequency must be positive and zeta between -1 and 1")
    omega_d = 2.0 * np.pi * frequency
    decay = Decay.from_modal(omega_d / np.sqrt(1.0 - zeta**2), zeta)
    angle = amplitude * np.cos(phase)
    rate = -decay.rate * angle - omega_d * amplitude * np.sin(phase)
    information = information_at(time, decay, float(angle), float(rate))
    order = [0, 1, 3, 4, 2]
    covariance = inverse(information[np.ix_(order, order)]) * noise_std**2
    # Rows: amplitude, phase, f, ωn, ζ, offset. Columns: a, k, angle, rate, offset.
    a, omega = decay.rate, decay.omega_n
    damped_row = np.array([-a / omega_d, 0.5 / omega_d, 0.0, 0.0, 0.0])
    # In-phase part x = A cos φ is the angle, quadrature A sin φ = −(rate + a·angle)/ωd.
    in_phase, quadrature = amplitude * np.cos(phase), amplitude * np.sin(phase)
    x_row = np.array([0.0, 0.0, 1.0, 0.0, 0.0])
    q_row = np.array([-in_phase, 0.0, -a, -1.0, 0.0]) / omega_d - quadrature / omega_d * damped_row
    jacobian = np.array(
        [
            (in_phase * x_row + quadrature * q_row) / amplitude,
            (in_phase * q_row - quadrature * x_row) / amplitude**2,
            damped_row / (2.0 * np.pi),
            np.array([0.0, 0.5 / omega, 0.0, 0.0, 0.0]),
            np.array([1.0 / omega, -0.5 * a / omega**3, 0.0, 0.0, 0.0]),
            np.array([0.0, 0.0, 0.0, 0.0, 1.0]),
        ]
    )
    deviations = np.sqrt(np.diag(jacobian @ covariance @ jacobian.T))
    return SinusoidBound(*map(float, deviations))


@dataclass(frozen=True)
class CampaignBound:
    """The bound of a campaign's common parameters, with every run's initial state and the zero unknown.

    The zero is common to the runs, unless a run has no spring.

    Args:
        covariance: smallest covariance, shape (p, p), in the products of their units.
    """

    parameters: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...]

    def std(self, name: str) -> float:
        """The smallest standard deviation of a parameter; KeyError when the campaign does not determine it."""
        if name not in self.parameters:
            raise KeyError(name)
        place = self.parameters.index(name)
        return float(np.sqrt(self.covariance[place][place]))


def campaign_bound(
    campaign: Campaign,
    truth: Truth,
    *,
    noise_std: float,
    drive_gain: float = 1.0,
    initial_states: Sequence[tuple[float, float]] | None = None,
    random_moments: Sequence[float] | None = None,
    repeatability: Repeatability | None = None,
) -> CampaignBound:
    """The bound of Cnβ, Cnr, Izz and Cr together, from free and driven runs with exactly known inputs.

    Args:
        campaign: conditions, inputs and sample times; the readings themselves are not used.
        noise_std: noise of the reading, quantisation included (add resolution²/12 to the variance), rad.
        drive_gain: true gain of inputs that state none, unknown to the estimator, N m per unit.
        initial_states: angle [rad] and rate [rad/s] at each run's first sample; None: the runs' nominal release
            angles at rest, and 0 for driven runs.
        random_moments: spectral intensity q of a white random moment on each run over the inertia, ⟨w(t)w(t′)⟩ =
            q δ(t − t′), rad²/s³; None: there is none. The bound is then for the response to release and input in
            noise of known spectrum, by the steady Kalman filter (doi:10.1137/0141046), without the information of
            the random motion itself. Samples must be evenly spaced.
        repeatability: true standard deviations of the runs' deviations, normal and to first order; None: zero. The
            bound is then for the Gaussian mixed model of known widths.

    Raises:
        TunnelError: when a run states no spring stiffness, the rig states no size although the wind is on, or a
            run has neither an initial state nor a release angle.
    """
    runs = campaign.runs
    if any(run.spring_stiffness is None for run in runs):
        raise TunnelError(
            "run without spring_stiffness", where=campaign.name, remedy="state it for every run"
        )
    if any(run.wind_on for run in runs) and not has_size(campaign.rig):
        remedy = "state frontal_area and reference_length"
        raise TunnelError("rig without size", where=campaign.name, remedy=remedy)
    design = build_design(runs, campaign.rig)
    linked = with_gains(design, runs)
    truths = []
    for run, load, damping in zip(runs, design.stiffness_loads, design.damping_loads, strict=True):
        rate, gain = 0.5 * (truth.mechanical_damping - damping * truth.cn_r), 0.0
        if run.drive is not None and not run.drive.kind.by_inertia:  # its gain depends on no parameter
            gain = run.drive.kind.scale * drive_gain if run.input_gain is None else run.input_gain
        truths += [rate, (run.spring_stiffness or 0.0) - load * truth.cn_beta, gain]
    parameters: Array = np.linalg.lstsq(
        np.vstack(linked.links), np.array(truths, dtype=np.float64) / truth.yaw_inertia, rcond=None
    )[0].astype(np.float64)
    states = initial_states
    if states is None:
        for run in runs:
            if run.release_angle is None and run.drive is None:
                remedy = "state release_angle or initial_states"
                raise TunnelError("no initial state", where=f"run {run.id}", remedy=remedy)
        states = [(run.release_angle or 0.0, 0.0) for run in runs]
    drifting = any(run.unrestrained for run in runs)
    filters = None
    if random_moments is not None:
        # From readings to innovations, scaled to the variance of a reading.
        dynamics, drive = np.zeros((2, len(runs), 2, 2))
        dynamics[:, 0, 1] = 1.0
        for of_run, link in zip(dynamics, linked.links, strict=True):
            rate, stiffness = link[:2] @ parameters
            of_run[1] = -stiffness, -2.0 * rate
        drive[:, 1, 1] = random_moments
        interval = np.array([run.record.duration / (run.record.time_s.size - 1) for run in runs])
        variance = noise_std**2
        steady = steady_filters(*discretised(dynamics, drive, interval), np.full(len(runs), variance))
        filters = [(numerator * np.sqrt(variance / spread), poles) for numerator, poles, spread in steady]
    links, priors = _with_deviations(runs, linked, parameters, repeatability)
    values = np.concatenate((parameters, np.zeros(priors.size)))
    fits = []
    for i, (run, link, initial) in enumerate(zip(runs, links, states, strict=True)):
        reading = Reading.from_run(run, 0)
        decay, gain = reading.forcing.at(link @ values)
        rows = reading.forcing.rows(reading.time, decay)
        if filters is not None:
            from scipy.signal import lfilter  # imported here because it is slow to load

            rows = np.asarray(lfilter(*filters[i], rows, axis=1))
        fits.append(
            run_at(
                reading.forcing, RunUnknowns(decay, 0.0, *initial, gain), rows, np.zeros(reading.time.size)
            )
        )
    normal = shared_system(fits, links, "own" if drifting else "shared", values)[0]
    places = linked.size + np.arange(priors.size)
    normal[places, places] += noise_std**2 * priors
    information, _ = eliminate(normal, np.zeros(len(normal)), design.size)
    found = derivatives(design, parameters[: design.size])
    covariance = found.jacobian @ (inverse(information) * noise_std**2) @ found.jacobian.T
    names = tuple(name for name in PARAMETERS if name in found.names)
    return CampaignBound(names, tuple(map(tuple, covariance.tolist())))


def _with_deviations(
    runs: Sequence[Run], linked: Design, parameters: Array, repeatability: Repeatability | None
) -> tuple[list[Array], Array]:
    """The links with every run's deviations appended to φ, and the inverse variances of the deviations, shape (d,).

    The deviations count as unknowns with their prior as information; eliminating them gives the information of the
    marginal distribution (Woodbury's identity).
    """
    stated = {} if repeatability is None else repeatability.stated
    widths = np.array([stated.get(name, 0.0) for name in SCATTERED])
    used = np.flatnonzero(widths)
    links = []
    for place, (link, move) in enumerate(zip(linked.links, moves_of(runs, linked, parameters), strict=True)):
        own = np.zeros((len(link), used.size * len(runs)))
        own[:, used.size * place : used.size * (place + 1)] = move[:, used]
        links.append(np.hstack((link, own)))
    return links, np.tile(widths[used] ** -2.0, len(runs))
