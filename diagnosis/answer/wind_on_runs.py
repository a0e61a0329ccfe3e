"""The wind-on runs of a fit, as the effects are told of them."""

from __future__ import annotations

import math

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.spectra import linear_coefficients
from tunnel_sim.effects.parameters import WindOnRun


def wind_on_runs(fit: Fit) -> list[WindOnRun]:
    """Stiffnesses, frequencies and loads of the wind-on runs that a spring holds, in SI units."""
    data = fit.problem.data
    found = []
    for i, run in enumerate(data.runs):
        if not run.wind_on:
            continue
        inertia, _, stiffness = linear_coefficients(fit, i)
        spring = fit.problem.stated(fit.point.common, fit.point.release[i], run).spring_stiffness
        if stiffness <= 0.0 or spring <= 0.0:
            continue
        load = 0.5 * run.air_density * run.wind_speed * data.frontal_area * data.reference_length**2
        omega, still = math.sqrt(stiffness / inertia), math.sqrt(spring / inertia)
        pressure = load * run.wind_speed / data.reference_length
        found.append(WindOnRun(spring, omega, still, pressure, load))
    return found
