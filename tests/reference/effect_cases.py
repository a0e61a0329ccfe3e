"""The public vocabulary of effects, copied from its table, and values at which each is seen."""

from __future__ import annotations

from tests.reference.effect_oracle import Setting
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.aero import AeroDerivatives

# name: (channel, condition)
VOCABULARY = {
    "coulomb_friction": ("damping", "always"),
    "quadratic_damping": ("damping", "always"),
    "structural_damping": ("damping", "always"),
    "cubic_stiffness": ("stiffness", "always"),
    "asymmetric_stiffness": ("stiffness", "always"),
    "free_play": ("stiffness", "always"),
    "gravity_stiffness": ("stiffness", "always"),
    "rod_flexibility": ("stiffness", "always"),
    "nonlinear_yaw_moment": ("stiffness", "wind_on"),
    "wind_speed_drift": ("stiffness", "wind_on"),
    "nonlinear_yaw_damping": ("damping", "wind_on"),
    "unsteady_aero_lag": ("damping", "wind_on"),
    "buffeting": ("forcing", "wind_on"),
    "vortex_shedding": ("forcing", "wind_on"),
    "flow_misalignment": ("forcing", "wind_on"),
    "sensor_nonlinearity": ("sensor", "always"),
    "sensor_quantisation": ("sensor", "always"),
    "sensor_hysteresis": ("sensor", "always"),
    "sensor_drift": ("sensor", "always"),
    "mains_hum": ("sensor", "always"),
    "sensor_clipping": ("sensor", "always"),
    "spring_miscalibration": ("calibration", "always"),
    "wind_speed_offset": ("calibration", "wind_on"),
}

# One value of every parameter of every effect, none at its default.
VALUES: dict[str, dict[str, float]] = {
    "coulomb_friction": {"friction_moment": 0.05},
    "quadratic_damping": {"coefficient": 0.01},
    "structural_damping": {"loss_factor": 0.02},
    "cubic_stiffness": {"coefficient": 1.0},
    "asymmetric_stiffness": {"coefficient": 0.2},
    "free_play": {"half_width": 0.01},
    "gravity_stiffness": {"stiffness": 0.4, "rest_angle": 0.2},
    "rod_flexibility": {"compliance": 1e-3, "inertia_share": 0.3},
    "nonlinear_yaw_moment": {"coefficient": 3.0},
    "wind_speed_drift": {"drift": 0.1},
    "nonlinear_yaw_damping": {"coefficient": 20.0},
    "unsteady_aero_lag": {"lag": 1.5},
    "buffeting": {"intensity": 0.02, "bandwidth": 8.0},
    "vortex_shedding": {"amplitude": 0.1, "strouhal_number": 0.02},
    "flow_misalignment": {"angle": 0.02},
    "sensor_nonlinearity": {"coefficient": 0.2},
    "sensor_quantisation": {"step": 0.004},
    "sensor_hysteresis": {"half_width": 0.003},
    "sensor_drift": {"drift": 0.01},
    "mains_hum": {"amplitude": 0.002, "frequency": 60.0},
    "sensor_clipping": {"limit": 0.2},
    "spring_miscalibration": {"error": 0.05, "spring_stiffness": 16.12},
    "wind_speed_offset": {"offset": 1.0},
}


def settings(run: Setting) -> RunSettings:
    """The oracle's run as the simulator takes it."""
    from tests.reference import effect_oracle as oracle

    return RunSettings(
        run.spring,
        AeroDerivatives(oracle.CN_BETA, oracle.CN_R),
        oracle.INERTIA,
        oracle.DAMPING,
        wind_speed=run.speed,
        air_density=oracle.DENSITY,
        release_angle=run.release,
        duration=run.duration,
    )
