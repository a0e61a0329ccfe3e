"""Frequency response: the ratio of reading to input, line by line, and a second-order system fitted to it.

The response at a line is the cross spectrum of input and reading over the power of the input, Ĥ1 (Bendat and
Piersol, Random Data, 4th ed. (2010), ch. 6, doi 10.1002/9781118032428). For an input that is periodic in the record
it is computed at the lines of its Fourier transform, for others from segments with Hann windows (Welch, IEEE Trans.
Audio Electroacoust. 15 (1967) 70–73, doi 10.1109/TAU.1967.1161901). These are shorter than the memory of a lightly
damped rig, so that leakage would flatten the resonance. The model's response therefore passes through the same
windows, with its initial state. Lines without coherence of reading and model are left out. The least-squares
residual of the record judges the model and gives the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from identification.campaign.combination import Found, RunByRun, RunDecay
from identification.estimate import Status
from identification.signal.decay_fit import Reading, project_run
from identification.signal.forcing import Forced
from identification.signal.frequency import starting_decay
from identification.signal.run_fit import Gained, describe_run, identify_run
from identification.signal.run_unknowns import ANGLE, ANGULAR_RATE, RunUnknowns
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

# share of the power of the input's greatest line from which a line counts as excited on purpose
_EXCITED = 1e-3
_BETWEEN = 1e-6  # share of the input's power between these lines below which it is periodic in the record
_LEAST = 1e-8  # share of the power of the input's greatest line: weaker lines are rounding
# minimum number of lines: the real and imaginary parts of five unknowns, and some to judge the fit
_FEWEST = 6
_STEPS = 30
_SETTLED = 1e-10  # relative change of the coefficients or of the sum of squares


@dataclass(frozen=True)
class FrequencyResponse(RunByRun):
    """A second-order response fitted to Ĥ1 of driven runs.

    Args:
        segments: number of segment lengths in the record, if the input is not periodic; segments overlap by
            half.
        least_coherence: minimum coherence of reading and model at a line, as a share of the power.
    """

    name = "frequency_response"
    takes_driven = True
    segments: int = 4
    least_coherence: float = 0.5

    def _refusal(self, run: Run) -> str:
        if not run.record.uniform:
            return "has uneven samples, which a Fourier transform does not take"
        if run.unrestrained:
            return "has no spring, and so no resonance"
        return "is a free decay, which has no frequency response" if run.drive is None else ""

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        bare = identify_run(run, sensor)
        reading, forcing = bare.reading, bare.reading.forcing
        if bare.fit is None or bare.noise is None or not isinstance(forcing, Forced):
            return RunDecay(bare.estimate)
        start = forcing.start(run.record, starting_decay)
        lines = _Lines.of(forcing.values, self.segments)
        found = None if start is None else _fitted(reading, forcing, start[forcing.sought], lines)
        if found is not None:
            left, seen = (np.sum(np.abs(lines.spectra(y)) ** 2, axis=0) for y in (found[1], reading.yaw))
            kept = left <= (1.0 - self.least_coherence) * seen
            lines = replace(lines, used=lines.used[kept], moved=lines.moved[:, kept], power=lines.power[kept])
            found = _fitted(reading, forcing, found[0], lines)
        if found is None:
            return Status.NOT_DETERMINED
        decay, gain = forcing.at(forcing.link @ found[0])
        if not decay.stiffness > 0.0:
            return Status.NOT_CONVERGED
        free = reading.freed(decay, gain)
        projected = project_run(free, decay)
        if projected is None:
            return Status.NOT_CONVERGED
        variance, gains = bare.noise.std**2 * bare.noise.slow_ratio, found[2][: len(forcing.sought)]
        covariance = gains @ gains.T * variance
        estimate = describe_run(run, free, *projected, covariance[:2, :2], variance, noise=bare.noise)
        coefficients = np.array([decay.rate, decay.stiffness, gain])
        return RunDecay(estimate, Gained.of(coefficients, covariance, forcing.sought))


@dataclass(frozen=True, eq=False)
class _Lines:
    """The linear map from a record to its response at some lines.

    Args:
        window: shape (length,).
        starts: first sample of every segment, shape (s,).
        used: indices of the lines, shape (k,).
        moved: conjugate spectrum of the input over its power, shape (s, k).
        power: power of the input, shape (k,).
    """

    window: Array
    starts: NDArray[np.intp]
    used: NDArray[np.intp]
    moved: NDArray[np.complex128]
    power: Array

    @classmethod
    def of(cls, values: Array, segments: int) -> Self:
        """The lines that an input excites, shape (n,)."""
        whole = np.abs(np.fft.rfft(values - values.mean())) ** 2
        periodic = float(whole[whole < _EXCITED * whole.max()].sum()) < _BETWEEN * float(whole.sum())
        length = values.size if periodic else values.size // segments
        window = np.ones(length) if periodic else np.hanning(length + 1)[:-1]
        starts = np.arange(0, values.size - length + 1, max(length // 2, 1))
        none = np.zeros((0, 0), np.complex128)
        spectrum = cls(window, starts, np.arange(length // 2 + 1), none, whole).spectra(values)
        power = np.sum(np.abs(spectrum) ** 2, axis=0)
        used = np.flatnonzero(power > _LEAST * power.max())
        return cls(window, starts, used, spectrum[:, used].conj() / power[used], power[used])

    def spectra(self, values: Array) -> NDArray[np.complex128]:
        """Spectra of records, shape (..., n), in all segments: shape (..., s, k)."""
        pieces = values[..., self.starts[:, None] + np.arange(self.window.size)]
        pieces = (pieces - pieces.mean(axis=-1, keepdims=True)) * self.window
        return np.asarray(np.fft.rfft(pieces)[..., self.used])

    def weighted(self, values: Array) -> Array:
        """Ĥ1 of records, shape (..., n), with errors of equal size: real, then imaginary parts, (..., 2k)."""
        found = np.sum(self.spectra(values) * self.moved, axis=-2) * np.sqrt(self.power)
        return np.concatenate([found.real, found.imag], axis=-1)

    def adjoint(self, rows: Array) -> Array:
        """From rows over the weighted responses, shape (p, 2k), to rows over the samples, shape (p, n)."""
        real, imaginary = np.split(rows * np.tile(np.sqrt(self.power), 2), 2, axis=1)
        size = self.window.size
        out = np.zeros((len(rows), int(self.starts[-1]) + size))
        for start, moved in zip(self.starts, self.moved, strict=True):
            sparse = np.zeros((len(rows), size), np.complex128)
            sparse[:, self.used] = (real - 1j * imaginary) * moved
            piece = np.fft.fft(sparse).real * self.window
            out[:, start : start + size] += piece - piece.mean(axis=1, keepdims=True)
        return out


def _fitted(
    reading: Reading, forcing: Forced, start: Array, lines: _Lines
) -> tuple[Array, Array, Array] | None:
    """Coefficients, the record's residual (rad), and weights of its samples in them; None where undetermined."""
    if lines.used.size < _FEWEST:
        return None
    parameters, last = start, np.inf
    initial = np.zeros(2)  # angle and rate; no line shows the zero
    step = np.zeros(start.size + 2)
    for _ in range(_STEPS):
        with np.errstate(all="ignore"):  # a distant trial may overflow; it is then rejected
            decay, gain = forcing.at(forcing.link @ parameters)
            state = RunUnknowns(decay, 0.0, float(initial[0]), float(initial[1]), gain)
            rows = forcing.rows(reading.time, decay)
            residual, local = reading.residual(state, rows), forcing.weights(state) @ rows
            left = lines.weighted(residual)
            cost = float(left @ left)
        if np.isfinite(cost) and cost <= last * (1.0 + _SETTLED):
            of_coefficients = forcing.link.T @ local[list(forcing.coefficients)]
            design = lines.weighted(np.vstack([of_coefficients, local[[ANGLE, ANGULAR_RATE]]])).T
            size = np.linalg.norm(design, axis=0)
            if not (np.isfinite(design).all() and size.min() > 0.0):
                return None
            solver = np.linalg.pinv(design / size, rcond=1e-10) / size[:, None]
            kept = parameters, residual - residual.mean(), lines.adjoint(solver)
            step, last, before = solver @ left, cost, last
            small = np.abs(step[: start.size]) <= _SETTLED * np.abs(parameters)
            if small.all() or cost >= before * (1.0 - _SETTLED):
                return kept
        else:
            parameters, initial = parameters - step[: start.size], initial - step[start.size :]
            step = 0.25 * step
        parameters, initial = parameters + step[: start.size], initial + step[start.size :]
    return None
