"""Whether pictures can be drawn here; MuJoCo's log out of the way."""

from __future__ import annotations

import pytest

from tunnel_sim.envs import EnvError
from tunnel_sim.envs.rendering import RigView
from tunnel_sim.files.rig_file import load_rig


@pytest.fixture(autouse=True)
def _log_elsewhere(in_a_folder_of_its_own: None) -> None:
    """MuJoCo's log of every test here."""


@pytest.fixture(scope="session")
def drawing() -> None:
    view = RigView(load_rig(), "rgb_array", 32, 32, "overview", 0.01)
    try:
        view.draw(0.0, 0.0)
    except EnvError as error:
        pytest.skip(str(error))
    finally:
        view.close()
