"""The derivatives in phase with angle and rate, which an oscillation shows where no lag of the air is named.

A lag with the response H(iω) to the angle gives the moment Ka H β, so that

    Cnβ in phase with the angle: Cnβ Re H,        Cnr in phase with the rate: Cnr + Cnβ Im H V/(ω l).

To first order in the reduced frequency a lag of a l/V is −a Cnβ of Cnr.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from tunnel_reference import moments
from tunnel_reference.draw import CampaignDraw
from tunnel_reference.integrator import BoundLaw
from tunnel_reference.severity import bind_effects
from tunnel_reference.true_conditions import REFERENCE_LENGTH, Array

Response = NDArray[np.complex128]


def in_phase(draw: CampaignDraw) -> dict[str, float] | None:
    """Cnβ and Cnr in phase, 1/rad, means over the wind-on runs at their natural frequencies.

    Returns:
        Keys ``cn_beta`` and ``cn_r``; None if no lag of the air acts.
    """
    c, bound = bind_effects(draw)
    laws = [term for term in bound if isinstance(term, BoundLaw) and term.law in _RESPONSES]
    if not laws or not np.any(c.wind_on):
        return None
    stiffness = np.maximum(c.true_stiffness - c.air_stiffness, 1e-9)
    omega = np.sqrt(stiffness / c.yaw_inertia)[c.wind_on]
    (term,) = laws
    params = {name: np.broadcast_to(value, (c.runs,))[c.wind_on] for name, value in term.params.items()}
    response = _RESPONSES[term.law](omega, params)
    speed = c.true_speed[c.wind_on]
    rate = c.cn_beta * response.imag * speed / (omega * REFERENCE_LENGTH)
    return {
        "cn_beta": float(c.cn_beta * np.mean(response.real)),
        "cn_r": float(c.cn_r + np.mean(rate)),
    }


def _one(omega: Array, p: Mapping[str, Array]) -> Response:
    return np.asarray(1.0 - p["w1"] + p["w1"] / (1.0 + 1j * omega * p["tau1"]))


def _two(omega: Array, p: Mapping[str, Array]) -> Response:
    parts = [(p["w1"], p["tau1"]), (p["w2"], p["tau2"])]
    return np.asarray(1.0 - p["w1"] - p["w2"] + sum(w / (1.0 + 1j * omega * tau) for w, tau in parts))


def _cascade(omega: Array, p: Mapping[str, Array]) -> Response:
    return np.asarray((1.0 + 0.5j * omega * p["tau1"]) ** -2)


_RESPONSES: Mapping[object, Callable[[Array, Mapping[str, Array]], Response]] = {
    moments.lag_one: _one,
    moments.lag: _two,
    moments.lag_cascade: _cascade,
}
"""The response to the angle, by the law of the motion."""
