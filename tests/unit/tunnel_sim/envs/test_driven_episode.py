"""An episode of the operator preset as a driven run: its record is saved, read again and identified."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification import identify
from tests.support.env_episodes import make
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input

TRUTH = {"cn_beta": 0.47, "cn_r": -0.1, "yaw_inertia": 0.1, "mechanical_damping": 0.02, "sensor_zero": 0.004}
RATE, PERIOD = 200.0, 0.05


def campaign(folder: Path) -> Campaign:
    """Two episodes in still air with random moments, through the files of a campaign."""
    runs = []
    for seed in range(2):
        env = make(preset="operator", duration=6.0, control_period=PERIOD, sample_rate=RATE)
        options = {
            "spring": 5 + seed,
            "wind_speed": 0.0,
            "release_angle": 0.2,
            "truth": TRUTH,
            "effects": {},
        }
        _, stated = env.reset(seed=seed, options=options)
        rng, over = np.random.default_rng(seed), False
        while not over:
            moment = float(rng.uniform(-0.4, 0.4))
            action = env.unwrapped.operator_action(wind_speed=0.0, moment=moment)
            *_, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        values = np.repeat(info["operator_log"].moment, round(RATE * PERIOD))
        drive = Input("moment_nm", values[: info["record"].time_s.size], "zero")
        runs.append(Run(f"r{seed}", info["record"], 0.0, stated["spring_stiffness"], drive=drive))
    write_campaign(Campaign("episodes", RigProperties(), SensorProperties(RATE), tuple(runs)), folder)
    return read_campaign(folder)


def test_an_episode_with_moments_is_identified_as_a_driven_run(tmp_path: Path) -> None:
    found = identify(campaign(tmp_path / "episodes"))
    for name in ("yaw_inertia", "mechanical_damping"):
        quantity = getattr(found, name)
        assert abs(quantity.value - TRUTH[name]) < 4.5 * quantity.std
