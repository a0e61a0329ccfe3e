"""A run that sticks under dry friction moves again when the wind changes, in any company."""

import numpy as np

from tunnel_sim.physics.forward import integrate
from tunnel_sim.physics.moment_law import parameter_vector, run_dtype

LAW = {
    "air_density": 1.2, "frontal_area": 0.036, "reference_length": 0.625, "cn_beta": 0.35, "cn_r": -0.7,
    "spring_stiffness": 8.0, "mechanical_damping": 0.01, "yaw_inertia": 0.05, "friction_moment": 0.2,
    "flow_angle": 0.3,
}  # fmt: skip
WIND = np.linspace(0.0, 25.0, 5)  # m/s, in 4 s
CALM = np.zeros(1)


def test_a_run_at_rest_moves_when_the_wind_has_risen():
    run = np.zeros(1, run_dtype())
    given = {"wind": WIND.ctypes.data, "wind_count": WIND.size, "wind_interval": 1.0, "angle": 0.01}
    for name, value in {**given, "step": 0.002, "steps": 2}.items():
        run[name] = value
    alone = run.copy()
    alone["forcing"], alone["forcing_count"] = CALM.ctypes.data, 1  # which is not integrated side by side
    law = parameter_vector(LAW)[None]
    found, expected = integrate(law, run, 1000)[0][0], integrate(law, alone, 1000)[0][0]
    assert found[250] == 0.01  # rad: friction holds it for the first second
    assert found[-1] > 0.1
    np.testing.assert_array_equal(found, expected)
