"""What a menu of runs refuses, and the bound it names."""

from __future__ import annotations

import pytest

from tunnel_lab.envs.menu import make_menu
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError

LISTS = {"springs": (5, 8), "wind_speeds": (0.0, 15.0), "release_angles_deg": (20.0,), "durations": (10.0,)}


@pytest.mark.parametrize(
    ("name", "bound"),
    [("wind_speeds", "of 0 or more"), ("durations", "above 0"), ("release_angles_deg", "above 0")],
)
def test_a_number_below_its_bound_is_refused_with_the_bound(name: str, bound: str) -> None:
    with pytest.raises(TunnelError, match=bound):
        make_menu(load_rig(), **(LISTS | {name: (-1.0,)}))


def test_still_air_is_on_the_menu_and_a_release_from_rest_is_not() -> None:
    assert make_menu(load_rig(), **LISTS).wind_speeds == (0.0, 15.0)
    with pytest.raises(TunnelError, match="above 0"):
        make_menu(load_rig(), **(LISTS | {"release_angles_deg": (0.0,)}))
