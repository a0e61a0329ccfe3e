"""A pendulum released near its top creeps before it swings: its centre moves as an AC-coupled reading's does."""

import numpy as np
from scipy.integrate import solve_ivp

from identification.examination.examine import examine
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record


def test_a_pendulum_from_near_the_top_is_not_called_ac_coupled() -> None:
    time = np.arange(0.0, 30.0, 0.005)
    motion = solve_ivp(
        lambda _, y: [y[1], -25.0 * np.sin(y[0]) - 0.5 * y[1]],
        (0.0, 30.0),
        [np.radians(175.0), 0.0],
        t_eval=time,
        rtol=1e-8,
        atol=1e-9,
    ).y[0]
    record = Record(time, motion + 0.002 * np.random.default_rng(1).standard_normal(time.size))
    run = Run("top", record, 0.0)
    found = examine(Campaign("pendulum", RigProperties(), SensorProperties(), (run,)))
    assert not found.remarks
