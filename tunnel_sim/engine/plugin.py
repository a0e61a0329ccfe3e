"""Loading the compiled engine plugin into MuJoCo, once."""

from __future__ import annotations

import functools

import mujoco

from tunnel_sim.physics.native import native_library


@functools.cache
def load_plugin() -> None:
    """Register the plugin with MuJoCo; a second call does nothing.

    Raises:
        TunnelError: when the library is missing.
    """
    mujoco.mj_loadPluginLibrary(str(native_library("vwt_plugin")))
