"""The driven oscillation β̈ + 2aβ̇ + kβ = g u(t), exact for an input that is held or linear between samples.

The state and its derivatives with respect to a and k form one linear system of order six, driven by the input
alone. Its exponential over a sample interval, with the input and its slope as further states (Van Loan, IEEE Trans.
Automat. Contr. 23 (1978) 395–404), gives the motion and its sensitivities at the samples without discretisation
error, for any damping and any stiffness, zero included.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from tunnel_sim.vocabulary.record import Array

_STATE = 6  # β, β̇, and their derivatives with respect to a and to k
_LINES = 24  # least number of spectral lines for a start
_POWER = 0.999  # least share of the response's power in these lines
_ROUNDS = 8


def driven_rows(
    time: Array, values: Array, rate: float, stiffness: float, *, held: bool, derivative: int = 0
) -> Array:
    """The response from rest to an input of unit gain, and its derivatives.

    Args:
        time: since the first sample, shape (n,), s, increasing.
        values: of the input at these times, shape (n,), rad/s² per unit gain.
        rate: a, 1/s.
        stiffness: k, 1/s².
        held: whether the input is constant from one sample to the next; else linear.
        derivative: 0 for the angle, 1 for its rate.

    Returns:
        Angle (rad), its derivative with respect to a (rad s) and to k (rad s²), shape (3, n); of the rate, per s.
    """
    steps = np.diff(time)
    if np.ptp(steps) <= 1e-6 * steps.mean():
        steps = steps[:1]
    dynamics = np.zeros((_STATE + 2, _STATE + 2))
    for first in (0, 2, 4):
        dynamics[first, first + 1] = 1.0
        dynamics[first + 1, first], dynamics[first + 1, first + 1] = -stiffness, -2.0 * rate
    dynamics[3, 1], dynamics[5, 0] = -2.0, -1.0
    dynamics[1, 6], dynamics[6, 7] = 1.0, 1.0  # the input, and its slope
    whole = expm(dynamics * steps[:, None, None])
    transition, constant, ramp = whole[:, :_STATE, :_STATE], whole[:, :_STATE, 6], whole[:, :_STATE, 7]
    slope = np.zeros(time.size - 1) if held else np.diff(values) / np.diff(time)
    pushed = constant * values[:-1, None] + ramp * slope[:, None]
    state = np.zeros((time.size, _STATE))
    if steps.size == 1:
        state[1:] = pushed
        power, reach = transition[0], 1
        while reach < time.size:  # each round, a state includes the input of the last `reach` intervals
            state[reach:] += state[:-reach] @ power.T
            power, reach = power @ power, 2 * reach
    else:
        for i, (matrix, push) in enumerate(zip(transition, pushed, strict=True)):
            state[i + 1] = matrix @ state[i] + push
    return np.asarray(state[:, derivative::2].T, np.float64)


def driven_start(
    time: Array, reading: Array, values: Array, *, sprung: bool = True, derivative: int = 0
) -> tuple[float, float, float] | None:
    """Decay rate, stiffness and gain from the spectra of input and response.

    The equation of motion is satisfied line by line, with a polynomial for the ends of the record; the weights of
    its residuals come from the response of the previous iteration (Sanathanan and Koerner, IEEE Trans. Automat.
    Contr. 8 (1963) 56–58).

    Args:
        time: of the samples, shape (n,), s.
        reading: of the response, shape (n,), rad, or rad/s of its rate.
        values: of the input, shape (n,).
        derivative: 0 where the reading is the angle, 1 where it is the rate.

    Returns:
        a (1/s), k (1/s²) and g (rad/s² per unit); None where the response contains no motion.
    """
    count = time.size
    response, moved = np.fft.rfft(reading - reading.mean()), np.fft.rfft(values - values.mean())
    power = np.cumsum(np.abs(response[1:]) ** 2)
    if not power[-1] > 0.0:
        return None
    used = slice(1, 1 + min(max(_LINES, int(np.searchsorted(power, _POWER * power[-1])) + 1), power.size))
    turn = 2.0 * np.pi / (count * (time[-1] - time[0]) / (count - 1)) * np.arange(response.size)[used]
    y, u, s = response[used], moved[used], 1j * turn
    unit = float(turn[-1])
    columns = np.column_stack([s / unit * y, y, -((s / unit) ** derivative) * u, -np.ones_like(y), -s / unit])
    sought = [0, 1, 2, 3, 4] if sprung else [0, 2, 3, 4]
    weight = np.ones(turn.size)
    found = np.zeros(5)
    for _ in range(_ROUNDS):
        left = columns[:, sought] * weight[:, None]
        right = -((s / unit) ** 2) * y * weight
        size = np.linalg.norm(left, axis=0)
        if not size.min() > 0.0:
            return None
        stacked = np.vstack([left.real, left.imag]) / size
        solved = np.linalg.lstsq(stacked, np.concatenate([right.real, right.imag]), rcond=None)[0]
        found[sought] = solved / size
        weight = 1.0 / np.maximum(np.abs((s / unit) ** 2 + found[0] * s / unit + found[1]), 1e-9)
    return 0.5 * float(found[0]) * unit, float(found[1]) * unit**2, float(found[2]) * unit ** (2 - derivative)
