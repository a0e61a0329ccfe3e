"""One run per term of the moment law, as the simulator takes it and as the SciPy oracle takes it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.analytic.decay_oracle import Oracle
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RodTwist, RunSettings, Series
from tunnel_sim.vocabulary.plan import AeroDerivatives

RIG = load_rig()
DURATION, SAMPLE_RATE = 2.5, 1000.0
GUSTS = Series(tuple(20.0 + np.random.default_rng(5).normal(0.0, 1.0, 21)), 0.5)
TURBULENCE = Series(tuple(np.random.default_rng(6).normal(0.0, 0.02, 101)), 0.1)


@dataclass(frozen=True)
class Case:
    """A run and how far from the oracle it may be at a step of 1 ms, rad; the sensor's noise is 5e-4 rad.

    Smooth terms leave RK4's own error, larger for the rod's fast mode; a kink or a jump of the law inside a
    step leaves an error of second order.
    """

    name: str
    terms: Mapping[str, float] = field(default_factory=dict)
    series: Mapping[str, Series] = field(default_factory=dict)
    twist: RodTwist | None = None
    spring: float = 16.12
    speed: float = 20.0
    tolerance: float = 1e-8  # of the MuJoCo model
    forward_tolerance: float = 1e-8  # of the forward integrator, which locates reversals under friction

    def settings(self, timestep: float = 1e-3) -> RunSettings:
        return RunSettings(
            self.spring,
            AeroDerivatives(0.35, -0.7),
            RIG.dynamics.yaw_inertia,
            RIG.dynamics.mechanical_damping,
            wind_speed=self.speed,
            air_density=1.204,
            release_angle=0.3,
            duration=DURATION,
            timestep=timestep,
            parameters=self.terms,
            series=self.series,
            rod_twist=self.twist,
        )

    def oracle(self) -> np.ndarray:
        return _solve(self.name)


def _function(series: Series | None, otherwise: float) -> Callable[[float], float]:
    if series is None:
        return lambda _: otherwise
    times = np.arange(len(series.values)) * series.interval
    return lambda t: float(np.interp(t, times, series.values))


@functools.cache
def _solve(name: str) -> np.ndarray:
    case = next(case for case in CASES if case.name == name)
    wind, forcing = case.series.get("wind_speed"), case.series.get("forcing")
    breaks = {s.interval * i for s in case.series.values() for i in range(len(s.values))}
    twist = case.twist
    share = twist.inertia_share if twist is not None else 0.0
    reduced = RIG.dynamics.yaw_inertia * share * (1.0 - share)
    rod = 0.0
    if twist is not None:  # a fraction of critical damping of the rod between two free ends
        rod = 2.0 * twist.damping_ratio * float(np.sqrt(reduced / twist.compliance))
    return Oracle(
        case.spring, RIG.dynamics.mechanical_damping, RIG.dynamics.yaw_inertia, 0.35, -0.7, 1.204,
        _function(wind, case.speed), 0.3, dict(case.terms), _function(forcing, 0.0), tuple(breaks),
        twist.compliance if twist is not None else 0.0, share, rod,
    ).solve(round(DURATION * SAMPLE_RATE), SAMPLE_RATE)  # fmt: skip


SMOOTH = (
    Case("nominal"),
    Case("wind_off", speed=0.0),
    Case("quadratic_damping", {"quadratic_damping": 0.02}),
    Case("structural_damping", {"loss_factor": 0.01}),
    Case("cubic_stiffness", {"stiffness_cubic": 2.0}),
    Case("softening", {"stiffness_cubic": -2.0}),
    Case("asymmetric_stiffness", {"stiffness_quadratic": 0.5}),
    Case("power_spring", {"stiffness_cubic": 2.0, "stiffness_cubic_exponent": 5.0}),
    Case("power_asymmetry", {"stiffness_quadratic": 0.5, "stiffness_quadratic_exponent": 4.0}),
    Case("power_damping", {"quadratic_damping": 0.02, "quadratic_damping_exponent": 3.0}),
    Case("power_yaw_moment", {"moment_cubic": 4.0, "moment_cubic_exponent": 4.0}),
    Case("power_yaw_damping", {"damping_quadratic": -5.0, "damping_quadratic_exponent": 3.0}),
    Case("gravity_stiffness", {"gravity_stiffness": 0.5, "gravity_angle": 0.05}),
    Case("nonlinear_yaw_moment", {"moment_cubic": 4.0}),
    Case("nonlinear_yaw_damping", {"damping_quadratic": -5.0}),
    Case("lag", {"aero_lag": 2.0}),
    Case("lead", {"aero_lag": -2.0}),
    Case("long_lag", {"aero_lag": 60.0}),
    Case("flow_misalignment", {"flow_angle": 0.03}),
    Case("shedding", {"shedding_amplitude": 0.05, "strouhal_number": 0.2, "shedding_phase": 0.4}),
    Case("gusts", series={"wind_speed": GUSTS}),
    Case("turbulence", series={"forcing": TURBULENCE}),
    Case("flexible_rod", twist=RodTwist(2e-3, 0.3, 0.02), tolerance=3e-7, forward_tolerance=3e-7),
    Case(
        "many",
        {"aero_lag": 1.0, "moment_cubic": 2.0, "quadratic_damping": 0.01, "gravity_stiffness": 0.3},
        {"wind_speed": GUSTS},
        RodTwist(2e-3, 0.3, 0.02),
        tolerance=3e-7,
        forward_tolerance=3e-7,
    ),
)
FREE_PLAY = Case("free_play", {"free_play": 0.01}, tolerance=1e-5, forward_tolerance=1e-5)
FRICTION = (
    Case("friction", {"friction_moment": 0.01}, tolerance=1e-6),
    Case("strong_friction", {"friction_moment": 0.05}, tolerance=2e-6),
    Case(
        "friction_stiff_spring", {"friction_moment": 0.05}, spring=67.98,
        tolerance=5e-6, forward_tolerance=5e-8,
    ),
    Case("friction_and_turbulence", {"friction_moment": 0.02}, {"forcing": TURBULENCE}, tolerance=1e-6),
    Case(
        "friction_flexible_rod", {"friction_moment": 0.02}, twist=RodTwist(2e-3, 0.3, 0.02),
        tolerance=2e-5, forward_tolerance=5e-6,
    ),
    Case("friction_and_lag", {"friction_moment": 0.02, "aero_lag": 2.0}, tolerance=1e-6),
)  # fmt: skip
OF_RATE = (
    Case(
        "sublinear_friction", {"friction_moment": 0.05, "friction_exponent": 0.3},
        tolerance=2e-5, forward_tolerance=2e-5,
    ),
    Case(
        "saturating_friction", {"friction_moment": 0.05, "friction_saturation": 0.2},
        tolerance=1e-6, forward_tolerance=1e-8,
    ),
    Case(
        "stribeck_friction",
        {"friction_moment": 0.02, "friction_peak": 1.0, "friction_peak_rate": 0.3},
        tolerance=2e-6, forward_tolerance=1e-7,
    ),
    Case(
        "stribeck_friction_flexible_rod",
        {"friction_moment": 0.02, "friction_peak": 1.0, "friction_peak_rate": 0.3},
        twist=RodTwist(2e-3, 0.3, 0.02), tolerance=2e-5, forward_tolerance=1e-5,
    ),
    Case(
        "presliding_and_peak",
        {"friction_moment": 0.02, "presliding": 0.005, "friction_peak": 1.0, "friction_peak_rate": 0.3},
    ),
)  # fmt: skip
LOADED = (
    Case(
        "loaded_friction", {"friction_moment": 0.02, "friction_load": 0.1, "gravity_stiffness": 2.0},
        tolerance=2e-6, forward_tolerance=1e-7,
    ),
    Case(
        "only_loaded_friction", {"friction_load": 0.3, "gravity_stiffness": 1.0, "gravity_angle": 0.4},
        tolerance=4e-6,
    ),
    Case(
        "loaded_friction_flexible_rod", {"friction_load": 0.1, "load_stiffness": 1.0, "load_angle": 0.4},
        twist=RodTwist(2e-3, 0.3, 0.02), tolerance=2e-5, forward_tolerance=1e-5,
    ),
)  # fmt: skip
#: Friction that jumps, or rises without bound in its slope, where the rate reverses.
REVERSING = (
    *FRICTION,
    *LOADED,
    *(c for c in OF_RATE if not {"presliding", "friction_saturation"} & c.terms.keys()),
)
PRESLIDING = (
    Case("presliding", {"friction_moment": 0.02, "presliding": 0.005}),
    Case("wide_presliding", {"friction_moment": 0.4, "presliding": 0.1}),
    Case(
        "narrow_presliding", {"friction_moment": 0.05, "presliding": 3e-4}, spring=67.98,
        tolerance=1e-6, forward_tolerance=1e-6,
    ),
    Case(
        "presliding_and_turbulence", {"friction_moment": 0.02, "presliding": 0.002}, {"forcing": TURBULENCE},
    ),
    Case(
        "presliding_flexible_rod", {"friction_moment": 0.02, "presliding": 0.005},
        twist=RodTwist(2e-3, 0.3, 0.02), tolerance=3e-7, forward_tolerance=3e-7,
    ),
    Case("presliding_and_lag", {"friction_moment": 0.02, "presliding": 0.005, "aero_lag": 2.0}),
)  # fmt: skip
CASES = (*SMOOTH, FREE_PLAY, *FRICTION, *LOADED, *OF_RATE, *PRESLIDING)
