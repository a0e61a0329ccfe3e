"""The rig in real time in a browser: MuJoCo Studio's web viewer.

A browser does not have the engine plugin and refuses a model that names it. Therefore the physics runs here,
with the plugin, and the browser shows a copy without it: the same bodies in the same pose.
"""

from __future__ import annotations

import time

from tunnel_lab.show.live import LiveRun, Puppet
from tunnel_lab.show.request import ShownRun
from tunnel_lab.terminal.tables import say
from tunnel_sim.vocabulary.errors import TunnelError

WARNING = (
    "The server listens on all network interfaces, without a password or a check of the Origin. Anyone who reaches "
    "this port, and any web page in a browser of this machine, can watch and control the view. "
    "Use it only in a network that you trust."
)
"""MuJoCo 4.0 has no option that binds the loopback only; see docs/reference/limits.md."""


def view_in_browser(run: ShownRun, *, port: int, open_browser: bool, seconds: float | None = None) -> None:
    """Serve the run to browsers until interrupted.

    Args:
        port: TCP port (index); 0 takes the first free one from 8080 on.
        seconds: time until it stops, s; None runs until interrupted.

    Raises:
        TunnelError: when the port is taken or MuJoCo Studio is not installed.
    """
    try:
        from mujoco.studio import app, launch_web, viewer_protocol
    except ImportError as error:
        remedy = "install the full mujoco package (pip install mujoco), not only mujoco-core"
        raise TunnelError("MuJoCo Studio is missing", where="tunnel view --web", remedy=remedy) from error
    from tunnel_lab.show.stepper import puppet_master

    say(WARNING, stderr=True)
    live = LiveRun(run)
    puppet = Puppet(live)
    config = viewer_protocol.ViewerConfig(
        gfx="web", http_port=port, open_browser=open_browser, title="virtual wind tunnel"
    )
    begun = time.monotonic()
    try:
        with launch_web.launch(config, plugins=[app.App(), puppet_master(live)]) as handle:
            handle.set_model(puppet.model, data=puppet.data)
            while handle.is_running() and (seconds is None or time.monotonic() - begun < seconds):
                handle.sync()
    except RuntimeError as error:
        raise TunnelError(str(error), where="tunnel view --web", remedy="name another --port") from error
